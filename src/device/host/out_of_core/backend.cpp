#include "device/host/out_of_core/backend.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <optional>

#include "device/host/host_executor.hpp"
#include "device/host/kept_fronts.hpp"
#include "device/host/out_of_core/direct_copies.hpp"
#include "device/host/out_of_core/group_tasks.hpp"
#include "device/host/outcome.hpp"
#include "device/host/selected_inverse.hpp"
#include "device/host/tile_factor.hpp"
#include "device/host/triangular_solve.hpp"

namespace espalier::device::host {

namespace {

using out_of_core::ColumnGroup;
using out_of_core::InCoreStep;
using out_of_core::Operation;
using out_of_core::OperationType;
using out_of_core::Queue;
using plan::FrontLayout;
using plan::Task;

template <class T>
class HostOutOfCoreBackend final : public out_of_core::OutOfCoreBackend<T> {
 public:
  HostOutOfCoreBackend(const Job& job, HostOutOfCoreOptions options)
      : plan_(job.plan.ownership.devices > 1 ? plan::plan_for_one_device(job.plan) : job.plan),
        matrix_{job.kind, job.hermitian},
        rule_(job.rule),
        own_pool_(options.threads > 0 ? std::make_unique<base::ThreadPool>(options.threads) : nullptr),
        pool_(own_pool_ != nullptr ? *own_pool_ : job.pool),
        solve_pool_(job.pool),
        budget_(job.budget),
        options_(std::move(options)),
        direct_(options_.late_copies) {
    const auto panel = static_cast<Offset>(plan_.options.tiles.panel);
    for (Index f = 0; f < plan_.fronts(); ++f) {
      sizes_.factor.push_back((plan_.layout[f].factor_size() + panel - 1) / panel * panel);
      sizes_.contribution.push_back((plan_.layout[f].contribution_size() + panel - 1) / panel * panel);
    }
  }

  // ---- layout -------------------------------------------------------------------------------------------------------

  [[nodiscard]] const plan::Plan& plan() const override { return plan_; }
  [[nodiscard]] Offset element_bytes() const override { return sizeof(T); }
  [[nodiscard]] const plan::TaskList& order() const override { return plan_.tasks; }
  [[nodiscard]] const plan::ArraySizes& sizes() const override { return sizes_; }
  [[nodiscard]] Offset factor_offset(Index f, Index column) const override {
    const FrontLayout& l = plan_.layout[f];
    return column < l.pivot_tiles ? l.tile_offset(column, column) : sizes_.factor[f];
  }
  [[nodiscard]] Offset contribution_offset(Index f, Index column) const override {
    const FrontLayout& l = plan_.layout[f];
    return column < l.tiles_below() ? l.contribution_offset(column, column) : sizes_.contribution[f];
  }
  void slab(Index f, Index begin, Index end, Index row, std::vector<out_of_core::Extent>& extents) const override {
    const FrontLayout& l = plan_.layout[f];
    for (Index k = begin; k < end; ++k) {
      const Offset rows = l.padded_begin(l.tiles) - l.padded_begin(row);
      extents.push_back({l.tile_offset(row, k), l.width(k) * rows});
    }
  }
  [[nodiscard]] Offset share_bytes(Index) const override { return 0; }
  [[nodiscard]] Offset table_bytes(const InCoreStep&) const override { return 0; }
  [[nodiscard]] Offset scratch_bytes(const InCoreStep&) const override { return 0; }
  [[nodiscard]] Offset output_bytes(const InCoreStep&) const override { return 0; }
  [[nodiscard]] Offset table_bytes(Index, Index, Index) const override { return 0; }
  [[nodiscard]] Offset scratch_bytes(Index, Index, Index) const override { return 0; }
  [[nodiscard]] Offset output_bytes(Index, Index, Index) const override { return 0; }
  [[nodiscard]] bool copies_values() const override { return false; }
  [[nodiscard]] Offset solve_bytes(const std::vector<Index>&, Index) const override { return 0; }

