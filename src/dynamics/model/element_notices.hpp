/// \file
/// What is known of elements where they fail: locking, and enhanced strains under compression.
#pragma once

#include <optional>
#include <string>

#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// A solid whose elements are much too stiff in what its shape makes likely: tet4 and full hex8 in bending, full hex20
/// in thin curved walls.
[[nodiscard]] std::optional<std::string> locking_notice(const BuiltBody& body);

/// A solid with enhanced strains whose hex8 are compressed so far that these may lose their stability (P. Wriggers,
/// S. Reese, Comput. Methods Appl. Mech. Engrg. 135, 1996): the bar of steel of a Saint Venant material buckles into an
/// hourglass at a tenth. @param q  configuration of the system
[[nodiscard]] std::optional<std::string> compression_notice(const BuiltBody& body, ConstSpan q);

}  // namespace espalier::dynamics::model
