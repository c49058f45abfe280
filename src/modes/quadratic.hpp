/// \file
/// The few eigenvalues of (l^2 M + l C + K) x = 0 nearest to a real shift.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "base/stage.hpp"
#include "espalier/modes.hpp"
#include "modes/resources.hpp"

namespace espalier::modes {

/// With l = s + 1 / theta and y = 1 / theta x, theta [x; y] = [-Q(s)^-1 ((C + 2 s M) x + M y); x]: one factor, and a
/// product with two matrices, for each step of Arnoldi's method with full orthogonalization. y is held over a typical
/// |l - s|, so that both halves count alike. Of few rows all eigenvalues are computed (dense_quadratic.hpp): there the
/// method would have to span the whole space, and finds a multiple eigenvalue once.
class QuadraticSearch {
 public:
  QuadraticSearch(const MatrixView& k, const MatrixView& c, const MatrixView& m, const QuadraticModesOptions& options,
                  Resources& shop, QuadraticModesResult& result);
  void run();

 private:
  void factorize();
  void apply(const Eigen::VectorXd& z, Eigen::VectorXd& out);
  void measure_scale();
  /// Steps until the basis has `columns` vectors; false: it cannot grow, an invariant subspace is spanned.
  bool expand(Eigen::Index columns);
  void begin();
  /// The Ritz pairs nearest to the shift; true: all wanted ones have converged.
  bool extract_ritz_pairs(bool last);
  void search();
  void take_all();  ///< by the dense method: a few rows
  /// One more result, of length one.
  void add(std::complex<double> l, Eigen::VectorXcd x);
  void deliver(const Eigen::VectorXcd& theta, const Eigen::MatrixXcd& s, const std::vector<Eigen::Index>& chosen);
  [[nodiscard]] double residual(std::complex<double> l, const Eigen::VectorXcd& x) const;

  const QuadraticModesOptions& options_;
  Resources& shop_;
  QuadraticModesResult& result_;
  base::Stage stage_{"modes", 0, "modes"};
  SparseMatrix k_, c_, m_;  // general, both triangles
  SparseMatrix shifted_;    // C + 2 s M
  double k_norm_ = 0, c_norm_ = 0, m_norm_ = 0;
  double shift_ = 0, scale_ = 1;
  Solver solver_;
  Eigen::MatrixXd basis_, h_;
  Eigen::Index size_ = 0;  // columns of the basis whose images are known
};

}  // namespace espalier::modes
