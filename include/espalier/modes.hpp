/// \file
/// Modes: eigenvalues and eigenvectors of symmetric pencils, found with a factor and proven complete by inertia.
///
///     K x = l M x     vibration: find_modes(); l is the square of an angular frequency
///     K x = l Kg x    buckling: find_buckling_modes(); l is a load factor
#pragma once

#include <complex>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "espalier/solver.hpp"

namespace espalier {

/// Which modes are sought, and how.
struct ModesOptions {
  /// So many of the lowest eigenvalues (find_buckling_modes(): of the smallest positive ones). 0: all below `below`.
  Index count = 0;
  /// All eigenvalues below this number (find_modes() alone); with a `count`, too, the fewer of both. Infinite: no
  /// bound.
  double below = std::numeric_limits<double>::infinity();
  /// What ||OP v - theta v|| <= tolerance |theta| ends the search for a mode, in the norm of M, OP = (K - s M)^-1 M,
  /// theta = 1 / (l - s). Errors of eigenvalues are about its square, of shapes about it, over relative gaps.
  double tolerance = 1e-10;
  /// Where the search begins. NaN: our choice, a little below zero.
  double shift = std::numeric_limits<double>::quiet_NaN();
  bool prove = true;       ///< count by inertia at the end whether a mode was missed: one factorization more
  bool check_mass = true;  ///< factorize M to see that it is semi-definite; without, that is the caller's word
  Index block_size = 0;    ///< vectors that are solved for at a time; 0: 8
  Index basis_size = 0;    ///< most vectors that are kept at a time, n values each; 0: by count and memory
  std::uint64_t seed = 1;  ///< of the vectors that the search starts with
  /// Device, threads, memory, where log lines go and whether to stop; `host_memory_bytes` holds for the vectors and the
  /// factor together. Kind, precision, refinement and singular matrices are our choice.
  Options solver;
};

/// How many eigenvalues lie below a number, by the inertia of K - at M (Sylvester's law).
struct ModeCount {
  double at = 0;
  Index below = 0;
};

/// Seconds of the parts of a search.
struct ModesSeconds {
  double total = 0;
  double mass = 0;           ///< M looked at
  double analysis = 0;       ///< of K - s M
  double factorization = 0;  ///< all of them
  double solves = 0;         ///< with the factors
  double orthogonalization = 0;
  double products = 0;  ///< with K and M
};

/// Modes of a symmetric pencil. What was found stands here also where the status is not ok.
struct ModesResult {
  Status status;
  Index n = 0;                      ///< rows of K
  std::vector<double> eigenvalues;  ///< ascending
  /// Shapes, n values each, one after another: x_i^T M x_j is 1 for i = j, else 0 (buckling: x_i^T K x_j).
  std::vector<double> vectors;
  /// ||K x - l M x||_2 / ((||K||_inf + |l| ||M||_inf) ||x||_2) of each mode, computed anew at the end.
  std::vector<double> residuals;
  /// |l - s| ||OP v - theta v|| / |theta|, of the search: an eigenvalue lies no farther from the given one, but for
  /// rounding. The true error is about its square over the distance to the next eigenvalue.
  std::vector<double> error_bounds;
  double orthogonality = 0;       ///< the largest |x_i^T M x_j - delta_ij|
  bool complete = false;          ///< proven: no eigenvalue is missing between those given, nor below them
  std::string completeness;       ///< how that was proven, or why not
  Index finite = -1;              ///< finite eigenvalues of the pencil; -1: not known
  Index massless = 0;             ///< unknowns without mass: rows of M that are zero
  std::vector<ModeCount> counts;  ///< at all numbers at which the pencil was factorized
  Index factorizations = 0;       ///< of K - s M
  Index restarts = 0;
  Offset solved_columns = 0;  ///< right-hand sides
  Offset peak_bytes = 0;      ///< of factor and vectors together, on the host
  ModesSeconds seconds;

