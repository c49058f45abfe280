/// \file
/// The judge of every answer: backward errors computed by the benchmark itself, in extended precision.
#pragma once

#include <span>

#include "espalier/matrix.hpp"

namespace espalier::bench {

/// Largest backward errors over some right-hand sides.
struct BackwardError {
  double normwise = 0;       ///< max over columns of |b - A x|_inf / (|A|_inf |x|_inf + |b|_inf)
  double componentwise = 0;  ///< max of |b - A x|_i / (|A| |x| + |b|)_i (Oettli and Prager 1964)
};

/// Sums in long double (64 bits of significand on x86-64). `x` and `b` hold `columns` vectors of a.rows values. With
/// `lower_only` the lower triangle of a matrix in general storage stands for the whole. An x that is not finite gives
/// infinity.
BackwardError backward_error(const MatrixView& a, bool lower_only, std::span<const double> x, std::span<const double> b,
                             Index columns);

}  // namespace espalier::bench
