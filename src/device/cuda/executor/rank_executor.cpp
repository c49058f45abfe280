#include "device/cuda/executor/rank_executor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>

#include "device/cuda/executor/device_linear_system.hpp"
#include "device/cuda/executor/device_side.hpp"
#include "device/cuda/executor/mirrored_memory.hpp"
#include "device/cuda/executor/plan_values.hpp"
#include "device/cuda/executor/reached_memory.hpp"
#include "device/cuda/executor/side_outcome.hpp"
#include "device/cuda/kernels/rank_rows.hpp"
#include "device/cuda/tables/pairs.hpp"
#include "device/rank_rows.hpp"
#include "plan/fingerprint.hpp"

namespace espalier::device::cuda {

namespace {

// As in one process, others may write here as soon as their kernels run: everything is cleared after a run, when all
// have finished, and the next run begins when all are clear. Until then nobody changes what others read: pivots, values
// that are shared, solutions.
template <class T>
class ExecutorOnRanks final : public CudaExecutor<T> {
 public:
  explicit ExecutorOnRanks(const Job& job)
      : plan_(job.plan),
        kind_(job.kind),
        link_(*job.link),
        device_(job.devices.at(static_cast<std::size_t>(job.link->rank()))),
        machines_(ranks::Machines::agreed(*job.link)),
        reached_(*job.link, machines_, device_),
        reached_values_(*job.link, machines_, device_),
        reached_solutions_(*job.link, machines_, device_),
        rows_(job.plan, job.link->size()) {
    if (plan_.ownership.devices != link_.size())
      throw std::invalid_argument(
          fmt::format("the plan is for {} devices, not for {} ranks", plan_.ownership.devices, link_.size()));
    expect_same_plan();
    const DeviceGuard guard(device_);
    link_.expect_all([&] { make_side(job); });
    if (mirrored_) mirrored_->open();
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
    last_filled_ = false;
    return run();
  }

  std::optional<FactorOutcome> factorize_filled(const FilledValues& values) override {
    const DeviceGuard guard(device_);
    if (!(values == filled_)) {
      filled_ = {};
      record_filled(values);
      filled_ = values;
    }
    last_filled_ = true;
    if (mirrored_ && !is_finite(values)) return std::nullopt;  // kernels would end, and so wait for no tiles
    FactorOutcome out = run();
    if (!std::isfinite(side_->factor_end().largest)) return std::nullopt;
    return out;
  }
  double refactorize_again() override {
    const DeviceGuard guard(device_);
    return run().seconds;
  }

  void solve(T* x, Index columns, bool transpose) override {
    const Offset count = Offset{plan_.tree.n} * columns;
    T* rhs = device_rhs(columns);
    to_device(rhs, x, count);
    solve_device(rhs, columns, transpose);
    from_device(x, rhs, count);
  }

  double solve_device(T* x, Index columns, bool transpose) override {
    const DeviceGuard guard(device_);
    const double began = base::now_seconds();
    take_solve_memory(columns);
    for (Index c = 0; c < columns; c += at_once_) {
      const Index width = at_once_ > 1 ? std::min(at_once_, slabs(columns - c)) : 1;
      const Graph& graph = solve_graph({x, solutions_.data(), columns, c, width, transpose});
      const auto clearing = [&] { side_->enqueue_clear_solve(at_once_); };
      run_on_all(solve_clean_, clearing, graph, [&] { mirrored_->begin_solve(sides_, width); });
      if (side_->solve_counters()[1] != 0) throw solve_given_up();
      (void)link_.all_numbers(1);  // all have finished
      clear(solve_clean_, clearing);
    }
    collect_solutions(x, columns);
    return base::now_seconds() - began;
  }
  void enqueue_solve(T* x, Index columns, bool transpose) override { (void)solve_device(x, columns, transpose); }
  [[nodiscard]] SolveClear clear_before_solve(Index /*columns*/) override { return {}; }
  [[nodiscard]] const int* solve_aborted() const override { return nullptr; }
  [[nodiscard]] Error solve_given_up() const override { return given_up("solve"); }

  // Collective where it grows, which it does on all ranks alike.
  T* device_rhs(Index columns) override {
    const Offset size = Offset{plan_.tree.n} * columns;
    if (rhs_.size() < size)
      link_.expect_all([&] {
        const DeviceGuard guard(device_);
        solve_graphs_.clear();
        side_->budget().give_back(rhs_.bytes());
        rhs_ = DeviceArray<T>();
        rhs_ = DeviceArray<T>(size, side_->budget(), side_->held() + size * static_cast<Offset>(sizeof(T)));
      });
    return rhs_.data();
  }
  void to_device(T* to, const T* from, Offset count) override {
    const DeviceGuard guard(device_);
    side_->copy_in(to, from, count * static_cast<Offset>(sizeof(T)));
  }
  void from_device(T* to, const T* from, Offset count) override {
    const DeviceGuard guard(device_);
    side_->copy_out(to, from, count * static_cast<Offset>(sizeof(T)));
  }

