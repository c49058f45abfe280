#include "device/host/host_executor.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/stage.hpp"
#include "device/host/factor_arrays.hpp"
#include "device/host/halting.hpp"
#include "device/host/kept_fronts.hpp"
#include "device/host/numeric_state.hpp"
#include "device/host/outcome.hpp"
#include "device/host/selected_inverse.hpp"
#include "device/host/task_queues.hpp"
#include "device/host/tile_factor.hpp"
#include "device/host/triangular_solve.hpp"
#include "device/host/workspace.hpp"
#include "plan/reached_fronts.hpp"

namespace espalier::device::host {

namespace {

template <class T>
class HostExecutor final : public Executor<T> {
 public:
  HostExecutor(const Job& job, HostOptions options)
      : plan_(job.plan),
        pool_(job.pool),
        options_(std::move(options)),
        devices_(plan_.ownership.devices),
        budget_(job.budget != nullptr ? job.budget : &own_budget_),
        held_before_(budget_->held()),
        timeline_(job.timeline),
        queues_(plan_),
        work_(make_workspaces(job.kind)),
        state_(plan_, {job.kind, job.hermitian}, job.rule, budget_, plan::elements_with_room(plan_.memory)),
        solve_(state_, pool_, budget_),
        next_rule_(job.rule) {
    if (timeline_ == nullptr) return;
    for (int t = 0; t < pool_.size(); ++t) {
      const Index d = device_of(t);
      const int first = team_begin(d);
      tracks_.push_back(timeline_->add_track(device_name(d), fmt::format("thread {}", t - first)));
    }
  }

  /// Takes over the memory of `from`.
  HostExecutor(const plan::Plan& changed, const plan::FrontsBefore& before, HostExecutor& from)
      : plan_(changed),
        pool_(from.pool_),
        options_(from.options_),
        devices_(1),
        budget_(from.budget_),
        held_before_(from.held_before_),
        timeline_(from.timeline_),
        queues_(plan_),
        work_(from.fitting_workspaces(changed)),
        state_(plan_, before, from.fronts_for(changed, before), from.state_, budget_),
        solve_(state_, pool_, budget_),
        tracks_(from.tracks_),
        next_rule_(from.next_rule_) {
    state_.take_arena(from.state_);
    if (work_.empty()) work_ = std::move(from.work_);
    if (before.of_pattern) made_ = std::exchange(state_.kept, {});
  }

  void set_pivot_rule(const PivotRule& rule) override { next_rule_ = rule; }
  bool copy_inverse_pivots(std::span<T> d, std::span<T> e) const override {
    if (state_.kind != Kind::ldlt) return false;
    std::copy_n(state_.d_inverse.data(), d.size(), d.begin());
    std::copy_n(state_.e_inverse.data(), e.size(), e.begin());
    return true;
  }
  void halt_at_failures(bool halt) override { state_.halting = halt && devices_ == 1 && state_.kind != Kind::llt; }
  [[nodiscard]] const LeftContributions<WideOf<T>>* left_contributions() const override {
    return halted_ ? &left_ : nullptr;
  }
  [[nodiscard]] const LeftContributions<WideOf<T>>* border_contribution() const override {
    return plan_.tree.border > 0 ? &left_ : nullptr;
  }
  std::unique_ptr<Executor<T>> with_changed_plan(const plan::Plan& plan, const plan::FrontsBefore& before) override {
    const auto& limits = options_.device_memory_bytes;
    const bool limited = std::any_of(limits.begin(), limits.end(), [](Offset bytes) { return bytes > 0; });
    if (devices_ > 1 || limited || budget_ == &own_budget_) return nullptr;
    if (before.of_pattern && (!has_made_some() || plan.memory.size > state_.arena.size())) return nullptr;
    return std::make_unique<HostExecutor>(plan, before, *this);
  }

