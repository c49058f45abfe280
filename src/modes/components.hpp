/// \file
/// Connected components of a symmetric matrix.
#pragma once

#include <vector>

#include "espalier/matrix.hpp"

namespace espalier::modes {

/// For each row whether it belongs to the first of the connected components that are equal to each other, entry by
/// entry in the order of their rows. The mass matrix of a solid has three such components, one for each direction:
/// whatever is said of the eigenvalues of one holds for all.
/// @param a  lower triangle
[[nodiscard]] std::vector<char> in_first_of_equal_components(const SparseMatrix& a);

}  // namespace espalier::modes
