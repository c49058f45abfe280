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
template <class T>
class System {
 public:
  using Matrix = typename Border<T>::Matrix;

  /// @pre `solver` has a factor, which outlives this and stays
  explicit System(SolverOf<T>& solver);
  System(const System&) = delete;
  System& operator=(const System&) = delete;

  [[nodiscard]] const ChangedMatrix<T>& matrix() const { return matrix_; }
  /// To be changed.
  [[nodiscard]] ChangedMatrix<T>& changing() {
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
  /// @param transpose  with the transposed matrix
  /// @param conjugate  with the conjugate of that, or of the matrix
  void solve(const T* b, T* x, Index columns, bool transpose, bool conjugate, SolveResult& result);
  [[nodiscard]] Inertia inertia();

 private:
  [[nodiscard]] Base<T>& base() { return folded_ ? *folded_ : original_; }
  [[nodiscard]] const Base<T>& base() const { return folded_ ? *folded_ : original_; }
  void find_wanted();
  void update();
  void factorize_changed();
  void back_to_original();
  // Vectors over the entities that count: of those that the base has in its memory, one after another, where others are
  // zero; of active members of the border that are no slacks on the host.
  struct Vectors {
    T* inside = nullptr;
    Matrix around;  // active members x columns
  };
  // `turned`: of the transposed matrix, where that is no matter of conjugates.
  void solve_block(const T* given, T* to, Index columns, bool turned, bool conjugate, SolveResult& result);
  [[nodiscard]] Vectors send(const T* given, Index columns, bool conjugate);
  void fetch(const Vectors& x, T* to, Index columns, bool conjugate);
  [[nodiscard]] Vectors residual(const Vectors& b, Vectors& x, T* rest, bool turned);
  [[nodiscard]] Vectors substitute(const Vectors& r, T* to, bool turned);
  struct Entries {
    std::vector<Offset> places;  // column after column, in each ascending
    std::vector<T> values;
  };
  Entries take_from(T* v, const Matrix& t, bool turned, bool with_slacks);
  void set_auxiliary(Vectors& x, bool turned);
  void clear_silent(T* v, Index columns);
  [[nodiscard]] Eigen::Index place_around(Index entity) const;
  [[nodiscard]] std::vector<double> errors_of(const Vectors& r, const Vectors& x, const std::vector<double>& given,
                                              bool turned);
  [[nodiscard]] double norm(bool turned);
  /// Counts work that a factorization would have spared.
  void count_spared(double work) {
    cost_.changes += work;
    spared_ += work;
  }

  SolverOf<T>* solver_;
  Base<T> original_;
  ChangedMatrix<T> matrix_;
  std::unique_ptr<SolverOf<T>> own_;  // of the changed matrix, as it was when it was factorized
  std::optional<Base<T>> folded_;
  Border<T> border_;
  std::set<Index> wanted_;      // entities that belong into the border
  std::set<Index> silent_;      // that do not count
  std::vector<Index> outside_;  // that the base does not have
  RowNorm<T> row_norm_;
  std::optional<double> norms_[2];  // of the matrix, of its transpose
  Matrix staged_;                   // what a solve sends and fetches, by entities of the base
  bool updated_ = false;            // the border is that of the matrix
  bool stale_ = true;               // the matrix has changed since prepare()
  bool folds_ = true;
  bool refused_ = false;  // a factorization of its own has failed
  ChangeCost cost_;
  double spared_ = 0;  // of cost_.changes: what solves would have been without if the matrix had been factorized
};

}  // namespace espalier::changes
