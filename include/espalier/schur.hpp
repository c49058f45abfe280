/// \file
/// Schur complements: a system is condensed onto some of its unknowns.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "espalier/solver.hpp"

namespace espalier {

/// What SchurComplement::factorize() did.
struct SchurResult {
  Status status;
  /// The factorization of A_rr. Rows, columns and null vectors are those of A: n values a vector, zero at the listed
  /// unknowns; rank and inertia are of A_rr alone.
  FactorResult rest;
  double seconds = 0;             ///< whole call
  double complement_seconds = 0;  ///< of it: forming S once A_rr is factorized
  /// Whether S was left by the elimination itself. Otherwise (out of core, on GPUs, or where pivots had to be replaced)
  /// it was formed by solves with the factor, which takes longer.
  bool by_elimination = false;
};

/// Inertia of both parts; by Haynsworth's theorem their sum is that of A.
struct SchurInertia {
  Status status;       ///< of the factorization of S; singular counts as ok
  Inertia rest;        ///< of A_rr
  Inertia complement;  ///< of S; -1 where A is not symmetric
};

/// Factors all of a matrix but some unknowns, and keeps what is left for these as a dense matrix:
///
///     A = [ A_rr A_rs ]     S = A_ss - A_sr A_rr^-1 A_rs
///         [ A_sr A_ss ]
///
/// s are the listed unknowns, in the order of the list, r the rest in rising order. The list becomes the border of the
/// last front, which nobody eliminates (Duff and Reid 1983; the same as in MUMPS and PARDISO). The factor of A_rr is
/// kept: right-hand sides are condensed, S solved by whom it concerns, solutions expanded:
///
///     g   = b_s - A_sr A_rr^-1 b_r        condense()
///     S x_s = g                           the caller; or solve() does all three
///     x_r = A_rr^-1 (b_r - A_rs x_s)      expand()
///
/// A_rr may need any kind of factorization; it must be regular, S need not. S is dense: size * size doubles, and while
/// it is formed about twice as much. Objects are independent of each other; calls on one object must not overlap.
class SchurComplement {
 public:
  /// Options as for Solver, but for these: factors are FP64 whatever `precision` says, and a singular A_rr is an error
  /// whatever `singular` says. `permutation` is one of A; the listed unknowns in it are passed over.
  /// @throws std::invalid_argument for numbers and enumerations that no option can be
  explicit SchurComplement(Options options = {});
  ~SchurComplement();
  SchurComplement(SchurComplement&&) noexcept;
  SchurComplement& operator=(SchurComplement&&) noexcept;

  /// Orders A_rr and lays out the plan. Nothing is kept of the arrays.
  /// @param unknowns  0-based, each once, in the order that the rows of S shall have; at least one. All unknowns of A
  ///                  may be listed: then S is A
  /// The status is invalid_input for an empty list, one with duplicates or numbers out of range (which is named).
  AnalysisResult analyze(const MatrixView& a, std::span<const Index> unknowns);
  /// Factorizes A_rr and forms S. @param values  in the order of the analyzed matrix. @pre analyze() was called
  /// Status singular: A_rr is; the message and rest.dependent_rows name rows of A. They, or others, belong into the
  /// list. not_positive_definite: kind llt was asked for. Further ones as for Solver.
  SchurResult factorize(std::span<const double> values);

  [[nodiscard]] Index size() const;                          ///< of the list
  [[nodiscard]] const std::vector<Index>& unknowns() const;  ///< the list
  [[nodiscard]] const AnalysisResult& analysis() const;
  [[nodiscard]] bool factorized() const;
  /// S, size() * size() values column by column, both triangles also of a symmetric one. @pre factorized()
  [[nodiscard]] std::span<const double> complement() const;

  /// g = b_s - A_sr A_rr^-1 b_r (of A^T: with its parts) for `columns` right-hand sides.
  /// @param b  n values each; @param g  size() values each
  /// The result's errors are those of the solves with A_rr, after refinement. @pre factorized(), here and below
  /// @throws std::invalid_argument for arrays of other sizes, here and below
  SolveResult condense(std::span<const double> b, std::span<double> g, Index columns = 1,
                       Transpose transpose = Transpose::no);
  /// x_r = A_rr^-1 (b_r - A_rs x_s); x, n values each, gets x_s at the listed unknowns. x may be b.
  SolveResult expand(std::span<const double> b, std::span<const double> xs, std::span<double> x, Index columns = 1,
                     Transpose transpose = Transpose::no);
  /// A x = b by way of S, which is factorized by the first call after factorize(); refined with the residual of A.
  /// Status singular when S is singular to rounding (and so is A). x may be b.
  SolveResult solve(std::span<const double> b, std::span<double> x, Index columns = 1,
                    Transpose transpose = Transpose::no);
  /// Factorizes S, unless solve() has.
  SchurInertia inertia();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace espalier
