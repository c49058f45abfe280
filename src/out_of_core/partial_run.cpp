#include "out_of_core/partial_run.hpp"

#include <algorithm>

#include "base/at.hpp"

namespace espalier::out_of_core {

// Operations stand in a topological order of the units.
PartialRun::PartialRun(const plan::Plan& plan, const OutOfCorePlan& operations, std::span<const char> reached)
    : plan_(&plan), operations_(&operations), kept_(reached.size(), 1) {
  for (std::size_t f = 0; f < reached.size(); ++f)
    if (reached[f] != 0) kept_[f] = 0;
  for (const Operation& op : operations.ops) {
    if (op.type != OperationType::eliminate && op.type != OperationType::eliminate_group) continue;
    const std::span<const Index> fronts = fronts_of(op);
    if (std::all_of(fronts.begin(), fronts.end(), [&](Index f) { return kept_[at(f)] != 0; })) continue;
    for (const Index f : fronts) {
      kept_[at(f)] = 0;
      if (const Index parent = plan.tree.parent[at(f)]; parent >= 0) kept_[at(parent)] = 0;
    }
  }
  for (const LeftContribution& left : operations.left) {
    const Index parent = plan.tree.parent[at(left.front)];
    if (left.read_there && kept_[at(left.front)] != 0 && kept_[at(parent)] == 0) brought_.push_back(left);
  }
}

std::span<const Index> PartialRun::fronts_of(const Operation& op) const {
  if (op.grouped) return {&operations_->groups[at(op.unit)].front, 1};
  return operations_->steps[at(op.unit)].fronts;
}

bool PartialRun::makes(const Operation& op) const {
  if (kept_.empty()) return true;
  if (op.type == OperationType::store_contribution) return kept_[at(op.front)] == 0;
  if (op.type == OperationType::load_contribution) return kept_[at(plan_->tree.parent[at(op.front)])] == 0;
  return kept_[at(fronts_of(op).front())] == 0;
}

std::span<const LeftContribution> PartialRun::brought(const Operation& op) const {
  if (brought_.empty()) return {};
  const auto number = static_cast<std::size_t>(&op - operations_->ops.data());
  const auto before = [](const LeftContribution& x, std::size_t k) { return x.after < k; };
  const auto begin = std::lower_bound(brought_.begin(), brought_.end(), number, before);
  const auto end = std::lower_bound(begin, brought_.end(), number + 1, before);
  return {begin, end};
}

}  // namespace espalier::out_of_core
