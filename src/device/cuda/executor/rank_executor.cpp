#include "device/cuda/executor/rank_executor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <map>
#include <optional>
#include <tuple>

#include "device/cuda/executor/device_side.hpp"
#include "device/cuda/executor/mirrored_memory.hpp"
#include "device/cuda/executor/plan_values.hpp"
#include "device/cuda/executor/reached_memory.hpp"
#include "device/cuda/executor/side_outcome.hpp"
#include "device/rank_rows.hpp"
#include "plan/fingerprint.hpp"

namespace espalier::device::cuda {

namespace {

constexpr double kPatience = 30;  // seconds that a block of threads waits for another one's

// As in one process, others may write here as soon as their kernels run: everything is cleared after a run, when all
// have finished, and the next run begins when all are clear.
template <class T>
class ExecutorOnRanks final : public Executor<T> {
 public:
  explicit ExecutorOnRanks(const Job& job)
      : plan_(job.plan),
        kind_(job.kind),
        link_(*job.link),
        device_(job.devices.at(static_cast<std::size_t>(job.link->rank()))),
        reached_(*job.link, device_),
        rows_(job.plan, job.link->size()) {
    if (plan_.ownership.devices != link_.size())
      throw std::invalid_argument(
          fmt::format("the plan is for {} devices, not for {} ranks", plan_.ownership.devices, link_.size()));
    expect_same_plan();
    const DeviceGuard guard(device_);
    link_.expect_all([&] { make_side(job); });
    reach();
    link_.expect_all([&] { connect(); });
    for (const auto& bytes : link_.all_gather(std::as_bytes(std::span(side_->name()))))
      names_.emplace_back(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    set_pivot_rule(job.rule);
  }

  void set_pivot_rule(const PivotRule& rule) override {
    smallest_ = rule.smallest;
    const DeviceGuard guard(device_);
    side_->set_limits(limits_of<T>(rule));
  }

  FactorOutcome factorize(std::span<const T> values) override {
    const DeviceGuard guard(device_);
    side_->copy_in(side_->values(), values.data(), static_cast<Offset>(values.size_bytes()));
    const double began = base::now_seconds();
    run_on_all(
        factor_clean_, [&] { side_->enqueue_clear_factor(); }, factor_graph_,
        [&] { mirrored_->exchange().begin_factor(); });
    if (mirrored_) {  // nobody reads any more what the inverses overwrite
      inverses_graph_.launch(side_->stream().get());
      side_->stream().wait();
    }
    FactorOutcome out;
    SideFlags flags;
    read_counters(out, flags);
    const FactorEnd end = judge();
    read_marks(out, flags, end);
    clear(factor_clean_, [&] { side_->enqueue_clear_factor(); });
    out.seconds = base::now_seconds() - began;
    if (flags.stopped)
      throw Error(StatusCode::device_error,
                  fmt::format("the factorization on {} was given up after waiting {} s for one of its own blocks",
                              name(), kPatience));
    if (out.not_positive >= 0) return out;
    if (smallest_.empty())
      take_determinant(end, out);
    else
      judge_pivots(all_pivots(), smallest_, out);
    return out;
  }

  void solve(T* x, Index columns, bool transpose) override {
    const DeviceGuard guard(device_);
    const Offset bytes = Offset{plan_.tree.n} * columns * static_cast<Offset>(sizeof(T));
    take_solve_memory(columns);
    side_->copy_in(rhs_.data(), x, bytes);
    for (Index c = 0; c < columns; c += at_once_) {
      const Index width = at_once_ > 1 ? std::min(at_once_, slabs(columns - c)) : 1;
      const SolvePass<T> pass{rhs_.data(), rhs_.data(), columns, c, width, transpose};
      const Graph& graph = solve_graph(pass);
      const auto clearing = [&] { side_->enqueue_clear_solve(at_once_); };
      run_on_all(solve_clean_, clearing, graph, [&] { mirrored_->begin_solve(side_->addresses(), width); });
      if (side_->solve_counters()[1] != 0)
        throw Error(StatusCode::device_error,
                    fmt::format("the solve on {} was given up after waiting {} s for one of its own blocks", name(),
                                kPatience));
      (void)link_.all_numbers(1);  // all have finished
      clear(solve_clean_, clearing);
    }
    side_->copy_out(x, rhs_.data(), bytes);
    rows_.share(link_, x, columns);
  }

  [[nodiscard]] std::string name() const override {
    return fmt::format("{} ranks on GPUs, here {}", link_.size(), side_->name());
  }
  [[nodiscard]] Offset peak_bytes() const override { return side_->held(); }
  [[nodiscard]] std::vector<DeviceWork> device_work() const override { return work_; }

 private:
  static Index slabs(Index columns) { return (columns + kSlab - 1) / kSlab * kSlab; }

  // Whether each rank reaches the memory of all others: the same on all ranks.
  [[nodiscard]] bool one_machine() const {
    for (int r = 0; r < link_.size(); ++r)
      if (link_.machine_of(r) != link_.machine_of(0)) return false;
    return true;
  }

  void expect_same_plan() {
    const auto machines = link_.all_numbers(one_machine() ? 1 : 0);
    if (std::count(machines.begin(), machines.end(), machines[0]) != link_.size())
      throw Error(StatusCode::invalid_input,
                  "ranks do not agree on whether each is a machine of its own: give all the same --nodes");
    const auto marks = link_.all_numbers(plan::fingerprint(
        plan_, static_cast<int>(kind_), [&](Index f, Index j) { return plan_.ownership.owner(f, j); }));
    for (std::size_t r = 0; r < marks.size(); ++r)
      if (marks[r] != marks[0])
        throw Error(StatusCode::invalid_input,
                    fmt::format("{} and {} have come to different plans: give all ranks the same matrix and options",
                                link_.name_of(0), link_.name_of(static_cast<int>(r))));
  }

  void make_side(const Job& job) {
    tables_.emplace(make_device_plan(plan_, kind_, true, {}, &job.pool, !one_machine()));
    const int self = link_.rank();
    context_.emplace(
        SideContext{plan_, kind_, *tables_, kPatience, 0, values_of(plan_, &job.pool), &job.pool, self, true});
    const Offset budget = job.memory_bytes.empty() ? 0 : job.memory_bytes.at(static_cast<std::size_t>(self));
    side_.emplace(*context_, self, device_, budget, CommonMemory<T>());
    side_->send_lists();
    side_->send_tables();
    rows_.own([&](Index f) { return std::countr_zero(tables_->fronts[static_cast<std::size_t>(f)].members); });
    moved_ = transferred_elements(plan_, kind_, *tables_);
    if (self == 0) take_owners();
    if (one_machine()) return;
    mirrored_.emplace(link_, plan_, kind_, *tables_, side_->budget());
    pivots_ = PinnedArray<T>((kind_ == Kind::ldlt ? 3 : 1) * Offset{plan_.tree.n});
  }

  // Where the memory of all sides is, or its mirrors here.
  void reach() {
    reached_.open(side_->addresses());
    sides_ = reached_.sides();
    if (mirrored_) mirrored_->connect(side_->addresses(), sides_);
  }

  // Whose pivots count, for the judge.
  void take_owners() {
    std::vector<unsigned char> owner(static_cast<std::size_t>(plan_.tree.n));
    for (Index f = 0; f < plan_.fronts(); ++f)
      std::fill(owner.begin() + plan_.tree.first[f], owner.begin() + plan_.tree.first[f + 1],
                static_cast<unsigned char>(std::countr_zero(tables_->fronts[static_cast<std::size_t>(f)].members)));
    const auto bytes = static_cast<Offset>(owner.size());
    owner_ = DeviceArray<unsigned char>(bytes, side_->budget(), side_->held() + bytes);
    side_->copy_in(owner_.data(), owner.data(), bytes);
  }

  void connect() {
    side_->connect(sides_);
    const auto stream = side_->stream().get();
    const auto finish = [&] {
      side_->enqueue_inverses();
      side_->enqueue_counters();
    };
    factor_graph_ = Graph::record(stream, [&] {
      side_->enqueue_tasks();
      if (!mirrored_) finish();
    });
    if (mirrored_) inverses_graph_ = Graph::record(stream, finish);
  }

  template <class Clear>
  void clear(bool& clean, Clear&& clearing) {
    clearing();
    clean = true;
  }

  // Launches here as the others do there, and waits for this rank's part. What fails ends the kernels here; the others
  // hear of it by the link.
  // begin_exchange(): between machines, before the launch.
  template <class Clear, class Begin>
  void run_on_all(bool& clean, Clear&& clearing, const Graph& graph, Begin&& begin_exchange) {
    side_->stream().wait();  // clear of the run before
    const auto all = link_.all_numbers(clean ? 1 : 0);
    if (std::find(all.begin(), all.end(), 0) != all.end()) {  // a run has failed, and nobody's kernels run any more
      clearing();
      side_->stream().wait();
      (void)link_.all_numbers(1);
    }
    clean = false;
    try {
      if (mirrored_) begin_exchange();
      graph.launch(side_->stream().get());
      if (mirrored_) {
        mirrored_->exchange().run([&] { return has_finished(); });
      } else {
        link_.begin_operation();
        link_.wait([](int, const ranks::Message&) {}, [&] { return has_finished(); });
      }
    } catch (...) {
      side_->abort();
      (void)cudaStreamSynchronize(side_->stream().get());
      if (mirrored_) mirrored_->exchange().give_up();
      (void)cudaGetLastError();
      factor_clean_ = solve_clean_ = false;
      throw;
    }
  }

  [[nodiscard]] bool has_finished() const {
    const auto e = cudaStreamQuery(side_->stream().get());
    if (e == cudaErrorNotReady) return false;
    check(e, "kernels of this rank");
    return true;
  }

  void read_counters(FactorOutcome& out, SideFlags& flags) {
    std::vector<std::int64_t> mine(side_->factor_counters(), side_->factor_counters() + kCounters);
    mine.push_back(side_->held());
    const auto all = link_.all_gather_of(std::span<const std::int64_t>(mine));
    work_.clear();
    for (std::size_t r = 0; r < all.size(); ++r) {
      const std::vector<int> counters(all[r].begin(), all[r].begin() + kCounters);
      add_counters(counters.data(), plan_.tree.n, all.size(), out, flags);
      work_.push_back(work_of(counters.data(), link_.name_of(static_cast<int>(r)) + ": " + names_[r],
                              all[r].at(kCounters), static_cast<Offset>(moved_[r] * sizeof(T))));
    }
  }

  // All have finished. On rank 0, which reads the others' pivots; all get what it finds.
  FactorEnd judge() {
    const bool here = link_.rank() == 0;
    if (mirrored_) gather_pivots();
    if (here) {
      side_->enqueue_judge({}, sides_, owner_.data());
      side_->stream().wait();
    }
    const auto all = link_.all_gather_of(std::span<const FactorEnd>(&side_->factor_end(), here ? 1 : 0));
    return all.at(0).at(0);
  }

  // Of other machines, rank 0 reads from its own memory.
  void gather_pivots() {
    const Offset n = plan_.tree.n, parts = kind_ == Kind::ldlt ? 3 : 1;
    const Offset bytes = parts * n * static_cast<Offset>(sizeof(T));
    T* const there = side_->addresses().pivots;
    side_->copy_out(pivots_.data(), there, bytes);
    for (Offset part = 0; part < parts; ++part) rows_.gather(link_, pivots_.data() + part * n, 1);
    if (link_.rank() == 0) side_->copy_in(there, pivots_.data(), bytes);
  }

  void read_marks(FactorOutcome& out, const SideFlags& flags, const FactorEnd& end) {
    if (flags.failed) take_failed(all_marks(true), out);
    if (flags.replaced || (out.not_positive < 0 && end.small > 0)) take_marks(all_marks(false), out);
  }

  std::vector<unsigned char> all_marks(bool failed) {
    std::vector<unsigned char> marks;
    side_->marked(failed, marks);
    for (const auto& of_rank : link_.all_gather_of(std::span<const unsigned char>(marks)))
      for (std::size_t k = 0; k < marks.size(); ++k) marks[k] = static_cast<unsigned char>(marks[k] | of_rank.at(k));
    return marks;
  }

  std::vector<T> all_pivots() {
    std::vector<T> pivots;
    side_->pivots(pivots);
    rows_.share(link_, pivots.data(), 1);
    return pivots;
  }

  const Graph& solve_graph(const SolvePass<T>& pass) {
    Graph& graph = solve_graphs_[{pass.columns, pass.first_column, pass.transpose}];
    if (!graph.recorded())
      graph = Graph::record(side_->stream().get(), [&] {
        side_->enqueue_solve(sides_, pass);
        side_->enqueue_counters();
      });
    return graph;
  }

  // As many right-hand sides in a pass as there is room for on all ranks. Vectors that move are opened anew.
  void take_solve_memory(Index columns) {
    std::int64_t most = columns > 1 ? std::min<Index>(kManyColumns, slabs(columns)) : 1;
    while (most > kSlab && !side_->has_room_for(static_cast<Index>(most))) most -= kSlab;
    for (const std::int64_t of_rank : link_.all_numbers(most)) most = std::min(most, of_rank);
    const Offset size = Offset{plan_.tree.n} * columns;
    link_.expect_all([&] {
      if (rhs_.size() >= size) return;
      solve_graphs_.clear();
      rhs_ = DeviceArray<T>();
      rhs_ = DeviceArray<T>(size, side_->budget(), side_->held() + size * static_cast<Offset>(sizeof(T)));
    });
    if (at_once_ == most) return;
    at_once_ = static_cast<Index>(most);
    solve_clean_ = false;
    solve_graphs_.clear();
    if (most <= widest_) return;
    widest_ = 0;  // until all have it
    reached_.close();
    link_.expect_all([] {});  // nobody has the vectors open
    link_.expect_all([&] { (void)side_->take_solve_memory(at_once_); });
    reach();
    widest_ = at_once_;
  }

  const plan::Plan& plan_;
  Kind kind_;
  ranks::Link& link_;
  int device_;
  std::optional<DevicePlan> tables_;
  std::optional<SideContext> context_;
  std::optional<DeviceSide<T>> side_;
  ReachedMemory<T> reached_;  // closed before what this rank has is given back
  std::vector<SideAddresses<T>> sides_;
  std::optional<MirroredMemory<T>> mirrored_;  // with ranks of other machines
  RankRows rows_;                              // whose front it is tells the solution
  std::vector<std::string> names_;             // of the GPUs, by rank
  DeviceArray<unsigned char> owner_;           // n, on rank 0: whose pivot counts
  DeviceArray<T> rhs_;
  PinnedArray<T> pivots_;                // for gather_pivots()
  Graph factor_graph_, inverses_graph_;  // the second: between machines, once all tiles are where they belong
  std::map<std::tuple<Index, Index, bool>, Graph> solve_graphs_;  // by columns, first column, transpose
  std::vector<double> moved_;                                     // by rank; elements
  std::vector<DeviceWork> work_;
  std::span<const double> smallest_;  // PivotRule::smallest
  bool factor_clean_ = false, solve_clean_ = false;
  Index at_once_ = 1, widest_ = 1;  // right-hand sides of a pass; for which there is memory
};

}  // namespace

template <class T>
std::unique_ptr<Executor<T>> make_rank_executor(const Job& job) {
  return std::make_unique<ExecutorOnRanks<T>>(job);
}

template std::unique_ptr<Executor<double>> make_rank_executor(const Job&);
template std::unique_ptr<Executor<float>> make_rank_executor(const Job&);

}  // namespace espalier::device::cuda
