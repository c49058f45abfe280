#include "modes/dense_quadratic.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numeric>
#include <vector>

#include "dense/dense.hpp"
#include "espalier/types.hpp"

namespace espalier::modes {
namespace {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;
using Complex = std::complex<double>;

constexpr double kQuadraticEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kDependent = 1e-11;  // of the largest singular value: nothing
constexpr double kTiny = 1e-300;
constexpr double kSeenResidual = 1e-9;

[[noreturn]] void refuse_shift(double shift) {
  throw Error(StatusCode::singular,
              fmt::format("Q({:g}) is singular: the shift is an eigenvalue, or rows depend on each "
                          "other whatever the shift",
                          shift));
}

VectorXd inverse_or_one(const VectorXd& v) {
  return v.unaryExpr([](double x) { return x > 0 ? 1 / x : 1.0; });
}

/// R A E with rows and columns of about length one in the largest norm (D. Ruiz, RAL-TR-2001-034).
struct Equilibrated {
  explicit Equilibrated(MatrixXd matrix) : a(std::move(matrix)), rows(VectorXd::Ones(a.rows())), columns(rows) {
    for (int pass = 0; pass < 6; ++pass) {
      const VectorXd r = inverse_or_one(a.cwiseAbs().rowwise().maxCoeff().cwiseSqrt());
      const VectorXd e = inverse_or_one(a.cwiseAbs().colwise().maxCoeff().transpose().cwiseSqrt());
      a = r.asDiagonal() * a * e.asDiagonal();
      rows = rows.cwiseProduct(r);
      columns = columns.cwiseProduct(e);
    }
  }
  MatrixXd a;
  VectorXd rows, columns;
};

/// Basis of the vectors z with A z = 0 for a matrix of full row rank, orthonormal.
MatrixXd null_space(const MatrixXd& a, double shift) {
  if (a.rows() == 0) return MatrixXd::Identity(a.cols(), a.cols());
  if (a.rows() > a.cols()) refuse_shift(shift);
  const VectorXd scale = inverse_or_one(a.rowwise().norm());
  MatrixXd basis = dense::null_space(scale.asDiagonal() * a, kDependent);
  if (basis.cols() > a.cols() - a.rows()) refuse_shift(shift);
  return basis;
}

/// The problem without the unknowns of which M and C know nothing. Of the rows and columns of K that they have,
/// K_aa = U S V^T: what S holds follows the others, its null space is that of multipliers and constraints.
class Reduced {
 public:
  Reduced(const MatrixXd& k, const MatrixXd& c, const MatrixXd& m, double shift) {
    for (Eigen::Index i = 0; i < k.rows(); ++i) {
      const bool known = m.row(i).any() || m.col(i).any() || c.row(i).any() || c.col(i).any();
      (known ? dynamic_ : static_).push_back(i);
    }
    k_ = k(dynamic_, dynamic_);
    c_ = c(dynamic_, dynamic_);
    m_ = m(dynamic_, dynamic_);
    left_ = right_ = MatrixXd::Identity(k_.rows(), k_.rows());
    if (static_.empty()) return;
    const Equilibrated own(k(static_, static_));
    const dense::SingularValues svd = dense::singular_values(own.a);
    const VectorXd& s = svd.values;
    const Eigen::Index rank = (s.array() > kDependent * std::max(s[0], kTiny)).count();
    const MatrixXd u = own.rows.asDiagonal() * svd.u, v = own.columns.asDiagonal() * svd.v;
    const MatrixXd k_ad = k(static_, dynamic_), k_da = k(dynamic_, static_);
    MatrixXd seen = dense::transposed_times(u.leftCols(rank), k_ad);
    for (Eigen::Index i = 0; i < rank; ++i) seen.row(i) /= s[i];
    follows_ = dense::times(v.leftCols(rank), seen);
    free_ = v.rightCols(v.cols() - rank);
    pulls_ = dense::times(k_da, free_);
    k_ -= dense::times(k_da, follows_);
    right_ = null_space(dense::transposed_times(u.rightCols(u.cols() - rank), k_ad), shift);
    left_ = null_space(pulls_.transpose(), shift);
  }

  [[nodiscard]] MatrixXd k() const { return projected(k_); }
  [[nodiscard]] MatrixXd c() const { return projected(c_); }
  [[nodiscard]] MatrixXd m() const { return projected(m_); }

  /// The whole vector to one of the reduced problem.
  [[nodiscard]] VectorXcd expanded(Complex l, const VectorXcd& y) const {
    VectorXcd x = dense::real_times_complex(right_, y);
    VectorXcd out(static_cast<Eigen::Index>(static_.size() + dynamic_.size()));
    out(dynamic_) = x;
    if (static_.empty()) return x;
    VectorXcd rest = -dense::real_times_complex(follows_, x);
    if (free_.cols() > 0) {
      const VectorXcd force = -(dense::real_times_complex(k_, x) + l * dense::real_times_complex(c_, x) +
                                l * l * dense::real_times_complex(m_, x));
      rest += dense::real_times_complex(free_, dense::least_squares(pulls_.cast<Complex>(), force));
    }
    out(static_) = rest;
    return out;
  }

