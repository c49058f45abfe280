/// \file
/// A bound of the inertia that the pattern and the diagonal tell.
#pragma once

#include "espalier/matrix.hpp"

namespace espalier::batch {

/// Of a regular symmetric matrix at least so many eigenvalues are negative.
Index least_negative(const MatrixView& a);

}  // namespace espalier::batch
