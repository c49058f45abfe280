#include "dynamics/dae/component.hpp"

#include <algorithm>

namespace espalier::dynamics {

std::string Component::coordinate_name(Index local_coordinate) const {
  return "\"" + name_ + "\", coordinate " + std::to_string(local_coordinate);
}

void Component::initial(Span q, Span v) const {
  std::fill_n(q.begin() + at_.q, sizes().configuration, 0.0);
  std::fill_n(v.begin() + at_.v, sizes().velocity, 0.0);
}

Energy Component::energy(const StateView& /*s*/) { return {}; }

}  // namespace espalier::dynamics
