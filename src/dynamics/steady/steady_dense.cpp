#include "dynamics/steady/steady_dense.hpp"

#include <algorithm>
#include <cmath>

#include "base/at.hpp"
#include "dense/dense.hpp"
#include "modes/dense_quadratic.hpp"

namespace espalier::dynamics {

namespace {

using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;

/// Orthonormal basis of the vectors z with A z = 0, A of full row rank.
MatrixXd steady_null_space(const MatrixXd& a) {
  if (a.rows() == 0) return MatrixXd::Identity(a.cols(), a.cols());
  return dense::qr_factors(a.transpose()).q.rightCols(a.cols() - a.rows());
}

/// x' = A x for x = (a, u / rate), and xi = xi_of a.
struct FirstOrder {
  MatrixXd a, xi_of;
  double noise = 0;  ///< of A, over its norm
};

std::optional<FirstOrder> first_order(const SteadyPencil& p) {
  const auto n = static_cast<Eigen::Index>(p.weights.size()), r = static_cast<Eigen::Index>(p.holonomic.size());
  const VectorXd weights = Eigen::Map<const VectorXd>(p.weights.data(), n);
  if (!(weights.minCoeff() > 0)) return std::nullopt;
  const VectorXd scale = weights.cwiseSqrt().cwiseInverse();  // in units of masses
  const MatrixXd k = modes::dense_of(p.stiffness), c = modes::dense_of(p.damping), m = modes::dense_of(p.mass);
  std::vector<Eigen::Index> held, rolling;
  for (Eigen::Index i = 0; i < r; ++i) (p.holonomic[at(i)] != 0 ? held : rolling).push_back(n + i);
  const auto own = [&](const MatrixXd& x) -> MatrixXd {
    return scale.asDiagonal() * x.topLeftCorner(n, n) * scale.asDiagonal();
  };
  const auto rows = [&](const MatrixXd& x, const std::vector<Eigen::Index>& which) -> MatrixXd {
    return x(which, Eigen::seqN(0, n)) * scale.asDiagonal();
  };
  const auto unit = [](MatrixXd x) -> MatrixXd { return x.rowwise().normalized(); };
  const MatrixXd z = steady_null_space(unit(rows(k, held)));
  const MatrixXd by_rate = dense::times(rows(c, rolling), z), by_place = dense::times(rows(k, rolling), z);
  const MatrixXd y = steady_null_space(unit(by_rate));
  MatrixXd drift = MatrixXd::Zero(z.cols(), z.cols());
  if (!rolling.empty()) drift = dense::least_squares(by_rate, by_place);
  const MatrixXd left = steady_null_space(unit((scale.asDiagonal() * k.topRightCorner(n, r)).transpose()));
  const auto projected = [&](const MatrixXd& x) { return dense::times(dense::transposed_times(left, own(x)), z); };
  const MatrixXd mz = projected(m), cz = projected(c), kz = projected(k);
  const dense::Lu inertia(dense::times(mz, y));
  if (y.cols() > 0 && !(inertia.rcond() > 1e-14)) return std::nullopt;
  const MatrixXd of_rate = inertia.solve(dense::times(mz, drift) - cz), of_place = inertia.solve(kz);
  const MatrixXd by_a = -dense::times(of_rate, drift) - of_place, by_u = dense::times(of_rate, y);
  const double rate = std::max(std::sqrt(by_a.norm()), by_u.norm()), unit_rate = rate > 0 ? rate : 1;
  FirstOrder out;
  const Eigen::Index na = z.cols(), nu = y.cols();
  out.a.resize(na + nu, na + nu);
  out.a << -drift, unit_rate * y, by_a / unit_rate, by_u;
  out.xi_of = scale.asDiagonal() * z;
  constexpr double kRounding = 2e-13, kDifferences = 2e-12;  // those of how rows change with places
  out.noise = rolling.empty() ? kRounding : kDifferences;
  return out;
}

/// x := Q z for coordinates that A does not lead to zero, with the part x = N w / l + ... of those that it does.
struct Deflated {
  MatrixXd null, rest, coupling;  // x = null w + rest y; w' = coupling y
};

}  // namespace

std::optional<std::vector<SteadyPair>> dense_steady_pairs(const SteadyPencil& p) {
  const std::optional<FirstOrder> system = first_order(p);
  if (!system) return std::nullopt;
  std::vector<SteadyPair> pairs;
  if (system->a.rows() == 0) return pairs;
  MatrixXd a = system->a;
  const double allowed = system->noise * a.norm();
  std::vector<Deflated> levels;
  MatrixXd all = MatrixXd::Identity(a.rows(), a.rows());  // x of the coordinates left
  while (a.rows() > 0) {
    const dense::RightSingularVectors svd = dense::right_singular_vectors(a);
    const Eigen::Index zero = (svd.values.array() <= allowed).count();
    if (zero == 0) break;
    const MatrixXd& v = svd.v;
    Deflated level{v.rightCols(zero), v.leftCols(v.cols() - zero), {}};
    const MatrixXd still = dense::times(system->xi_of, dense::times(all, level.null).topRows(system->xi_of.cols()));
    for (Eigen::Index i = 0; i < zero; ++i) pairs.push_back({0, still.col(i).cast<std::complex<double>>()});
    const MatrixXd of_rest = dense::times(a, level.rest);
    level.coupling = dense::transposed_times(level.null, of_rest);
    a = dense::transposed_times(level.rest, of_rest);
    all = dense::times(all, level.rest);
    levels.push_back(std::move(level));
  }
  if (a.rows() == 0) return pairs;
  const dense::ComplexSpectrum eigen = dense::general_eigen(a);
  if (!eigen.converged)
    throw Error(StatusCode::accuracy_not_reached, "modes of a steady motion: the QR algorithm did not converge");
  for (Eigen::Index i = 0; i < a.rows(); ++i) {
    const std::complex<double> e = eigen.values[i];
    if (e.imag() < 0) continue;
    VectorXcd x = eigen.vectors.col(i);
    for (auto level = levels.rbegin(); level != levels.rend(); ++level)
      x = (dense::real_times_complex(level->rest, x) +
           dense::real_times_complex(level->null, dense::real_times_complex(level->coupling, x)) / e)
              .eval();
    pairs.push_back({e, dense::real_times_complex(system->xi_of, x.head(system->xi_of.cols()))});
  }
  return pairs;
}

}  // namespace espalier::dynamics
