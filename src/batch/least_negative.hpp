/// \file
/// A bound of the inertia that the pattern and the diagonal tell.
#pragma once

#include "espalier/matrix.hpp"

namespace espalier::batch {

/// A lower bound of the number of negative eigenvalues of a regular symmetric matrix.
Index least_negative(const MatrixView& a);

}  // namespace espalier::batch
