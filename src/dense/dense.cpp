#include "dense/dense.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace espalier::dense {

MatrixXd times(const ConstRef& a, const ConstRef& b) { return a * b; }
MatrixXd transposed_times(const ConstRef& a, const ConstRef& b) { return a.transpose() * b; }
VectorXcd real_times_complex(const ConstRef& a, const VectorXcd& b) { return a * b; }

void divide_by_upper_cholesky(const MatrixXd& b, MatrixXd& x) {
  const Eigen::LLT<MatrixXd> factor(b);
  factor.matrixU().solveInPlace<Eigen::OnTheRight>(x);
}

void solve_upper(const MatrixXcd& u, VectorXcd& x) { u.triangularView<Eigen::Upper>().solveInPlace(x); }
void solve_adjoint_upper(const MatrixXcd& u, VectorXcd& x) {
  u.triangularView<Eigen::Upper>().adjoint().solveInPlace(x);
}

Eigen::VectorXi completely_pivoted_columns(const MatrixXd& a) {
  return Eigen::FullPivLU<MatrixXd>(a).permutationQ().indices();
}

VectorXd solve_by_complete_pivoting(const MatrixXd& a, const VectorXd& b) {
  return Eigen::FullPivLU<MatrixXd>(a).solve(b);
}

Eigen::Index rank_by_complete_pivoting(const MatrixXd& a, double dependent) {
  Eigen::FullPivLU<MatrixXd> lu(a);
  lu.setThreshold(dependent);
  return lu.rank();
}

std::optional<MatrixXd> cholesky(const MatrixXd& a) {
  const Eigen::LLT<MatrixXd> factor(a);
  if (factor.info() != Eigen::Success) return {};
  return MatrixXd(factor.matrixL());
}

MatrixXd solve_transposed_lower(const MatrixXd& l, const MatrixXd& b) {
  return l.transpose().triangularView<Eigen::Upper>().solve(b);
}

MatrixXcd solve(const MatrixXcd& a, const MatrixXcd& b) { return LuOf<std::complex<double>>(a).solve(b); }

bool solve_definite(const MatrixXd& a, MatrixXd& x) {
  const Eigen::LDLT<MatrixXd> factor(a);
  if (factor.info() != Eigen::Success || !factor.isPositive() || !(factor.vectorD().minCoeff() > 0)) return false;
  x = factor.solve(x).eval();
  return true;
}

template <class T>
struct LuOf<T>::Factor {
  Eigen::PartialPivLU<Matrix> lu;
};

template <class T>
LuOf<T>::LuOf() : factor_(std::make_unique<Factor>()) {}
template <class T>
LuOf<T>::LuOf(const Matrix& a) : LuOf() {
  compute(a);
}
template <class T>
LuOf<T>::~LuOf() = default;
template <class T>
LuOf<T>::LuOf(LuOf&&) noexcept = default;
template <class T>
LuOf<T>& LuOf<T>::operator=(LuOf&&) noexcept = default;

template <class T>
void LuOf<T>::compute(const Matrix& a) {
  factor_->lu.compute(a);
}
template <class T>
typename LuOf<T>::Matrix LuOf<T>::solve(const Matrix& b) const {
  return factor_->lu.solve(b);
}
template <class T>
typename LuOf<T>::Matrix LuOf<T>::solve_transposed(const Matrix& b) const {
  return factor_->lu.transpose().solve(b);
}

template <class T>
void LuOf<T>::solve(const Eigen::Ref<const Vector>& b, Eigen::Ref<Vector> x) const {
  const auto& lu = factor_->lu;
  x.noalias() = lu.permutationP() * b;
  lu.matrixLU().template triangularView<Eigen::UnitLower>().solveInPlace(x);
  lu.matrixLU().template triangularView<Eigen::Upper>().solveInPlace(x);
}

template <class T>
bool LuOf<T>::regular() const {
  const Matrix& lu = factor_->lu.matrixLU();
  for (Eigen::Index k = 0; k < lu.rows(); ++k)
    if (lu(k, k) == T(0)) return false;
  return lu.allFinite();
}
template <class T>
typename LuOf<T>::Vector LuOf<T>::pivots() const {
  return factor_->lu.matrixLU().diagonal();
}
template <class T>
int LuOf<T>::permutation_sign() const {
  return factor_->lu.permutationP().determinant() < 0 ? -1 : 1;
}
template <class T>
double LuOf<T>::rcond() const {
  return factor_->lu.rcond();
}

template class LuOf<double>;
template class LuOf<std::complex<double>>;

}  // namespace espalier::dense
