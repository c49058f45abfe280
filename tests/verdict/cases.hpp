/// \file
/// Random matrices whose rank is known exactly: by their construction in integers, or by singular values that were put
/// in. For the tests of the verdict (tests/solver/singular/deficiency_test.cpp) and for the campaign
/// (tests/verdict/campaign.cpp).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "reference/reference.hpp"

namespace espalier::verdict {

struct Case {
  std::string name;
  SparseMatrix a;  ///< general storage, or symmetric_lower
  Index zeros = 0;
  bool definite = false;  ///< no eigenvalue is negative
  Index negative = -1;    ///< eigenvalues below zero; -1: not known
};

/// How many sorts of case there are.
Index structures();
/// @param structure  0 to structures() - 1
Case make_case(Index structure, Index n, std::uint64_t seed);

/// The same matrix in other units, rows and columns by random powers of two up to 2^+-range (alike where symmetric),
/// and renumbered: no rounding anywhere, the same rank.
SparseMatrix disguised(const SparseMatrix& a, int range, std::uint64_t seed);
/// All entries times 2^exponent.
SparseMatrix in_units(const SparseMatrix& a, int exponent);
/// [A u; v^T 0] with u, v outside of what A's rows and columns span (a unit vector where A is singular, n more zeros
/// otherwise stay): the rank rises by two where A is singular, and the number of zeros falls by one.
SparseMatrix bordered(const SparseMatrix& a, Index row);

}  // namespace espalier::verdict
