/// \file
/// How far from the origin places may lie.
#pragma once

#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// Refuses places whose rounding is large beside the bodies: a joint there would be rounding, and steps endless.
class Reach {
 public:
  explicit Reach(const std::vector<BuiltBody>& bodies);
  /// @throws Error(invalid_input) with the place in the text; `what` is the name of what lies at r
  void check(const Vec3& r, const Place& place, const std::string& what) const;

 private:
  double extent_ = 0;  ///< of the largest body
};

}  // namespace espalier::dynamics::model
