/// \file
/// Systems whose frequency response is known, and a dense reference.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"

namespace espalier::test {

using Complex = std::complex<double>;
inline constexpr double kTwoPi = 2 * std::numbers::pi;
inline constexpr Complex kI{0, 1};

/// All entries, general storage.
inline SparseMatrix sparse(const Eigen::MatrixXd& a) {
  SparseMatrix out;
  out.rows = static_cast<Index>(a.rows());
  out.cols = static_cast<Index>(a.cols());
  out.col_ptr.push_back(0);
  for (Eigen::Index j = 0; j < a.cols(); ++j) {
    for (Eigen::Index i = 0; i < a.rows(); ++i)
      if (a(i, j) != 0) {
        out.row_ind.push_back(static_cast<Index>(i));
        out.values.push_back(a(i, j));
      }
    out.col_ptr.push_back(static_cast<Offset>(out.row_ind.size()));
  }
  return out;
}

inline SparseMatrix scalar(double x) { return sparse(Eigen::MatrixXd::Constant(1, 1, x)); }

inline HarmonicOptions range(double from, double to, Index points, double tolerance = 0) {
  HarmonicOptions o;
  o.from = from;
  o.to = to;
  o.points = points;
  o.tolerance = tolerance;
  o.solver.threads = 1;
  return o;
}

/// n masses in a row between two walls, springs and masses 1.
inline Eigen::MatrixXd chain(int n) {
  Eigen::MatrixXd k = 2 * Eigen::MatrixXd::Identity(n, n);
  for (int i = 1; i < n; ++i) k(i, i - 1) = k(i - 1, i) = -1;
  return k;
}

/// Responses by a dense L U of Eigen.
inline Eigen::MatrixXcd dense_response(const Eigen::MatrixXd& k, const Eigen::MatrixXd& c, const Eigen::MatrixXd& m,
                                       double eta, const Eigen::MatrixXcd& f, double frequency) {
  const double w = kTwoPi * frequency;
  const Eigen::MatrixXcd z =
      k.cast<Complex>() * Complex(1, eta) + kI * w * c.cast<Complex>() - w * w * m.cast<Complex>();
  return z.partialPivLu().solve(f);
}

inline std::vector<Complex> flat(const Eigen::MatrixXcd& f) { return {f.data(), f.data() + f.size()}; }

/// The largest error of all points without a failure: relative to the magnitude, but not below a hundredth of a
/// response's median.
inline double worst_error(const HarmonicResult& r, const std::function<Eigen::MatrixXcd(double)>& truth) {
  std::vector<Eigen::MatrixXcd> exact;
  Eigen::MatrixXd medians(r.outputs, r.loads);
  for (const HarmonicPoint& p : r.points) exact.push_back(truth(p.frequency));
  for (Index l = 0; l < r.loads; ++l)
    for (Index o = 0; o < r.outputs; ++o) {
      std::vector<double> sizes;
      for (std::size_t i = 0; i < r.points.size(); ++i)
        if (r.points[i].status.ok()) sizes.push_back(std::abs(exact[i](o, l)));
      if (sizes.empty()) return 0;
      std::nth_element(sizes.begin(), sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2), sizes.end());
      medians(o, l) = sizes[sizes.size() / 2];
    }
  double worst = 0;
  for (std::size_t i = 0; i < r.points.size(); ++i) {
    if (!r.points[i].status.ok()) continue;
    for (Index l = 0; l < r.loads; ++l)
      for (Index o = 0; o < r.outputs; ++o) {
        const double size = std::max(std::abs(exact[i](o, l)), 0.01 * medians(o, l));
        const double e = std::abs(r.response(i, l, o) - exact[i](o, l)) / size;
        worst = std::max(worst, std::isfinite(e) ? e : INFINITY);
      }
  }
  return worst;
}

}  // namespace espalier::test
