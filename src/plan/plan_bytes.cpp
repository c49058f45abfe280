#include "plan/plan_bytes.hpp"

namespace espalier::plan {

PlanBytes bytes_of(const Plan& plan) {
  const auto of = [](const auto&... arrays) {
    return (Offset{0} + ... + static_cast<Offset>(arrays.size() * sizeof(arrays[0])));
  };
  const analysis::AssemblyTree& t = plan.tree;
  const MemoryPlan& m = plan.memory;
  const Ownership& a = plan.ownership;
  PlanBytes b;
  b.tree = of(t.order, t.first, t.parent, t.row_ptr) +
           of(plan.layout, plan.whole, plan.child_ptr, plan.children, plan.row_begin, plan.first_tile, plan.first_task,
              plan.last_task, plan.tier) +
           of(a.subtree_of, a.owner_ptr, a.owners, a.members) +
           of(m.factor, m.factor2, m.contribution, m.contribution2, m.on_stack, m.wait_ptr, m.wait_fronts);
  b.rows = of(t.rows, plan.relative);
  b.tiles = of(plan.entry_ptr);
  b.entries = of(plan.entries, plan.sources);
  b.tasks = of(plan.tasks);
  return b;
}

}  // namespace espalier::plan
