#include "dynamics/bodies/rotor_inertia.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace espalier::dynamics {

RotorInertia::RotorInertia(std::string name, double inertia, double speed)
    : Component(std::move(name)), inertia_(inertia), speed_(speed) {
  if (!(inertia > 0) || !std::isfinite(inertia))
    throw std::invalid_argument("rotor inertia \"" + this->name() + "\": must be positive and finite");
}

void RotorInertia::place(const Placement& at) {
  Component::place(at);
  coordinates_[0] = at.v;
}

void RotorInertia::initial(Span q, Span v) const {
  q[static_cast<std::size_t>(placement().q)] = 0;
  v[static_cast<std::size_t>(placement().v)] = speed_;
}

std::string RotorInertia::coordinate_name(Index /*local_coordinate*/) const { return "armature of \"" + name() + "\""; }

void RotorInertia::declare(PatternBuilder& w, PatternBuilder& /*phi_q*/) const {
  w.add(coordinates_[0], coordinates_[0]);
}

void RotorInertia::bind(const SparsePattern& w, const SparsePattern& /*phi_q*/) {
  position_ = find_entry(w, coordinates_[0], coordinates_[0]);
}

void RotorInertia::residual(const StateView& s, Span f) {
  const auto at = static_cast<std::size_t>(coordinates_[0]);
  f[at] += inertia_ * s.a[at];
}

void RotorInertia::tangent(const StateView& /*s*/, const TangentWeights& weights, Span w_values) {
  w_values[static_cast<std::size_t>(position_)] += weights.a * inertia_;
}

Energy RotorInertia::energy(const StateView& s) { return {0.5 * inertia_ * speed(s.v) * speed(s.v), 0}; }

void RotorFrame::motion(ConstSpan q, ConstSpan v, FrameMotion& out) const {
  out = FrameMotion{};
  out.r[2] = rotor_->position(q);
  if (!v.empty()) out.vel[2] = rotor_->speed(v);
}

void RotorFrame::jacobian(ConstSpan /*q*/, double* j) const {
  std::fill_n(j, 6, 0.0);
  j[2] = 1;
}

}  // namespace espalier::dynamics
