// An executor for a changed pattern that goes on with the numbers of the one before. One GPU.
#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "device/cuda/executor/executor_on_devices.hpp"

namespace espalier::device::cuda {

namespace {

// Lists of n pivots each move with their fronts.
template <class T>
std::vector<T> pivots_of_now(const plan::Plan& plan, const plan::Plan& before, const std::vector<Index>& same,
                             const std::vector<T>& pivots) {
  std::vector<T> moved(pivots.size(), T(1));
  const auto n = static_cast<std::size_t>(plan.tree.n);
  for (Index f = 0; f < plan.fronts(); ++f) {
    const Index o = same[static_cast<std::size_t>(f)];
    if (o < 0) continue;
    const auto first = static_cast<std::size_t>(before.tree.first[o]),
               to = static_cast<std::size_t>(plan.tree.first[f]);
    for (std::size_t list = 0; list < pivots.size(); list += n)
      std::copy_n(pivots.data() + list + first, plan.layout[f].pivots, moved.data() + list + to);
  }
  return moved;
}

}  // namespace

// Nothing but the arena and the pivots of the sides before is of use: what else they hold goes before the new ones
// take theirs.
template <class T>
std::unique_ptr<Executor<T>> ExecutorOnDevices<T>::with_changed_plan(const plan::Plan& plan,
                                                                     const plan::FrontsBefore& before) {
  const bool can = before.of_pattern && !several() && goes_on() && plan.options.keep_contributions &&
                   plan.tree.n == plan_.tree.n && plan.memory.size <= first().arena_elements();
  if (!can) return nullptr;
  std::vector<T> pivots;
  DeviceArray<T> arena;
  at(first(), [&] { arena = first().leave_arena(pivots); });
  pivots = pivots_of_now(plan, plan_, before.same, pivots);
  std::vector<char> made(before.same.size());
  std::transform(before.same.begin(), before.same.end(), made.begin(), [&](Index o) {
    return static_cast<char>(o >= 0 && (made_.empty() || made_[static_cast<std::size_t>(o)] != 0));
  });
  sides_.clear();
  auto next = std::make_unique<ExecutorOnDevices>(plan, kind_, PivotRule(), options_, std::move(arena));
  if (next->context_.pair_sign != context_.pair_sign) return nullptr;  // other kernels have made what stays
  next->made_ = std::move(made);
  next->last_ = last_;
  next->last_filled_ = last_filled_;
  next->limits_known_ = false;
  next->limits_ = limits_;
  next->at(next->first(), [&] {
    next->first().set_limits(limits_);
    next->first().go_on(pivots);
  });
  return next;
}

template <class T>
bool ExecutorOnDevices<T>::takes_up(const FilledValues& values) {
  if (made_.empty()) return values == filled_;
  filled_ = {};
  filled_graphs_ = record_factorization(values);
  filled_ = values;
  return true;
}

template <class T>
std::vector<char> ExecutorOnDevices<T>::open_fronts(std::span<const char> reached) const {
  std::vector<char> open(reached.begin(), reached.end());
  if (made_.empty()) return open;
  for (Index f = 0; f < plan_.fronts(); ++f) {  // children stand before their parents
    const auto k = static_cast<std::size_t>(f);
    if (made_[k] == 0) open[k] = 1;
    if (const Index parent = plan_.tree.parent[k]; parent >= 0 && open[k] != 0)
      open[static_cast<std::size_t>(parent)] = 1;
  }
  return open;
}

template class ExecutorOnDevices<double>;
template class ExecutorOnDevices<float>;

}  // namespace espalier::device::cuda