  // ---- memory and copies --------------------------------------------------------------------------------------------

  [[nodiscard]] Offset host_bytes(const out_of_core::OutOfCorePlan& plan, int slots, Offset slot_bytes) const override {
    const Offset arena = plan.arena_bytes / static_cast<Offset>(sizeof(T));
    // The first device solves, with all threads of the pool.
    return host::host_bytes<T>(plan_, matrix_.kind, options_.device == 0 ? solve_pool_.size() : pool_.size(), arena,
                               stack_of(plan)) +
           slots * slot_bytes;
  }
  void prepare(const out_of_core::OutOfCorePlan& plan, int slots, Offset slot_bytes) override {
    out_of_core_ = &plan;
    slot_bytes_ = slot_bytes;
    ring_ = base::Buffer<std::byte>(slots * slot_bytes, budget_);
    plan_.memory = plan::MemoryPlan{};
    plan_.memory.size = plan.arena_bytes / static_cast<Offset>(sizeof(T));
    const auto n = static_cast<std::size_t>(plan_.fronts());
    plan_.memory.factor.assign(n, 0);
    plan_.memory.factor2.assign(n, 0);
    plan_.memory.contribution.assign(n, 0);
    plan_.memory.contribution2.assign(n, 0);
    plan_.memory.on_stack.assign(n, 0);
    plan_.memory.wait_ptr.assign(n + 1, 0);
    plan_.memory.stack_size = stack_of(plan);
    for (int t = 0; t < pool_.size(); ++t) work_.emplace_back(plan_, matrix_.kind, budget_);
    state_.emplace(plan_, matrix_, rule_, budget_);
    if (options_.device == 0) solve_.emplace(*state_, solve_pool_, budget_);
  }

  void set_pivot_rule(const PivotRule& rule) override { rule_ = rule; }

  [[nodiscard]] std::vector<char> changed_fronts(std::span<const T> values, std::span<const T> before) override {
    return host::changed_fronts(*state_, values, before, rule_, pool_);
  }
  void keep(std::span<const char> kept) override { state_->kept.assign(kept.begin(), kept.end()); }
  void bring(Queue, Offset to, const std::byte* from, Offset bytes) override {
    pinned_memory().check_not_torn(from, bytes);
    std::memcpy(place(to, bytes), from, static_cast<std::size_t>(bytes));
  }
  void begin(std::span<const T> values) override {
    state_->rule = rule_;
    reset_state(*state_, values);
    state_->places = state_->arena.data();
    for (auto& w : work_) w.waited_seconds = w.task_seconds = 0;
    times_ = {};
    direct_.begin();
  }
  void enter_thread() override {}
  std::byte* staging(int slot) override { return ring_.data() + slot * slot_bytes_; }
  void copy_in(Offset to, int slot, Offset bytes) override {
    std::memcpy(place(to, bytes), staging(slot), static_cast<std::size_t>(bytes));
  }
  void copy_out(int slot, Offset from, Offset bytes) override {
    std::memcpy(staging(slot), place(from, bytes), static_cast<std::size_t>(bytes));
  }
  void wait_for_slot(int) override {}
  bool pin(std::byte* at, Offset bytes) override {
    return ++pins_ != options_.refuse_pin && pinned_memory().add(at, bytes);
  }
  void unpin(std::byte* at) noexcept override { pinned_memory().remove(at); }
  void copy_in_direct(Offset to, const std::byte* from, Offset bytes) override {
    pinned_memory().check(from, bytes);
    direct_.copy(Queue::in, place(to, bytes), from, bytes);
  }
  void copy_out_direct(std::byte* to, Offset from, Offset bytes) override {
    pinned_memory().check(to, bytes);
    direct_.copy(Queue::out, to, place(from, bytes), bytes);
  }
  std::span<const std::byte> tables(const Operation&) override { return {}; }
  void take_outputs(const Operation&, std::span<const std::byte>) override {}
  void mark(Queue queue, std::int64_t number) override { direct_.mark(queue, number); }
  void wait_for_mark(Queue, Queue other, std::int64_t number) override { direct_.wait(other, number); }
  void wait_for_mark(Queue, out_of_core::OutOfCoreBackend<T>& of, Queue other, std::int64_t number) override {
    dynamic_cast<HostOutOfCoreBackend&>(of).direct_.wait(other, number);
  }
  void wait_until(Queue queue, std::int64_t number) override { direct_.wait(queue, number); }
  void finish() override { state_->window = {}; }
  void abandon() noexcept override { state_->window = {}; }
  FactorOutcome outcome() override { return summarize(*state_, work_); }
  [[nodiscard]] OperationTimes times() const override { return times_; }

