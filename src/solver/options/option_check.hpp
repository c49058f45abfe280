/// \file
/// What options may hold.
#pragma once

#include "espalier/solver.hpp"

namespace espalier::solver {

/// More host threads than this are a slip of the pen.
inline constexpr int kMostThreads = 4096;

/// Looks at numbers and enumerations; texts (device) and lists are looked at where they are used.
/// @throws std::invalid_argument naming the field and what it takes
void check_options(const Options& options);

}  // namespace espalier::solver