  FactorOutcome factorize_changed(std::span<const T> values, std::span<const T> before) override {
    state_.kept.clear();  // for the values of then, which have not been factorized
    if (has_made_some()) {
      state_.kept = unchanged_fronts(state_, values, before, next_rule_, pool_, made_);
      std::fill(state_.begun.begin(), state_.begun.end(), 1);
    }
    return factorize(values);
  }

  FactorOutcome factorize(std::span<const T> values) override {
    const double start = base::now_seconds();
    const KeptOnce<T> once{state_};
    complete_ = false;
    made_.clear();
    state_.rule = next_rule_;
    reset(values);
    base::Stage* const stage = base::Stage::current("factorization");
    const auto take_tasks = [&](int worker) {
      const double begin = base::now_seconds();
      const Index device = device_of(worker);
      try {
        for (Offset at = queues_.next(device); at >= 0; at = queues_.next(device)) {
          if (state_.abort.load(std::memory_order_relaxed)) break;
          pool_.check();
          const plan::Task& task = plan_.tasks[static_cast<std::size_t>(at)];
          execute(task, device, worker);
          if (stage != nullptr) stage->add_share(share_of(task));
        }
      } catch (const Aborted&) {
      } catch (...) {
        state_.abort = true;
        fail(device);
      }
      work_[static_cast<std::size_t>(worker)].task_seconds = base::now_seconds() - begin;
    };
    // Each device has tasks of its own, so its threads must come.
    if (devices_ > 1)
      pool_.run(take_tasks);
    else
      pool_.share(take_tasks);
    FactorOutcome out = summarize(state_, work_);
    halted_ = out.halted;
    complete_ = !halted_ && !state_.abort;
    if (!state_.kept.empty()) out.share = 1 - plan::share_of_work(plan_, state_.kept);
    out.seconds = base::now_seconds() - start;
    return out;
  }

  [[nodiscard]] std::uint64_t arrays_layout() const override {
    return plan_.tree.border > 0 ? 0 : layout_of_arrays(state_);
  }
  void visit_arrays(const ArrayVisit& visit) override { host::visit_arrays(state_, visit); }
  FactorOutcome restore(std::span<const T> values, const ArrayVisit& visit) override {
    const KeptOnce<T> once{state_};
    complete_ = halted_ = false;
    made_.clear();
    state_.rule = next_rule_;
    reset(values);
    host::visit_arrays(state_, visit);
    expect_factor(state_);
    return summarize(state_, work_);
  }

  void solve(T* x, Index columns, bool transpose) override { solve_.run(x, columns, transpose); }
  bool solve_on_paths(const PathSolve<T>& solve) override {
    solve_.run(solve);
    return true;
  }
  bool invert_at(const InverseEntries<T>& entries) override {
    host::invert_at(state_, pool_, budget_, entries);
    return true;
  }

  [[nodiscard]] std::string name() const override {
    const std::string threads = fmt::format("({} thread{})", pool_.size(), pool_.size() == 1 ? "" : "s");
    return devices_ == 1 ? "host " + threads : fmt::format("{} host devices {}", devices_, threads);
  }
  [[nodiscard]] Offset peak_bytes() const override { return budget_->peak() - held_before_; }
  [[nodiscard]] std::vector<DeviceWork> device_work() const override {
    std::vector<DeviceWork> list;
    if (devices_ == 1) return list;
    const std::vector<Offset> bytes = device_bytes<T>(plan_, state_.kind, pool_.size());
    for (Index d = 0; d < devices_; ++d) {
      DeviceWork work{device_name(d), 0, 0, queues_.stolen(d), bytes[static_cast<std::size_t>(d)]};
      const double workers = team_begin(d + 1) - team_begin(d);
      for (int t = team_begin(d); t < team_begin(d + 1); ++t) {
        const Workspace<T>& w = work_[static_cast<std::size_t>(t)];
        work.busy_seconds += (w.task_seconds - w.waited_seconds) / workers;
        work.waiting_seconds += w.waited_seconds / workers;
      }
      list.push_back(std::move(work));
    }
    return list;
  }

