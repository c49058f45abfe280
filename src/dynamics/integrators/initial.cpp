#include "dynamics/integrators/initial.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/at.hpp"

namespace espalier::dynamics {

namespace {

struct Work {
  explicit Work(const Sizes& s) : n(at(s.velocity)), m(at(s.constraints)), b(n + m), f(n), level(m) {}
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

/// Largest |Phi_i| over the size of its terms.
double relative_violation(Equations& eq, ConstSpan q) {
  const std::vector<double> sizes = constraint_sizes(eq.system(), q, eq.phi_q());
  double worst = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const double part = std::abs(eq.phi()[i]) / sizes[i];
    if (!(part <= worst)) worst = part;  // not a number, too
  }
  return worst;
}

double project_position(Equations& eq, State& s, const ConsistencyOptions& o, Work& w, int& iterations) {
  std::vector<double> total(w.n, 0.0);
  double previous = std::numeric_limits<double>::infinity();
  for (int k = 0; k < o.max_iterations; ++k) {
    eq.evaluate_constraints(s.t, s.q, {});
    const double violation = relative_violation(eq, s.q);
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

void project_velocity(Equations& eq, State& s, const ConsistencyOptions& o, Work& w) {
  for (int k = 0; k < 3; ++k) {
    eq.level(s.v, eq.nu(), w.level);
    std::fill(w.b.begin(), w.b.end(), 0.0);
    for (std::size_t i = 0; i < w.m; ++i) w.lower()[i] = -w.level[i];
    eq.solve(w.b);
    for (std::size_t i = 0; i < w.n; ++i) s.v[i] += w.b[i];
  }
  eq.level(s.v, eq.nu(), w.level);
  if (!(max_norm(w.level) <= o.tolerance * 10 * std::max(1.0, max_norm(s.v)))) {
    fail_level(eq, w.level, "the velocity constraints", s.t);
  }
}

/// Diagonal of the mass matrix.
std::vector<double> masses(Equations& eq, const State& s) {
  const SparsePattern& p = eq.system().tangent_pattern();
  std::vector<double> values(at(p.nonzeros())), out(s.v.size(), 1.0);
  eq.system().tangent(s.view(), {1, 0, 0}, values);
  for (Index j = 0; j < p.cols; ++j)
    for (Offset k = p.ptr[at(j)]; k < p.ptr[at(j) + 1]; ++k)
      if (p.ind[at(k)] == j) out[at(j)] = std::abs(values[at(k)]);
  return out;
}

/// Velocities nearest to those given that satisfy the constraints, and agree with them at the marks: v + Z f with
/// forces f there, Z what the constraints leave of the inverse mass. The equations for f are solved by conjugate
/// gradients, scaled by masses, in as many steps as the marked motion has degrees of freedom. Where the constraints do
/// not allow for the given velocities, as near as they come.
/// @pre v satisfies the constraints, and the factor is that of the mass matrix
class KeptVelocities {
 public:
  KeptVelocities(Equations& eq, State& s, ConstSpan given, const std::vector<char>& kept, Work& w)
      : eq_(eq), s_(s), given_(given), kept_(kept), w_(w), mass_(masses(eq, s)) {}

  void run() {
    constexpr int kMostSteps = 200;
    constexpr double kStill = 1e-9;  // of the mobility without constraints
    std::vector<double> r = residual(), p(w_.n), best = s_.v;
    double squares = weighted(r, r), least = squares;
    for (std::size_t i = 0; i < w_.n; ++i) p[i] = mass_[i] * r[i];
    for (int step = 0; step < kMostSteps && squares > 1e-28 * weighted(given_, given_); ++step) {
      std::fill(w_.b.begin(), w_.b.end(), 0.0);
      for (std::size_t i = 0; i < w_.n; ++i) w_.b[i] = p[i];
      eq_.solve(w_.b);
      double moved = 0, free = 0;
      for (std::size_t i = 0; i < w_.n; ++i) {
        moved += p[i] * w_.b[i];
        free += p[i] * p[i] / mass_[i];
      }
      if (!(moved > kStill * free)) break;  // what is left contradicts the constraints
      for (std::size_t i = 0; i < w_.n; ++i) s_.v[i] += squares / moved * w_.b[i];
      r = residual();
      const double now = weighted(r, r);
      for (std::size_t i = 0; i < w_.n; ++i) p[i] = mass_[i] * r[i] + now / squares * p[i];
      squares = now;
      if (now >= least) continue;
      least = now;
      best = s_.v;
    }
    s_.v = best;
  }

 private:
  [[nodiscard]] std::vector<double> residual() const {
    std::vector<double> r(w_.n, 0.0);
    for (std::size_t i = 0; i < w_.n; ++i)
      if (kept_[i] != 0) r[i] = given_[i] - s_.v[i];
    return r;
  }
  [[nodiscard]] double weighted(ConstSpan a, ConstSpan b) const {
    double sum = 0;
    for (std::size_t i = 0; i < w_.n; ++i)
      if (kept_[i] != 0) sum += mass_[i] * a[i] * b[i];
    return sum;
  }

  Equations& eq_;
  State& s_;
  ConstSpan given_;
  const std::vector<char>& kept_;
  Work& w_;
  std::vector<double> mass_;
};

/// With those that are to be kept. @return the largest change
double find_velocities(Equations& eq, State& s, const ConsistencyOptions& o, Work& w) {
  const std::vector<double> given = s.v;
  project_velocity(eq, s, o, w);
  if (!o.kept_velocities.empty()) {
    KeptVelocities(eq, s, given, o.kept_velocities, w).run();
    project_velocity(eq, s, o, w);
  }
  double change = 0;
  for (std::size_t i = 0; i < w.n; ++i) change = std::max(change, std::abs(s.v[i] - given[i]));
  return change;
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

std::vector<char> length_coordinates(const System& system, ConstSpan q) {
  // An angle's magnitude is 1 whatever the configuration.
  std::vector<double> sizes(at(system.sizes().velocity)), other = sizes, moved(q.begin(), q.end());
  for (double& x : moved) x *= 1.01;
  system.magnitude(q, sizes);
  system.magnitude(moved, other);
  std::vector<char> marks(sizes.size());
  for (std::size_t i = 0; i < sizes.size(); ++i) marks[i] = sizes[i] != 1 || other[i] != 1 ? 1 : 0;
  return marks;
}

std::vector<double> coordinate_sizes(const System& system, ConstSpan q) {
  std::vector<double> sizes(at(system.sizes().velocity));
  system.magnitude(q, sizes);
  const std::vector<char> lengths = length_coordinates(system, q);
  double extent = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i)
    if (lengths[i] != 0) extent = std::max(extent, sizes[i]);
  for (std::size_t i = 0; i < sizes.size(); ++i)
    if (lengths[i] != 0) sizes[i] = extent > 0 ? extent : 1;
  return sizes;
}

std::vector<double> constraint_sizes(System& system, ConstSpan q, ConstSpan phi_q) {
  constexpr double kLeast = 1e-4;
  std::vector<double> magnitude(at(system.sizes().velocity));
  system.magnitude(q, magnitude);
  const SparsePattern& p = system.constraint_pattern();
  std::vector<double> sizes(at(p.rows), 0.0);
  for (std::size_t i = 0; i < sizes.size(); ++i)
    for (auto k = at(p.ptr[i]); k < at(p.ptr[i + 1]); ++k) sizes[i] += std::abs(phi_q[k]) * magnitude[at(p.ind[k])];
  const double least = kLeast * max_norm(sizes);
  for (double& size : sizes) size = least > 0 ? std::max(size, least) : 1;
  return sizes;
}

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
    result.velocity_change = find_velocities(equations, state, options, w);
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

}  // namespace espalier::dynamics
