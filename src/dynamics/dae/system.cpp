#include "dynamics/dae/system.hpp"

#include <algorithm>
#include <cmath>

namespace espalier::dynamics {

std::string System::constraint_name(Index row) const { return "constraint " + std::to_string(row); }
std::string System::coordinate_name(Index coordinate) const { return "coordinate " + std::to_string(coordinate); }

void System::retract(ConstSpan q, ConstSpan dq, Span q_out) const {
  for (std::size_t i = 0; i < q.size(); ++i) q_out[i] = q[i] + dq[i];
}

void System::local(ConstSpan base, ConstSpan q, Span theta) const {
  for (std::size_t i = 0; i < q.size(); ++i) theta[i] = q[i] - base[i];
}

void System::velocity_of_rate(ConstSpan /*theta*/, ConstSpan theta_dot, Span v) const {
  if (v.data() != theta_dot.data()) std::copy(theta_dot.begin(), theta_dot.end(), v.begin());
}

void System::rate_of_velocity(ConstSpan /*theta*/, ConstSpan v, Span theta_dot) const {
  if (v.data() != theta_dot.data()) std::copy(v.begin(), v.end(), theta_dot.begin());
}

void System::magnitude(ConstSpan q, Span out) const {
  for (std::size_t i = 0; i < q.size(); ++i) out[i] = std::abs(q[i]);
}

Energy System::energy(const StateView& /*s*/) { return {}; }

}  // namespace espalier::dynamics
