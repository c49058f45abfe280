#include "dynamics/integrators/initial.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace espalier::dynamics {

namespace {

struct Work {
  explicit Work(const Sizes& s)
      : n(static_cast<std::size_t>(s.velocity)), m(static_cast<std::size_t>(s.constraints)), b(n + m), f(n), level(m) {}
  [[nodiscard]] Span upper() { return Span(b).first(n); }
  [[nodiscard]] Span lower() { return Span(b).subspan(n); }
  std::size_t n, m;
  std::vector<double> b, f, level;
};

[[noreturn]] void fail_level(Equations& eq, ConstSpan violation, const char* what, double t) {
  std::size_t worst = 0;
  for (std::size_t i = 0; i < violation.size(); ++i) {
    if (!(std::abs(violation[i]) <= std::abs(violation[worst]))) worst = i;
  }
  throw Error(StatusCode::invalid_input, std::string(what) + " cannot be satisfied at t = " + std::to_string(t) + ": " +
                                             eq.system().constraint_name(static_cast<Index>(worst)) +
                                             " keeps a violation of " +
                                             std::to_string(violation.empty() ? 0.0 : violation[worst]) +
                                             "; check initial positions and contradictory joints");
}

double project_position(Equations& eq, State& s, const ConsistencyOptions& o, Work& w, int& iterations) {
  std::vector<double> total(w.n, 0.0);
  double previous = std::numeric_limits<double>::infinity();
  for (int k = 0; k < o.max_iterations; ++k) {
    eq.evaluate_constraints(s.t, s.q, {});
    const double violation = max_norm(eq.phi());
    // Round-off ends the iteration a little above a very small tolerance.
    if (violation <= o.tolerance && (violation == 0 || violation > 0.5 * previous || violation < 1e-3 * o.tolerance)) {
      return max_norm(total);
    }
    if (violation <= o.tolerance) previous = violation;
    if (!std::isfinite(violation)) break;
    ++iterations;
    eq.factorize(s.view(), {1, 0, 0});
    std::fill(w.b.begin(), w.b.end(), 0.0);
    for (std::size_t i = 0; i < w.m; ++i) w.lower()[i] = -eq.phi()[i];
    eq.solve(w.b);
    eq.system().retract(s.q, w.upper(), s.q);
    for (std::size_t i = 0; i < w.n; ++i) total[i] += w.b[i];
  }
  fail_level(eq, eq.phi(), "the position constraints", s.t);
}

double project_velocity(Equations& eq, State& s, const ConsistencyOptions& o, Work& w) {
  std::vector<double> total(w.n, 0.0);
  for (int k = 0; k < 3; ++k) {
    eq.level(s.v, eq.nu(), w.level);
    std::fill(w.b.begin(), w.b.end(), 0.0);
    for (std::size_t i = 0; i < w.m; ++i) w.lower()[i] = -w.level[i];
    eq.solve(w.b);
    for (std::size_t i = 0; i < w.n; ++i) {
      s.v[i] += w.b[i];
      total[i] += w.b[i];
    }
  }
  eq.level(s.v, eq.nu(), w.level);
  if (!(max_norm(w.level) <= o.tolerance * 10 * std::max(1.0, max_norm(s.v)))) {
    fail_level(eq, w.level, "the velocity constraints", s.t);
  }
  return max_norm(total);
}

void solve_accelerations(Equations& eq, State& s, const ConsistencyOptions& o, Work& w) {
  double previous = std::numeric_limits<double>::infinity(), first = 0;
  // Forces that depend on multipliers (friction) are not linear in them: a true Newton iteration.
  const bool linear = eq.system().multiplier_pattern() == nullptr;
  for (int k = 0; k < o.max_iterations; ++k) {
    eq.motion(s.view(), w.f);
    eq.level(s.a, eq.gamma(), w.level);
    for (std::size_t i = 0; i < w.n; ++i) w.b[i] = -w.f[i];
    for (std::size_t i = 0; i < w.m; ++i) w.lower()[i] = -w.level[i];
    const double size = std::max(max_norm(w.f), max_norm(w.level));
    if (!std::isfinite(size))
      throw Error(StatusCode::invalid_input, "forces are not finite at t = " + std::to_string(s.t));
    if (k == 0) first = size;
    if (size == 0 || (k > 1 && size >= 0.5 * previous && (linear || size <= 1e-9 * first))) return;
    previous = size;
    if (k > 0 && !linear) eq.factorize(s.view(), {1, 0, 0});
    eq.solve(w.b);
    for (std::size_t i = 0; i < w.n; ++i) s.a[i] += w.b[i];
    for (std::size_t i = 0; i < w.m; ++i) s.lambda[i] += w.b[w.n + i];
  }
  if (!linear && previous > 1e-6 * first)
    throw Error(
        StatusCode::accuracy_not_reached,
        fmt::format("no accelerations and reactions were found at t = {:g} that fit each other: friction that is "
                    "so strong may lock; make coefficients smaller",
                    s.t));
}

void refuse(double change, double allowed, const char* what) {
  if (change > allowed) {
    throw Error(StatusCode::invalid_input, std::string("the given ") + what +
                                               " contradict the constraints: they had to change by " +
                                               std::to_string(change) + ", allowed are " + std::to_string(allowed));
  }
}

}  // namespace