 private:
  [[nodiscard]] MatrixXd projected(const MatrixXd& a) const {
    return dense::times(dense::transposed_times(left_, a), right_);
  }

  std::vector<Eigen::Index> dynamic_, static_;
  MatrixXd k_, c_, m_, follows_, free_, pulls_, right_, left_;
};

/// Makes rows and columns of the same index about equal in length, by powers of two; the diagonal of D in D^-1 A D.
VectorXd balance(MatrixXd& a) {
  VectorXd d = VectorXd::Ones(a.rows());
  bool changed = true;
  for (int pass = 0; pass < 100 && changed; ++pass) {
    changed = false;
    for (Eigen::Index i = 0; i < a.rows(); ++i) {
      const double own = std::abs(a(i, i));
      const double column = a.col(i).lpNorm<1>() - own, row = a.row(i).lpNorm<1>() - own;
      if (!(column > 0) || !(row > 0)) continue;
      const double f = std::exp2(std::round(0.5 * std::log2(row / column)));
      if (column * f + row / f >= 0.95 * (column + row)) continue;
      changed = true;
      d[i] *= f;
      a.col(i) *= f;
      a.row(i) /= f;
    }
  }
  return d;
}

/// Infinite eigenvalues at least: null vectors of M, and those of C among them.
Eigen::Index infinite(const MatrixXd& c, const MatrixXd& m) {
  const Equilibrated scaled(m);
  const dense::SingularValues svd = dense::singular_values(scaled.a);
  const VectorXd& s = svd.values;
  const Eigen::Index null = s.size() - (s.array() > kDependent * std::max(s[0], kTiny)).count();
  if (null == 0) return 0;
  const MatrixXd u = scaled.rows.asDiagonal() * svd.u.rightCols(null);
  const MatrixXd v = scaled.columns.asDiagonal() * svd.v.rightCols(null);
  const MatrixXd inner = Equilibrated(dense::transposed_times(u, dense::times(c, v))).a;
  return null + (null - dense::rank_by_complete_pivoting(inner, kDependent));
}

/// How far pairs are from being solutions, in equilibrated rows and unknowns.
class Residuals {
 public:
  Residuals(const MatrixXd& k, const MatrixXd& c, const MatrixXd& m, const VectorXd& rows, const VectorXd& columns)
      : k_(rows.asDiagonal() * k * columns.asDiagonal()),
        c_(rows.asDiagonal() * c * columns.asDiagonal()),
        m_(rows.asDiagonal() * m * columns.asDiagonal()) {}
  /// The residual of z, x over its scale.
  [[nodiscard]] double operator()(Complex l, const VectorXcd& z) const {
    const double a = std::abs(l), size = a * a * m_norm_ + a * c_norm_ + k_norm_;
    return (dense::real_times_complex(k_, z) + l * dense::real_times_complex(c_, z) +
            l * l * dense::real_times_complex(m_, z))
               .norm() /
           (size * z.norm());
  }

 private:
  static double norm(const MatrixXd& a) { return a.cwiseAbs().rowwise().sum().maxCoeff(); }
  MatrixXd k_, c_, m_;
  double k_norm_ = norm(k_), c_norm_ = norm(c_), m_norm_ = norm(m_);
};

/// theta [x; y] = [-Q(s)^-1 ((C + 2 s M) x + M y); x], l = s + 1 / theta, in equilibrated unknowns x = E z.
struct Linearized {
  Linearized(const MatrixXd& k, const MatrixXd& c, const MatrixXd& m, double shift) {
    const Eigen::Index n = k.rows();
    const Equilibrated q(k + shift * c + shift * shift * m);
    const dense::Lu lu(q.a);
    if (!(lu.rcond() > kQuadraticEpsilon)) refuse_shift(shift);
    a = MatrixXd::Zero(2 * n, 2 * n);
    a.topLeftCorner(n, n) = -lu.solve(q.rows.asDiagonal() * (c + 2 * shift * m) * q.columns.asDiagonal());
    a.topRightCorner(n, n) = -lu.solve(q.rows.asDiagonal() * m * q.columns.asDiagonal());
    a.bottomLeftCorner(n, n).setIdentity();
    unscale = balance(a);
    rows = q.rows;
    columns = q.columns;
    order.resize(static_cast<std::size_t>(2 * n));
    std::iota(order.begin(), order.end(), Eigen::Index{0});
    const VectorXd size = a.cwiseAbs().rowwise().sum() + a.cwiseAbs().colwise().sum().transpose();
    // Large rows first: the QR algorithm then keeps small eigenvalues of graded matrices.
    std::stable_sort(order.begin(), order.end(), [&](Eigen::Index i, Eigen::Index j) { return size[i] > size[j]; });
    a = a(order, order).eval();
  }
  /// z of a vector of `a`.
  [[nodiscard]] VectorXcd unknowns(const VectorXcd& v) const {
    VectorXcd z(v.size());
    z(order) = v;
    return unscale.cast<Complex>().cwiseProduct(z).head(v.size() / 2);
  }
  MatrixXd a;
  VectorXd unscale, rows, columns;
  std::vector<Eigen::Index> order;
};

}  // namespace

MatrixXd dense_of(const SparseMatrix& a) {
  MatrixXd out = MatrixXd::Zero(a.rows, a.cols);
  for (Index j = 0; j < a.cols; ++j)
    for (auto p = static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(j)]);
         p < static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(j) + 1]); ++p)
      out(a.row_ind[p], j) += a.values[p];
  return out;
}

