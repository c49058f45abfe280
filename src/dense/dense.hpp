/// \file
/// Products and decompositions of small dense matrices: Eigen's, compiled once. A source that calls these functions
/// reads Eigen's matrices alone; products and decompositions take a compiler a second each and more, in every source
/// anew. Indices are based on 0. Nothing is kept of the arguments. Sizes must fit; where they do not, Eigen's
/// assertions say so in a debug build.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

namespace espalier::dense {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

/// Matrices and blocks of them are read where they are; other expressions are computed first.
using ConstRef = Eigen::Ref<const MatrixXd>;

/// Another size, any content. Where a matrix that has memory is resized or assigned to, and there is none for it,
/// Eigen 3.4 frees what it had twice; an empty one, and one that is moved into, has nothing to lose.
inline void resize(MatrixXd& m, Eigen::Index rows, Eigen::Index cols) {
  if (m.rows() == rows && m.cols() == cols) return;
  m = MatrixXd();
  m.resize(rows, cols);
}

/// A B (m x k, k x n), A^T B (k x m, k x n).
[[nodiscard]] MatrixXd times(const ConstRef& a, const ConstRef& b);
[[nodiscard]] MatrixXd transposed_times(const ConstRef& a, const ConstRef& b);
[[nodiscard]] VectorXcd real_times_complex(const ConstRef& a, const VectorXcd& b);

/// Real eigenvalues, ascending, and eigenvectors as columns.
template <class T>
struct SpectrumOf {
  VectorXd values;
  Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic> vectors;
};
using Spectrum = SpectrumOf<double>;

/// A x = l x for a symmetric A (n x n, the lower triangle is read); vectors are orthonormal.
[[nodiscard]] Spectrum symmetric_eigen(const MatrixXd& a);
[[nodiscard]] VectorXd symmetric_eigenvalues(const MatrixXd& a);
/// The same for a Hermitian A, too. @tparam T  double or std::complex<double>
template <class T>
[[nodiscard]] SpectrumOf<T> hermitian_eigen(const Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>& a);
template <class T>
[[nodiscard]] VectorXd hermitian_eigenvalues(const Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>& a);
[[nodiscard]] Eigen::Vector3d principal_values(const Eigen::Matrix3d& a);
/// Values, ascending, and directions of length 1 as columns, of a symmetric tensor.
struct PrincipalAxes {
  Eigen::Vector3d values;
  Eigen::Matrix3d axes;
};
[[nodiscard]] PrincipalAxes principal_axes(const Eigen::Matrix3d& a);
/// A x = l B x for symmetric A and B, B positive definite; x^T B x = 1.
[[nodiscard]] Spectrum symmetric_eigen(const MatrixXd& a, const MatrixXd& b);

/// Eigenvalues in no order, complex pairs side by side, and eigenvectors of length 1 as columns.
struct ComplexSpectrum {
  VectorXcd values;
  MatrixXcd vectors;
  bool converged = true;  ///< whether the QR algorithm came to an end; else the others are not to be used
};

/// A x = l x for any square A.
[[nodiscard]] ComplexSpectrum general_eigen(const MatrixXd& a);
[[nodiscard]] VectorXcd general_eigenvalues(const MatrixXd& a);
[[nodiscard]] ComplexSpectrum general_eigen(const MatrixXcd& a);
[[nodiscard]] VectorXcd general_eigenvalues(const MatrixXcd& a);

/// A = U diag(values) V^T, values descending.
struct SingularValues {
  VectorXd values;  ///< min(m, n)
  MatrixXd u;       ///< m x min(m, n), columns orthonormal
  MatrixXd v;       ///< n x n, whole
};

/// @param a m x n
[[nodiscard]] SingularValues singular_values(const MatrixXd& a);

/// Values, descending, and V alone: for hundreds of columns.
struct RightSingularVectors {
  VectorXd values;  ///< min(m, n)
  MatrixXd v;       ///< n x n
};

[[nodiscard]] RightSingularVectors right_singular_vectors(const MatrixXd& a);
/// The v of length 1 for which |A v| is least. @param a square, n at least 1
[[nodiscard]] VectorXcd last_right_singular_vector(const MatrixXcd& a);

/// The rotation R nearest to A, in the sum of squares: A = R S with a symmetric S.
struct NearestRotation {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d values;  ///< singular values of A, descending; R is unique where the second is not zero
};

[[nodiscard]] NearestRotation nearest_rotation(const Eigen::Matrix3d& a);
/// The least rotation that brings the direction of `from` to that of `to`. @pre neither is zero
[[nodiscard]] Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

/// X L^-T, where B = L L^T (6 x 6, positive definite): columns that are orthonormal in the matrix that B = X^T M X is
/// of.
void divide_by_upper_cholesky(const MatrixXd& b, MatrixXd& x);

/// The order in which columns are taken, each the longest beside those before it.
struct PivotedColumns {
  Eigen::VectorXi order;  ///< n
  Eigen::Index rank = 0;  ///< the first `rank` of them are independent, to the given part of the longest
};

/// @param a m x n @param dependent part of the longest column below which a column depends on others
[[nodiscard]] PivotedColumns pivoted_columns(const MatrixXd& a, double dependent);
/// Orthonormal basis (n x (n - rank)) of the vectors that `rows` (m x n) makes zero; rows may depend on each other.
[[nodiscard]] MatrixXd null_space(const MatrixXd& rows, double dependent);
/// The orthogonal factor Q (m x m) and R (min(m, n) x n, upper trapezoid) of A = Q R (m x n).
struct QrFactors {
  MatrixXd q, r;
};
[[nodiscard]] QrFactors qr_factors(const MatrixXd& a);
/// R alone.
[[nodiscard]] MatrixXd qr_triangle(const MatrixXd& a);
[[nodiscard]] MatrixXcd qr_triangle(const MatrixXcd& a);
/// The x of least length among those with the least |A x - b|. @param dependent as for pivoted_columns()
[[nodiscard]] VectorXd least_squares(const MatrixXd& a, const VectorXd& b, double dependent);
/// The same for each column of B; what depends is told by rounding.
[[nodiscard]] MatrixXd least_squares(const MatrixXd& a, const MatrixXd& b);
/// x := U^-1 x, x := U^-H x for an upper triangle U without zeros on its diagonal.
void solve_upper(const MatrixXcd& u, VectorXcd& x);
void solve_adjoint_upper(const MatrixXcd& u, VectorXcd& x);

/// Columns of A (m x n) in the order of complete pivoting.
[[nodiscard]] Eigen::VectorXi completely_pivoted_columns(const MatrixXd& a);
/// x with A x = b by complete pivoting; a singular A gives some x.
[[nodiscard]] VectorXd solve_by_complete_pivoting(const MatrixXd& a, const VectorXd& b);

/// How many columns are independent by complete pivoting. @param dependent part of the largest pivot below which one is
/// none
[[nodiscard]] Eigen::Index rank_by_complete_pivoting(const MatrixXd& a, double dependent);

/// L of A = L L^T (n x n, symmetric, the lower triangle is read); nothing where A is not positive definite.
[[nodiscard]] std::optional<MatrixXd> cholesky(const MatrixXd& a);
/// X with L^T X = B for a lower triangular L.
[[nodiscard]] MatrixXd solve_transposed_lower(const MatrixXd& l, const MatrixXd& b);

/// X with A X = B, with pivoting by rows. @pre A is regular
[[nodiscard]] MatrixXcd solve(const MatrixXcd& a, const MatrixXcd& b);
/// An x with the least |A x - b|, zero where columns depend on others.
[[nodiscard]] VectorXcd least_squares(const MatrixXcd& a, const VectorXcd& b);

/// x with A X = B for a symmetric positive definite A. @return false, and X as it was, where A is not
[[nodiscard]] bool solve_definite(const MatrixXd& a, MatrixXd& x);

/// P A = L U with pivoting by rows. @tparam T  double or std::complex<double>
template <class T>
class LuOf {
 public:
  using Matrix = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<T, Eigen::Dynamic, 1>;

  LuOf();
  explicit LuOf(const Matrix& a);
  ~LuOf();
  LuOf(LuOf&&) noexcept;
  LuOf& operator=(LuOf&&) noexcept;

  void compute(const Matrix& a);
  /// A^-1 B, A^-T B. @pre computed, without a zero pivot
  [[nodiscard]] Matrix solve(const Matrix& b) const;
  [[nodiscard]] Matrix solve_transposed(const Matrix& b) const;
  /// x = A^-1 b without an allocation; b and x must not overlap
  void solve(const Eigen::Ref<const Vector>& b, Eigen::Ref<Vector> x) const;
  /// Whether all numbers of L and U are finite, and no pivot is zero.
  [[nodiscard]] bool regular() const;
  /// Diagonal of U.
  [[nodiscard]] Vector pivots() const;
  /// The sign of the permutation P: 1 or -1.
  [[nodiscard]] int permutation_sign() const;
  /// Estimate of the reciprocal condition in the 1-norm.
  [[nodiscard]] double rcond() const;

 private:
  struct Factor;
  std::unique_ptr<Factor> factor_;
};
using Lu = LuOf<double>;

}  // namespace espalier::dense
