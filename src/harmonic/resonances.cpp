#include "harmonic/resonances.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dense/dense.hpp"
#include "espalier/modes.hpp"

namespace espalier::harmonic {
namespace {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Matrix = DynamicStiffness::Matrix;

constexpr double kTwoPi = 2 * std::numbers::pi;
constexpr double kSharpest = 1e-9;  // half width of a mode without damping, over its frequency

MatrixXd projected(const DynamicStiffness& z, Matrix part, const Eigen::Map<const MatrixXd>& x) {
  MatrixXd ax(x.rows(), x.cols());
  for (Eigen::Index c = 0; c < x.cols(); ++c) z.product(part, x.col(c).data(), ax.col(c).data());
  return dense::transposed_times(x, ax);
}

// Eigenvalues l and vectors of l^2 M + l C + K, from l [z; l z] = [0 I; -M^-1 K -M^-1 C] [z; l z].
struct Damped {
  Eigen::VectorXcd values;
  MatrixXcd vectors;
};

Damped damped_modes(const MatrixXcd& k, const MatrixXcd& c, const MatrixXcd& m) {
  const Eigen::Index q = k.rows();
  MatrixXcd a = MatrixXcd::Zero(2 * q, 2 * q);
  MatrixXcd both(q, 2 * q);
  both << k, c;
  both = dense::solve(m, both);
  // In units of the largest frequency, so that both halves of a vector count alike.
  const double unit = std::sqrt(std::max(1e-300, both.leftCols(q).cwiseAbs().maxCoeff()));
  a.topRightCorner(q, q).setIdentity();
  a.bottomLeftCorner(q, q) = -both.leftCols(q) / (unit * unit);
  a.bottomRightCorner(q, q) = -both.rightCols(q) / unit;
  const dense::ComplexSpectrum eigen = dense::general_eigen(a);
  if (!eigen.converged) return {};  // resonances only guide where frequencies are sampled
  return {eigen.values * unit, eigen.vectors.topRows(q)};
}

}  // namespace

Resonances find_resonances(const DynamicStiffness& z, std::span<const Complex> loads, Index columns, const Sweep& sweep,
                           double from, double to, const HarmonicOptions& options) {
  Resonances out;
  ModesOptions o;
  o.below = std::pow(kTwoPi * to, 2);
  o.solver = options.solver;
  const ModesResult found = find_modes(z.symmetric_part(Matrix::stiffness), z.symmetric_part(Matrix::mass), o);
  const StatusCode code = found.status.code;
  if (code == StatusCode::out_of_memory || code == StatusCode::device_error || code == StatusCode::cancelled)
    throw Error(found.status);
  out.complete = found.complete && z.symmetric();
  out.completeness = !found.status.ok() ? "the modes could not be found: " + found.status.message
                     : z.symmetric()    ? found.completeness
                                        : "the matrices are not symmetric: modes of their symmetric parts are a guide";
  if (found.count() == 0) return out;
  const Eigen::Map<const MatrixXd> x(found.vectors.data(), found.n, found.count());
  MatrixXcd k = projected(z, Matrix::stiffness, x) * Complex(1, z.loss_factor());
  if (z.structural()) k += projected(z, Matrix::structural, x) * Complex(0, 1);
  const Damped modes = damped_modes(k, projected(z, Matrix::damping, x), projected(z, Matrix::mass, x));
  const Eigen::Map<const MatrixXcd> f(loads.data(), found.n, columns);
  MatrixXcd observed(static_cast<Eigen::Index>(sweep.observed()), x.cols());
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    const Eigen::VectorXcd mode = x.col(j).cast<Complex>();
    sweep.observer().observe(std::sqrt(std::max(0.0, found.eigenvalues[static_cast<std::size_t>(j)])), -1, mode.data(),
                             observed.col(j).data());
  }
  const MatrixXcd xf = x.transpose() * f;
  for (Eigen::Index i = 0; i < modes.values.size(); ++i) {
    const Complex l = modes.values[i];
    // i w = l: the peak is at the imaginary part, and as wide as the real part is large.
    const double frequency = l.imag() / kTwoPi, width = std::abs(l.real()) / kTwoPi;
    if (!(frequency > from && frequency < to) || width > frequency) continue;
    Resonance r;
    r.frequency = frequency;
    r.half_width = std::max(width, kSharpest * frequency);
    // y = v (u^T f) / (2 w (w_i - w)), v normalised in M; left vectors are taken for the right ones.
    const Eigen::VectorXcd u = modes.vectors.col(i) / modes.vectors.col(i).norm();
    const double height = 1 / (2 * l.imag() * kTwoPi * r.half_width);
    r.peak = ((observed * u).cwiseAbs() * (u.transpose() * xf).cwiseAbs()) * height;
    out.all.push_back(std::move(r));
  }
  std::sort(out.all.begin(), out.all.end(),
            [](const Resonance& a, const Resonance& b) { return a.frequency < b.frequency; });
  return out;
}

}  // namespace espalier::harmonic
