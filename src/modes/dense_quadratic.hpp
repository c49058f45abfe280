/// \file
/// All eigenvalues of a small quadratic problem (l^2 M + l C + K) x = 0.
#pragma once

#include <Eigen/Core>
#include <complex>

#include "espalier/matrix.hpp"

namespace espalier::modes {

/// A matrix of general storage, entries of the same place added up.
Eigen::MatrixXd dense_of(const SparseMatrix& a);

struct DenseQuadraticModes {
  Eigen::VectorXcd eigenvalues;  ///< finite ones by distance from the shift; of a conjugate pair the one above the axis
  Eigen::MatrixXcd vectors;      ///< n rows, a column for each
  Eigen::Index unseen = 0;       ///< so far from the shift that rounding leaves nothing of them: not among those above
};

/// Real matrices n x n, symmetric or not; M may be singular. Unknowns of which M and C know nothing (multipliers, rows
/// of constraints, massless ones) are eliminated first: their infinite eigenvalues are defective, and rounding would
/// make large finite ones of them. What is left is linearized, shifted and inverted as in QuadraticSearch, equilibrated
/// and balanced (B. Parlett, C. Reinsch, Numer. Math. 13, 1969), so that units of the unknowns do not matter and the
/// eigenvalues next to the shift are the most exact; then the QR algorithm. O((2 n)^3).
/// @throws Error: singular where the shift is an eigenvalue or the problem is singular everywhere
DenseQuadraticModes dense_quadratic_modes(const Eigen::MatrixXd& k, const Eigen::MatrixXd& c, const Eigen::MatrixXd& m,
                                          double shift);

/// Makes an approximate pair as exact as rows and unknowns of its own size allow, by Newton's method for (l, x) with
/// x_0^H x = 1 (A. Neumaier, SIAM J. Numer. Anal. 22, 1985), in rows and columns scaled by the diagonal of Q(l): what
/// lies far above l in the spectrum then leaves no rounding in it. @return by how much l has changed, in parts
double polish_quadratic_pair(const Eigen::MatrixXd& k, const Eigen::MatrixXd& c, const Eigen::MatrixXd& m,
                             std::complex<double>& l, Eigen::VectorXcd& x);

}  // namespace espalier::modes