ConsistencyResult make_consistent(Equations& equations, State& state, const ConsistencyOptions& options) {
  Work w(equations.sizes());
  ConsistencyResult result;
  if (w.m > 0) {
    result.position_change = project_position(equations, state, options, w, result.iterations);
    refuse(result.position_change, options.allowed_position, "positions");
  }
  equations.evaluate_constraints(state.t, state.q, {});
  equations.factorize(state.view(), {1, 0, 0});
  if (w.m > 0) {
    result.velocity_change = project_velocity(equations, state, options, w);
    refuse(result.velocity_change, options.allowed_velocity, "velocities");
  }
  for (std::size_t i = 0; i < w.m; ++i) {
    if (equations.dropped()[i]) state.lambda[i] = 0;
  }
  equations.evaluate_constraints(state.t, state.q, state.v);
  solve_accelerations(equations, state, options, w);
  result.levels = equations.levels(state.view());
  return result;
}

namespace {

Eigen::MatrixXd dense_w(const SparsePattern& p, ConstSpan values) {
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(p.rows, p.cols);
  for (Index j = 0; j < p.cols; ++j) {
    for (auto k = static_cast<std::size_t>(p.ptr[static_cast<std::size_t>(j)]);
         k < static_cast<std::size_t>(p.ptr[static_cast<std::size_t>(j) + 1]); ++k) {
      a(p.ind[k], j) = values[k];
    }
  }
  return a;
}

// Orthonormal basis of the null space of Phi_q, by QR with column pivoting of its transpose (redundant rows allowed).
Eigen::MatrixXd null_space(const SparsePattern& p, ConstSpan values) {
  Eigen::MatrixXd g = Eigen::MatrixXd::Zero(p.rows, p.cols);
  for (Index i = 0; i < p.rows; ++i) {
    for (auto k = static_cast<std::size_t>(p.ptr[static_cast<std::size_t>(i)]);
         k < static_cast<std::size_t>(p.ptr[static_cast<std::size_t>(i) + 1]); ++k) {
      g(i, p.ind[k]) = values[k];
    }
  }
  return dense::null_space(g, 1e-10);
}

}  // namespace

std::vector<double> real_shape(const Eigen::VectorXcd& x) {
  Eigen::Index at = 0;
  const double largest = x.size() > 0 ? x.cwiseAbs().maxCoeff(&at) : 0.0;
  std::vector<double> shape(static_cast<std::size_t>(x.size()), 0.0);
  if (!(largest > 0)) return shape;
  const std::complex<double> turn = 1.0 / x[at];
  for (std::size_t i = 0; i < shape.size(); ++i) shape[i] = (turn * x[static_cast<Eigen::Index>(i)]).real();
  return shape;
}

std::vector<Mode> eigenfrequencies(Equations& equations, const State& state) {
  System& system = equations.system();
  const SparsePattern& p = system.tangent_pattern();
  std::vector<double> values(static_cast<std::size_t>(p.nonzeros()));
  const auto part = [&](const TangentWeights& weights) {
    system.tangent(state.view(), weights, values);
    return dense_w(p, values);
  };
  equations.evaluate_constraints(state.t, state.q, {});
  const Eigen::MatrixXd basis = null_space(system.constraint_pattern(), equations.phi_q());
  const Eigen::MatrixXd mass = basis.transpose() * part({1, 0, 0}) * basis;
  const Eigen::MatrixXd damping = basis.transpose() * part({0, 1, 0}) * basis;
  const Eigen::MatrixXd stiffness = basis.transpose() * part({0, 0, 1}) * basis;
  const Eigen::Index n = basis.cols();
  if (n == 0) return {};
  const dense::Lu lu(mass);
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  companion.topRightCorner(n, n).setIdentity();
  companion.bottomLeftCorner(n, n) = -lu.solve(stiffness);
  companion.bottomRightCorner(n, n) = -lu.solve(damping);
  const dense::ComplexSpectrum eigen = dense::general_eigen(companion);
  const Eigen::VectorXcd& eigenvalues = eigen.values;
  const Eigen::MatrixXcd vectors = eigen.vectors.topRows(n);
  std::vector<Mode> modes;
  const double largest = eigenvalues.cwiseAbs().maxCoeff();
  for (Eigen::Index k = 0; k < eigenvalues.size(); ++k) {
    const std::complex<double> e = eigenvalues[k];
    if (e.imag() < -1e-14 * largest) continue;
    const double modulus = std::abs(e);
    modes.push_back({e, std::abs(e.imag()) / (2 * std::numbers::pi), modulus > 0 ? -e.real() / modulus : 0.0,
                     real_shape(basis * vectors.col(k))});
  }
  std::sort(modes.begin(), modes.end(),
            [](const Mode& a, const Mode& b) { return std::abs(a.eigenvalue) < std::abs(b.eigenvalue); });
  return modes;
}

}  // namespace espalier::dynamics
