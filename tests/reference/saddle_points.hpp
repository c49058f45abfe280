/// \file
/// Regularised saddle points: systems of which a corner is far smaller than what stands beside it.
#pragma once

#include <complex>
#include <string>

#include "reference/reference.hpp"

namespace espalier::reference {

/// A diagonal block of a saddle point.
enum class Corner {
  zero,       ///< no entries
  identity,   ///< size * I
  wandering,  ///< diagonal, entries from size^2 to 1
  chain,      ///< size * tridiag(-1, 4, -1) over every second unknown, I of the others
};

/// [U B; B^T -L] with B (top x bottom) of full rank, its condition below 1e4; U and L as the corners say.
struct SaddleShape {
  Index top = 1, bottom = 1;
  Corner upper = Corner::zero, lower = Corner::zero;
  double upper_size = 0, lower_size = 0;
  std::uint64_t seed = 1;
};

/// As text, for failures.
std::string name_of(const SaddleShape& shape);
/// In symmetric_lower, numbered at random. Regular where the corners are.
SparseMatrix saddle_point(const SaddleShape& shape);
/// All entries times 2^exponent: nothing is rounded.
SparseMatrix in_units(SparseMatrix a, int exponent);
/// Rows in another order than columns: the diagonal becomes what it may. General storage.
SparseMatrix shuffled_rows(const MatrixView& a, std::uint64_t seed);
/// D A D, or D A D^H where `hermitian`, with D of 1, i, -1 and -i at random: nothing is rounded.
/// @param a  symmetric_lower, or general
ComplexSparseMatrix turned(const MatrixView& a, bool hermitian, std::uint64_t seed);

}  // namespace espalier::reference
