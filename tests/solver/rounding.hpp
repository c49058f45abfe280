/// \file
/// The unit of rounding.
#pragma once

#include <limits>

namespace espalier::test {

inline constexpr double kEps = std::numeric_limits<double>::epsilon();

}  // namespace espalier::test
