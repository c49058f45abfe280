/// \file
/// Systems that differ from a factorized one by a few rows and columns, or by a matrix of low rank, solved with the
/// factor that is there.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "espalier/solver.hpp"

namespace espalier {

/// A factorized system with changes, all of which become rows and columns around it:
///
///     [ A  U ] [ x ]   [ b ]      S = D - W A^-1 U, dense, one row for each change;
///     [ W  D ] [ t ] = [ d ]      x = A^-1 b - A^-1 U t,  S t = d - W A^-1 b
///
///  - *added* unknowns and equations, as constraints of a KKT system: U, W and D are theirs;
///  - *removed* ones: x_p = 0, and equation p is dropped. U and W are the unit vector of p, D is 0, t takes up what is
///    left of equation p;
///  - a change of *low rank*, A + U C V^T: W = C V^T, D = -I. That is the formula of Woodbury (1950) without an inverse
///    of C, which may be singular.
///
/// Each change costs one solve with the factor for each of its columns, and n values of memory a column; each solve one
/// with A and products with the columns. No analysis or factorization is made anew. Solutions are refined with the
/// residual of the changed system.
///
/// Unknowns keep their numbers whatever comes and goes: 0 to n - 1 are those of A, added ones follow in the order in
/// which they came. The Solver must outlive this object and keep its factor: once it is factorized again, calls throw
/// std::logic_error until reset(). Not safe for concurrent calls, nor beside calls on the Solver.
class ChangedSystem {
 public:
  /// @throws std::logic_error where `solver` has no factor
  explicit ChangedSystem(Solver& solver);
  ~ChangedSystem();
  ChangedSystem(ChangedSystem&&) noexcept;
  ChangedSystem& operator=(ChangedSystem&&) noexcept;

  /// Adds `count` unknowns and equations.
  /// @param columns  count * n, one column after another: how the equations of A depend on the new unknowns
  /// @param rows     likewise how the new equations depend on the unknowns of A; empty: as `columns` (symmetric)
  /// @param corner   count * count, column by column, among the new ones; empty: zeros. Between those of different
  ///                 calls there are zeros
  /// @throws std::invalid_argument for arrays of other sizes, here and below
  Status add(std::span<const double> columns, Index count, std::span<const double> rows = {},
             std::span<const double> corner = {});
  /// Removes unknowns, of A or added, with the equations of the same number.
  /// Status invalid_input for numbers out of range, twice in the list, or of what is removed already.
  Status remove(std::span<const Index> unknowns);
  /// Takes back what remove() did. Status invalid_input for what is not removed.
  Status restore(std::span<const Index> unknowns);
  /// A + U C V^T, on top of what was added before.
  /// @param u, v  rank * n, column by column; v empty: u (symmetric)
  /// @param c     rank * rank, column by column; empty: the identity
  Status add_low_rank(std::span<const double> u, Index rank, std::span<const double> c = {},
                      std::span<const double> v = {});
  /// Forgets all changes, and takes the factor that the Solver has now.
  void reset();

  [[nodiscard]] Index size() const;     ///< unknowns: n and all that were added, removed ones among them
  [[nodiscard]] Index changes() const;  ///< rows of S
  /// Solves for `columns` right-hand sides of size() values. What b says of removed equations is not read; removed
  /// unknowns are 0. x may be b.
  /// `backward_error` is normwise, of the changed system, over a lower bound of its norm (Hager's, rarely off by more
  /// than a factor of 3), so that it is never too small; `componentwise_error` is NaN.
  /// Status singular where S, and so the changed matrix, is singular to rounding.
  SolveResult solve(std::span<const double> b, std::span<double> x, Index columns = 1);
  /// Of the changed matrix without its removed rows and columns, by Haynsworth's theorem; -1 where A or a change is not
  /// symmetric.
  [[nodiscard]] Inertia inertia() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace espalier
