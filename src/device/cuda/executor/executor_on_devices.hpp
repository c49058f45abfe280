/// \file
/// The executor of the CUDA backend on one GPU or several; its parts stand in cuda_executor.cpp (construction),
/// executor_runs.cpp (factorizations) and executor_solve.cpp. For this backend alone: needs the CUDA runtime.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <span>
#include <tuple>

#include "base/timeline.hpp"
#include "device/cuda/executor/device_linear_system.hpp"
#include "device/cuda/executor/device_side.hpp"
#include "device/cuda/executor/selected_inverse.hpp"
#include "device/cuda/executor/side_outcome.hpp"

namespace espalier::device::cuda {

/// One GPU or several. With one, a graph clears what the kernels need clear, and runs them. With several, a side may
/// write to another one as soon as its kernels run, so everything is cleared between runs, when all have finished:
/// after a run, or, where the next one may go on from it, before that one. It begins when all are clear.
template <class T>
class ExecutorOnDevices final : public CudaExecutor<T> {
  using Side = DeviceSide<T>;

 public:
  /// @param arena  of an executor before; empty: it is taken
  ExecutorOnDevices(const plan::Plan& plan, Kind kind, const PivotRule& rule, const CudaOptions& options,
                    DeviceArray<T> arena = {});

  void set_pivot_rule(const PivotRule& rule) override {
    smallest_ = rule.smallest;
    const PivotLimits<T> limits = limits_of<T>(rule);
    if (limits_known_ && limits == limits_) return;
    limits_known_ = false;
    for (const auto& side : sides_) at(*side, [&] { side->set_limits(limits); });
    limits_ = limits;
    limits_known_ = true;
  }

  FactorOutcome factorize(std::span<const T> values) override;

  std::optional<FactorOutcome> factorize_filled(const FilledValues& values) override;

  FactorOutcome factorize_changed(std::span<const T> values, std::span<const T> before) override;

  std::optional<FactorOutcome> factorize_part(const FilledValues& values, std::span<const char> reached) override;

  std::unique_ptr<Executor<T>> with_changed_plan(const plan::Plan& plan, const plan::FrontsBefore& before) override;

  double refactorize_again() override {
    const FactorGraphs& graphs = last_filled_ ? filled_graphs_ : graphs_;
    if (several()) return launch_on_all(graphs, [] {});
    const DeviceGuard guard(first().device());
    return first().stream().timed([&] { graphs.sides.front().launch(first().stream().get()); });
  }

  [[nodiscard]] void* stream() const override { return first().stream().get(); }
  [[nodiscard]] T* values() const override { return first().values(); }
  [[nodiscard]] Offset values_size() const override { return first().values_size(); }

  void solve(T* x, Index columns, bool transpose) override;

  bool solve_on_paths(const PathSolve<T>& solve) override;

  double solve_device(T* x, Index columns, bool transpose) override;

  SolveClear clear_before_solve(Index columns) override {
    take_solve_memory(columns);
    return several() ? SolveClear{} : first().solve_clear(pass_width(columns));
  }
  void enqueue_solve(T* x, Index columns, bool transpose) override;
  [[nodiscard]] const int* solve_aborted() const override { return several() ? nullptr : first().solve_aborted(); }
  [[nodiscard]] Error solve_given_up() const override { return stalled("solve"); }

  T* device_rhs(Index columns) override;

  void to_device(T* to, const T* from, Offset count) override {
    at(first(), [&] { first().copy_in(to, from, count * static_cast<Offset>(sizeof(T))); });
  }
  void from_device(T* to, const T* from, Offset count) override {
    at(first(), [&] { first().copy_out(to, from, count * static_cast<Offset>(sizeof(T))); });
  }

  bool copy_inverse_pivots(std::span<T> d, std::span<T> e) const override;
  bool invert_at(const InverseEntries<T>& entries) override;
  [[nodiscard]] std::string name() const override {
    if (!several()) return first().name();
    return fmt::format("{} GPUs, the first {}", sides_.size(), first().name());
  }
  [[nodiscard]] Offset peak_bytes() const override {
    Offset most = 0;
    for (const auto& side : sides_) most = std::max(most, side->held());
    return most;
  }
  [[nodiscard]] std::vector<DeviceWork> device_work() const override { return work_; }
  std::unique_ptr<DeviceLinearSystem> make_linear_system(const LinearSystemArrays& arrays,
                                                         Offset memory_bytes) override {
    return make_device_linear_system<T>(arrays, *this, devices_.front(), memory_bytes);
  }

 private:
  struct SolveKey {
    T* x;
    Index columns;
    bool transpose;
    int side;
    Index first_column;
    Index at_once;
    bool cleared;  // what the first pass needs clear is so
    bool operator<(const SolveKey& o) const {
      return std::tie(x, columns, transpose, side, first_column, at_once, cleared) <
             std::tie(o.x, o.columns, o.transpose, o.side, o.first_column, o.at_once, o.cleared);
    }
  };