  void take_pivots(out_of_core::OutOfCoreBackend<T>& from) override {
    auto& other = dynamic_cast<HostOutOfCoreBackend&>(from);
    const auto take = [&](Index begin, Index end) {
      const auto copy = [&](auto& to, const auto& list) {
        if (list.size() > 0) std::copy(list.data() + begin, list.data() + end, to.data() + begin);
      };
      copy(state_->pivot_order, other.state_->pivot_order);
      copy(state_->d_inverse, other.state_->d_inverse);
      copy(state_->e_inverse, other.state_->e_inverse);
    };
    for (const InCoreStep& s : other.out_of_core_->steps)
      for (const Index f : s.fronts) take(plan_.tree.first[f], plan_.tree.first[f + 1]);
    for (const ColumnGroup& g : other.out_of_core_->groups) {
      const FrontLayout& l = plan_.layout[g.front];
      const Index first = plan_.tree.first[g.front], end = std::min(g.end, l.pivot_tiles);
      if (g.begin < end) take(first + l.begin(g.begin), first + l.begin(end));
    }
  }

  void set_reader(out_of_core::FrontReader* reader) override { solve_->set_reader(reader); }
  void solve(const T* store, bool, T* x, Index columns, bool transpose) override {
    place_factors(store);
    solve_->run(x, columns, transpose);
  }
  bool solve_on_paths(const T* store, bool, const PathSolve<T>& solve) override {
    place_factors(store);
    solve_->run(solve);
    return true;
  }
  bool invert_at(const T* store, const InverseEntries<T>& entries) override {
    place_factors(store);
    host::invert_at(*state_, solve_pool_, budget_, entries);
    return true;
  }

  [[nodiscard]] std::string name() const override {
    const std::string threads = fmt::format("({} thread{}), out of core", pool_.size(), pool_.size() == 1 ? "" : "s");
    return options_.devices == 1 ? "host " + threads : fmt::format("host device {} {}", options_.device, threads);
  }
  [[nodiscard]] Offset peak_bytes() const override { return state_ ? state_->arena.bytes() : 0; }

  // ---- operations ---------------------------------------------------------------------------------------------------

  void run(const Operation& op) override {
    if (options_.before_run) options_.before_run(op);
    const double start = base::now_seconds();
    carry_out(op);
    out_of_core::time_of(times_, op.type) += base::now_seconds() - start;
  }

 private:
  // As they are after a factorization. All places count from the arena, in which some factors are.
  void place_factors(const T* store) {
    const auto store_at =
        element(reinterpret_cast<std::intptr_t>(store) - reinterpret_cast<std::intptr_t>(state_->arena.data()));
    for (Index f = 0; f < plan_.fronts(); ++f) {
      const auto& stays_at = out_of_core_->resident_at[f];
      const bool stays = stays_at[0] >= 0;
      plan_.memory.factor[f] = stays ? element(stays_at[0]) : store_at + out_of_core_->factor_store[f];
      plan_.memory.factor2[f] = stays ? element(stays_at[1]) : store_at + out_of_core_->factor2_store[f];
    }
  }

  static Offset stack_of(const out_of_core::OutOfCorePlan& plan) {
    Offset most = 0;
    for (const InCoreStep& s : plan.steps) most = std::max(most, s.memory.stack_size);
    return most;
  }

