#include "device/cuda/out_of_core/backend.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "device/cuda/executor/selected_inverse.hpp"
#include "device/cuda/out_of_core/launches.hpp"
#include "device/cuda/out_of_core/layout.hpp"
#include "device/cuda/out_of_core/part_solve.hpp"
#include "device/cuda/out_of_core/pivot_record.hpp"
#include "device/cuda/out_of_core/resources.hpp"
#include "device/cuda/out_of_core/store_solve.hpp"
#include "device/cuda/runtime/device_guard.hpp"
#include "device/cuda/runtime/device_memory.hpp"
#include "out_of_core/cut.hpp"
#include "plan/reached_fronts.hpp"

namespace espalier::device::cuda {

namespace {

using out_of_core::ColumnGroup;
using out_of_core::InCoreStep;
using out_of_core::Operation;
using out_of_core::Queue;

template <class T>
class CudaOutOfCoreBackend final : public CudaOutOfCoreLayout<T> {
 public:
  /// @param solve_pool  null: this backend never solves
  CudaOutOfCoreBackend(std::shared_ptr<const OutOfCoreSource> source, Kind kind, const PivotRule& rule,
                       base::ThreadPool* solve_pool, const CudaOutOfCoreOptions& options)
      : CudaOutOfCoreLayout<T>(std::move(source)),
        kind_(kind),
        rule_(rule),
        options_(options),
        resources_(options),
        pivots_(kind, this->plan().tree.n),
        solve_pool_(solve_pool) {
    if (solve_pool != nullptr)
      solve_.emplace(this->plan(), this->out_of_core_tables().device_plan().fronts, kind, *solve_pool);
  }

  // ---- memory and copies --------------------------------------------------------------------------------------------

  void prepare(const out_of_core::OutOfCorePlan& plan, int slots, Offset slot_bytes) override {
    out_of_core_ = &plan;
    std::array<std::size_t, out_of_core::kQueues> count{};
    for (const Operation& op : plan.ops) ++count[static_cast<std::size_t>(op.queue)];
    resources_.take(plan.arena_bytes, slots, slot_bytes, count);
    build_tables(plan);
    launches_.emplace(*this, this->out_of_core_tables(), kind_, plan, resources_.arena(), options_.patience_seconds);
    T* arena = reinterpret_cast<T*>(resources_.arena());
    copy_now(plan.shared_at, &arena, sizeof arena);
    set_pivot_rule(rule_);
    if (this->plan().options.keep_contributions) pivots_.keep_units(steps_.size() + groups_.size());
    if (!plan.resident.empty() && solve_pool_ != nullptr)
      part_.emplace(PartContext{this->plan(), this->out_of_core_tables(), plan, kind_, resources_.arena(),
                                resources_.stream(Queue::run), *solve_pool_, options_.patience_seconds});
  }

  void set_pivot_rule(const PivotRule& rule) override {
    rule_ = rule;
    if (out_of_core_ == nullptr) return;
    enter_thread();
    const PivotLimits<T> limits = limits_of<T>(rule);
    copy_now(out_of_core_->shared_at + kLimitsAt, limits.data(), sizeof limits);
  }

