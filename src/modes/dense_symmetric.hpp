/// \file
/// All modes of a small symmetric pencil, the lowest to full relative accuracy whatever the range of the spectrum.
#pragma once

#include <Eigen/Core>

namespace espalier::modes {

struct DenseModes {
  Eigen::VectorXd eigenvalues;  ///< ascending
  Eigen::MatrixXd vectors;      ///< N rows, a column for each: x_i^T M x_j is 1 for i = j, else 0; without the border
  /// How far each eigenvalue may be from that of the exact matrices by rounding alone, of their entries (relative
  /// 1.1e-16 each: |x|^T |K| |x|) and of the method.
  Eigen::VectorXd rounding;
};

/// All finite eigenvalues of [A G^T; G 0] x = l [M 0; 0 0] x. A direct method finds each to within rounding of the
/// largest, which drowns the lowest where stiffnesses lie far apart: the frequencies of a thin wire are 10^8 times
/// below those of its section. Here the pencil is shifted and inverted, L^T (K - s M)^-1 L with M = L L^T, at some
/// shifts s that come down to the lowest eigenvalue and go up again; each eigenvalue is taken from the shift that gives
/// it best (spectral transformation: T. Ericsson, A. Ruhe, Math. Comp. 35, 1980), by its number in the order. Matrices
/// are scaled to a unit diagonal of M and then to unit rows: units of the unknowns do not matter. O((N + m)^3) for each
/// of some shifts.
/// @param k  symmetric, (N + m) x (N + m), the last m rows and columns those of constraints, which are independent
/// @param m  symmetric, N x N
/// @param accurate  so many of the lowest are sought at shifts of their own
/// @throws Error: invalid_input where M is not positive definite, accuracy_not_reached where shifts contradict each
/// other
DenseModes dense_modes(const Eigen::MatrixXd& k, const Eigen::MatrixXd& m, Eigen::Index accurate);

}  // namespace espalier::modes
