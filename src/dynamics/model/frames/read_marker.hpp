/// \file
/// Keys of markers that other tables have as well.
#pragma once

#include "dynamics/model/description.hpp"

namespace espalier::dynamics::model {

/// Axes with z along `axis`; x as near to `x_axis` as that allows, or to the global x (y) axis; or `rotation`.
/// @param given  whether the text says where z points
[[nodiscard]] Mat3 read_axes(Section& s, bool& given);
[[nodiscard]] Attach read_attach(Section& s);

}  // namespace espalier::dynamics::model
