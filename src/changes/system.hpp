/// \file
/// A changed matrix with the factor that stands for a part of it, and the rows and columns around that.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "changes/base.hpp"
#include "changes/border.hpp"
#include "changes/changed_matrix.hpp"
#include "changes/row_norm.hpp"
#include "espalier/changed_system.hpp"

namespace espalier::changes {

/// Calls throw Error.
class System {
 public:
  /// @pre `solver` has a factor, which outlives this and stays
  explicit System(Solver& solver);
  System(const System&) = delete;
  System& operator=(const System&) = delete;

  [[nodiscard]] const ChangedMatrix& matrix() const { return matrix_; }
  /// To be changed.
  [[nodiscard]] ChangedMatrix& changing() {
    stale_ = true;
    return matrix_;
  }
  /// Rows of S, as they are or will be.
  [[nodiscard]] Index changes() const;
  void set_folding(bool automatic) { folds_ = automatic; }
  [[nodiscard]] ChangeCost cost() const;

  /// Columns, S and the norm. @throws Error(singular)
  void prepare();
  void fold();
  /// b and x: unknowns x columns. @pre b is finite where it is read
  /// @param transpose  for the transposed matrix
  void solve(const double* b, double* x, Index columns, bool transpose, SolveResult& result);
  [[nodiscard]] Inertia inertia();

 private:
  [[nodiscard]] Base& base() { return folded_ ? *folded_ : original_; }
  [[nodiscard]] const Base& base() const { return folded_ ? *folded_ : original_; }
  void find_wanted();
  void update();
  void factorize_changed();
  void back_to_original();
  // `turned`: of the transposed matrix, where that is another one.
  void solve_block(const double* b, double* x, Index columns, bool turned, SolveResult& result);
  [[nodiscard]] Eigen::MatrixXd residual(const Eigen::MatrixXd& b, Eigen::MatrixXd& x, bool turned);
  [[nodiscard]] Eigen::MatrixXd substitute(const Eigen::MatrixXd& r, bool turned);
  [[nodiscard]] double norm(bool turned);
  void count_products(Index columns);

  ChangedMatrix matrix_;
  Solver* solver_;
  Base original_;
  std::unique_ptr<Solver> own_;  // of the changed matrix, as it was when it was factorized
  std::optional<Base> folded_;
  Border border_;
  std::set<Index> wanted_;      // entities that belong into the border
  std::set<Index> silent_;      // that do not count
  std::vector<Index> outside_;  // that the base does not have
  RowNorm row_norm_;
  std::optional<double> norms_[2];  // of the matrix, of its transpose
  bool updated_ = false;            // the border is that of the matrix
  bool stale_ = true;               // the matrix has changed since prepare()
  bool folds_ = true;
  bool refused_ = false;  // a factorization of its own has failed
  ChangeCost cost_;
};

}  // namespace espalier::changes