  [[nodiscard]] bool several() const { return devices_.size() > 1; }
  [[nodiscard]] std::vector<SideAddresses<T>> addresses() const {
    std::vector<SideAddresses<T>> list;
    for (const auto& side : sides_) list.push_back(side->addresses());
    return list;
  }
  [[nodiscard]] Side& first() const { return *sides_.front(); }
  template <class Use>
  void at(const Side& side, Use&& use) const {
    const DeviceGuard guard(side.device());
    use();
  }

  [[nodiscard]] Error stalled(const char* what) const {
    return {StatusCode::device_error,
            fmt::format("the {} on {} was given up after waiting {} s for one of its own blocks", what, name(),
                        options_.patience_seconds)};
  }

  // ---- construction ------------------------------------------------------------------------------------------------

  // Where access from one device to another is refused: memory on the host that all of them see.
  void take_common();

  // All sides with their tables. They are made at the same time, each but the first by a thread of its own.
  void make_sides();
  void add_side(int self);
  template <class Use>
  void for_sides(int first, Use&& use) const;

  void set_up_tests();

  // What each side takes of the values, and whose pivots count.
  void take_needed_values();

  // Graphs of a factorization: of each side, and, of several, of the judge on the first that follows them.
  struct FactorGraphs {
    std::vector<Graph> sides;
    Graph judge;
  };
  FactorGraphs record_factorization(const FilledValues& values);
  void enqueue_factorization(Side& side, const FilledValues& values);

  // ---- runs --------------------------------------------------------------------------------------------------------

  // Launches on every side and waits for all; then finish() and clear(), which the next run needs. What goes wrong on
  // one ends the others. clean: whether what clear() clears is so; a run that failed leaves it to the next one, and so
  // does one that stays.
  template <class Launch, class Finish, class Clear>
  double run_on_all(bool& clean, bool stays, Launch&& launch, Finish&& finish, Clear&& clear) {
    if (!clean) clear();
    clean = false;
    const double start = base::now_seconds();
    std::string what;
    const auto fail = [&](const Side& side, const char* text) {
      factor_clean_ = solve_clean_ = false;
      if (what.empty()) what = fmt::format("{}: {}", side.name(), text);
      for (const auto& other : sides_) other->abort();
    };
    for (const auto& side : sides_) side->stream().wait();  // clear of the run before
    std::vector<char> running(sides_.size(), 0);
    for (const auto& side : sides_) {
      try {
        at(*side, [&] { launch(*side); });
        running[static_cast<std::size_t>(side->self())] = 1;
      } catch (const Error& e) {
        fail(*side, e.what());
      }
    }
    for (auto left = std::count(running.begin(), running.end(), 1); left > 0;)
      for (const auto& side : sides_) {
        char& runs = running[static_cast<std::size_t>(side->self())];
        if (runs == 0) continue;
        const auto e = cudaStreamQuery(side->stream().get());
        if (e == cudaErrorNotReady) continue;
        runs = 0;
        --left;
        if (e != cudaSuccess) {
          (void)cudaGetLastError();
          fail(*side, cudaGetErrorString(e));
        } else if (side->self() == options_.fail_device) {
          fail(*side, "failed halfway, as asked for");
        }
      }
    if (!what.empty()) throw Error(StatusCode::device_error, what);
    finish();
    const double seconds = base::now_seconds() - start;
    if (stays) return seconds;
    clear();
    clean = true;
    return seconds;
  }
  // The same for a factorization; after_judge() reads what the clearing will wipe out. @returns seconds before it
  template <class AfterJudge>
  double launch_on_all(const FactorGraphs& graphs, AfterJudge&& after_judge) {
    double seconds = 0;
    const double start = base::now_seconds();
    run_on_all(
        factor_clean_, plan_.options.keep_contributions,
        [&](Side& s) { graphs.sides[static_cast<std::size_t>(s.self())].launch(s.stream().get()); },
        [&] {
          at(first(), [&] {
            graphs.judge.launch(first().stream().get());
            first().stream().wait();
          });
          seconds = base::now_seconds() - start;
          after_judge();
        },
        [&] { clear_factor(); });
    return seconds;
  }

  void clear_factor() {
    if (common_.flag != nullptr) std::fill(common_.flag, common_.flag + common_flag_.size(), 0);
    for (const auto& side : sides_) at(*side, [&] { side->enqueue_clear_factor(); });
  }
  void clear_solve(Index pass) {
    if (common_.updates != nullptr)
      std::memset(common_.updates, 0xff, static_cast<std::size_t>(common_updates_.size()) * sizeof(T));
    for (const auto& side : sides_) at(*side, [&] { side->enqueue_clear_solve(pass); });
  }

