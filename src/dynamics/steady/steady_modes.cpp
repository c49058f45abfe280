#include "dynamics/steady/steady_modes.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "base/at.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/steady/steady_dense.hpp"
#include "dynamics/steady/steady_pencil.hpp"
#include "espalier/solver.hpp"
#include "modes/dense_quadratic.hpp"

namespace espalier::dynamics {

namespace {

SparseMatrix sum_at(const SteadyPencil& p, double s) {
  EntrySums out(p.mass.cols);
  for (const auto& [a, factor] : {std::pair{&p.mass, s * s}, {&p.damping, s}, {&p.stiffness, 1.0}})
    for (Index j = 0; j < a->cols; ++j)
      for (Offset k = a->col_ptr[at(j)]; k < a->col_ptr[at(j + 1)]; ++k)
        out.add(a->row_ind[at(k)], j, factor * a->values[at(k)]);
  return out.matrix();
}

/// xi under forces that are random numbers in units of masses, growing with exp(s t), in units of masses.
Eigen::VectorXd response(const SteadyPencil& p, double s, const Options& options) {
  SparseMatrix q = sum_at(p, s);
  q.storage = Storage::general;
  std::vector<double> b(at(q.rows), 0.0);
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> amount(-1, 1);
  for (std::size_t i = 0; i < p.weights.size(); ++i) b[i] = std::sqrt(p.weights[i]) * amount(random);
  Options own = options;
  own.kind = Kind::lu;
  own.device = "cpu";
  Solver solver(own);
  Status status = solver.analyze(q).status;
  if (status.ok()) status = solver.factorize(q).status;
  if (status.ok()) status = solver.solve(b, b).status;
  if (!status.ok()) throw Error(status.code, "modes of a steady motion: " + status.message);
  Eigen::VectorXd x(static_cast<Eigen::Index>(p.weights.size()));
  for (std::size_t i = 0; i < p.weights.size(); ++i) x[static_cast<Eigen::Index>(i)] = std::sqrt(p.weights[i]) * b[i];
  return x;
}

/// The state a time later, or before, to second order.
State after(Equations& equations, const State& s, double time) {
  State moved = s;
  std::vector<double> way(s.v.size());
  for (std::size_t i = 0; i < way.size(); ++i) {
    way[i] = time * (s.v[i] + 0.5 * time * s.a[i]);
    moved.v[i] = s.v[i] + time * s.a[i];
  }
  equations.system().retract(s.q, way, moved.q);
  moved.t = s.t + time;
  ConsistencyOptions options;
  options.tolerance = 1e-11;
  make_consistent(equations, moved, options);
  return moved;
}

Mat3 turn_by(const Vec3& angle) { return rotation_matrix(quaternion_exp(angle)); }

/// By how much responses change while the fastest body turns by a radian, in parts. What cannot be followed that far is
/// not steady.
double unsteadiness(Equations& equations, SteadyProblem& problem, const State& s, const Vec3& rate, double fastest,
                    const Options& solver) {
  constexpr double kTurn = 1e-3;
  const double time = kTurn / fastest;
  double worst = 0;
  try {
    const State before = after(equations, s, -time), later = after(equations, s, time);
    const SteadyPencil a = problem.pencil(before, rate, turn_by(-time * rate)),
                       b = problem.pencil(later, rate, turn_by(time * rate));
    for (const double growth : {0.7, 3.1}) {
      const Eigen::VectorXd x = response(a, growth * fastest, solver), y = response(b, growth * fastest, solver);
      const double change = (x - y).norm() / (2 * kTurn * std::max(x.norm(), 1e-300));
      if (!(change <= worst)) worst = change;
    }
  } catch (const Error& error) {
    const StatusCode code = error.status().code;
    if (code == StatusCode::out_of_memory || code == StatusCode::cancelled || code == StatusCode::device_error) throw;
    return std::numeric_limits<double>::infinity();
  }
  return worst;
}

/// A real number next to zero, at a distance that factors see.
double shift_of(const SteadyPencil& p, double fastest) {
  std::vector<double> ratios;
  for (std::size_t j = 0; j < p.weights.size(); ++j)
    for (Offset k = p.stiffness.col_ptr[j]; k < p.stiffness.col_ptr[j + 1]; ++k)
      if (at(p.stiffness.row_ind[at(k)]) == j && p.weights[j] > 0 && p.stiffness.values[at(k)] != 0)
        ratios.push_back(std::abs(p.stiffness.values[at(k)]) / p.weights[j]);
  double typical = 0;
  if (!ratios.empty()) {
    const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
    std::nth_element(ratios.begin(), middle, ratios.end());
    typical = std::sqrt(*middle);
  }
  return -(0.0123456789 * fastest + 1e-4 * typical);
}

/// The whirl of complex paths in the plane across the axis, weighted by masses and inertias: 1 where all go round with
/// it, -1 against it.
double whirl_of(const SteadyProblem& problem, const SteadyPencil& p, const Eigen::VectorXcd& xi, const Vec3& axis) {
  if (!(axis.norm() > 0)) return 0;
  const Vec3 z = axis.normalized(), x = z.unitOrthogonal(), y = z.cross(x);
  double area = 0, size = 0, whole = 0;
  for (const VectorCoordinates& v : problem.vectors()) {
    if (v.kind == VectorCoordinates::Kind::direction) continue;
    const Eigen::Vector3cd u = xi.segment<3>(v.v);
    const std::complex<double> a = x.cast<std::complex<double>>().dot(u), b = y.cast<std::complex<double>>().dot(u);
    const double m = p.weights[at(v.v)];
    area += m * 2 * std::imag(a * std::conj(b));
    size += m * (std::norm(a) + std::norm(b));
    whole += m * u.squaredNorm();
  }
  constexpr double kAcross = 1e-6;
  return size > kAcross * whole ? area / size : 0;
}

double standing(double frequency, double whirl, double turns) {
  constexpr double kCircle = 1e-3;
  if (turns == 0) return whirl < 0 ? -frequency : frequency;
  if (whirl == 0) return frequency;
  if (std::abs(whirl) < 1 - kCircle) return std::numeric_limits<double>::quiet_NaN();
  return whirl > 0 ? frequency + turns : turns - frequency;
}

SteadyMode mode_of(const SteadyProblem& problem, const SteadyPencil& p, std::complex<double> e,
                   const Eigen::VectorXcd& xi, const Vec3& axis, bool turning) {
  SteadyMode out;
  const double modulus = std::abs(e);
  out.mode.eigenvalue = e;
  out.mode.frequency = std::abs(e.imag()) / (2 * std::numbers::pi);
  out.mode.damping_ratio = modulus > 0 ? (0 - e.real()) / modulus : 0;
  Eigen::Index largest = 0;
  const Eigen::Index n = static_cast<Eigen::Index>(p.weights.size());
  xi.head(n).cwiseAbs().maxCoeff(&largest);
  const Eigen::VectorXcd turned = xi.head(n) / xi[largest];
  out.mode.shape.assign(p.weights.size(), 0.0);
  for (Index j = 0; j < static_cast<Index>(n); ++j)  // dq = S^T xi
    p.axes.column(j, [&](Index i, double value) { out.mode.shape[at(j)] += value * turned[i].real(); });
  out.whirl = e.imag() != 0 ? whirl_of(problem, p, xi.head(n), axis) : 0;
  out.standing_frequency = standing(out.mode.frequency, out.whirl, turning ? axis.norm() / (2 * std::numbers::pi) : 0);
  return out;
}

/// The speed of what moves without a turn.
double speed_over_extent(const System& system, const State& s) {
  const std::vector<double> sizes = coordinate_sizes(system, s.q);
  double most = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i) most = std::max(most, std::abs(s.v[i]) / sizes[i]);
  return std::max(most, 1e-300);
}

std::string axes_notice(const Vec3& rate, const Vec3& axis, double change) {
  if (rate.norm() > 0)
    return fmt::format(
        "initial.modes: small motions about the steady motion, seen from axes that turn with it ({:.6g}, {:.6g}, "
        "{:.6g} rad per unit of time); seen from axes at rest, what circles has the standing frequency",
        rate.x(), rate.y(), rate.z());
  return fmt::format("initial.modes: small motions about the steady motion, seen from axes at rest{}",
                     axis.norm() > 0 && change > 1e-7
                         ? fmt::format(" (their coefficients change by {:.1e} of them in a radian)", change)
                         : std::string());
}

/// The slowest; of `zeros` eigenvalues of zero, two for a motion that nothing resists, one for each motion: rounding
/// makes pairs of them, or none.
std::vector<SteadyPair> ordered(std::vector<SteadyPair> pairs, Index zeros, Index count) {
  std::stable_sort(pairs.begin(), pairs.end(), [](const SteadyPair& a, const SteadyPair& b) {
    return std::abs(a.eigenvalue) < std::abs(b.eigenvalue);
  });
  const auto first = std::find_if(pairs.begin(), pairs.end(), [](const SteadyPair& x) { return x.eigenvalue != 0.0; });
  const auto kept = std::min<std::ptrdiff_t>((zeros + 1) / 2, first - pairs.begin());
  pairs.erase(pairs.begin() + kept, first);
  pairs.resize(std::min(at(count), pairs.size()));
  return pairs;
}

/// Slow motions beside stiff ones, to their own rounding. xi: with multipliers
void polish(const SteadyPencil& p, std::vector<SteadyPair>& pairs) {
  constexpr Index kMost = 200;  // rows
  if (p.stiffness.rows > kMost) return;
  const Eigen::MatrixXd k = espalier::modes::dense_of(p.stiffness), c = espalier::modes::dense_of(p.damping),
                        m = espalier::modes::dense_of(p.mass);
  for (SteadyPair& pair : pairs)
    if (pair.eigenvalue != 0.0) espalier::modes::polish_quadratic_pair(k, c, m, pair.eigenvalue, pair.xi);
}

/// The pairs of few coordinates that roll by the dense method: their constraints stand in C, and the search would meet
/// eigenvalues that are infinite but for rounding.
std::vector<SteadyPair> pairs_of(const SteadyPencil& p, Index count, double fastest, const Options& solver,
                                 std::string& notice) {
  constexpr Index kDense = 300;
  constexpr double kNothing = 1e-6;
  const bool rolls = std::find(p.holonomic.begin(), p.holonomic.end(), 0) != p.holonomic.end();
  if (rolls && static_cast<Index>(p.weights.size()) <= kDense)
    if (std::optional<std::vector<SteadyPair>> all = dense_steady_pairs(p)) {
      const auto zeros =
          std::count_if(all->begin(), all->end(), [](const SteadyPair& x) { return x.eigenvalue == 0.0; });
      return ordered(*std::move(all), static_cast<Index>(zeros), count);
    }
  QuadraticModesOptions options;
  constexpr Index kAll = 150;   // rows up to which all are found, two for each
  constexpr Index kRigid = 14;  // motions that nothing resists: two eigenvalues of zero each
  options.count = count + kRigid;
  if (options.count > p.stiffness.rows && p.stiffness.rows > kAll) options.count = p.stiffness.rows;
  options.solver = solver;
  options.shift = shift_of(p, fastest);
  const QuadraticModesResult found = find_quadratic_modes(p.stiffness, p.damping, p.mass, options);
  if (!found.status.ok() && found.count() == 0)
    throw Error(found.status.code, "modes of a steady motion: " + found.status.message);
  if (!found.status.ok()) notice = "; " + found.status.message;
  double largest = 0;
  for (const std::complex<double> e : found.eigenvalues) largest = std::max(largest, std::abs(e));
  std::vector<SteadyPair> pairs;
  Index zeros = 0;
  for (Index i = 0; i < found.count(); ++i) {
    const std::complex<double> e = found.eigenvalues[at(i)];
    const Eigen::Map<const Eigen::VectorXcd> x(found.vectors.data() + Offset{i} * found.n, found.n);
    const bool nothing = std::abs(e) <= kNothing * largest;
    if (nothing) zeros += e.imag() != 0 ? 2 : 1;
    pairs.push_back({nothing ? 0 : e, x});
  }
  pairs = ordered(std::move(pairs), zeros, count);
  polish(p, pairs);
  for (SteadyPair& pair : pairs) pair.xi.conservativeResize(static_cast<Eigen::Index>(p.weights.size()));
  return pairs;
}

}  // namespace

