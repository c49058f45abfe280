/// \file
/// Estimating |A^-1|_1 from a few solves.
#pragma once

#include <functional>

#include "espalier/types.hpp"

namespace espalier::solver {

/// y = A^-1 x (transpose false) or A^-H x, n values; x and y do not overlap.
template <class Value>
using InverseProduct = std::function<void(const Value* x, Value* y, bool transpose)>;

/// Lower bound of |A^-1|_1, nearly always within a factor of 3 (Hager 1984; Higham 1988, algorithm 4.1; of complex
/// numbers Higham and Tisseur 2000). Value: double or complex<double>.
template <class Value>
double estimate_inverse_norm(Index n, const InverseProduct<Value>& solve);

}  // namespace espalier::solver