  // Runs a graph of graphs_, or of filled_graphs_.
  FactorOutcome run(bool filled);
  FactorOutcome run_once(bool filled, SideFlags& flags);
  void finish_run(bool filled, const SideFlags& flags, FactorOutcome& out);
  // Runs the tasks of the fronts that are not 0, and of those that have to be made. @pre goes_on(), and judges_alike()
  // by the limits that are set
  FactorOutcome run_part(const FilledValues& values, std::span<const char> reached);
  void run_part_on_all(const FilledValues& values, FactorOutcome& out, SideFlags& flags);
  // Whether all fronts are finished, or those of made_, without a failure, and stay until a next run.
  [[nodiscard]] bool goes_on() const;
  // Whether a factorization of these goes on from the last one, which was of others where the plan has changed.
  [[nodiscard]] bool takes_up(const FilledValues& values);
  // The fronts that values reach, those that have not been made, and all above them.
  [[nodiscard]] std::vector<char> open_fronts(std::span<const char> reached) const;
  [[nodiscard]] bool judges_alike(const PivotLimits<T>& now) const;
  // @param all  all fronts were made
  void note_run(const FactorOutcome& out, const SideFlags& flags, const PivotLimits<T>& limits, bool all);
  // As the GPU completes those of filled_.
  [[nodiscard]] PivotLimits<T> limits_of_filled(double largest) const {
    return {static_cast<T>(filled_.tiny * largest), limits_[1], static_cast<T>(filled_.rounding * largest),
            static_cast<T>(largest)};
  }
  // Where unknowns stand in pairs, a replaced pivot does not: records graphs that know nothing of pairs.
  void forget_pairs();

  [[nodiscard]] std::vector<std::vector<TaskTime>> task_times() const override;
  [[nodiscard]] const DevicePlan& device_plan() const override { return tables_; }
  [[nodiscard]] TableUpload& uploads() override { return sides_.front()->uploads(); }

  // The devices' clocks have nothing in common: each device's first task counts as the begin of the run.
  void record(double began);

  void take_values(std::span<const T> values);
  void send_values();

  // Where the others do not reach the first's memory: the limits of the pivot rule, set from here.
  // @returns whether the values are finite
  bool set_limits_here(const FilledValues& values);

  [[nodiscard]] const int* counters_of(const Side& side) const {
    return several() ? side.factor_counters() : side.factor_end().counters;
  }
  void read_counters(FactorOutcome& out, SideFlags& flags);

  void read_marks(FactorOutcome& out, const SideFlags& flags);

  std::vector<unsigned char> marks(bool failed);

  // The determinant, and the positive pivots (llt) that count as zero: on the host, from all pivots, where several
  // GPUs have them or the rule knows every pivot's own limit; else as the GPU found it.
  void judge_pivots_here(FactorOutcome& out);

  // ---- solve -------------------------------------------------------------------------------------------------------

  // Memory for the first pass of a solve with so many right-hand sides.
  void take_solve_memory(Index columns);
  // A multiple of kSlab that holds so many.
  static Index slabs(Index columns) { return (columns + kSlab - 1) / kSlab * kSlab; }
  // Right-hand sides of a pass where so many are left.
  [[nodiscard]] Index pass_width(Index columns) const { return std::min(at_once_, at_once_ > 1 ? slabs(columns) : 1); }

  const Graph& solve_graph_of(T* x, Index columns, bool transpose, bool cleared);
  template <class Record>
  const Graph& solve_graph(const SolveKey& key, const Side& side, Record&& record);

  // Every side works on a copy of the right-hand sides; solutions go to x, on the first device or wherever it lies.
  double solve_on_all(T* x, Index columns, bool transpose);

  void stage_rhs(const T* x, Offset count);

  // Every row from the device that speaks for its front.
  void collect_solution(T* x, Index columns);

  const plan::Plan& plan_;
  Kind kind_;
  CudaOptions options_;
  std::vector<int> devices_;
  bool peers_;  // each reaches the memory of all others
  DevicePlan tables_;
  SideContext context_;
  DeviceArray<T> arena_;  // until the side has it
  PinnedArray<T> common_top_, common_places_, common_pivot_, common_updates_;
  PinnedArray<int> common_flag_;
  CommonMemory<T> common_;
  std::vector<std::unique_ptr<Side>> sides_;
  std::vector<DeviceArray<T>> side_rhs_;
  DeviceArray<unsigned char> owner_;     // n, on the first of several: whose pivot counts
  FactorGraphs graphs_, filled_graphs_;  // the second: of factorize_filled() with filled_
  FilledValues filled_;
  bool last_filled_ = false;  // the last factorization was one of these
  std::vector<char> made_;    // fronts of a changed plan that the one before has left (1); empty: a run has made all
  struct LastRun {
    bool sound = false;          // no pivot was replaced or failed: some fronts alone may be made again
    bool near = false;           // kNear, of any run since all fronts were made
    bool varied = false;         // runs since then had other limits
    PivotLimits<T> of_all = {};  // when all fronts were made
    T least = 0;                 // no pivot is smaller in magnitude
  } last_;
  std::map<SolveKey, Graph> solve_graphs_;
  KeptInverseTables kept_inverse_;
  std::vector<DeviceWork> work_;
  std::vector<std::vector<T>> pivots_host_;
  PivotLimits<T> limits_ = {};
  bool limits_known_ = false;
  bool factor_clean_ = false, solve_clean_ = false;  // what a run on several expects to be clear is so
  std::span<const double> smallest_;                 // PivotRule::smallest
  std::vector<double> moved_;                        // devices; elements
  Index at_once_ = 1;                                // most right-hand sides of a pass of the current solve
};

}  // namespace espalier::device::cuda
