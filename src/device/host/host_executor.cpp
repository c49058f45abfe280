#include "device/host/host_executor.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "device/host/numeric_state.hpp"
#include "device/host/tile_factor.hpp"
#include "device/host/triangular_solve.hpp"

namespace espalier::device::host {

template <class T>
Workspace<T>::Workspace(const analysis::Plan& plan, Kind kind, base::MemoryBudget* budget) {
  Offset area = 0;
  Offset widest = 0;
  for (Index f = 0; f < plan.fronts(); ++f) {
    const auto& l = plan.layout[f];
    if (plan.whole[f] != 0) {
      widest = std::max<Offset>(widest, l.pivots);
      area = std::max(area, padded<T>(l.rows) * padded<T>(l.rows));
      continue;
    }
    Offset most = 0;
    for (Index i = 0; i < l.tiles; ++i) most = std::max<Offset>(most, l.width(i));
    widest = std::max(widest, most);
    area = std::max(area, padded<T>(most) * padded<T>(most));
  }
  c = base::Buffer<T>(area, budget);
  if (kind != Kind::llt) c2 = base::Buffer<T>(area, budget);
  panels = base::Buffer<T>(area, budget);
  stack = base::Buffer<T>(plan.memory.stack_size, budget);
  column = base::Buffer<T>(2 * padded<T>(widest) + kPanel<T>, budget);
  marks = base::Buffer<char>(padded<T>(widest), budget);
  runs.reserve(static_cast<std::size_t>(3 * 2048));
}

namespace {

template <class T>
class HostExecutor final : public Executor<T> {
 public:
  HostExecutor(const analysis::Plan& plan, Kind kind, const PivotRule& rule, base::ThreadPool& pool,
               base::MemoryBudget* budget, base::Timeline* timeline)
      : plan_(plan),
        pool_(pool),
        budget_(budget != nullptr ? budget : &own_budget_),
        timeline_(timeline),
        state_(plan, kind, rule, budget_),
        solve_(state_, pool, budget_) {
    for (int t = 0; t < pool.size(); ++t) {
      work_.emplace_back(plan, kind, budget_);
      if (timeline_ != nullptr) tracks_.push_back(timeline_->add_track(name(), fmt::format("thread {}", t)));
    }
  }

  void set_pivot_rule(const PivotRule& rule) override { state_.rule = rule; }

  FactorOutcome factorize(std::span<const T> values) override {
    const double start = base::now_seconds();
    reset(values);
    std::atomic<std::size_t> next{0};
    pool_.run([&](int worker) {
      const double begin = base::now_seconds();
      try {
        for (std::size_t at = next++; at < plan_.tasks.size(); at = next++) execute(plan_.tasks[at], worker);
      } catch (const Aborted&) {
      } catch (...) {
        state_.abort = true;
        throw;
      }
      work_[static_cast<std::size_t>(worker)].task_seconds = base::now_seconds() - begin;
    });
    FactorOutcome out = summarize();
    out.seconds = base::now_seconds() - start;
    for (const auto& w : work_)
      out.busy_seconds += (w.task_seconds - w.waited_seconds) / static_cast<double>(work_.size());
    return out;
  }

  void solve(T* x, Index columns, bool transpose) override { solve_.run(x, columns, transpose); }

  [[nodiscard]] std::string name() const override {
    return fmt::format("host ({} thread{})", pool_.size(), pool_.size() == 1 ? "" : "s");
  }
  [[nodiscard]] Offset peak_bytes() const override { return budget_->peak(); }

 private:
  void reset(std::span<const T> values) {
    state_.values = values;
    state_.abort = false;
    state_.tile_done.reset();
    state_.front_done.reset();
    std::fill(state_.column_state.begin(), state_.column_state.end(), kColumnFine);
    std::fill(state_.fronts.begin(), state_.fronts.end(), FrontOutcome{});
    for (Index f = 0; f < plan_.fronts(); ++f)
      state_.open_tiles[f].store(static_cast<Index>(plan_.layout[f].tile_count()), std::memory_order_relaxed);
    for (auto& w : work_) w.waited_seconds = w.task_seconds = 0;
  }

  void execute(const analysis::Task& task, int worker) {
    Workspace<T>& w = work_[static_cast<std::size_t>(worker)];
    const double begin = timeline_ != nullptr ? base::now_seconds() : 0;
    if (task.is_range())
      eliminate_range(state_, w, task);
    else
      make_tile(state_, w, task);
    if (timeline_ != nullptr) record(task, tracks_[static_cast<std::size_t>(worker)], begin);
  }

  void record(const analysis::Task& task, int track, double begin) {
    base::TimelineEvent e;
    e.front = task.front;
    e.row = task.i;
    e.col = task.j;
    e.begin = begin;
    e.end = base::now_seconds();
    const auto& l = plan_.layout[task.front];
    if (task.is_range()) {
      e.kind = "range";
      for (Index f = task.begin; f <= task.front; ++f)
        e.flops += analysis::front_flops(plan_.layout[f].pivots, plan_.layout[f].rows, plan_.options.unsymmetric);
    } else {
      e.kind = task.j >= l.pivot_tiles ? "contribution" : task.i == task.j ? "diagonal" : "panel";
      const double depth = l.begin(std::min(task.j, l.pivot_tiles));
      e.flops = 2.0 * l.width(task.i) * l.width(task.j) * depth;
      e.bytes = static_cast<double>(sizeof(T)) * l.width(task.i) * l.width(task.j);
    }
    timeline_->record(track, e);
  }

  [[nodiscard]] FactorOutcome summarize() const {
    FactorOutcome out;
    for (const FrontOutcome& f : state_.fronts) {
      if (f.not_positive >= 0 && (out.not_positive < 0 || f.not_positive < out.not_positive))
        out.not_positive = f.not_positive;
      out.negative += f.negative;
      out.two_by_two += f.two_by_two;
      out.determinant_sign *= f.determinant_sign;
      out.determinant_log += f.determinant_log;
    }
    for (Index p = 0; p < plan_.tree.n; ++p) {
      const char s = state_.column_state[static_cast<std::size_t>(p)];
      if ((s & kColumnReplaced) != 0) out.replaced.push_back(p);
      if ((s & kColumnFailed) != 0) out.failed.push_back(p);
    }
    return out;
  }

  const analysis::Plan& plan_;
  base::ThreadPool& pool_;
  base::MemoryBudget own_budget_{"host memory"};
  base::MemoryBudget* budget_;
  base::Timeline* timeline_;
  NumericState<T> state_;
  TriangularSolve<T> solve_;
  std::vector<Workspace<T>> work_;
  std::vector<int> tracks_;
};

}  // namespace

template <class T>
std::unique_ptr<Executor<T>> make_host_executor(const analysis::Plan& plan, Kind kind, const PivotRule& rule,
                                                base::ThreadPool& pool, base::MemoryBudget* budget,
                                                base::Timeline* timeline) {
  return std::make_unique<HostExecutor<T>>(plan, kind, rule, pool, budget, timeline);
}

template std::unique_ptr<Executor<double>> make_host_executor(const analysis::Plan&, Kind, const PivotRule&,
                                                              base::ThreadPool&, base::MemoryBudget*, base::Timeline*);
template std::unique_ptr<Executor<float>> make_host_executor(const analysis::Plan&, Kind, const PivotRule&,
                                                             base::ThreadPool&, base::MemoryBudget*, base::Timeline*);

}  // namespace espalier::device::host
