#include "changes/border.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace espalier::changes {

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

double inverse_power_of_two(double x) { return x > 0 && std::isfinite(x) ? std::ldexp(1.0, -std::ilogb(x)) : 1.0; }

void erase_column(MatrixXd& m, Index k) {
  const Eigen::Index right = m.cols() - k - 1;
  m.middleCols(k, right) = m.rightCols(right).eval();
  m.conservativeResize(m.rows(), m.cols() - 1);
}

void erase_both(MatrixXd& m, Index k) {
  const Eigen::Index below = m.rows() - k - 1;
  m.middleRows(k, below) = m.bottomRows(below).eval();
  m.conservativeResize(m.rows() - 1, m.cols());
  erase_column(m, k);
}

}  // namespace

void Border::append(Sort sort, const MatrixXd& u, const MatrixXd& w, const MatrixXd& d, bool symmetric,
                    const Solve& solve) {
  const Eigen::Index before = count(), more = u.cols(), all = before + more;
  MatrixXd z = u;
  solve(z);
  for (MatrixXd* m : {&u_, &w_, &z_}) m->conservativeResize(n_, all);
  u_.rightCols(more) = u;
  w_.rightCols(more) = w;
  z_.rightCols(more) = z;
  d_.conservativeResize(all, all);
  d_.rightCols(more).setZero();
  d_.bottomRows(more).setZero();
  d_.bottomRightCorner(more, more) = d;
  g_.conservativeResize(all, all);
  g_.rightCols(more) = w_.transpose() * z;
  g_.bottomLeftCorner(more, before) = w.transpose() * z_.leftCols(before);
  sort_.insert(sort_.end(), static_cast<std::size_t>(more), sort);
  active_.insert(active_.end(), static_cast<std::size_t>(more), true);
  symmetric_.insert(symmetric_.end(), static_cast<std::size_t>(more), symmetric);
}

void Border::erase(Index k) {
  for (MatrixXd* m : {&u_, &w_, &z_}) erase_column(*m, k);
  for (MatrixXd* m : {&d_, &g_}) erase_both(*m, k);
  sort_.erase(sort_.begin() + k);
  active_.erase(active_.begin() + k);
  symmetric_.erase(symmetric_.begin() + k);
}

std::vector<Index> Border::numbers() const {
  std::vector<Index> list;
  for (Index k = 0; k < count(); ++k)
    if (active(k)) list.push_back(k);
  return list;
}

bool Border::symmetric() const {
  return std::all_of(symmetric_.begin(), symmetric_.end(), [](bool s) { return s; });
}

MatrixXd Border::complement() const {
  const std::vector<Index> list = numbers();
  return d_(list, list) - g_(list, list);
}

// Singular: a condition, rows and columns scaled to 1, at which rounding may leave no digit.
bool Border::factorize() {
  MatrixXd s = complement();
  const Eigen::Index k = s.rows();
  if (k == 0) return true;
  if (!s.allFinite()) return false;
  row_ = s.cwiseAbs().rowwise().maxCoeff().unaryExpr(&inverse_power_of_two);
  s = row_.asDiagonal() * s;
  col_ = s.cwiseAbs().colwise().maxCoeff().transpose().unaryExpr(&inverse_power_of_two);
  s = s * col_.asDiagonal();
  factor_.compute(s);
  // Where a pivot is zero, Eigen's estimate of the condition may come out finite.
  if (!factor_.matrixLU().allFinite() || (factor_.matrixLU().diagonal().array() == 0).any()) return false;
  const double least = 4 * static_cast<double>(k) * std::numeric_limits<double>::epsilon();
  return factor_.rcond() > least;
}

MatrixXd Border::solve(const MatrixXd& right) const {
  const std::vector<Index> list = numbers();
  MatrixXd t = MatrixXd::Zero(right.rows(), right.cols());
  if (list.empty()) return t;
  const MatrixXd scaled = row_.asDiagonal() * right(list, Eigen::all);
  t(list, Eigen::all) = col_.asDiagonal() * factor_.solve(scaled);
  return t;
}

}  // namespace espalier::changes
