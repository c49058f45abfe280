#include "factor/streaming_executor.hpp"

#include <algorithm>
#include <array>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "base/timeline.hpp"
#include "factor/stream_copies.hpp"

namespace espalier::factor {

namespace {

using analysis::StreamOp;
using analysis::StreamQueue;
using analysis::StreamWork;
using device::FactorOutcome;

struct Stopped {};

// How far the queues are: operations asked for, and, for copies, those whose host side is done.
class Progress {
 public:
  void reset() {
    asked_ = {};
    done_ = {};
    stopped_ = false;
  }
  void asked(StreamQueue q, std::int64_t number) { set(asked_[static_cast<std::size_t>(q)], number); }
  void done(StreamQueue q, std::int64_t number) { set(done_[static_cast<std::size_t>(q)], number); }
  /// @throws Stopped after stop()
  void wait_asked(StreamQueue q, std::int64_t number) { wait(asked_[static_cast<std::size_t>(q)], number); }
  void wait_done(StreamQueue q, std::int64_t number) { wait(done_[static_cast<std::size_t>(q)], number); }
  bool is_asked(StreamQueue q, std::int64_t number) {
    const std::lock_guard lock(mutex_);
    return stopped_ || asked_[static_cast<std::size_t>(q)] >= number;
  }
  void stop() {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    changed_.notify_all();
  }

 private:
  void set(std::int64_t& of, std::int64_t number) {
    const std::lock_guard lock(mutex_);
    of = number;
    changed_.notify_all();
  }
  void wait(const std::int64_t& of, std::int64_t number) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return stopped_ || of >= number; });
    if (stopped_) throw Stopped{};
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::array<std::int64_t, analysis::kStreamQueues> asked_{}, done_{};
  bool stopped_ = false;
};

template <class T>
class StreamingExecutor final : public device::Executor<T> {
 public:
  StreamingExecutor(std::unique_ptr<device::StreamBackend<T>> backend, const StreamingOptions& options,
                    base::MemoryBudget* budget)
      : backend_(std::move(backend)),
        options_(options),
        plan_(analysis::plan_streaming(*backend_, options.budget_bytes, options.rates)),
        in_crew_(options.copy_threads),
        out_crew_(options.copy_threads) {
    backend_->prepare(plan_, 2 * options.slots, options.slot_bytes);
    store_ = base::Buffer<T>(plan_.store_elements, budget);
    touch_store();
    for (const StreamOp& op : plan_.ops)
      (op.queue == StreamQueue::in ? loads_ : op.queue == StreamQueue::out ? stores_ : runs_).push_back(&op);
  }

  void set_pivot_rule(const device::PivotRule& rule) override { backend_->set_pivot_rule(rule); }

  FactorOutcome factorize(std::span<const T> values) override {
    const double start = base::now_seconds();
    values_ = values;
    in_seconds_ = out_seconds_ = 0;
    progress_.reset();
    error_ = nullptr;
    backend_->begin(values);
    std::thread in([&] { guarded([&] { load_all(); }); });
    std::thread out([&] { guarded([&] { store_all(); }); });
    guarded([&] { run_all(); });
    in.join();
    out.join();
    if (error_ != nullptr) {
      backend_->abandon();
      std::rethrow_exception(error_);
    }
    FactorOutcome outcome = backend_->outcome();
    outcome.seconds = base::now_seconds() - start;
    if (outcome.busy_seconds <= 0) outcome.busy_seconds = outcome.seconds;
    return outcome;
  }

  void solve(T* x, Index columns, bool transpose) override { backend_->solve(store_.data(), x, columns, transpose); }
  [[nodiscard]] std::string name() const override { return backend_->name(); }
  [[nodiscard]] Offset peak_bytes() const override { return backend_->peak_bytes(); }
  [[nodiscard]] device::StreamReport streaming() const override {
    const auto steps =
        std::count_if(plan_.steps.begin(), plan_.steps.end(), [](const auto& s) { return !s.fronts.empty(); });
    return {options_.budget_bytes,
            plan_.arena_bytes,
            plan_.bytes_in,
            plan_.bytes_out,
            plan_.link_seconds,
            plan_.predicted_seconds,
            in_seconds_,
            out_seconds_,
            static_cast<Index>(steps),
            static_cast<Index>(plan_.groups.size())};
  }

 private:
  struct Arrival {  // a slot on its way to the host
    int slot;
    const StreamOp* op;
    std::int64_t number;
    Offset begin, size;
    bool last;
  };

