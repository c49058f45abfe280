/// \file
/// What is known of elements where they fail: locking, and enhanced strains under compression.
#pragma once

#include <optional>
#include <string>

#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// A solid, also a reduced one, whose elements are much too stiff in what its shape makes likely: tet4, and hex8 that
/// are full or of mean dilatation, in bending, with few elements through the thickness; full hex20 in thin curved
/// walls.
[[nodiscard]] std::optional<std::string> locking_notice(const BuiltBody& body);

/// A solid with enhanced strains whose hex8 are compressed so far that these may lose their stability (P. Wriggers,
/// S. Reese, Comput. Methods Appl. Mech. Engrg. 135, 1996): elements that are flat in that direction buckle into an
/// hourglass at 6 to 20 %, others not before 30 %. @param q  configuration of the system
[[nodiscard]] std::optional<std::string> compression_notice(const BuiltBody& body, ConstSpan q);

}  // namespace espalier::dynamics::model