  std::unique_ptr<DeviceLinearSystem> make_linear_system(const LinearSystemArrays& arrays,
                                                         Offset memory_bytes) override {
    reached_values_.close();
    shares_values_ = false;
    std::unique_ptr<DeviceLinearSystem> system;
    link_.expect_all([&] { system = make_device_linear_system<T>(arrays, *this, device_, memory_bytes); });
    return system;
  }
  [[nodiscard]] bool on_ranks() const override { return true; }
  void share_values(double* given, Offset first, Offset count) override {
    const DeviceGuard guard(device_);
    if (!shares_values_) reached_values_.open({given});
    shares_values_ = true;
    side_->stream().wait();  // what this rank has sent is there
    constexpr auto kBytes = static_cast<std::int64_t>(sizeof(double));
    const std::int64_t mine[2] = {first, count};
    std::vector<typename TileExchange<T>::Range> ranges;
    for (const auto& range : link_.all_gather_of(std::span<const std::int64_t>(mine)))
      ranges.push_back({range.at(0) * kBytes, range.at(1) * kBytes});
    for (int r = 0; r < link_.size(); ++r) {
      const auto rank = static_cast<std::size_t>(r);
      const Offset begin = ranges[rank].first / kBytes, size = ranges[rank].count / kBytes;
      if (r == link_.rank() || size == 0 || reached_values_.arrays()[rank].front() == nullptr) continue;
      const auto* theirs = static_cast<const double*>(reached_values_.arrays()[rank].front());
      call("cudaMemcpyAsync(values of another rank)", [&] {
        return cudaMemcpyAsync(given + begin, theirs + begin, static_cast<std::size_t>(size) * sizeof(double),
                               cudaMemcpyDefault, side_->stream().get());
      });
    }
    if (!mirrored_) return;
    std::vector<std::byte*> arrays;
    for (const auto& of_rank : reached_values_.arrays()) arrays.push_back(static_cast<std::byte*>(of_rank.front()));
    between_machines([&] { mirrored_->exchange().share(arrays, ranges); });
  }

  [[nodiscard]] void* stream() const override { return side_->stream().get(); }
  [[nodiscard]] T* values() const override { return side_->values(); }
  [[nodiscard]] Offset values_size() const override { return side_->values_size(); }
  [[nodiscard]] std::vector<std::vector<TaskTime>> task_times() const override { return {}; }
  [[nodiscard]] const DevicePlan& device_plan() const override { return *tables_; }
  TableUpload& uploads() override { return side_->uploads(); }

  [[nodiscard]] std::string name() const override {
    return fmt::format("{} ranks on GPUs, here {}", link_.size(), side_->name());
  }
  [[nodiscard]] Offset peak_bytes() const override { return side_->held(); }
  [[nodiscard]] std::vector<DeviceWork> device_work() const override { return work_; }

 private:
  static Index slabs(Index columns) { return (columns + kSlab - 1) / kSlab * kSlab; }

  void expect_same_plan() {
    const auto marks = link_.all_numbers(plan::fingerprint(
        plan_, static_cast<int>(kind_), [&](Index f, Index j) { return plan_.ownership.owner(f, j); }));
    for (std::size_t r = 0; r < marks.size(); ++r)
      if (marks[r] != marks[0])
        throw Error(StatusCode::invalid_input,
                    fmt::format("{} and {} have come to different plans: give all ranks the same matrix and options",
                                link_.name_of(0), link_.name_of(static_cast<int>(r))));
  }

