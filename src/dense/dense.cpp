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

MatrixXcd solve(const MatrixXcd& a, const MatrixXcd& b) { return Eigen::PartialPivLU<MatrixXcd>(a).solve(b); }

bool solve_definite(const MatrixXd& a, MatrixXd& x) {
  const Eigen::LDLT<MatrixXd> factor(a);
  if (factor.info() != Eigen::Success || !factor.isPositive() || !(factor.vectorD().minCoeff() > 0)) return false;
  x = factor.solve(x).eval();
  return true;
}

struct Lu::Factor {
  Eigen::PartialPivLU<MatrixXd> lu;
};

Lu::Lu() : factor_(std::make_unique<Factor>()) {}
Lu::Lu(const MatrixXd& a) : Lu() { compute(a); }
Lu::~Lu() = default;
Lu::Lu(Lu&&) noexcept = default;
Lu& Lu::operator=(Lu&&) noexcept = default;

void Lu::compute(const MatrixXd& a) { factor_->lu.compute(a); }
MatrixXd Lu::solve(const MatrixXd& b) const { return factor_->lu.solve(b); }

void Lu::solve(const Eigen::Ref<const VectorXd>& b, Eigen::Ref<VectorXd> x) const {
  const auto& lu = factor_->lu;
  x.noalias() = lu.permutationP() * b;
  lu.matrixLU().triangularView<Eigen::UnitLower>().solveInPlace(x);
  lu.matrixLU().triangularView<Eigen::Upper>().solveInPlace(x);
}

VectorXd Lu::pivots() const { return factor_->lu.matrixLU().diagonal(); }
int Lu::permutation_sign() const { return factor_->lu.permutationP().determinant() < 0 ? -1 : 1; }
double Lu::rcond() const { return factor_->lu.rcond(); }

}  // namespace espalier::dense
