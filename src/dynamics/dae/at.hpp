/// \file
/// For sources of this folder: indices as positions in vectors.
#pragma once

#include <cstddef>

#include "espalier/types.hpp"

namespace espalier::dynamics {

inline std::size_t at(Offset i) { return static_cast<std::size_t>(i); }

}  // namespace espalier::dynamics
