/// \file
/// What M says of a pencil K x = l M x: is it semi-definite, how many finite eigenvalues are there, and how many
/// negative eigenvalues does K - s M have because of the infinite ones.
#pragma once

#include <string>
#include <vector>

#include "base/thread_pool.hpp"
#include "espalier/modes.hpp"

namespace espalier::modes {

struct MassReport {
  Index massless = 0;  ///< rows of M without entries other than zero
  Index rank = 0;      ///< of M
  Index finite = 0;    ///< eigenvalues of the pencil that are finite, if it is regular
  /// Negative eigenvalues of K - s M for s below all finite eigenvalues: by Sylvester's law the eigenvalues below any s
  /// are as many as K - s M has negative ones beyond these.
  Index negative_at_infinity = 0;
  bool proven = true;  ///< by a factorization (or a diagonal M); else `why` says what was taken on trust
  std::string why;
};

/// With the range of M apart, K = [K11 K12; K21 K22], M = [M11 0; 0 0]: for s to minus infinity the Schur complement
/// K22 - K21 (K11 - s M11)^-1 K12 has the negative eigenvalues of K22 and, on its null space, as many as that has
/// dimensions (where constraints do not depend on each other; else K - s M is singular for every s). So does K - s M,
/// and each of those dimensions takes one finite eigenvalue away.
/// @param k, m lower triangles  @param check  whether to factorize M where it is not diagonal
/// @throws Error(invalid_input) where M has a negative eigenvalue, or no entry but zeros
MassReport look_at_mass(const SparseMatrix& k, const SparseMatrix& m, bool check, const Options& options);

}  // namespace espalier::modes