  void begin(std::span<const T>) override {
    pivots_.begin();
    runs_.clear();
    marked_ = {};
    times_ = {};
    if (part_) part_->forget();
  }
  void enter_thread() override {
    call("cudaSetDevice", [&] { return cudaSetDevice(resources_.device()); });
  }
  std::byte* staging(int slot) override { return resources_.slot(slot); }
  void copy_in(Offset to, int slot, Offset bytes) override {
    move(resources_.arena() + to, resources_.slot(slot), bytes, cudaMemcpyHostToDevice, Queue::in);
    mark_slot(slot, Queue::in);
  }
  void copy_out(int slot, Offset from, Offset bytes) override {
    move(resources_.slot(slot), resources_.arena() + from, bytes, cudaMemcpyDeviceToHost, Queue::out);
    mark_slot(slot, Queue::out);
  }
  void wait_for_slot(int slot) override {
    call("cudaEventSynchronize", [&] { return cudaEventSynchronize(resources_.slot_event(slot)); });
  }
  bool pin(std::byte* at, Offset bytes) override {
    const cudaError_t e = attempt("cudaHostRegister", [&] {
      return cudaHostRegister(at, static_cast<std::size_t>(bytes), cudaHostRegisterPortable);
    });
    (void)cudaGetLastError();
    return e == cudaSuccess;
  }
  void unpin(std::byte* at) noexcept override { (void)cudaHostUnregister(at); }
  void copy_in_direct(Offset to, const std::byte* from, Offset bytes) override {
    move(resources_.arena() + to, from, bytes, cudaMemcpyHostToDevice, Queue::in);
  }
  void copy_out_direct(std::byte* to, Offset from, Offset bytes) override {
    move(to, resources_.arena() + from, bytes, cudaMemcpyDeviceToHost, Queue::out);
  }
  std::span<const std::byte> tables(const Operation& op) override { return unit(op).bytes; }
  void mark(Queue q, std::int64_t number) override {
    call("cudaEventRecord", [&] { return cudaEventRecord(resources_.mark(q, number), resources_.stream(q)); });
    if (q == Queue::run || q == Queue::second_run) marked_[static_cast<std::size_t>(q)] = number;
  }
  void wait_for_mark(Queue q, Queue other, std::int64_t number) override { wait_for_mark(q, *this, other, number); }
  void wait_for_mark(Queue q, out_of_core::OutOfCoreBackend<T>& of, Queue other, std::int64_t number) override {
    const Resources& its = dynamic_cast<CudaOutOfCoreBackend&>(of).resources_;
    call("cudaStreamWaitEvent", [&] { return cudaStreamWaitEvent(resources_.stream(q), its.mark(other, number), 0); });
  }
  void wait_until(Queue q, std::int64_t number) override {
    call("cudaEventSynchronize", [&] { return cudaEventSynchronize(resources_.mark(q, number)); });
  }
  void finish() override {
    for (const auto q : {Queue::run, Queue::second_run})
      call("cudaStreamSynchronize", [&] { return cudaStreamSynchronize(resources_.stream(q)); });
    add_up_times();
    if (pivots_.stopped())
      throw Error(StatusCode::device_error, "the factorization on " + name() + " was given up after waiting " +
                                                std::to_string(options_.patience_seconds) +
                                                " s for one of its own blocks");
  }
  void abandon() noexcept override {
    for (const auto q : {Queue::in, Queue::run, Queue::second_run, Queue::out})
      (void)cudaStreamSynchronize(resources_.stream(q));
    (void)cudaGetLastError();
  }

  [[nodiscard]] std::vector<char> changed_fronts(std::span<const T> values, std::span<const T> before) override {
    if (!this->plan().options.keep_contributions || !pivots_.positive()) return {};
    std::vector<char> changed(static_cast<std::size_t>(this->plan().fronts()));
    if (solve_pool_ != nullptr) changed = plan::fronts_reached(this->plan(), values, before, *solve_pool_);
    pivots_.mark_others(*out_of_core_, rule_, changed);
    return changed;
  }
  void bring(Queue queue, Offset to, const std::byte* from, Offset bytes) override {
    move(resources_.arena() + to, from, bytes, cudaMemcpyHostToDevice, queue);
    call("cudaStreamSynchronize", [&] { return cudaStreamSynchronize(resources_.stream(queue)); });
  }

  // ---- operations ---------------------------------------------------------------------------------------------------

  void run(const Operation& op) override {
    const cudaStream_t stream = resources_.stream(op.queue);
    const std::int64_t number = marked_[static_cast<std::size_t>(op.queue)] + 1;
    runs_.push_back({&op, number});
    call("cudaEventRecord", [&] { return cudaEventRecord(resources_.start(op.queue, number), stream); });
    launches_->run(op, unit(op), stream);
  }

  void take_outputs(const Operation& op, std::span<const std::byte> bytes) override {
    pivots_.take(static_cast<std::size_t>(op.unit) + (op.grouped ? steps_.size() : 0), unit(op).scratch,
                 op.grouped ? positions_of(group(op), unit(op)) : positions_of(step(op)), rule_, bytes);
  }
  FactorOutcome outcome() override { return pivots_.outcome(); }

