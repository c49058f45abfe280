#include "dynamics/model/build/reach.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace espalier::dynamics::model {
namespace {

/// Largest extent; 0 of a point.
double extent_of(const BuiltBody& body) {
  if (const auto* rigid = std::get_if<RigidSpec>(&body.spec.shape))
    return std::sqrt(6 * rigid->data.inertia.trace() / rigid->data.mass);  // of a block, at least its diagonal
  if (body.flexible == nullptr) return 0;
  const auto& x = body.flexible->reference();
  const auto step = 3 * at(body.flexible->vertices_per_node());
  double extent = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (std::size_t i = axis; i < x.size(); i += step) low = std::min(low, x[i]), high = std::max(high, x[i]);
    extent = std::max(extent, high - low);
  }
  return extent;
}

}  // namespace

Reach::Reach(const std::vector<BuiltBody>& bodies) {
  for (const BuiltBody& body : bodies) extent_ = std::max(extent_, extent_of(body));
}

void Reach::check(const Vec3& r, const Place& place, const std::string& what) const {
  constexpr double kCoarsest = 1e-5, kLargest = 1e100;  // of the largest body; squares of more come to an end
  const double far = r.cwiseAbs().maxCoeff(), rounding = far * std::numeric_limits<double>::epsilon();
  if (far > kLargest || !std::isfinite(far))
    fail(place, fmt::format("{} lies {:.3g} from the origin, too far for computing with its square", what, far));
  if (extent_ == 0 || rounding <= kCoarsest * extent_) return;
  fail(place,
       fmt::format("{} lies {:.3g} from the origin, where double precision keeps places {:.1e} apart; the largest "
                   "body measures {:.3g}. Put the origin near the bodies",
                   what, far, rounding, extent_));
}

}  // namespace espalier::dynamics::model
