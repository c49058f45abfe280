/// \file
/// Messages about A^T as messages about A.
#pragma once

#include <string>
#include <string_view>

namespace espalier::solver {

/// What the solver says of a matrix that the caller gave by rows, and the solver took by columns: rows and columns,
/// "lower triangle" and "upper triangle", and the two indices of "entry (3, 7)" change places.
std::string transposed_text(std::string_view message);

}  // namespace espalier::solver