  void make_side(const Job& job) {
    tables_.emplace(make_device_plan(plan_, kind_, true, {}, &job.pool, !machines_.is_one()));
    const int self = link_.rank();
    pair_sign_ = base::keeps_fp64<T> && stands_in_pairs(plan_) ? job.pair_sign : 0;
    context_.emplace(SideContext{plan_, kind_, *tables_, patience_of_kernels(link_.patience()), 0,
                                 values_of(plan_, &job.pool), &job.pool, self, true, pair_sign_});
    const Offset budget = job.memory_bytes.empty() ? 0 : job.memory_bytes.at(static_cast<std::size_t>(self));
    side_.emplace(*context_, self, device_, budget, CommonMemory<T>());
    side_->send_lists();
    side_->send_tables();
    rows_.own([&](Index f) { return std::countr_zero(tables_->fronts[static_cast<std::size_t>(f)].members); });
    moved_ = transferred_elements(plan_, kind_, *tables_);
    take_owners();
    if (machines_.is_one()) return;
    mirrored_.emplace(link_, machines_, plan_, kind_, *tables_, device_, side_->budget());
    pivots_ = PinnedArray<T>((kind_ == Kind::ldlt ? 3 : 1) * Offset{plan_.tree.n});
  }

  // Where the memory of all sides is, or its mirrors here.
  void reach() {
    reached_.open(side_->addresses());
    sides_ = reached_.sides();
    if (mirrored_) mirrored_->connect(sides_);
  }

  // Whose pivots count, for the judge, and whose rows of a solution.
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
    record_factor();
    if (mirrored_) inverses_graph_ = Graph::record(side_->stream().get(), [&] { enqueue_end(); });
  }
  void record_factor() {
    factor_graph_ = Graph::record(side_->stream().get(), [&] { enqueue_factor(); });
  }
  void record_filled(const FilledValues& values) {
    filled_graph_ = Graph::record(side_->stream().get(), [&] {
      side_->enqueue_take(*side_, values);
      enqueue_factor();
    });
  }

  // Between machines, the end waits until all tiles are where they belong: inverses overwrite them.
  void enqueue_factor() {
    side_->enqueue_tasks();
    if (!mirrored_) enqueue_end();
  }
  void enqueue_end() {
    side_->enqueue_inverses();
    side_->enqueue_counters();
  }

  [[nodiscard]] Error given_up(const char* what) const {
    return {StatusCode::device_error,
            fmt::format("the {} on {} was given up after waiting {:.3g} s for one of its own blocks", what, name(),
                        patience_of_kernels(link_.patience()))};
  }

  // As in one process: where unknowns stand in pairs, a replaced pivot does not, and all know of it.
  FactorOutcome run() {
    SideFlags flags;
    FactorOutcome out = run_once(flags);
    if (pair_sign_ == 0 || !flags.replaced) return out;
    link_.expect_all([&] { forget_pairs(); });
    flags = {};
    return run_once(flags);
  }

  void forget_pairs() {
    pair_sign_ = 0;
    side_->forget_pairs();
    record_factor();
    if (filled_.largest != nullptr) record_filled(filled_);
  }

