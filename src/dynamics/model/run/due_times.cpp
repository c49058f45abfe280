#include "dynamics/model/run/due_times.hpp"

#include <cmath>

namespace espalier::dynamics::model {

// Round-off of a due time that a step was to meet must not delay it to the next step.
bool DueTimes::strikes(double t) {
  if (interval < 0) return false;
  if (interval == 0) return true;
  if (t < due() - 1e-9 * interval) return false;
  wind_to(t);
  return true;
}

void DueTimes::wind_to(double t) {
  if (interval > 0) next = static_cast<long>(std::floor((t - start) / interval + 1e-9)) + 1;
}

}  // namespace espalier::dynamics::model
