#include "dynamics/forces/state_function.hpp"

#include <map>

namespace espalier::dynamics {
namespace {

/// Appends the indices that are new to `all` and returns where each of them stands there.
std::vector<std::size_t> merge(const std::vector<Index>& more, std::vector<Index>& all,
                               std::map<Index, std::size_t>& place) {
  std::vector<std::size_t> result;
  for (const Index i : more) {
    const auto [it, fresh] = place.emplace(i, all.size());
    if (fresh) all.push_back(i);
    result.push_back(it->second);
  }
  return result;
}

}  // namespace

void StateFunction::gradient(const StateView& s, StateGradient& out) const {
  out.q.assign(coordinates_.size(), 0.0);
  out.v.assign(coordinates_.size(), 0.0);
  out.lambda.assign(multipliers_.size(), 0.0);
  add_gradient(s, out);
}

CompositeFunction::CompositeFunction(std::vector<StateFunctionPtr> parts) : parts_(std::move(parts)) {
  std::map<Index, std::size_t> coordinate, multiplier;
  for (const StateFunctionPtr& part : parts_) {
    coordinate_place_.push_back(merge(part->coordinates(), coordinates_, coordinate));
    multiplier_place_.push_back(merge(part->multipliers(), multipliers_, multiplier));
  }
}

void CompositeFunction::branches(const StateView& s, Branches& out) const {
  for (const StateFunctionPtr& part : parts_) part->branches(s, out);
}

void CompositeFunction::add_part(const StateView& s, std::size_t k, double factor, StateGradient& out) const {
  if (factor == 0) return;
  StateGradient own;
  parts_[k]->gradient(s, own);
  for (std::size_t i = 0; i < own.q.size(); ++i) {
    out.q[coordinate_place_[k][i]] += factor * own.q[i];
    out.v[coordinate_place_[k][i]] += factor * own.v[i];
  }
  for (std::size_t i = 0; i < own.lambda.size(); ++i) out.lambda[multiplier_place_[k][i]] += factor * own.lambda[i];
}

}  // namespace espalier::dynamics