  void take_pivots(out_of_core::OutOfCoreBackend<T>& from) override {
    auto& other = dynamic_cast<CudaOutOfCoreBackend&>(from);
    const auto take = [&](const Positions& list) {
      for (const auto& [begin, end] : list) pivots_.copy_from(other.pivots_, begin, end - begin);
    };
    for (const InCoreStep& s : other.out_of_core_->steps) take(positions_of(s));
    for (std::size_t k = 0; k < other.groups_.size(); ++k)
      take(positions_of(other.out_of_core_->groups[k], other.groups_[k]));
  }

  void set_reader(out_of_core::FrontReader* reader) override {
    if (solve_) solve_->set_reader(reader);
  }
  void solve(const T* store, bool reachable, T* x, Index columns, bool transpose) override {
    solve_with(store, reachable, [&](const HostFactors<T>& factors) { solve_->run(factors, x, columns, transpose); });
  }
  bool solve_on_paths(const T* store, bool reachable, const PathSolve<T>& solve) override {
    solve_with(store, reachable, [&](const HostFactors<T>& factors) { solve_->run(factors, solve); });
    return true;
  }

  bool invert_at(const T* store, const InverseEntries<T>& entries) override {
    const DeviceGuard guard(resources_.device());
    if (part_) part_->forget();  // its tables stand in the same memory
    try {
      invert_in(idle_space(true), store, nullptr, entries);
    } catch (const Error& e) {
      if (e.status().code != StatusCode::out_of_memory || out_of_core_->resident.empty()) throw;
      AwayFromDevice away(*this);  // what stays on the device takes the room
      invert_in(idle_space(false), store, away.memory(), entries);
    }
    return true;
  }

  [[nodiscard]] OperationTimes times() const override { return times_; }
  [[nodiscard]] std::string name() const override {
    cudaDeviceProp p{};
    call("cudaGetDeviceProperties", [&] { return cudaGetDeviceProperties(&p, options_.device); });
    return std::string(p.name) + " #" + std::to_string(options_.device) + ", out of core";
  }
  [[nodiscard]] Offset peak_bytes() const override { return resources_.arena_bytes(); }

 private:
  // The factors that stay on the device, in the host's memory for a while.
  class AwayFromDevice {
   public:
    explicit AwayFromDevice(const CudaOutOfCoreBackend& of)
        : of_(of), memory_(to_elements(of.resources_.arena_bytes()), nullptr) {
      of_.for_residents([&](Offset at, Offset bytes) { of_.copy(memory() + to_elements(at), at, bytes, false); });
    }
    ~AwayFromDevice() {
      try {
        of_.for_residents([&](Offset at, Offset bytes) { of_.copy(memory() + to_elements(at), at, bytes, true); });
      } catch (const Error&) {  // the device is lost, and so is the factor: the next call says so
      }
    }
    AwayFromDevice(const AwayFromDevice&) = delete;
    AwayFromDevice& operator=(const AwayFromDevice&) = delete;
    /// Places as in the arena.
    [[nodiscard]] T* memory() { return memory_.data(); }

   private:
    const CudaOutOfCoreBackend& of_;
    base::Buffer<T> memory_;  // pages that nobody writes are none
  };
  static Offset to_elements(Offset bytes) { return bytes / static_cast<Offset>(sizeof(T)); }
  // use(place in the arena, bytes) for each factor array there.
  template <class Use>
  void for_residents(Use&& use) const {
    for (const Index f : out_of_core_->resident)
      for (const Offset at : out_of_core_->resident_at[static_cast<std::size_t>(f)])
        if (at >= 0) use(at, this->front(f).factor_size() * static_cast<Offset>(sizeof(T)));
  }
  void copy(T* host, Offset at, Offset bytes, bool back) const {
    std::byte* const device = resources_.arena() + at;
    call("cudaMemcpy", [&] {
      return back ? cudaMemcpy(device, host, static_cast<std::size_t>(bytes), cudaMemcpyHostToDevice)
                  : cudaMemcpy(host, device, static_cast<std::size_t>(bytes), cudaMemcpyDeviceToHost);
    });
  }