  void carry_out(const Operation& op) {
    if (!op.grouped) return eliminate(out_of_core_->steps[static_cast<std::size_t>(op.unit)]);
    const ColumnGroup& g = out_of_core_->groups[static_cast<std::size_t>(op.unit)];
    NumericState<T>& s = *state_;
    switch (op.type) {
      case OperationType::begin_group:
        place_group(g);
        return for_each_tile(g, [&](Workspace<T>&, Index i, Index j) { begin_tile(s, g.front, i, j); });
      case OperationType::add_child:
        return add_child(op, g);
      case OperationType::update: {
        SlabColumns<T> slab{op.front, op.begin, op.end, op.slab ? op.row : -1, {at(op.at[0]), at(op.at[1])}};
        return for_each_tile(g, [&](Workspace<T>&, Index i, Index j) { update_tile(s, i, j, slab); });
      }
      default:
        return eliminate_group(g);
    }
  }

  [[nodiscard]] std::byte* place(Offset bytes_at, Offset bytes) {
    if (bytes_at < 0 || bytes_at + bytes > state_->arena.bytes())
      throw std::logic_error("out of core: a copy outside the device's memory");
    return reinterpret_cast<std::byte*>(state_->arena.data()) + bytes_at;
  }
  [[nodiscard]] static Offset element(Offset bytes) { return bytes / static_cast<Offset>(sizeof(T)); }
  [[nodiscard]] T* at(Offset bytes) { return bytes < 0 ? nullptr : state_->arena.data() + element(bytes); }

  // body(worker) on all workers; what is thrown in one ends the others.
  template <class Body>
  void on_all(Body&& body) {
    pool_.run([&](int worker) {
      Workspace<T>& w = work_[static_cast<std::size_t>(worker)];
      const double begin = base::now_seconds();
      try {
        body(w);
      } catch (const Aborted&) {
      } catch (...) {
        state_->abort = true;
        throw;
      }
      w.task_seconds += base::now_seconds() - begin;
    });
  }

  void eliminate(const InCoreStep& step) {
    place_step(step);
    std::atomic<std::size_t> next{0};
    on_all([&](Workspace<T>& w) {
      for (std::size_t k = next++; k < step.tasks.size(); k = next++) {
        pool_.check();
        if (step.tasks[k].is_range())
          eliminate_range(*state_, w, step.tasks[k]);
        else
          make_tile(*state_, w, step.tasks[k]);
      }
    });
  }

  void place_step(const InCoreStep& step) {
    auto& m = plan_.memory;
    const Offset work = element(step.work_at);
    m.wait_fronts.clear();
    for (std::size_t k = 0; k < step.fronts.size(); ++k) {
      const Index f = step.fronts[k];
      m.factor[f] = work + step.memory.factor[k];
      if (!step.memory.factor2.empty()) m.factor2[f] = work + step.memory.factor2[k];
      m.on_stack[f] = step.memory.on_stack[k];
      const bool leaves = step.root_at[k][0] >= 0;
      const Offset base = m.on_stack[f] != 0 ? 0 : work;
      m.contribution[f] = leaves ? element(step.root_at[k][0]) : base + step.memory.contribution[k];
      if (matrix_.kind == Kind::lu)
        m.contribution2[f] = leaves ? element(step.root_at[k][1]) : base + step.memory.contribution2[k];
      m.wait_ptr[f] = static_cast<Offset>(m.wait_fronts.size());
      for (Offset q = step.memory.wait_ptr[k]; q < step.memory.wait_ptr[k + 1]; ++q)
        m.wait_fronts.push_back(step.fronts[static_cast<std::size_t>(step.memory.wait_fronts[q])]);
      m.wait_ptr[f + 1] = static_cast<Offset>(m.wait_fronts.size());
    }
    for (std::size_t k = 0; k < step.externals.size(); ++k) {
      state_->front_done.set(step.externals[k]);  // maybe by another device
      m.on_stack[step.externals[k]] = 0;
      m.contribution[step.externals[k]] = element(step.external_at[k][0]);
      if (matrix_.kind == Kind::lu) m.contribution2[step.externals[k]] = element(step.external_at[k][1]);
    }
  }

