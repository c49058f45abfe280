#include "out_of_core/partial_run.hpp"

#include <algorithm>

#include "base/at.hpp"

namespace espalier::out_of_core {

PartialRun::PartialRun(const plan::Plan& plan, std::span<const OutOfCorePlan> plans, std::span<const char> reached)
    : plan_(&plan), plans_(plans), kept_(reached.size(), 1), brought_(plans.size()) {
  make_again(reached);
  for (std::size_t d = 0; d < plans.size(); ++d)
    for (const LeftContribution& left : plans[d].left) {
      const Index parent = plan.tree.parent[at(left.front)];
      if (left.read_there && kept_[at(left.front)] != 0 && kept_[at(parent)] == 0) brought_[d].push_back(left);
    }
}

// With a front all of its step, and its parent. A large front is a unit of its own.
void PartialRun::make_again(std::span<const char> reached) {
  std::vector<std::span<const Index>> step_of(kept_.size());
  for (const OutOfCorePlan& p : plans_)
    for (const InCoreStep& s : p.steps)
      for (const Index f : s.fronts) step_of[at(f)] = s.fronts;
  std::vector<Index> open;
  const auto add = [&](Index f) {
    if (kept_[at(f)] != 0) open.push_back(f);
    kept_[at(f)] = 0;
  };
  for (std::size_t f = 0; f < reached.size(); ++f)
    if (reached[f] != 0) add(static_cast<Index>(f));
  while (!open.empty()) {
    const Index f = open.back();
    open.pop_back();
    if (plan_->tree.parent[at(f)] >= 0) add(plan_->tree.parent[at(f)]);
    for (const Index other : step_of[at(f)]) add(other);
  }
}

std::span<const Index> PartialRun::fronts_of(const Operation& op, Index device) const {
  const OutOfCorePlan& p = plans_[at(device)];
  if (op.grouped) return {&p.groups[at(op.unit)].front, 1};
  return p.steps[at(op.unit)].fronts;
}

bool PartialRun::makes(const Operation& op, Index device) const {
  if (kept_.empty()) return true;
  if (op.type == OperationType::store_contribution) return kept_[at(op.front)] == 0;
  if (op.type == OperationType::load_contribution) return kept_[at(plan_->tree.parent[at(op.front)])] == 0;
  return kept_[at(fronts_of(op, device).front())] == 0;
}

std::span<const LeftContribution> PartialRun::brought(const Operation& op, Index device) const {
  if (kept_.empty()) return {};
  const std::vector<LeftContribution>& all = brought_[at(device)];
  const auto number = at(&op - plans_[at(device)].ops.data());
  const auto before = [](const LeftContribution& x, std::size_t k) { return x.after < k; };
  const auto begin = std::lower_bound(all.begin(), all.end(), number, before);
  const auto end = std::lower_bound(begin, all.end(), number + 1, before);
  return {begin, end};
}

}  // namespace espalier::out_of_core
