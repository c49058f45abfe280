/// \file
/// The rows and columns around a factorized matrix, and the dense system that they leave.
#pragma once

#include <Eigen/Dense>
#include <functional>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::changes {

/// Why a row and a column are there.
enum class Sort { added, removed, low_rank };

/// U, W and D of all changes, with what the factor makes of U.
class Border {
 public:
  /// X := A^-1 X in place, n values a column.
  using Solve = std::function<void(Eigen::MatrixXd& x)>;

  explicit Border(Index n) : n_(n) {}

  /// Appends columns of U (n x k), rows of W (k x n, given as n x k), and their block of D.
  /// @param symmetric  W = U^T and D = D^T; of low rank: it comes from a symmetric change
  void append(Sort sort, const Eigen::MatrixXd& u, const Eigen::MatrixXd& w, const Eigen::MatrixXd& d, bool symmetric,
              const Solve& solve);
  /// Change k of the list goes or comes back; its columns are kept.
  void set_active(Index k, bool active) { active_[static_cast<std::size_t>(k)] = active; }
  [[nodiscard]] bool active(Index k) const { return active_[static_cast<std::size_t>(k)]; }
  [[nodiscard]] Sort sort(Index k) const { return sort_[static_cast<std::size_t>(k)]; }
  /// Takes change k off the list.
  void erase(Index k);
  [[nodiscard]] Index count() const { return static_cast<Index>(sort_.size()); }
  [[nodiscard]] Index active_count() const { return static_cast<Index>(numbers().size()); }

  /// Factorizes S of the active changes. @returns false where it is singular to rounding
  [[nodiscard]] bool factorize();
  /// t of the active changes for right-hand sides d - W A^-1 b, by rows of all changes; zero for others.
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& right) const;

  [[nodiscard]] const Eigen::MatrixXd& u() const { return u_; }
  [[nodiscard]] const Eigen::MatrixXd& w() const { return w_; }
  [[nodiscard]] const Eigen::MatrixXd& d() const { return d_; }
  [[nodiscard]] const Eigen::MatrixXd& response() const { return z_; }
  [[nodiscard]] bool symmetric() const;
  /// S of the active changes.
  [[nodiscard]] Eigen::MatrixXd complement() const;
  /// Numbers of the active changes.
  [[nodiscard]] std::vector<Index> numbers() const;

 private:
  Index n_;
  Eigen::MatrixXd u_, w_, z_;  // n x count: U, W^T, A^-1 U
  Eigen::MatrixXd d_, g_;      // count x count: D, W A^-1 U
  std::vector<Sort> sort_;
  std::vector<bool> active_, symmetric_;
  Eigen::VectorXd row_, col_;  // powers of two that bring the rows and columns of S to about 1
  Eigen::PartialPivLU<Eigen::MatrixXd> factor_;
};

}  // namespace espalier::changes
