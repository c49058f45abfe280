/// \file
/// How ill-conditioned a positive definite matrix will turn out, before it is factorized: Precision::automatic asks.
#pragma once

#include "solver/analysis/analysis.hpp"

namespace espalier::solver {

/// Principal submatrices of a positive definite matrix are no worse conditioned than it is (Cauchy's interlacing), and
/// those of discretized bodies get worse with a power of their size. Two sub-trees of the assembly tree, of at most a
/// 64th of all unknowns (and 4,096) and a quarter of that, are factorized with diagonals of 1, and their condition
/// numbers are continued to the size of the matrix. Costs about a hundredth of analysis and factorization.
/// @param values  of system.prepared.a
/// @returns 0 where nothing can be said: other kinds, complex or small matrices, parts that are not positive definite
double guess_condition(const System& system, const Values& values, const analysis::AssemblyTree& tree);

/// Whether a factor of FP32 would be made in vain; the log says why.
bool is_too_ill_for_single(const System& system, const Values& values, const analysis::AssemblyTree& tree,
                           const Context& context);

}  // namespace espalier::solver
