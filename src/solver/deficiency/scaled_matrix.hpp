/// \file
/// B = R A C: a factored matrix as its verdict sees it, and its inverse as the factor knows it.
#pragma once

#include <vector>

#include "solver/deficiency/deficiency.hpp"
#include "solver/deficiency/rank_correction.hpp"
#include "solver/deficiency/small_block.hpp"

namespace espalier::solver {

/// A complex matrix acts on vectors of twice as many real numbers, real and imaginary parts in turn (base::Numbers):
/// its singular values (and the eigenvalues of a Hermitian one) stand twice there, and its transpose is A^H.
class ScaledMatrix {
 public:
  /// By the scaling of the factorization, of llt by the diagonal.
  explicit ScaledMatrix(const DeficiencyJob& job);
  /// Further sweeps of Ruiz (2001) where the scaling of the factorization has left rows or columns uneven, which costs
  /// a factor little and a verdict much. A matched scaling needs none.
  void make_even();

  /// Real numbers in one of the caller's.
  [[nodiscard]] Index parts() const { return parts_; }
  /// The size of the real space.
  [[nodiscard]] Index n() const { return parts_ * n_; }
  /// Whether B is not its own transpose there.
  [[nodiscard]] bool two_sided() const {
    return job_.kind == Kind::lu || job_.prepared.numbers == base::Numbers::complex;
  }
  /// sqrt(|B|_1 |B|_inf)
  [[nodiscard]] double norm() const { return norm_; }

  /// op(B) x in extended precision.
  [[nodiscard]] Block product(const Block& x, bool transpose) const;
  /// op(B)^-1 x by the factor.
  [[nodiscard]] Block inverse(Block x, bool transpose) const;

  /// From B's unknowns to the caller's.
  [[nodiscard]] double unscaled(Index i, double v, bool transpose) const {
    return v * (transpose ? row_ : col_)[at(i / parts_)];
  }
  /// From op(B) to the caller's op(A), a transpose instead of A^H.
  void to_caller(RankCorrection& c, bool transpose) const;

 private:
  void by_diagonal();
  void make_empty_ones_large();
  void measure();
  void turn(Block& x) const;
  void scale(Block& x, const std::vector<double>& by, bool inverse) const;
  [[nodiscard]] double size_of(Offset q) const;
  template <class Use>
  void visit(Use&& use) const;

  const DeficiencyJob& job_;
  Index parts_;
  Index n_;  // of the matrix
  std::vector<double> row_, col_;
  double norm_ = 0;
};

}  // namespace espalier::solver
