#include "out_of_core/store_uses.hpp"

#include <algorithm>

namespace espalier::out_of_core {

int parts_of(const Operation& op) {
  if (op.type == OperationType::load_tables || op.type == OperationType::load_values ||
      op.type == OperationType::store_outputs)
    return 1;
  return op.at[1] >= 0 && (op.type != OperationType::store_factor || op.grouped) ? 2 : 1;
}

Index steps_of(const std::vector<OutOfCorePlan>& plans) {
  std::size_t most = 0;
  for (const OutOfCorePlan& p : plans) most = std::max(most, p.ops.size());
  return static_cast<Index>(most);
}

Index step_of(const OutOfCorePlan& plan, const Operation* op, Index steps) {
  return static_cast<Index>((op - plan.ops.data()) * Offset{steps} / static_cast<Offset>(plan.ops.size()));
}

namespace {

class Uses {
 public:
  explicit Uses(const OutOfCoreLayout& layout) : layout_(layout), element_(layout.element_bytes()) {}

  void add(const Operation& op, Index step) {
    const bool write = op.queue == Queue::out;
    for (int k = 0; k < parts_of(op); ++k) {
      const Offset host = op.host[at(k)];
      if (op.type == OperationType::load_slab) {
        list_.clear();
        layout_.slab(op.front, op.begin, op.end, op.row, list_);
        for (const Extent& e : list_) uses_.push_back({step, false, {(host + e.at) * element_, e.size * element_}});
      } else if (op.type == OperationType::load_contribution || op.type == OperationType::store_contribution ||
                 op.type == OperationType::store_factor) {
        uses_.push_back({step, write, {host * element_, op.bytes / parts_of(op)}});
      }
    }
  }
  void add(const LeftContribution& left, Index step) {
    for (const Offset place : left.store)
      if (place >= 0) uses_.push_back({step, false, {place * element_, left.part_bytes}});
  }

  std::vector<StoreUse> by_steps() {
    std::stable_sort(uses_.begin(), uses_.end(), [](const StoreUse& x, const StoreUse& y) { return x.step < y.step; });
    return std::move(uses_);
  }

 private:
  const OutOfCoreLayout& layout_;
  Offset element_;
  std::vector<StoreUse> uses_;
  std::vector<Extent> list_;
};

}  // namespace

std::vector<StoreUse> store_uses(const std::vector<OutOfCorePlan>& plans, const OutOfCoreLayout& layout, Index steps,
                                 const PartialRun& part) {
  Uses uses(layout);
  for (Index d = 0; d < static_cast<Index>(plans.size()); ++d) {
    const OutOfCorePlan& p = plans[at(d)];
    for (const Operation& op : p.ops) {
      const Index step = step_of(p, &op, steps);
      if (part.makes(op, d)) uses.add(op, step);
      for (const LeftContribution& left : part.brought(op, d)) uses.add(left, step);
    }
  }
  return uses.by_steps();
}

}  // namespace espalier::out_of_core
