/// \file
/// The search for directions that a scaled matrix makes smallest, and what else the solutions of its factor tell of
/// zeros.
#pragma once

#include <cstdint>
#include <vector>

#include "solver/deficiency/deficiency.hpp"
#include "solver/deficiency/scaled_matrix.hpp"
#include "solver/deficiency/small_block.hpp"

namespace espalier::solver {

inline constexpr Index kFirstColumns = 8;           // a substitution takes as many in the time of one
inline constexpr Offset kMostVectorWork = 1 << 28;  // of rows * columns^2: a few tenths of a second

/// Numbers without pattern (the finalizer of splitmix64, Steele et al. 2014), the same in every run: of both signs,
/// from 1/2 to 1 in magnitude.
double random_number(std::uint64_t k);

/// A block of directions that op(B) makes smallest.
struct Directions {
  Block q{0, 0}, y{0, 0};      ///< orthonormal; y = op(B) q
  std::vector<double> values;  ///< |y_j|, ascending
  bool found = false;          ///< false: numbers overflowed
  bool solved = true;          ///< false: the factor's last solutions solve nothing

  [[nodiscard]] Index below(double bound) const;
};

Block first_columns(const Block& q, Index columns);

class NullSpaceIteration {
 public:
  explicit NullSpaceIteration(const DeficiencyJob& job)
      : job_(job), b_(job), share_(zero_singular_value(job.kind, job.prepared.n())) {}

  /// Whether the matrix is surely regular, by a few solutions: no singular value is near the bound of a zero (FP32:
  /// near what it can tell from one).
  [[nodiscard]] bool surely_regular() const;
  /// Before all below.
  void prepare();

  [[nodiscard]] const DeficiencyJob& job() const { return job_; }
  [[nodiscard]] const ScaledMatrix& matrix() const { return b_; }
  /// A singular value up to this counts as zero.
  [[nodiscard]] double zero() const { return zero_; }
  /// Whether each column of y is a zero beside that of x. A few entries that are no zeros would drown in its length.
  [[nodiscard]] bool vanish(const Block& y, const Block& x) const;

  [[nodiscard]] Directions find(Index columns, bool transpose) const;
  /// A matrix has as many null directions on the one side as on the other. Where the two searches disagree, or both
  /// came near only, each corrects its own with what the other has found.
  void agree(Directions& right, Directions& left) const;
  /// Whether vectors that are perpendicular to these null vectors lead to others: some that vanishing pivots make much
  /// larger drown the rest of a block, as if it were no part of the null space.
  [[nodiscard]] bool hides_more(const Block& right, const Block& left) const;

  /// Vectors of op(B)'s null space, by a factor of B + E (zeros_of_pivots()): what B makes of random vectors is taken
  /// off them.
  /// @param polished  once more than it takes
  /// @returns none where they are no null vectors to rounding
  [[nodiscard]] Block null_columns(Index columns, bool transpose, bool polished) const;
  /// Takes off null vectors what rounding has added to them in other directions: x -= (B + E)^-1 B x.
  void clean(Block& x, bool transpose) const;

 private:
  [[nodiscard]] bool surely_above(double bound) const;
  [[nodiscard]] bool returns(Block x, bool transpose) const;
  [[nodiscard]] bool solves(const Block& x, const Block& y, bool transpose) const;
  [[nodiscard]] bool below(const Block& y, const Block& x, double ratio) const;
  [[nodiscard]] double near() const;
  [[nodiscard]] Block start(Index columns) const;
  bool iterate(Block& x, bool transpose) const;
  bool make_orthonormal(Block& x) const;
  void inspect(Directions& d, bool transpose) const;
  void improve(Directions& d, bool transpose) const;
  void correct(Directions& d, const Block& other, bool transpose) const;
  [[nodiscard]] Block left_of(Index columns, Index keep, bool transpose) const;

  const DeficiencyJob& job_;
  ScaledMatrix b_;
  double share_;  // of |B|, that stands for a zero
  double zero_ = 0;
};

}  // namespace espalier::solver