DenseQuadraticModes dense_quadratic_modes(const MatrixXd& k, const MatrixXd& c, const MatrixXd& m, double shift) {
  const Reduced reduced(k, c, m, shift);
  const MatrixXd rk = reduced.k(), rc = reduced.c(), rm = reduced.m();
  const Eigen::Index n = rk.rows();
  if (n == 0) return {};
  const Linearized linear(rk, rc, rm, shift);
  const dense::ComplexSpectrum eigen = dense::general_eigen(linear.a);
  if (!eigen.converged) throw Error(StatusCode::accuracy_not_reached, "the QR algorithm did not converge");
  const VectorXcd& theta = eigen.values;
  const MatrixXcd& vectors = eigen.vectors;
  std::vector<Eigen::Index> chosen(static_cast<std::size_t>(2 * n));
  std::iota(chosen.begin(), chosen.end(), Eigen::Index{0});
  std::stable_sort(chosen.begin(), chosen.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return std::abs(theta[a]) > std::abs(theta[b]); });
  chosen.resize(static_cast<std::size_t>(2 * n - std::min(2 * n, infinite(rc, rm))));
  const Residuals residual(rk, rc, rm, linear.rows, linear.columns);
  DenseQuadraticModes out;
  std::vector<VectorXcd> found;
  std::vector<Complex> values;
  for (const Eigen::Index i : chosen) {
    if (theta[i].imag() > 0) continue;
    const Complex l = shift + 1.0 / theta[i];
    const VectorXcd z = linear.unknowns(vectors.col(i));
    if (!(residual(l, z) <= kSeenResidual)) {
      ++out.unseen;
      continue;
    }
    values.push_back(l);
    found.push_back(reduced.expanded(l, linear.columns.cast<Complex>().cwiseProduct(z)));
  }
  out.eigenvalues = Eigen::Map<const VectorXcd>(values.data(), static_cast<Eigen::Index>(values.size()));
  out.vectors.resize(k.rows(), out.eigenvalues.size());
  for (std::size_t i = 0; i < found.size(); ++i) out.vectors.col(static_cast<Eigen::Index>(i)) = found[i];
  return out;
}

double polish_quadratic_pair(const MatrixXd& k, const MatrixXd& c, const MatrixXd& m, Complex& l, VectorXcd& x) {
  constexpr int kMostPasses = 5;
  constexpr double kEnough = 4 * kQuadraticEpsilon;
  const Complex begin = l;
  double before = 1;
  for (int pass = 0; pass < kMostPasses; ++pass) {
    const double a = std::abs(l);
    const VectorXd e = (k.diagonal().cwiseAbs() + a * c.diagonal().cwiseAbs() + a * a * m.diagonal().cwiseAbs())
                           .unaryExpr([](double y) { return y > 0 ? 1 / std::sqrt(y) : 1.0; });
    const MatrixXcd q = e.asDiagonal() * (k.cast<Complex>() + l * c + l * l * m) * e.asDiagonal();
    const VectorXcd z = x.cwiseQuotient(e.cast<Complex>());
    const VectorXcd slope =
        e.cast<Complex>().asDiagonal() * (dense::real_times_complex(c, x) + 2.0 * l * dense::real_times_complex(m, x));
    const VectorXcd w = dense::solve(q, slope);
    const Complex step = z.squaredNorm() / z.dot(w);
    const double change = std::abs(step) / std::max(a, kTiny);
    if (!std::isfinite(change) || !w.allFinite() || change > before) break;
    before = change;
    l -= step;
    x = e.cast<Complex>().cwiseProduct(w).normalized();
    if (change < kEnough) break;
  }
  return std::abs(l - begin) / std::max(std::abs(begin), kTiny);
}

}  // namespace espalier::modes
