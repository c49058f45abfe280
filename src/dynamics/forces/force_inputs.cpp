#include "dynamics/forces/force_inputs.hpp"

namespace espalier::dynamics {
namespace {

std::vector<Offset> positions(std::span<const Index> rows, const std::vector<Index>& columns,
                              const SparsePattern& pattern) {
  std::vector<Offset> result;
  result.reserve(rows.size() * columns.size());
  for (const Index c : columns)
    for (const Index r : rows) result.push_back(r < 0 || c < 0 ? -1 : find_entry(pattern, c, r));
  return result;
}

void add_outer(const std::vector<Offset>& position, ConstSpan rows, ConstSpan columns, Span values) {
  std::size_t e = 0;
  for (const double c : columns)
    for (const double r : rows) {
      if (position[e] >= 0) values[at(position[e])] += r * c;
      ++e;
    }
}

}  // namespace

std::vector<double> ForceInputs::values(const StateView& s) const {
  std::vector<double> result;
  result.reserve(inputs_.size());
  for (const StateFunctionPtr& u : inputs_) result.push_back(u->value(s));
  return result;
}

void ForceInputs::declare(std::span<const Index> rows, PatternBuilder& w) const {
  for (const StateFunctionPtr& u : inputs_) w.add_block(rows, u->coordinates());
}

void ForceInputs::declare_multipliers(std::span<const Index> rows, PatternBuilder& f_lambda) const {
  for (const StateFunctionPtr& u : inputs_) f_lambda.add_block(rows, u->multipliers());
}

void ForceInputs::bind(std::span<const Index> rows, const SparsePattern& w) {
  w_position_.clear();
  for (const StateFunctionPtr& u : inputs_) w_position_.push_back(positions(rows, u->coordinates(), w));
}

void ForceInputs::bind_multipliers(std::span<const Index> rows, const SparsePattern& f_lambda) {
  lambda_position_.clear();
  for (const StateFunctionPtr& u : inputs_) lambda_position_.push_back(positions(rows, u->multipliers(), f_lambda));
}

void ForceInputs::add_tangent(const StateView& s, std::size_t k, ConstSpan slope, const TangentWeights& weights,
                              Span w_values) const {
  if (inputs_[k]->coordinates().empty()) return;
  StateGradient g;
  inputs_[k]->gradient(s, g);
  for (std::size_t i = 0; i < g.q.size(); ++i) g.q[i] = weights.q * g.q[i] + weights.v * g.v[i];
  add_outer(w_position_[k], slope, g.q, w_values);
}

void ForceInputs::add_multiplier_tangent(const StateView& s, std::size_t k, ConstSpan slope, Span values) const {
  if (inputs_[k]->multipliers().empty()) return;
  StateGradient g;
  inputs_[k]->gradient(s, g);
  add_outer(lambda_position_[k], slope, g.lambda, values);
}

}  // namespace espalier::dynamics