 private:
  [[nodiscard]] int team_begin(Index d) const { return host::team_begin(d, devices_, pool_.size()); }
  [[nodiscard]] Index device_of(int worker) const {
    return static_cast<Index>(Offset{worker} * devices_ / pool_.size());
  }
  [[nodiscard]] std::string device_name(Index d) const {
    if (devices_ == 1) return name();
    const int threads = team_begin(d + 1) - team_begin(d);
    return fmt::format("host device {} ({} thread{})", d, threads, threads == 1 ? "" : "s");
  }
  // The workers' own memory, where what the devices need keeps to their budgets.
  [[nodiscard]] std::vector<Workspace<T>> make_workspaces(Kind kind) const {
    if (pool_.size() < devices_)
      throw Error(StatusCode::invalid_input,
                  fmt::format("{} host devices need as many threads, but there are {}", devices_, pool_.size()));
    const std::vector<Offset> needed = device_bytes<T>(plan_, kind, pool_.size());
    for (Index d = 0; d < static_cast<Index>(options_.device_memory_bytes.size()); ++d) {
      const Offset limit = options_.device_memory_bytes[static_cast<std::size_t>(d)];
      const Offset bytes = needed[static_cast<std::size_t>(d)];
      if (limit > 0 && bytes > limit)
        throw Error(StatusCode::out_of_memory,
                    fmt::format("{}: {} bytes are needed, its budget is {} bytes; give a larger one or more devices",
                                device_name(d), bytes, limit));
    }
    std::vector<Workspace<T>> work;
    for (int t = 0; t < pool_.size(); ++t) work.emplace_back(plan_, kind, budget_);
    return work;
  }

  // Rethrows what a worker of the device threw; of several devices, with the name of the device.
  [[noreturn]] void fail(Index device) const {
    if (devices_ == 1) throw;
    try {
      throw;
    } catch (const Error& e) {
      if (e.status().code == StatusCode::cancelled) throw;
      throw Error(StatusCode::device_error, fmt::format("{} failed: {}", device_name(device), e.what()));
    } catch (const std::exception& e) {
      throw Error(StatusCode::device_error, fmt::format("{} failed: {}", device_name(device), e.what()));
    } catch (...) {
      throw Error(StatusCode::device_error, device_name(device) + " failed for an unknown reason");
    }
  }

  [[nodiscard]] bool has_made_some() const { return complete_ || !made_.empty(); }

  // Fronts of a changed plan; 1: what this executor has made of them is that of the plan's, for the same values.
  [[nodiscard]] std::vector<char> fronts_for(const plan::Plan& changed, const plan::FrontsBefore& before) const {
    if (!before.of_pattern) return fronts_to_keep(state_, changed, before);
    std::vector<char> made(before.same.size(), 0);
    for (std::size_t f = 0; f < made.size(); ++f) {
      if (before.same[f] < 0) continue;
      const auto o = static_cast<std::size_t>(before.same[f]);
      made[f] = static_cast<char>((made_.empty() || made_[o] != 0) && state_.fronts[o].not_positive < 0);
    }
    return made;
  }

  // Empty: those of this executor will do for the other plan.
  [[nodiscard]] std::vector<Workspace<T>> fitting_workspaces(const plan::Plan& plan) const {
    std::vector<Workspace<T>> work;
    const Extent have = largest_tile<T>(plan_), need = largest_tile<T>(plan);
    const bool fit = need.area <= have.area && need.widest <= have.widest;
    if (fit && plan.memory.stack_size <= plan_.memory.stack_size) return work;
    for (int t = 0; t < pool_.size(); ++t) work.emplace_back(plan, state_.kind, budget_);
    return work;
  }

  void reset(std::span<const T> values) {
    halted_ = false;
    reset_state(state_, values);
    queues_.reset();
    for (auto& w : work_) w.waited_seconds = w.task_seconds = 0;
  }