  [[nodiscard]] Index count() const { return static_cast<Index>(eigenvalues.size()); }
};

/// The lowest eigenvalues of K x = l M x and their shapes. K is symmetric: it may be singular (free bodies) or have
/// rows of constraints, [A G^T; G 0], for which M has no entries. M is symmetric and positive semi-definite: rows
/// without mass are no hindrance. Any storage; both 0-based and of one size; general matrices must be symmetric to
/// 1e-12 of their largest entry. Nothing is kept of either.
///
/// Block Lanczos with shift and invert in the inner product of M, full reorthogonalization and thick restarts; for many
/// modes several shifts, each of which counts what lies below it (R. Grimes, J. Lewis, H. Simon, "A shifted block
/// Lanczos algorithm for solving sparse symmetric generalized eigenproblems", SIAM J. Matrix Anal. Appl. 15, 1994;
/// K. Wu, H. Simon, "Thick-restart Lanczos method for large symmetric eigenvalue problems", same journal 22, 2000). The
/// same bits for any number of threads.
///
/// Status invalid_input: matrices of other sizes, empty, unsymmetric, or with numbers that are not finite; M that has
/// negative eigenvalues, or none but zeros; more modes asked for than there are; nothing asked for. singular: det(K - s
/// M) = 0 for every s (redundant constraints, unknowns with neither mass nor stiffness), or for the caller's `shift`.
/// accuracy_not_reached: some were not found. out_of_memory, device_error, cancelled: as for Solver.
ModesResult find_modes(const MatrixView& k, const MatrixView& m, const ModesOptions& options);

/// The smallest positive eigenvalues of K x = l Kg x: load factors, where Kg is the negative of the geometric stiffness
/// of the unit load in the convention (K + l Kgeo) x = 0. K is positive definite, but for rows of constraints as above;
/// Kg is symmetric, of any signs. `below`, `shift` and `check_mass` are not used. Vectors are orthonormal in the inner
/// product of K, and so is `orthogonality` meant. Operator K^-1 Kg in that inner product; the count of eigenvalues in
/// (0, e) is by how many more negative eigenvalues K - e Kg has than K (Grimes, Lewis, Simon, section 2.3).
ModesResult find_buckling_modes(const MatrixView& k, const MatrixView& kg, const ModesOptions& options);

/// Which eigenvalues of a quadratic problem are sought.
struct QuadraticModesOptions {
  /// So many, of conjugate pairs one counts: those nearest to the shift. Up to 150 rows: all, where there are fewer.
  Index count = 6;
  /// Real number next to which they are sought. NaN: a little below zero, for the slowest motions.
  double shift = std::numeric_limits<double>::quiet_NaN();
  double tolerance = 1e-10;  ///< of the search, relative to 1 / |l - shift|
  Index basis_size = 0;      ///< most vectors, 2 n values each; 0: 20 count + 200
  std::uint64_t seed = 1;    ///< of the vector that the search starts with
  Options solver;            ///< device, threads, memory, log lines, interruption
};

struct QuadraticModesResult {
  Status status;
  Index n = 0;                                    ///< rows of K
  std::vector<std::complex<double>> eigenvalues;  ///< by distance from the shift; of a pair the one above the real axis
  std::vector<std::complex<double>> vectors;      ///< n values each, of norm 1, the largest real and positive
  /// ||Q(l) x||_2 / ((|l|^2 ||M||_inf + |l| ||C||_inf + ||K||_inf) ||x||_2), computed anew at the end.
  std::vector<double> residuals;
  double shift = 0;          ///< that was taken
  Index factorizations = 0;  ///< of Q(shift)
  Index solved_columns = 0;  ///< right-hand sides
  [[nodiscard]] Index count() const { return static_cast<Index>(eigenvalues.size()); }
};

/// Few eigenvalues of Q(l) x = (l^2 M + l C + K) x = 0: damping, gyroscopic terms (C or K unsymmetric), rows of
/// constraints as above ([K G^T; G 0], with zeros in C and M). Real matrices of one size, 0-based, any storage; M may
/// be singular. Shift and invert on the real linearization, Arnoldi's method in real arithmetic with full
/// orthogonalization (F. Tisseur, K. Meerbergen, "The quadratic eigenvalue problem", SIAM Review 43, 2001). Unlike
/// find_modes(), nothing proves that none was missed. Up to 150 rows all finite eigenvalues are computed densely.
///
/// Status invalid_input: as find_modes(). singular: `shift` is an eigenvalue, or Q is singular everywhere.
/// accuracy_not_reached: some were not found with this basis, or a residual is above 1e-6; what was found is there.
QuadraticModesResult find_quadratic_modes(const MatrixView& k, const MatrixView& c, const MatrixView& m,
                                          const QuadraticModesOptions& options);

}  // namespace espalier
