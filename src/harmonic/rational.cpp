#include "harmonic/rational.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>

#include "dense/dense.hpp"

namespace espalier::harmonic {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;

namespace {
Eigen::Index at(std::size_t i) { return static_cast<Eigen::Index>(i); }

constexpr Eigen::Index kSvd = 32;  // weights up to which they come from a singular value decomposition

// A vector v of length 1 for which |R v| is about the smallest singular value of the upper triangle R: inverse
// iteration with R^* R, which takes operations by the square of the size, where a decomposition takes them by its cube
// (130 resonances: most of a sweep's time). Where several singular values are rounding, any mix of their vectors does.
VectorXcd smallest_of_triangle(MatrixXcd r) {
  constexpr int kIterations = 8;
  const double least = std::numeric_limits<double>::epsilon() * r.cwiseAbs().maxCoeff();
  if (least == 0) return VectorXcd::Unit(r.cols(), r.cols() - 1);
  for (Eigen::Index j = 0; j < r.cols(); ++j)
    if (std::abs(r(j, j)) < least) r(j, j) = least;
  VectorXcd v(r.cols());
  std::uint64_t random = 1;  // Knuth's linear congruential generator: no start is orthogonal to all that is sought
  for (std::complex<double>& x : v) {
    random = random * 6364136223846793005U + 1442695040888963407U;
    x = {static_cast<double>(random >> 11) * 0x1p-53 - 0.5, 1};
  }
  for (int k = 0; k < kIterations; ++k) {
    v.normalize();
    dense::solve_adjoint_upper(r, v);
    v /= v.cwiseAbs().maxCoeff();
    dense::solve_upper(r, v);
    v /= v.cwiseAbs().maxCoeff();
  }
  return v.normalized();
}
}  // namespace

void Rational::find_weights(const MatrixXd& size) {
  const MatrixXcd& y = y_;
  const Eigen::Index columns = at(support_.size());
  std::vector<char> taken(s_.size(), 0);
  for (const std::size_t j : support_) taken[j] = 1;
  MatrixXcd loewner((at(s_.size()) - columns) * y.rows(), columns);
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < s_.size(); ++i) {
    if (taken[i] != 0) continue;
    for (Eigen::Index c = 0; c < y.rows(); ++c, ++row)
      for (Eigen::Index j = 0; j < columns; ++j) {
        const std::size_t k = support_[static_cast<std::size_t>(j)];
        loewner(row, j) = (y(c, at(i)) - y(c, at(k))) / ((s_[i] - s_[k]) * size(c, at(i)));
      }
  }
  // Each column of length 1: a weight beside a pole, where values are larger by decades, is smaller by as many, and is
  // known to as many digits as the others.
  const double none = std::numeric_limits<double>::min();
  const Eigen::VectorXd lengths = loewner.colwise().norm().transpose().cwiseMax(none);
  loewner = loewner * lengths.cwiseInverse().asDiagonal();
  if (loewner.rows() > columns) loewner = dense::qr_triangle(loewner);
  weights_ = columns > kSvd ? smallest_of_triangle(std::move(loewner)) : dense::last_right_singular_vector(loewner);
  weights_.array() *= lengths.minCoeff() / lengths.array();
}

void Rational::judge(const MatrixXd& size) {
  error_ = 0;
  for (std::size_t i = 0; i < s_.size(); ++i) {
    if (std::find(support_.begin(), support_.end(), i) != support_.end()) continue;
    const VectorXcd r = evaluate(s_[i]);
    const double e = ((r - y_.col(at(i))).cwiseAbs().array() / size.col(at(i)).array()).maxCoeff();
    if (!(e <= error_)) {
      error_ = e;
      worst_ = i;
    }
  }
}

void Rational::fit(const std::vector<double>& s, const MatrixXcd& y, const MatrixXd& size, double tolerance,
                   std::vector<std::size_t> support) {
  s_ = s;
  y_ = y;
  support_ = std::move(support);
  poles_.reset();
  if (support_.empty()) support_.push_back(s.size() / 2);
  // As many unknown weights as there are equations, at most.
  const auto c = static_cast<std::size_t>(y.rows());
  const std::size_t most = std::max<std::size_t>(1, std::min(s.size() - 1, s.size() * c / (c + 1)));
  while (true) {
    find_weights(size);
    judge(size);
    if (error_ <= tolerance || support_.size() >= most) return;
    support_.push_back(worst_);
  }
}

std::vector<double> Rational::support_at() const {
  std::vector<double> out;
  for (const std::size_t j : support_) out.push_back(s_[j]);
  return out;
}

VectorXcd Rational::evaluate(double s, const MatrixXcd& y) const {
  VectorXcd above = VectorXcd::Zero(y.rows());
  std::complex<double> below = 0;
  for (std::size_t j = 0; j < support_.size(); ++j) {
    const double apart = s - s_[support_[j]];
    if (apart == 0) return y.col(at(support_[j]));
    const std::complex<double> share = weights_[at(j)] / apart;
    above += share * y.col(at(support_[j]));
    below += share;
  }
  return above / below;
}

const std::vector<std::complex<double>>& Rational::poles() const {
  if (!poles_) poles_ = find_poles();
  return *poles_;
}

// sum b_j / (s - s_j) = c^T (s - S)^-1 1 has the zeros of S - 1 (c^T S) / sum b, and that one has 0 besides: s is
// counted from a point below all samples, where no pole of interest lies.
std::vector<std::complex<double>> Rational::find_poles() const {
  std::vector<std::complex<double>> out;
  const Eigen::Index m = at(support_.size());
  const std::complex<double> total = weights_.sum();
  if (m < 2 || total == 0.0) return out;
  const double length = s_.back() - s_.front(), origin = s_.front() - 2 * length;
  MatrixXcd a(m, m);
  for (Eigen::Index j = 0; j < m; ++j) {
    const double sj = s_[support_[static_cast<std::size_t>(j)]] - origin;
    a.col(j).setConstant(-weights_[j] * sj / total);
    a(j, j) += sj;
  }
  for (const std::complex<double>& p : dense::general_eigenvalues(a))
    if (std::abs(p) > length) out.push_back(p + origin);
  return out;
}

}  // namespace espalier::harmonic