  FactorOutcome run_once(SideFlags& flags) {
    const double began = base::now_seconds();
    const Graph& graph = last_filled_ ? filled_graph_ : factor_graph_;
    const FilledValues values = last_filled_ ? filled_ : FilledValues{};
    const auto clearing = [&] { side_->enqueue_clear_factor(); };
    run_on_all(factor_clean_, clearing, graph, [&] { mirrored_->exchange().begin_factor(); });
    if (mirrored_) {
      inverses_graph_.launch(side_->stream().get());
      side_->stream().wait();
    }
    FactorOutcome out;
    read_counters(out, flags);
    // All have finished. Each judges all pivots, and comes to the same.
    if (mirrored_) gather_pivots();
    side_->enqueue_judge(values, sides_, owner_.data());
    side_->stream().wait();
    const FactorEnd end = side_->factor_end();
    const bool finite = values.largest == nullptr || std::isfinite(end.largest);
    if (finite) read_marks(out, flags, end);
    clear(factor_clean_, clearing);
    out.seconds = base::now_seconds() - began;
    if (!finite) {
      flags = {};  // nothing that is known of pivots
      return out;
    }
    if (flags.stopped) throw given_up("factorization");
    if (out.not_positive >= 0) return out;
    if (smallest_.empty() || values.largest != nullptr)
      take_determinant(end, out);
    else
      judge_pivots(all_pivots(), smallest_, out);
    return out;
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

  // The pivots of other machines are read from this GPU's memory.
  void gather_pivots() {
    const Offset n = plan_.tree.n, parts = kind_ == Kind::ldlt ? 3 : 1;
    const Offset bytes = parts * n * static_cast<Offset>(sizeof(T));
    T* const there = side_->addresses().pivots;
    side_->copy_out(pivots_.data(), there, bytes);
    for (Offset part = 0; part < parts; ++part) rows_.share(link_, pivots_.data() + part * n, 1);
    side_->copy_in(there, pivots_.data(), bytes);
  }

  // What fails leaves no copy behind.
  template <class Body>
  void between_machines(Body&& body) {
    try {
      body();
    } catch (...) {
      mirrored_->exchange().give_up();
      throw;
    }
  }

  [[nodiscard]] bool is_finite(const FilledValues& values) const {
    std::vector<double> parts(static_cast<std::size_t>(values.parts));
    side_->copy_out(parts.data(), values.largest, values.parts * static_cast<Offset>(sizeof(double)));
    return std::all_of(parts.begin(), parts.end(), [](double part) { return std::isfinite(part); });
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
    constexpr std::size_t kMostGraphs = 64;
    if (solve_graphs_.size() >= kMostGraphs) solve_graphs_.clear();
    Graph& graph = solve_graphs_[{pass.rhs, pass.columns, pass.first_column, pass.transpose}];
    if (!graph.recorded())
      graph = Graph::record(side_->stream().get(), [&] {
        side_->enqueue_solve(sides_, pass);
        side_->enqueue_counters();
      });
    return graph;
  }

  // As many right-hand sides in a pass as there is room for on all ranks. Vectors that move are opened anew.
  void take_solve_memory(Index columns) {
    take_solutions(columns);
    std::int64_t most = 1;
    if (columns > 1) {
      most = std::min<Index>(kManyColumns, slabs(columns));
      while (most > kSlab && !side_->has_room_for(static_cast<Index>(most))) most -= kSlab;
      for (const std::int64_t of_rank : link_.all_numbers(most)) most = std::min(most, of_rank);
    }
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

  void take_solutions(Index columns) {
    const Offset size = whole_pages<T>(Offset{plan_.tree.n} * columns);
    if (solutions_.size() >= size) return;
    reached_solutions_.close();
    link_.expect_all([] {});  // nobody has them open
    link_.expect_all([&] {
      solve_graphs_.clear();
      side_->budget().give_back(solutions_.bytes());
      solutions_ = DeviceArray<T>();
      solutions_ = DeviceArray<T>(size, side_->budget(), side_->held() + size * static_cast<Offset>(sizeof(T)));
    });
    reached_solutions_.open({solutions_.data()});
  }

  // Each row from the rank that speaks for its front.
  void collect_solutions(T* x, Index columns) {
    if (mirrored_) {
      std::vector<T> all(static_cast<std::size_t>(Offset{plan_.tree.n} * columns));
      const auto bytes = static_cast<Offset>(all.size() * sizeof(T));
      side_->copy_out(all.data(), solutions_.data(), bytes);
      rows_.share(link_, all.data(), columns);
      return side_->copy_in(x, all.data(), bytes);
    }
    RankRowsJob<T> job{{}, x, owner_.data(), plan_.tree.n, columns};
    for (std::size_t r = 0; r < reached_solutions_.arrays().size(); ++r)
      job.from[r] = static_cast<const T*>(reached_solutions_.arrays()[r].front());
    call("launch of the kernel that gathers solutions", [&] { return launch_gather_rows(job, side_->stream().get()); });
  }

  const plan::Plan& plan_;
  Kind kind_;
  ranks::Communicator& link_;
  int device_;
  ranks::Machines machines_;  // of this executor's beginning
  std::optional<DevicePlan> tables_;
  std::optional<SideContext> context_;
  std::optional<DeviceSide<T>> side_;
  ReachedMemory<T> reached_;  // closed before what this rank has is given back
  std::vector<SideAddresses<T>> sides_;
  std::optional<MirroredMemory<T>> mirrored_;        // with ranks of other machines
  OpenedArrays reached_values_, reached_solutions_;  // likewise: one array of each rank
  RankRows rows_;                                    // whose front it is tells its pivots
  std::vector<std::string> names_;                   // of the GPUs, by rank
  DeviceArray<unsigned char> owner_;                 // n
  DeviceArray<T> rhs_, solutions_;                   // the second: others read it
  Graph factor_graph_, filled_graph_;                // the second: of factorize_filled() with filled_
  Graph inverses_graph_;                             // between machines: enqueue_end()
  PinnedArray<T> pivots_;                            // likewise: for gather_pivots()
  FilledValues filled_;
  int pair_sign_ = 0;                                                       // SideContext::pair_sign, as it is now
  bool last_filled_ = false;                                                // the last factorization was one of these
  bool shares_values_ = false;                                              // reached_values_ are open
  std::map<std::tuple<const T*, Index, Index, bool>, Graph> solve_graphs_;  // by rhs, columns, first column, transpose
  std::vector<double> moved_;                                               // by rank; elements
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