  [[nodiscard]] bool is_kept(const plan::Task& task) const {
    bool kept = state_.is_kept(task.front);
    for (Index f = task.begin; task.is_range() && kept && f < task.front; ++f) kept = state_.is_kept(f);
    return kept;
  }

  void execute(const plan::Task& task, Index device, int worker) {
    if (is_kept(task)) return;
    if (options_.before_task) options_.before_task(device, task);
    Workspace<T>& w = work_[static_cast<std::size_t>(worker)];
    const double begin = timeline_ != nullptr ? base::now_seconds() : 0, waited = w.waited_seconds;
    if (task.is_range())
      eliminate_range(state_, w, task);
    else
      make_tile(state_, w, task);
    if (timeline_ != nullptr) record(task, worker, begin, w.waited_seconds - waited);
  }

  [[nodiscard]] double flops_of(const plan::Task& task) const {  // of a tile updates alone, of one triangle
    const auto& l = plan_.layout[task.front];
    if (!task.is_range()) return 2.0 * l.width(task.i) * l.width(task.j) * l.begin(std::min(task.j, l.pivot_tiles));
    double flops = 0;
    for (Index f = task.begin; f <= task.front; ++f)
      flops += plan::front_flops(plan_.layout[f].pivots, plan_.layout[f].rows, plan_.options.unsymmetric);
    return flops;
  }

  // The share of all that the plan has to do.
  [[nodiscard]] double share_of(const plan::Task& task) const {
    if (task.is_range()) return flops_of(task) / plan_.flops;
    const auto& l = plan_.layout[task.front];
    const double rows = l.width(task.i), columns = l.width(task.j), depth = l.begin(std::min(task.j, l.pivot_tiles));
    const bool diagonal = task.i == task.j, pivots = task.j < l.pivot_tiles;
    double flops = (diagonal ? 1 : 2) * rows * columns * depth;
    if (pivots) flops += rows * columns * columns / (diagonal ? 3 : 1);
    return (plan_.options.unsymmetric ? 2 : 1) * flops / plan_.flops;
  }

  void record(const plan::Task& task, int worker, double begin, double waited) {
    base::TimelineEvent e;
    e.waited = waited;
    e.front = task.front;
    e.row = task.i;
    e.col = task.j;
    e.begin = begin;
    e.end = base::now_seconds();
    const auto& l = plan_.layout[task.front];
    e.flops = flops_of(task);
    if (task.is_range()) {
      e.kind = "range";
    } else {
      e.kind = task.j >= l.pivot_tiles ? "contribution" : task.i == task.j ? "diagonal" : "panel";
      e.bytes = static_cast<double>(sizeof(T)) * l.width(task.i) * l.width(task.j);
    }
    timeline_->record(tracks_[static_cast<std::size_t>(worker)], e);
  }

  const plan::Plan& plan_;
  base::ThreadPool& pool_;
  HostOptions options_;
  Index devices_;
  base::MemoryBudget own_budget_{"host memory"};
  base::MemoryBudget* budget_;
  Offset held_before_;  // by others, when the executor was made
  base::Timeline* timeline_;
  TaskQueues queues_;
  std::vector<Workspace<T>> work_;
  NumericState<T> state_;
  TriangularSolve<T> solve_;
  std::vector<int> tracks_;
  bool halted_ = false;
  bool complete_ = false;   // the last factorization has made all fronts
  std::vector<char> made_;  // else, in a changed pattern: fronts; 1: it is there as the last values make it
  PivotRule next_rule_;     // of the next factorization
  LeftInArena<T> left_{state_};
};

}  // namespace

template <class T>
std::unique_ptr<Executor<T>> make_host_executor(const Job& job, HostOptions options) {
  return std::make_unique<HostExecutor<T>>(job, std::move(options));
}

#define ESPALIER_INSTANTIATE(T) template std::unique_ptr<Executor<T>> make_host_executor(const Job&, HostOptions);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host
