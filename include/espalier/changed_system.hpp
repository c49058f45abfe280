/// \file
/// Systems that differ from a factorized one by a few rows and columns, or by a matrix of low rank, solved with the
/// factor that is there.
#pragma once

#include <complex>
#include <memory>
#include <span>
#include <vector>

#include "espalier/complex_solver.hpp"
#include "espalier/solve_rows.hpp"
#include "espalier/solver.hpp"

namespace espalier {

/// What changes around a factor have cost, beside what a fresh factor would. Operations are counted, so that decisions
/// do not depend on the clock: those of a factorization as AnalysisResult::flops, a sweep through the factor 120
/// for each of its entries, for which it waits, and 10 more for each column (H200 and 16 cores, elasticity 31^3).
struct ChangeCost {
  double changes = 0;                ///< operations of columns, and of products with them, since the last factorization
  double factorization = 0;          ///< of the changed matrix, with the analysis where its pattern has changed
  Index columns = 0;                 ///< that went through the factor since then
  Index factorizations = 0;          ///< of the changed matrix, since the last reset()
  double column_seconds = 0;         ///< that these columns have taken
  double factorization_seconds = 0;  ///< of the last factorization, or where there was none, of the solver's
};

/// What ChangedSystem::solve() did.
struct ChangedSolveResult : SolveResult {
  ChangeCost cost;
};

/// A factorized system with changes, which become rows and columns around it:
///
///     [ A  U ] [ x ]   [ b ]      S = D - W A^-1 U, dense, one row for each change;
///     [ W  D ] [ t ] = [ d ]      x = A^-1 b - A^-1 U t,  S t = d - W A^-1 b
///
///  - *added* unknowns and equations, as constraints of a KKT system: U, W and D are theirs;
///  - *removed* ones: x_p = 0, and equation p is dropped. U and W are the unit vector of p, D is 0, t takes up what is
///    left of equation p;
///  - *replaced* ones: removed, with added ones in their place, under the same number;
///  - a change of *low rank*, A + U C V^T: W = C V^T, D = -I. That is the formula of Woodbury (1950) without an inverse
///    of C, which may be singular.
///
/// Changes are noted when they are made. The next solve() lets the columns of all that are new go through the factor
/// together, 32 at a time, and keeps them; what is removed and restored later costs nothing. On a GPU that holds the
/// factor the columns stay there. Each solve takes one with A and products with the columns. Solutions are refined with
/// the residual of the changed system.
///
/// Where a factorization of the changed matrix would take fewer operations than the columns that are missing and what
/// solves have done with columns since the last one, it is factorized, beside the solver's factor, which stays as it is
/// (ChangeCost; set_folding()). Columns that were made do not count: those of later changes are needed either way.
///
/// Unknowns keep their numbers whatever comes and goes: 0 to n - 1 are those of A, added ones follow in the order in
/// which they came. The Solver must outlive this object and keep its factor: once it is factorized again, calls throw
/// std::logic_error until reset(). Not safe for concurrent calls, nor beside calls on the Solver.
///
/// Complex numbers: all the same. What "symmetric" means is said by what the solver holds (hermitian()): where that is
/// a Hermitian matrix (kinds llt and ldlt), rows that are left out are the conjugates of the columns, and V of low rank
/// that of U; V^T is no conjugate anywhere. The inertia is that of Hermitian systems. Vectors are on the host, wherever
/// the factor is.
/// @tparam Value  double or std::complex<double>
template <class Value>
class ChangedSystemOf {
 public:
  /// @param by_rows  the solver holds A^T, which of a Hermitian matrix is its conjugate: changes and solutions are of A
  ///                 all the same, and solves with the transpose are the shorter ones
  /// @throws std::logic_error where `solver` has no factor, or ranks share it
  explicit ChangedSystemOf(SolverOf<Value>& solver, bool by_rows = false);
  ~ChangedSystemOf();
  ChangedSystemOf(ChangedSystemOf&&) noexcept;
  ChangedSystemOf& operator=(ChangedSystemOf&&) noexcept;

