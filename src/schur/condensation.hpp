/// \file
/// The work behind SchurComplement: a factor of the rest, the dense complement, and solves with both.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "espalier/schur.hpp"
#include "schur/dense.hpp"
#include "schur/partition.hpp"
#include "solve/residual.hpp"
#include "solver/session/session.hpp"

namespace espalier::schur {

/// Right-hand sides in A's numbering and by the list, `columns` of each; what a call does not need is null.
struct Sides {
  const double* b = nullptr;   ///< n values each
  const double* xs = nullptr;  ///< size
  double* x = nullptr;         ///< n; may be b
  double* g = nullptr;         ///< size
  Index columns = 1;
  bool transpose = false;
};

class Condensation {
 public:
  explicit Condensation(Options options);

  AnalysisResult analyze(const MatrixView& a, std::span<const Index> unknowns);
  SchurResult factorize(std::span<const double> values);
  SolveResult condense(const Sides& sides);
  SolveResult expand(const Sides& sides);
  SolveResult solve(const Sides& sides);
  SchurInertia inertia();

  [[nodiscard]] bool analyzed() const { return parts_.has_value(); }
  [[nodiscard]] bool factorized() const { return factorized_; }
  [[nodiscard]] Index n() const { return parts_->n(); }
  [[nodiscard]] Offset nonzeros() const { return a_.nonzeros(); }
  [[nodiscard]] const std::vector<Index>& unknowns() const;
  [[nodiscard]] const AnalysisResult& analysis() const { return analysis_; }
  [[nodiscard]] std::span<const double> complement() const { return s_; }

 private:
  template <class Body>
  Status guarded(Body&& body);
  [[nodiscard]] Options options_of_rest(bool symmetric) const;
  [[nodiscard]] MatrixView rest_view(std::span<const double> rest_values) const;
  void analyze_rest(const MatrixView& a, bool with_border);
  void check_values(std::span<const double> values) const;
  void factorize_rest(std::span<const double> values, SchurResult& result);
  void form_complement(std::span<const double> values, SchurResult& result);
  void add_border_contribution();
  void subtract_by_solves();
  void name_in_full(FactorResult& rest) const;
  template <class Body>
  SolveResult solve_by(Body&& body);
  SolveResult solve_rest(std::vector<double>& x, Index columns, bool transpose, bool refined);
  [[nodiscard]] std::vector<double> rest_of(const double* b, Index columns) const;
  void condense(const Sides& sides, bool refined, SolveResult& result);
  void expand(const Sides& sides, bool refined, SolveResult& result);
  DenseFactor& dense_factor();
  [[nodiscard]] bool has_rest() const { return !parts_->rest().empty(); }

  Options options_;
  bool symmetric_ = false;  // the kind of A_rr is not lu
  SparseMatrix a_;          // the caller's, for residuals
  std::optional<Partition> parts_;
  std::unique_ptr<solver::Session> session_;  // of A_rr; null: all unknowns are listed
  AnalysisResult analysis_;
  std::optional<solve::ResidualOperator> residual_;  // of a_, when somebody asked
  std::vector<double> coupling_;                     // values of parts_->border()
  std::vector<double> s_;
  std::optional<DenseFactor> dense_;  // of s_, when somebody asked
  FactorResult rest_;
  bool factorized_ = false;
  base::Interruption interruption_;
  base::ThreadPool pool_;  // for the residuals of A
};

}  // namespace espalier::schur
