// Indices into arrays of the standard library, whose sizes have no sign.
#pragma once

#include <cstddef>

#include "espalier/types.hpp"

namespace espalier {

constexpr std::size_t at(Index i) { return static_cast<std::size_t>(i); }
constexpr std::size_t at(Offset i) { return static_cast<std::size_t>(i); }

}  // namespace espalier