SteadyModes steady_modes(Equations& equations, const AssembledSystem& system, const State& state, Index count,
                         const Options& solver) {
  constexpr double kSteady = 1e-5;
  SteadyModes out;
  SteadyProblem problem(equations, system, state.q);
  const std::vector<Vec3> rates = problem.rates(state);
  const Vec3 axis = rates.empty() ? Vec3(Vec3::Zero()) : rates.front();
  const double fastest = rates.empty() ? speed_over_extent(system, state) : axis.norm();
  std::vector<Vec3> candidates = {Vec3::Zero()};
  candidates.insert(candidates.end(), rates.begin(), rates.end());
  constexpr std::size_t kMost = 4;
  double change = 0;
  bool steady = false;
  for (std::size_t k = 0; k < std::min(kMost, candidates.size()) && !steady; ++k) {
    out.rate = candidates[k];
    change = unsteadiness(equations, problem, state, out.rate, fastest, solver);
    steady = change <= kSteady;
  }
  if (!steady) {
    equations.evaluate_constraints(state.t, state.q, state.v);
    out.notice = fmt::format(
        "(what small motions feel changes by {:.1e} of it while the fastest body turns by a radian)", change);
    return out;
  }
  const SteadyPencil p = problem.pencil(state, out.rate, Mat3::Identity());
  for (const SteadyPair& pair : pairs_of(p, count, fastest, solver, out.notice))
    out.modes.push_back(mode_of(problem, p, pair.eigenvalue, pair.xi, axis, out.rate.norm() > 0));
  out.notice = axes_notice(out.rate, axis, change) + out.notice;
  equations.evaluate_constraints(state.t, state.q, state.v);
  return out;
}

}  // namespace espalier::dynamics
