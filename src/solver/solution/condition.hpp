/// \file
/// Estimating |A^-1|_1 from a few solves.
#pragma once

#include <functional>

#include "espalier/types.hpp"

namespace espalier::solver {

/// Y = A^-1 X (transpose false) or A^-H X of `columns` columns of n values each; x and y do not overlap.
template <class Value>
using InverseProduct = std::function<void(const Value* x, Value* y, Index columns, bool transpose)>;

/// Lower bound of |A^-1|_1, nearly always within a factor of 3 (Hager 1984, with four columns at a time: Higham and
/// Tisseur 2000, algorithm 2.4); of small matrices the norm itself. Value: double or complex<double>.
template <class Value>
double estimate_inverse_norm(Index n, const InverseProduct<Value>& solve);

}  // namespace espalier::solver
