/// \file
/// Keys of markers that other tables have as well.
#pragma once

#include "dynamics/model/description.hpp"

namespace espalier::dynamics::model {

/// Axes with z along `axis`; x as near to `x_axis` as that allows, or to the global x (y) axis; or `rotation`.
/// @param given  whether the text says where z points
[[nodiscard]] Mat3 read_axes(Section& s, bool& given);
[[nodiscard]] Attach read_attach(Section& s);

/// Frames a and b (and c and d), or the short form bodies = [..], at = [..], axis = [..] in global axes.
[[nodiscard]] std::vector<MarkerSpec> read_frames(Section& s, std::size_t count);
/// The ends of a cable, and the rings between them in their order.
[[nodiscard]] std::vector<MarkerSpec> read_through(Section& s);

}  // namespace espalier::dynamics::model
