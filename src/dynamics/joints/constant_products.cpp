#include "dynamics/joints/constant_products.hpp"

#include "base/at.hpp"
#include "dynamics/dae/frame.hpp"

namespace espalier::dynamics {
namespace {

/// The sum of values that begin at `first` in a global array.
Vec3 sum_of(const MaterialVector& m, ConstSpan values, Index first) {
  Vec3 sum = Vec3::Zero();
  for (const auto& [vertex, factor] : m.parts)
    sum += factor * Eigen::Map<const Vec3>(values.data() + first + 3 * vertex);
  return sum;
}
Vec3 place_of(const MaterialVector& m, ConstSpan q) { return sum_of(m, q, m.body->configuration(0)); }
Vec3 rate_of(const MaterialVector& m, ConstSpan v) { return sum_of(m, v, m.body->coordinate(0)); }

}  // namespace

std::string ConstantProducts::constraint_name(Index local_row) const {
  return "tie \"" + name() + "\", " + rows_.at(at(local_row)).label;
}

void ConstantProducts::declare(PatternBuilder& w, PatternBuilder& phi_q) const {
  Index row = placement().c;
  for (const Row& r : rows_) {
    for (const MaterialVector* m : {&r.u, &r.w})
      for (const auto& [vertex, factor] : m->parts)
        for (Index d = 0; d < 3; ++d) phi_q.add(row, m->body->coordinate(vertex) + d);
    for (const auto& [a, fa] : r.u.parts)
      for (const auto& [b, fb] : r.w.parts)
        for (Index d = 0; d < 3; ++d) {
          w.add(r.u.body->coordinate(a) + d, r.w.body->coordinate(b) + d);
          w.add(r.w.body->coordinate(b) + d, r.u.body->coordinate(a) + d);
        }
    ++row;
  }
}

void ConstantProducts::bind(const SparsePattern& w, const SparsePattern& phi_q) {
  position_.clear();
  pairs_.clear();
  Index row = placement().c;
  for (const Row& r : rows_) {
    for (const MaterialVector* m : {&r.u, &r.w})
      for (const auto& [vertex, factor] : m->parts)
        for (Index d = 0; d < 3; ++d) position_.push_back(at(find_entry(phi_q, row, m->body->coordinate(vertex) + d)));
    for (const auto& [a, fa] : r.u.parts)
      for (const auto& [b, fb] : r.w.parts)
        for (Index d = 0; d < 3; ++d) {
          const Index of_u = r.u.body->coordinate(a) + d, of_w = r.w.body->coordinate(b) + d;
          pairs_.push_back(at(find_entry(w, of_w, of_u)));
          pairs_.push_back(at(find_entry(w, of_u, of_w)));
        }
    ++row;
  }
}

/// gamma = -(d/dt Phi_q) v = -2 u' . w'
void ConstantProducts::constraints(double /*t*/, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) {
  std::size_t row = at(placement().c), entry = 0;
  for (const Row& r : rows_) {
    const Vec3 u = place_of(r.u, q), w = place_of(r.w, q);
    if (!out.phi.empty()) out.phi[row] = u.dot(w) - r.rest;
    if (!out.nu.empty()) out.nu[row] = 0;
    if (!out.gamma.empty()) out.gamma[row] = -2 * rate_of(r.u, v).dot(rate_of(r.w, v));
    if (!out.phi_q_values.empty()) {
      const std::size_t end = entry + 3 * (r.u.parts.size() + r.w.parts.size());
      for (std::size_t e = entry; e < end; ++e) out.phi_q_values[position_[e]] = 0;  // vertices may be of both
      for (const MaterialVector* m : {&r.u, &r.w})
        for (const auto& [vertex, factor] : m->parts)
          for (Eigen::Index d = 0; d < 3; ++d) out.phi_q_values[position_[entry++]] += factor * (m == &r.u ? w : u)[d];
    }
    ++row;
  }
}

void ConstantProducts::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  std::size_t row = at(placement().c), entry = 0;
  for (const Row& r : rows_) {
    const double scale = weights.q * s.lambda[row++];
    for (const auto& [a, fa] : r.u.parts)
      for (const auto& [b, fb] : r.w.parts)
        for (int k = 0; k < 6; ++k) w_values[pairs_[entry++]] += scale * fa * fb;
  }
}

}  // namespace espalier::dynamics