  void place_group(const ColumnGroup& g) {
    auto& m = plan_.memory;
    const Index f = g.front, pivots = plan_.layout[f].pivot_tiles;
    const Offset before = factor_offset(f, std::min(g.begin, pivots));
    const Offset below = contribution_offset(f, std::max(g.begin, pivots) - pivots);
    m.factor[f] = element(g.factor_at[0]) - before;
    m.factor2[f] = element(g.factor_at[1]) - before;
    m.contribution[f] = element(g.contribution_at[0]) - below;
    m.contribution2[f] = element(g.contribution_at[1]) - below;
    m.wait_ptr[f] = m.wait_ptr[f + 1] = 0;
    state_->window = {f, g.begin};
  }

  // use(workspace, i, j) for the tiles of a group.
  template <class Use>
  void for_each_tile(const ColumnGroup& g, Use&& use) {
    const Index tiles = plan_.layout[g.front].tiles;
    std::atomic<Offset> next{0};
    Offset count = 0;
    for (Index j = g.begin; j < g.end; ++j) count += tiles - j;
    on_all([&](Workspace<T>& w) {
      for (Offset k = next++; k < count; k = next++) {
        Offset left = k;
        Index j = g.begin;
        for (; left >= tiles - j; ++j) left -= tiles - j;
        use(w, j + static_cast<Index>(left), j);
      }
    });
  }

  void add_child(const Operation& op, const ColumnGroup& g) {
    const FrontLayout& child = plan_.layout[op.front];
    const Offset before = contribution_offset(op.front, op.begin);
    const T* lower = at(op.at[0]) - before;
    const T* upper = op.at[1] >= 0 ? at(op.at[1]) - before : nullptr;
    const ColumnRange columns{op.begin * child.below_width, std::min(child.below(), op.end * child.below_width)};
    const ChildColumns<T> added{op.front, {lower, upper}, columns};
    for_each_tile(g, [&](Workspace<T>& w, Index i, Index j) { add_child_to_tile(*state_, w, g.front, i, j, added); });
  }

  void eliminate_group(const ColumnGroup& g) {
    for_each_tile(g, [&](Workspace<T>& w, Index i, Index j) { make_tile(*state_, w, Task{g.front, -1, i, j}); });
    state_->window = {};
  }

  plan::Plan plan_;
  MatrixKind matrix_;
  PivotRule rule_;
  std::unique_ptr<base::ThreadPool> own_pool_;
  base::ThreadPool& pool_;
  base::ThreadPool& solve_pool_;
  base::MemoryBudget* budget_;
  HostOutOfCoreOptions options_;
  plan::ArraySizes sizes_;
  DirectCopies direct_;
  int pins_ = 0;  // asked for
  const out_of_core::OutOfCorePlan* out_of_core_ = nullptr;
  Offset slot_bytes_ = 0;
  OperationTimes times_;
  base::Buffer<std::byte> ring_;
  std::vector<Workspace<T>> work_;
  std::optional<NumericState<T>> state_;
  std::optional<TriangularSolve<T>> solve_;
};

}  // namespace

template <class T>
std::unique_ptr<out_of_core::OutOfCoreBackend<T>> make_host_out_of_core_backend(const Job& job,
                                                                                HostOutOfCoreOptions options) {
  return std::make_unique<HostOutOfCoreBackend<T>>(job, std::move(options));
}

#define ESPALIER_INSTANTIATE(T)                                                                        \
  template std::unique_ptr<out_of_core::OutOfCoreBackend<T>> make_host_out_of_core_backend(const Job&, \
                                                                                           HostOutOfCoreOptions);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host
