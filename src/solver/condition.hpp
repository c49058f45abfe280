/// \file
/// Estimating |A^-1|_1 from a few solves.
#pragma once

#include <functional>

#include "espalier/types.hpp"

namespace espalier::solver {

/// y = A^-1 x (transpose false) or A^-T x, n values; x and y do not overlap.
using InverseProduct = std::function<void(const double* x, double* y, bool transpose)>;

/// Lower bound of |A^-1|_1, nearly always within a factor of 3 (Hager 1984; Higham 1988, algorithm 4.1).
double estimate_inverse_norm(Index n, const InverseProduct& solve);

}  // namespace espalier::solver
