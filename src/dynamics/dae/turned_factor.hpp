/// \file
/// A factor of K that goes on serving when bodies have turned.
///
/// In axes that turn with a flexible body its part of W changes with its strain alone, so a factor of
/// K_0 = [W_0 B_0; P_0 0] also tells of K = [R W_0 R^T, B; P 0]: R is orthogonal, a 3 x 3 rotation for each vertex of a
/// body, and B and P are those of the present state. In the unknowns R^T x_v,
///   K' = K_0 + U V^T,  U = [E 0; 0 I],  V^T = [0 I; D 0],  E = R^T B - B_0,  D = P R - P_0,
/// a change of rank 2 m, which the formula of Woodbury (1950) takes in: with G = K_0^-1 U
///   K'^-1 b = z - G (I + V^T G)^-1 V^T z,  z = K_0^-1 b.
/// Newton's iteration with it contracts as with a new factor but for strain, forces that do not turn with a body, and
/// what joints' reactions add to W.
#pragma once

#include <functional>
#include <vector>

#include "base/lazy_vector.hpp"
#include "base/thread_pool.hpp"
#include "dense/dense.hpp"
#include "dynamics/dae/system.hpp"

namespace espalier::dynamics {

class TurnedFactor {
 public:
  /// Solves K_0 X = B in place for the given number of columns, each n + m.
  using Solve = std::function<void(Span, Index)>;

  /// K_0 has been factorized. @param phi_q  outlives the use @param dropped  m marks: constraints whose rows are empty
  void start(const SparsePattern& phi_q, ConstSpan phi_q_values, const std::vector<char>& dropped);
  /// K_0^-1 [0; I] is known.
  void know(base::LazyVector<double> response_of_k_0) { y_0_ = std::move(response_of_k_0); }
  /// Nothing is turned any more.
  void drop() { active_ = false; }
  [[nodiscard]] bool active() const { return active_; }
  /// Constraints that are not dropped; three columns are kept for each.
  [[nodiscard]] Offset constraints() const { return static_cast<Offset>(kept_.size()); }

  /// Turns from the state of the factor. @return false where I + V^T G is singular: nothing is turned then
  [[nodiscard]] bool turn(std::vector<BodyTurn> turns, ConstSpan phi_q_values, const Solve& solve,
                          base::ThreadPool* pool);
  /// x = K^-1 b in place for `columns` right-hand sides.
  void solve(Span b, Index columns, const Solve& solve, base::ThreadPool* pool) const;
  /// K^-1 [0; I], a column for each of the constraints.
  [[nodiscard]] base::LazyVector<double> response(base::ThreadPool* pool) const;

 private:
  void rotate(Span x, bool back, base::ThreadPool* pool) const;
  void make_change(ConstSpan phi_q_values);
  void apply_v(ConstSpan z, double* out) const;

  const SparsePattern* phi_q_ = nullptr;
  std::vector<Index> kept_;
  std::vector<double> phi_q_0_;
  std::vector<BodyTurn> turns_;  // by their first coordinates
  SparsePattern change_;         // D by rows, of the constraints kept; E is its transpose
  std::vector<double> change_values_;
  base::LazyVector<double> y_0_;  // K_0^-1 [0; I]: made once for a factor
  Eigen::MatrixXd g_;             // n + m rows, first the columns of E, then y_0
  dense::Lu core_;
  Eigen::MatrixXd core_matrix_;  // V^T G
  bool active_ = false;
};

}  // namespace espalier::dynamics
