/// \file
/// The solver for complex matrices: symmetric (dynamic stiffness K + i w C - w^2 M), Hermitian and general ones.
#pragma once

#include <complex>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "espalier/matrix.hpp"
#include "espalier/solver.hpp"
#include "espalier/types.hpp"

namespace espalier {

/// What ComplexSolver::factorize() or refactorize() did. A Hermitian matrix has an inertia; of other complex ones it is
/// unknown (-1).
struct ComplexFactorResult : FactorReport {
  /// det A over its magnitude; 0 for a singular matrix. NaN where the real form was factorized (see ComplexSolver),
  /// whose determinant is +-|det A|^2 and does not tell it; those of Hermitian matrices are known by their inertia.
  std::complex<double> determinant_phase = 0;
  /// The null space of a singular matrix: n - rank vectors v with A v = 0 to rounding, n values each, one after
  /// another, the largest part of each 1 in magnitude.
  std::vector<std::complex<double>> null_vectors;
  /// Vectors w with A^T w = 0, likewise: of a Hermitian matrix the conjugates of the null vectors. Empty for a
  /// symmetric one, where they are the same.
  std::vector<std::complex<double>> left_null_vectors;
};

/// Solver for complex numbers: the same calls, options, states, errors and guarantees; see there for all that is not
/// said here. What differs:
///  - kinds: llt (L L^H) and ldlt (L D L^H, with inertia) of Hermitian matrices, ldlt (L D L^T) of symmetric ones, lu.
///    `automatic` goes by the storage; in general storage by the values: symmetric ones, then Hermitian ones, else lu.
///    Hermitian matrices with a positive diagonal take llt, and ldlt where a pivot is not positive.
///  - a matrix stays what it was analyzed as: a symmetric one does not become Hermitian with other values.
///  - GPUs have no kernels for complex numbers. There the real form is factorized, a real system of twice the size: one
///    GPU or several, of ranks as well, in core or streamed, as any real one. It takes up to twice the operations and
///    twice the memory that kernels for complex numbers would, and counts of fronts, entries, operations, 2x2 pivots
///    and moved pivots are those of the real form. All else (kinds, errors, rank, rows, null vectors, inertia,
///    condition) is that of the complex system; the phase of the determinant is not known, but of Hermitian matrices.
///  - precision fp32 and mixed factor in complex<float>; of real forms, in float.
class ComplexSolver {
 public:
  using State = Solver::State;
  using Value = std::complex<double>;

  /// @throws std::invalid_argument for numbers and enumerations that no option can be
  explicit ComplexSolver(Options options = {});
  /// A solver that all ranks share: see Solver.
  ComplexSolver(const Ranks& ranks, Options options = {});
  ~ComplexSolver();
  ComplexSolver(ComplexSolver&&) noexcept;
  ComplexSolver& operator=(ComplexSolver&&) noexcept;

  /// A Hermitian matrix whose diagonal is not real is refused, with its row.
  AnalysisResult analyze(const ComplexMatrixView& a);
  /// See Solver. What is Hermitian, or symmetric, and is not any more, is analyzed anew. Of a real form (GPUs) the
  /// numbers of fronts are not kept. @pre state() != empty
  ChangeResult analyze_change(const ComplexMatrixView& a);
  /// See Solver, for these and the two below.
  AnalysisResult analyze(const ComplexLocalRows& part);
  AnalysisResult analyze(const ComplexLocalEntries& part);
  void set_rows(RowRange rows);
  [[nodiscard]] RowRange rows() const;
  /// @pre state() != empty
  ComplexFactorResult factorize(const ComplexMatrixView& a);
  /// Same pattern, new values in the order of the analyzed matrix; allocates nothing. @pre state() != empty
  ComplexFactorResult refactorize(std::span<const Value> values);
  /// As Solver::refactorize_entries().
  ComplexFactorResult refactorize_entries(std::span<const Offset> places, std::span<const Value> values);
  /// Solves op(A) X = B for `columns` right-hand sides stored column by column, n values each (with ranks: rows().count
  /// values); x may alias b.
  /// @pre state() == factorized
  SolveResult solve(std::span<const Value> b, std::span<Value> x, Index columns = 1,
                    Transpose transpose = Transpose::no);
  /// See Solver.
  void set_refinement(int steps, double required_backward_error);
  [[nodiscard]] ComplexSolver clone(int threads = 0) const;
  [[nodiscard]] State state() const;
  [[nodiscard]] bool has_pattern(const ComplexMatrixView& a) const;
  [[nodiscard]] std::vector<Value> values() const;
  [[nodiscard]] const Options& options() const;
  [[nodiscard]] const AnalysisResult& analysis() const;
  /// 1-norm condition estimate (Hager; Higham and Tisseur 2000 for complex numbers). @pre state() == factorized
  [[nodiscard]] ConditionResult condition_estimate();
  [[nodiscard]] std::vector<Solver::TierRow> tiers() const;
  /// Files of Solver and ComplexSolver are the same where kind and pattern are.
  Status save_analysis(const std::string& path) const;
  AnalysisResult load_analysis(const std::string& path, const ComplexMatrixView& a);
  AnalysisResult load_analysis(const std::string& path, const ComplexLocalRows& part);
  AnalysisResult load_analysis(const std::string& path, const ComplexLocalEntries& part);
  Status write_trace(const std::string& path) const;

 private:
  struct Impl;
  friend struct solver::SolverAccess;
  explicit ComplexSolver(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// The solver for a sort of numbers, for templates: SolverOf<double>, SolverOf<std::complex<double>>.
template <class Value>
using SolverOf = std::conditional_t<std::is_same_v<Value, double>, Solver, ComplexSolver>;

}  // namespace espalier