  // The machine finds pages on the first write, one by one: by all threads, before it hurts.
  void touch_store() {
    constexpr Offset kPage = 4096 / static_cast<Offset>(sizeof(T));
    constexpr std::int64_t kPagesPerPiece = 4096;
    const Offset pages = (store_.size() + kPage - 1) / kPage;
    out_crew_.for_each_piece(pages, kPagesPerPiece, [&](std::int64_t b, std::int64_t e) {
      for (Offset p = b; p < e; ++p) store_[p * kPage] = T(0);
    });
  }

  template <class Work>
  void guarded(Work&& work) {
    try {
      backend_->enter_thread();
      work();
    } catch (const Stopped&) {
    } catch (...) {
      const std::lock_guard lock(error_mutex_);
      if (error_ == nullptr) error_ = std::current_exception();
      progress_.stop();
    }
  }

  void run_all() {
    std::array<std::int64_t, analysis::kStreamQueues> numbers{};
    for (const StreamOp* op : runs_) {
      for (std::size_t q = 0; q < op->waits.size(); ++q) {
        const auto other = static_cast<StreamQueue>(q);
        if (op->waits[q] == 0 || other == op->queue) continue;
        progress_.wait_asked(other, op->waits[q]);
        backend_->wait_for_mark(op->queue, other, op->waits[q]);
      }
      backend_->run(*op);
      const std::int64_t number = ++numbers[static_cast<std::size_t>(op->queue)];
      backend_->mark(op->queue, number);
      progress_.asked(op->queue, number);
    }
    progress_.wait_asked(StreamQueue::in, static_cast<std::int64_t>(loads_.size()));
    progress_.wait_done(StreamQueue::out, static_cast<std::int64_t>(stores_.size()));
    backend_->finish();
  }

  // Makes a queue of copies wait for what computes; before it blocks, `meanwhile` may go on with something else.
  template <class Meanwhile>
  void wait_for_runs(const StreamOp& op, Meanwhile&& meanwhile) {
    for (const StreamQueue lane : {StreamQueue::run, StreamQueue::second_run}) {
      const std::int64_t n = op.waits[static_cast<std::size_t>(lane)];
      if (n == 0) continue;
      while (!progress_.is_asked(lane, n) && meanwhile()) {
      }
      progress_.wait_asked(lane, n);
      backend_->wait_for_mark(op.queue, lane, n);
    }
  }

  // ---- to the device ------------------------------------------------------------------------------------------------

  void load_all() {
    std::int64_t number = 0;
    int slot = 0;
    HostPieces pieces;
    ValuePieces gathered;
    for (const StreamOp* op : loads_) {
      ++number;
      wait_for_runs(*op, [] { return false; });
      constexpr auto kOut = static_cast<std::size_t>(StreamQueue::out);
      if (op->waits[kOut] > 0) progress_.wait_done(StreamQueue::out, op->waits[kOut]);
      const bool values = op->work == StreamWork::load_values;
      if (values) gathered.set(*backend_, plan_, *op);
      const int parts = values ? 1 : parts_of(*op);
      for (int part = 0; part < parts; ++part) {
        if (!values) pieces_of(*op, part, pieces);
        const Offset bytes = values ? op->bytes : pieces.bytes();
        for (Offset done = 0; done < bytes; done += options_.slot_bytes) {
          const Offset now = std::min(options_.slot_bytes, bytes - done);
          backend_->wait_for_slot(slot);
          std::byte* to = backend_->staging(slot);
          const double start = base::now_seconds();
          constexpr auto kSize = static_cast<Offset>(sizeof(T));
          if (values)
            gathered.gather<T>(values_, reinterpret_cast<T*>(to), done / kSize, now / kSize, in_crew_);
          else
            pieces.copy_to(to, done, now, in_crew_);
          in_seconds_ += base::now_seconds() - start;
          backend_->copy_in(op->at[static_cast<std::size_t>(part)] + done, slot, now);
          slot = (slot + 1) % options_.slots;
        }
      }
      backend_->mark(StreamQueue::in, number);
      progress_.asked(StreamQueue::in, number);
    }
  }

  [[nodiscard]] int parts_of(const StreamOp& op) const {
    if (op.work == StreamWork::load_tables || op.work == StreamWork::store_outputs) return 1;
    return op.at[1] >= 0 && op.work != StreamWork::eliminate && second_part(op) ? 2 : 1;
  }
  // In-core steps store both factor arrays in one piece.
  [[nodiscard]] static bool second_part(const StreamOp& op) {
    return op.work != StreamWork::store_factor || op.grouped;
  }

