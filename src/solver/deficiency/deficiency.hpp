/// \file
/// Whether a factored matrix is singular, and by how much: the directions that it takes to nothing.
///
/// The matrix is judged as it was scaled for the factorization (by its diagonal for llt), B = R A C, so that the
/// verdict does not depend on the caller's units. Inverse iteration with the factor finds an orthonormal block Q of the
/// smallest singular values; B Q is formed in extended precision from the caller's values, and corrected by the factor
/// until it is as small as it gets. A direction counts as null when |B q|_2 <= s |B|, |B| = sqrt(|B|_1 |B|_inf), s =
/// zero_singular_value(), which bounds |B|_2: then a change of the entries by their own rounding makes the matrix
/// singular exactly.
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "solve/residual.hpp"
#include "solver/analysis/prepared_matrix.hpp"
#include "solver/deficiency/rank_correction.hpp"
#include "solver/factor/numeric.hpp"

namespace espalier::solver {

/// Entries that come of some roundings leave a zero singular value at some eps, at 14 in small dense matrices; regular
/// ones up to a condition of 3e14, scaled, stay regular. Large positive definite matrices are assembled from elements,
/// an entry in few roundings: their zeros were seen at 0.2 eps, while a plate of 1200 x 1200 elements has 13. There a
/// condition may be 1e15.
inline double zero_singular_value(Kind kind, Index n) {
  constexpr Index kLarge = 100000;
  return (kind == Kind::llt && n > kLarge ? 4 : 16) * std::numeric_limits<double>::epsilon();
}

/// FP32 cannot tell a matrix with a smaller singular value, over |B|, from a singular one.
inline constexpr double kLeastForFp32 = 1e-6;

struct Deficiency {
  double smallest = 1;               ///< singular value found, over |B|; 1: none was sought
  Index zeros = 0;                   ///< n less the rank
  std::vector<double> null_vectors;  ///< n * zeros, column-major: A v = 0, largest entry 1 in magnitude
  std::vector<Index> rows;           ///< rows of A that depend on the others, ascending; as many as zeros
  std::vector<Index> columns;        ///< lu: likewise columns
  std::vector<double> left_vectors;  ///< lu: n * zeros, A^T w = 0
  Index negative = 0;                ///< symmetric: negative eigenvalues among the `suspects` smallest
  double worst = 0;                  ///< of the null vectors, on either side: |B v| / (|B| |v|)
  bool doubtful = false;             ///< the factor has pivots with which it does not solve: there may be more zeros
  bool complete = true;              ///< false: more zeros than vectors were sought; `zeros` counts pivots
  bool by_pivots = false;            ///< each replaced pivot is a zero, and tells its row; no row was sought
  bool reduced = false;              ///< `negative` is that of the whole matrix
  std::vector<RankCorrection> corrections;  ///< lu, zeros_among_pivots(): of A and of A^T
  bool dense = false;                       ///< told by the matrix itself, whatever its factor is worth
};

/// A search finds no more zeros.
constexpr Index kMostZerosSought = 256;

struct DeficiencyJob {
  const PreparedMatrix& prepared;
  std::span<const double> values;  ///< of prepared.a
  const solve::ResidualSpace& residual;
  Numeric& numeric;
  base::ThreadPool& pool;
  const matrix::RowIndex& rows;  ///< of prepared.a
  Kind kind;
  bool rough = false;      ///< the factor is FP32, or no better
  bool replaced = false;   ///< the factor has pivots that were replaced
  Index suspects = 0;      ///< pivots that are small or were replaced
  Index proven = 0;        ///< zeros that another factor of the matrix has shown
  double vector_work = 0;  ///< null vectors are sought where they take fewer operations
  /// Nothing more is asked than whether a factor of FP32 is sure to tell the matrix from a singular one: `smallest` is
  /// 0 where it is not. Not with replaced pivots.
  bool surely_alone = false;
};

/// @pre the numeric factor solves (llt: no pivot was lost)
Deficiency find_deficiency(const DeficiencyJob& job);

/// Whether each vanishing pivot stands for a zero, and nothing else does, told without a search for the null vectors.
///
/// The factor has parted with the zeros: it is that of B + E, where E has as many entries as pivots vanished, k, each
/// as large as B's. If B + E is regular, n - k singular values of B are above its smallest one (Weyl). What is left of
/// random vectors, x - (B + E)^-1 B x, lies in a space of dimension k: where B takes it to nothing, so does it the
/// space.
/// @param zeros  replaced pivots in the real space of job.prepared.numbers
/// @returns nothing where that cannot be told
std::optional<Deficiency> zeros_of_pivots(const DeficiencyJob& job, Index zeros);
/// The same where fewer than k of them are zeros: null vectors lie in (B + E)^-1 E, so that a dense matrix of order k
/// tells how many there are (and of L D L^T how many of the others are negative).
/// @param rows, columns  of the caller's numbering, where the replaced pivots stand (Kind::ldlt: the same)
/// @returns nothing where that cannot be told, or takes too long
std::optional<Deficiency> zeros_among_pivots(const DeficiencyJob& job, std::span<const Index> rows,
                                             std::span<const Index> columns);
/// Real unknowns up to which a matrix is always asked itself what its rank is, by whichever scaling proves a higher
/// one.
constexpr Index kCheapDense = 128;
/// Rank, null vectors and negative eigenvalues of a small matrix, without its factor: two vanishing pivots, one after
/// the other, make numbers of 1e30 in it, beside which a search sees no other zeros.
/// @returns nothing where the matrix is large, or its rank is not clear
std::optional<Deficiency> zeros_of_dense(const DeficiencyJob& job);
/// Whether the matrix that was factorized is surely regular; it takes a few solutions.
bool surely_regular(const DeficiencyJob& job);

}  // namespace espalier::solver