  // @param away  the factors of residents, at their places in the arena; null: they are there
  void invert_in(std::span<std::byte> space, const T* store, const T* away, const InverseEntries<T>& entries) {
    std::vector<Front> fronts = this->out_of_core_tables().device_plan().fronts;
    const T* const here = away != nullptr ? away : reinterpret_cast<const T*>(resources_.arena());
    const bool lu = kind_ == Kind::lu, ldlt = kind_ == Kind::ldlt;
    std::vector<InverseSource<T>> sources;
    for (std::size_t f = 0; f < fronts.size(); ++f) {
      fronts[f].inverted = fronts[f].width;  // nobody joins inverses out of core
      std::array<Offset, 2> at{-1, -1};
      if (!out_of_core_->resident_at.empty()) at = out_of_core_->resident_at[f];
      if (at[0] >= 0)
        sources.push_back({here + to_elements(at[0]), lu ? here + to_elements(at[1]) : nullptr, away != nullptr});
      else
        sources.push_back(
            {store + out_of_core_->factor_store[f], lu ? store + out_of_core_->factor2_store[f] : nullptr, true});
    }
    TableUpload uploads(solve_pool_);
    invert_on_device<T>({this->plan(), kind_, fronts, std::move(sources), ldlt ? pivots_.inverse_d().data() : nullptr,
                         ldlt ? pivots_.inverse_e().data() : nullptr, resources_.stream(Queue::run), nullptr, space,
                         uploads, solve_pool_},
                        entries);
  }
  // The largest part of the arena that holds nothing between factorizations but tables of a solve.
  [[nodiscard]] std::span<std::byte> idle_space(bool with_residents) const {
    constexpr Offset kShared = 256, kAligned = 256;
    std::vector<std::pair<Offset, Offset>> used = {{out_of_core_->shared_at, out_of_core_->shared_at + kShared}};
    if (with_residents) for_residents([&](Offset at, Offset bytes) { used.emplace_back(at, at + bytes); });
    used.emplace_back(resources_.arena_bytes(), resources_.arena_bytes());
    std::sort(used.begin(), used.end());
    Offset best = 0, size = 0, end = 0;
    for (const auto& [from, to] : used) {
      if (from - end > size) {
        best = end;
        size = from - end;
      }
      end = std::max(end, (to + kAligned - 1) / kAligned * kAligned);
    }
    return {resources_.arena() + best, static_cast<std::size_t>(size)};
  }
  template <class Run>
  void solve_with(const T* store, bool reachable, Run&& run) {
    std::optional<DeviceGuard> guard;
    if (part_) {
      guard.emplace(resources_.device());
      const bool streams = reachable && !out_of_core_->streamed.empty() && resources_.reads_pinned_memory();
      const auto& part = part_->prepare(streams ? store : nullptr, pivots_.inverse_d(), pivots_.inverse_e());
      if (streams != shared_streams_) solve_->share(part, &*part_);
      shared_streams_ = streams;
    }
    try {
      run(HostFactors<T>{store, &out_of_core_->factor_store, &out_of_core_->factor2_store, &pivots_.inverse_d(),
                         &pivots_.inverse_e()});
    } catch (...) {
      abandon();  // the device's part may be under way, and reads the store
      throw;
    }
  }

  // Tables of all units, which take more bytes than the matrix: by all threads where there are some.
  void build_tables(const out_of_core::OutOfCorePlan& plan) {
    const auto& tables = this->out_of_core_tables();
    steps_.resize(plan.steps.size());
    groups_.resize(plan.groups.size());
    const auto build = [&](std::size_t k) {
      if (k >= steps_.size())
        groups_[k - steps_.size()] = tables.build(plan.groups[k - steps_.size()]);
      else if (!plan.steps[k].fronts.empty())
        steps_[k] = tables.build(plan.steps[k]);
    };
    out_of_core::for_each_unit(steps_.size() + groups_.size(), solve_pool_, build);
  }
  [[nodiscard]] const UnitTables& unit(const Operation& op) const {
    return op.grouped ? groups_[static_cast<std::size_t>(op.unit)] : steps_[static_cast<std::size_t>(op.unit)];
  }
  [[nodiscard]] const ColumnGroup& group(const Operation& op) const {
    return out_of_core_->groups[static_cast<std::size_t>(op.unit)];
  }
  [[nodiscard]] const InCoreStep& step(const Operation& op) const {
    return out_of_core_->steps[static_cast<std::size_t>(op.unit)];
  }
  [[nodiscard]] Positions positions_of(const ColumnGroup& g, const UnitTables& u) const {
    const Index first = this->plan().tree.first[g.front] + this->front(g.front).column_begin(g.begin);
    return {{first, first + u.scratch.pivots}};
  }
  [[nodiscard]] Positions positions_of(const InCoreStep& s) const {
    Positions list;
    for (const Index f : s.fronts) list.emplace_back(this->plan().tree.first[f], this->plan().tree.first[f + 1]);
    return list;
  }

