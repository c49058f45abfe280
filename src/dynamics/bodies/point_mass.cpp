#include "dynamics/bodies/point_mass.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/at.hpp"

namespace espalier::dynamics {

PointMass::PointMass(std::string name, const PointMassData& data) : Component(std::move(name)), data_(data) {
  if (!(data.mass > 0) || !std::isfinite(data.mass) || !data.position.allFinite() || !data.velocity.allFinite() ||
      !data.gravity.allFinite())
    throw std::invalid_argument("point mass \"" + this->name() + "\": the mass must be positive, all numbers finite");
}

void PointMass::place(const Placement& at) {
  Component::place(at);
  for (std::size_t k = 0; k < 3; ++k) coordinates_[k] = at.v + static_cast<Index>(k);
}

std::string PointMass::coordinate_name(Index local_coordinate) const {
  return "body \"" + name() + "\", position " + std::string(1, "xyz"[local_coordinate]);
}

void PointMass::initial(Span q, Span v) const {
  for (int k = 0; k < 3; ++k) {
    q[at(placement().q + k)] = data_.position[k];
    v[at(placement().v + k)] = data_.velocity[k];
  }
}

void PointMass::declare(PatternBuilder& w, PatternBuilder& /*phi_q*/) const {
  for (const Index c : coordinates_) w.add(c, c);
}

void PointMass::bind(const SparsePattern& w, const SparsePattern& /*phi_q*/) {
  std::transform(coordinates_.begin(), coordinates_.end(), mass_position_.begin(),
                 [&](Index c) { return find_entry(w, c, c); });
}

void PointMass::residual(const StateView& s, Span f) {
  const Vec3 sum = data_.mass * (three(s.a, placement().v) - load_factor() * data_.gravity);
  for (std::size_t k = 0; k < 3; ++k) f[at(coordinates_[k])] += sum[static_cast<int>(k)];
}

void PointMass::tangent(const StateView& /*s*/, const TangentWeights& weights, Span w_values) {
  for (const Offset p : mass_position_) w_values[at(p)] += weights.a * data_.mass;
}

Energy PointMass::energy(const StateView& s) {
  return {0.5 * data_.mass * velocity(s.v).squaredNorm(),
          -data_.mass * load_factor() * data_.gravity.dot(position(s.q))};
}

void PointFrame::motion(ConstSpan q, ConstSpan v, FrameMotion& out) const {
  out = FrameMotion{};
  out.r = body_->position(q);
  if (!v.empty()) out.vel = body_->velocity(v);
}

void PointFrame::jacobian(ConstSpan /*q*/, double* j) const {
  std::fill_n(j, 18, 0.0);
  for (std::size_t k = 0; k < 3; ++k) j[6 * k + k] = 1;
}

}  // namespace espalier::dynamics