  void pieces_of(const StreamOp& op, int part, HostPieces& pieces) {
    pieces.clear();
    constexpr auto kSize = static_cast<Offset>(sizeof(T));
    std::byte* store = reinterpret_cast<std::byte*>(store_.data());
    const Offset host = op.host[static_cast<std::size_t>(part)];
    if (op.work == StreamWork::load_tables) {
      const std::span<const std::byte> t = backend_->tables(op);
      pieces.add(const_cast<std::byte*>(t.data()), static_cast<Offset>(t.size()));
    } else if (op.work == StreamWork::load_panel) {
      std::vector<analysis::Piece> list;
      backend_->panel(op.front, op.begin, op.end, op.row, list);
      for (const analysis::Piece& p : list) pieces.add(store + (host + p.at) * kSize, p.size * kSize);
    } else {
      pieces.add(store + host * kSize, op.bytes / parts_of(op));
    }
  }

  // ---- to the host --------------------------------------------------------------------------------------------------

  void store_all() {
    std::int64_t number = 0;
    std::deque<Arrival> on_the_way;
    int slot = 0;
    std::vector<std::byte> outputs;
    for (const StreamOp* op : stores_) {
      ++number;
      const auto receive_one = [&] {
        if (on_the_way.empty()) return false;
        receive(on_the_way, outputs);
        return true;
      };
      wait_for_runs(*op, receive_one);
      if (const std::int64_t n = op->waits[static_cast<std::size_t>(StreamQueue::in)]; n > 0) {
        while (!progress_.is_asked(StreamQueue::in, n) && receive_one()) {
        }
        progress_.wait_asked(StreamQueue::in, n);
      }
      const int parts = parts_of(*op);
      const Offset each = op->bytes / parts;
      for (int part = 0; part < parts; ++part)
        for (Offset done = 0; done < each; done += options_.slot_bytes) {
          if (static_cast<int>(on_the_way.size()) == options_.slots) receive(on_the_way, outputs);
          const Offset now = std::min(options_.slot_bytes, each - done);
          backend_->copy_out(options_.slots + slot, op->at[static_cast<std::size_t>(part)] + done, now);
          on_the_way.push_back(
              {options_.slots + slot, op, number, part * each + done, now, part + 1 == parts && done + now == each});
          slot = (slot + 1) % options_.slots;
        }
      backend_->mark(StreamQueue::out, number);
      progress_.asked(StreamQueue::out, number);
    }
    while (!on_the_way.empty()) receive(on_the_way, outputs);
  }

  // The oldest slot to its place.
  void receive(std::deque<Arrival>& on_the_way, std::vector<std::byte>& outputs) {
    const Arrival a = on_the_way.front();
    on_the_way.pop_front();
    backend_->wait_for_slot(a.slot);
    const std::byte* from = backend_->staging(a.slot);
    if (a.op->work == StreamWork::store_outputs) {
      outputs.resize(static_cast<std::size_t>(a.op->bytes));
      std::copy_n(from, a.size, outputs.data() + a.begin);
      if (a.last) backend_->take_outputs(*a.op, outputs);
    } else {
      const Offset each = a.op->bytes / parts_of(*a.op);
      HostPieces pieces;
      for (int part = 0; part < parts_of(*a.op); ++part)
        pieces.add(reinterpret_cast<std::byte*>(store_.data() + a.op->host[static_cast<std::size_t>(part)]), each);
      const double start = base::now_seconds();
      pieces.copy_from(from, a.begin, a.size, out_crew_);
      out_seconds_ += base::now_seconds() - start;
    }
    if (a.last) progress_.done(StreamQueue::out, a.number);
  }

  std::unique_ptr<device::StreamBackend<T>> backend_;
  StreamingOptions options_;
  analysis::StreamingPlan plan_;
  base::ThreadPool in_crew_, out_crew_;
  base::Buffer<T> store_;
  std::vector<const StreamOp*> loads_, runs_, stores_;
  std::span<const T> values_;
  double in_seconds_ = 0, out_seconds_ = 0;
  Progress progress_;
  std::mutex error_mutex_;
  std::exception_ptr error_;
};

}  // namespace

template <class T>
std::unique_ptr<device::Executor<T>> make_streaming_executor(std::unique_ptr<device::StreamBackend<T>> backend,
                                                             const StreamingOptions& options,
                                                             base::MemoryBudget* budget) {
  return std::make_unique<StreamingExecutor<T>>(std::move(backend), options, budget);
}

template std::unique_ptr<device::Executor<double>> make_streaming_executor(
    std::unique_ptr<device::StreamBackend<double>>, const StreamingOptions&, base::MemoryBudget*);
template std::unique_ptr<device::Executor<float>> make_streaming_executor(std::unique_ptr<device::StreamBackend<float>>,
                                                                          const StreamingOptions&, base::MemoryBudget*);

}  // namespace espalier::factor
