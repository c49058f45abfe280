#include "dynamics/dae/capabilities.hpp"

#include <cmath>

#include "base/at.hpp"

namespace espalier::dynamics {

std::vector<double> memory_of(const Component& component) {
  std::vector<double> memory;
  if (const auto* const remembers = dynamic_cast<const Remembers*>(&component)) remembers->save(memory);
  return memory;
}

OwnCoordinates::OwnCoordinates(const Component& component)
    : component_(&component),
      curved_(dynamic_cast<const Curved*>(&component)),
      scaled_(dynamic_cast<const Scaled*>(&component)),
      q_(at(component.placement().q)),
      v_(at(component.placement().v)),
      count_(at(component.sizes().velocity)) {}

void OwnCoordinates::retract(ConstSpan q, ConstSpan dq, Span q_out) const {
  if (curved_ != nullptr) return curved_->retract(q, dq, q_out);
  for (std::size_t i = 0; i < count_; ++i) q_out[q_ + i] = q[q_ + i] + dq[v_ + i];
}

void OwnCoordinates::local(ConstSpan base, ConstSpan q, Span theta) const {
  if (curved_ != nullptr) return curved_->local(base, q, theta);
  for (std::size_t i = 0; i < count_; ++i) theta[v_ + i] = q[q_ + i] - base[q_ + i];
}

void OwnCoordinates::velocity_of_rate(ConstSpan theta, ConstSpan theta_dot, Span v) const {
  if (curved_ != nullptr) return curved_->velocity_of_rate(theta, theta_dot, v);
  for (std::size_t i = v_; i < v_ + count_; ++i) v[i] = theta_dot[i];
}

void OwnCoordinates::rate_of_velocity(ConstSpan theta, ConstSpan v, Span theta_dot) const {
  if (curved_ != nullptr) return curved_->rate_of_velocity(theta, v, theta_dot);
  for (std::size_t i = v_; i < v_ + count_; ++i) theta_dot[i] = v[i];
}

void OwnCoordinates::carry(ConstSpan theta, std::span<const Span> vectors) const {
  if (curved_ != nullptr) curved_->carry(theta, vectors);
}

void OwnCoordinates::magnitude(ConstSpan q, Span out) const {
  if (scaled_ != nullptr) return scaled_->magnitude(q, out);
  for (std::size_t i = 0; i < count_; ++i) out[v_ + i] = std::abs(q[q_ + i]);
}

}  // namespace espalier::dynamics