  /// Adds `count` unknowns and equations.
  /// @param columns  count * n, one column after another: how the equations of A depend on the new unknowns
  /// @param rows     likewise how the new equations depend on the unknowns of A; empty: as `columns` (symmetric), or
  ///                 their conjugates (Hermitian)
  /// @param corner   count * count, column by column, among the new ones; empty: zeros. Between those of different
  ///                 calls there are zeros
  /// @throws std::invalid_argument for arrays of other sizes, here and below. Status invalid_input for numbers that are
  ///         not finite and indices out of range, which it names; nothing has changed then
  Status add(std::span<const Value> columns, Index count, std::span<const Value> rows = {},
             std::span<const Value> corner = {});
  /// The same by their entries, which may stand in any of the size() unknowns that are there.
  /// @param rows  the equations, each as a column of entries; without columns: as above
  Status add(const SparseColumnsOf<Value>& columns, const SparseColumnsOf<Value>& rows = {},
             std::span<const Value> corner = {});
  /// Gives unknowns another column and another row, in all equations and unknowns that are there. What was said of
  /// them before, changes of low rank too, holds no more.
  /// @param unknowns  none that is removed
  /// @param columns   one for each, entries of unknowns 0 to size() - 1, the diagonal entry among them; of what stands
  ///                  between two of the list the later one decides
  /// @param rows      likewise, without the diagonal entry; without columns: as above
  Status replace(std::span<const Index> unknowns, const SparseColumnsOf<Value>& columns,
                 const SparseColumnsOf<Value>& rows = {});
  /// Removes unknowns, of A or added, with the equations of the same number.
  /// Status invalid_input for numbers out of range, twice in the list, or of what is removed already.
  Status remove(std::span<const Index> unknowns);
  /// Takes back what remove() did. Status invalid_input for what is not removed.
  Status restore(std::span<const Index> unknowns);
  /// Removes those that are there, restores those that are removed: an active set of bounds that changes.
  Status flip(std::span<const Index> unknowns);
  /// A + U C V^T, on top of what was added before.
  /// @param u, v  rank * n, column by column; v empty: u (symmetric), or its conjugate (Hermitian)
  /// @param c     rank * rank, column by column; empty: the identity
  Status add_low_rank(std::span<const Value> u, Index rank, std::span<const Value> c = {},
                      std::span<const Value> v = {});
  /// The same by entries. A column of A becomes another one by u = the new one less the old one, v = the unit vector.
  /// @param u, v  entries of unknowns 0 to n - 1
  Status add_low_rank(const SparseColumnsOf<Value>& u, std::span<const Value> c = {},
                      const SparseColumnsOf<Value>& v = {});
  /// Forgets all changes, and takes the factor that the Solver has now.
  void reset();
  /// The same where the solver's matrix has come in another layout since.
  void reset(bool by_rows);

  /// Lets the columns of what is new go through the factor now, or factorizes the changed matrix. solve() does that
  /// where it is needed.
  /// Status singular where S, and so the changed matrix, is singular to rounding. Changes may be taken back then.
  Status prepare();
  /// Factorizes the changed matrix now: the memory of another factor, and of a copy of the matrix.
  /// Where it fails, singular or without memory, everything is as it was.
  Status fold();
  /// Whether prepare() and solve() do so by themselves; they do at first.
  void set_folding(bool automatic);

  /// Whether what is left out is the conjugate.
  [[nodiscard]] bool hermitian() const;
  [[nodiscard]] Index size() const;     ///< unknowns: n and all that were added, removed ones among them
  [[nodiscard]] Index changes() const;  ///< rows that S has, or will have after the next prepare() without folding
  [[nodiscard]] bool removed(Index unknown) const;  ///< @throws std::out_of_range
  [[nodiscard]] ChangeCost cost() const;
  /// Solves for `columns` right-hand sides of size() values, with the changed matrix, its transpose, or its conjugate
  /// transpose. Those take two solves with A^T where they are not the matrix itself or its conjugate. What b says of
  /// removed equations is not read; removed unknowns are 0. x may be b. `backward_error` is normwise, of the changed
  /// system, over its norm, or a lower bound where changes touch more than 4096 rows, so that it is never too small;
  /// `componentwise_error` is NaN. Status as prepare().
  ChangedSolveResult solve(std::span<const Value> b, std::span<Value> x, Index columns = 1,
                           Transpose transpose = Transpose::no);
  /// The inertia of the changed matrix without its removed rows and columns, by Haynsworth's theorem; -1 where A or a
  /// change is not symmetric (complex: not Hermitian). Makes columns as prepare() does. @throws Error where the device
  /// or memory fails
  [[nodiscard]] Inertia inertia() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

extern template class ChangedSystemOf<double>;
extern template class ChangedSystemOf<std::complex<double>>;
using ChangedSystem = ChangedSystemOf<double>;
using ComplexChangedSystem = ChangedSystemOf<std::complex<double>>;

}  // namespace espalier