  void add_up_times() {
    for (const auto& [op, n] : runs_) {
      float ms = 0;
      call("cudaEventElapsedTime", [&, op = op, n = n] {
        return cudaEventElapsedTime(&ms, resources_.start(op->queue, n), resources_.mark(op->queue, n));
      });
      out_of_core::time_of(times_, op->type) += 1e-3 * static_cast<double>(ms);
    }
  }

  void copy_now(Offset to, const void* from, std::size_t bytes) {
    call("cudaMemcpy", [&] { return cudaMemcpy(resources_.arena() + to, from, bytes, cudaMemcpyHostToDevice); });
  }
  void move(void* to, const void* from, Offset bytes, cudaMemcpyKind kind, Queue q) {
    call("cudaMemcpyAsync",
         [&] { return cudaMemcpyAsync(to, from, static_cast<std::size_t>(bytes), kind, resources_.stream(q)); });
  }
  void mark_slot(int slot, Queue q) {
    call("cudaEventRecord", [&] { return cudaEventRecord(resources_.slot_event(slot), resources_.stream(q)); });
  }

  Kind kind_;
  PivotRule rule_;
  CudaOutOfCoreOptions options_;
  Resources resources_;
  PivotRecord<T> pivots_;
  base::ThreadPool* solve_pool_;
  std::optional<StoreSolve<T>> solve_;
  std::optional<PartSolve<T>> part_;    // where factors stay on the device
  std::optional<bool> shared_streams_;  // whether solve_ leaves the streamed fronts to it, too; empty: nothing
  std::optional<Launches<T>> launches_;
  const out_of_core::OutOfCorePlan* out_of_core_ = nullptr;
  std::vector<UnitTables> steps_, groups_;
  std::vector<std::pair<const Operation*, std::int64_t>> runs_;  // of the last factorization, with their numbers
  std::array<std::int64_t, out_of_core::kQueues> marked_{};      // of queues that compute
  OperationTimes times_;
};

}  // namespace

template <class T>
std::vector<std::unique_ptr<out_of_core::OutOfCoreBackend<T>>> make_cuda_out_of_core_backends(
    const plan::Plan& plan, Kind kind, const PivotRule& rule, base::ThreadPool& pool,
    const std::vector<CudaOutOfCoreOptions>& devices) {
  const auto source = std::make_shared<const OutOfCoreSource>(plan, kind, static_cast<Offset>(sizeof(T)));
  std::vector<std::unique_ptr<out_of_core::OutOfCoreBackend<T>>> list;
  for (const CudaOutOfCoreOptions& options : devices)
    list.push_back(
        std::make_unique<CudaOutOfCoreBackend<T>>(source, kind, rule, list.empty() ? &pool : nullptr, options));
  return list;
}

template std::vector<std::unique_ptr<out_of_core::OutOfCoreBackend<double>>> make_cuda_out_of_core_backends(
    const plan::Plan&, Kind, const PivotRule&, base::ThreadPool&, const std::vector<CudaOutOfCoreOptions>&);
template std::vector<std::unique_ptr<out_of_core::OutOfCoreBackend<float>>> make_cuda_out_of_core_backends(
    const plan::Plan&, Kind, const PivotRule&, base::ThreadPool&, const std::vector<CudaOutOfCoreOptions>&);

}  // namespace espalier::device::cuda
