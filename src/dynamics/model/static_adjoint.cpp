#include "dynamics/model/static_adjoint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace espalier::dynamics::model {

namespace {

constexpr double kStep = 1e-5;        // of the extent of the model, of the largest multiplier
constexpr double kProbeStep = 1e-4;   // likewise, of moves that are to change a bit
constexpr double kDefectStep = 3e-4;  // likewise: bent bodies resist their stretching with much of its square

// By four values of a function at -2, -1, 1 and 2 steps.
template <class Function>
double difference(double step, const Function& f) {
  return (8 * (f(step) - f(-step)) - (f(2 * step) - f(-2 * step))) / (12 * step);
}

}  // namespace

StaticAdjoint::StaticAdjoint(Mechanism& mechanism, Equations& equations, const State& state,
                             const std::vector<Quantity>& quantities, double load, Options options)
    : mechanism_(mechanism), state_(state), load_(load), dropped_(equations.dropped()), scene_(mechanism) {
  const Linearised a = linearise(equations, state);
  rows_ = a.rows;
  n_ = static_cast<std::size_t>(a.n);
  const double largest = max_norm(state.lambda);
  multiplier_step_ = largest > 0 ? largest : 1;
  options.kind = Kind::lu;  // general storage, as that of every Newton matrix
  Solver solver(std::move(options));
  const AnalysisResult analysis = solver.analyze(a.stiffness);
  if (!analysis.status.ok()) throw Error(analysis.status.code, "adjoint: " + analysis.status.message);
  const FactorResult factor = solver.factorize(a.stiffness);
  if (!factor.status.ok())
    throw Error(factor.status.code, "adjoint: the stiffness at the equilibrium: " + factor.status.message);
  for (const Quantity& q : quantities) {
    std::vector<double> y = gradient(q);
    const SolveResult solved = solver.solve(y, y, 1, Transpose::yes);
    if (!solved.status.ok()) throw Error(solved.status.code, "adjoint: " + solved.status.message);
    y_.push_back(std::move(y));
  }
  measure_defect(solver);
}

std::vector<double> StaticAdjoint::residual(Mechanism& mechanism) const {
  Equations equations(mechanism.system, nullptr, &mechanism.pool);
  equations.set_dropped(dropped_);
  std::vector<double> r(n_);
  equations.evaluate_constraints(state_.t, state_.q, {});
  equations.motion(state_.view(), r);
  for (const Index row : rows_) r.push_back(equations.phi()[static_cast<std::size_t>(row)]);
  return r;
}

double StaticAdjoint::value(const Quantity& quantity, const State& state) const {
  Sample s{&state, {}};
  s.load = load_;
  return quantity.value(s);
}

std::vector<double> StaticAdjoint::values(const std::vector<Quantity>& quantities) const {
  std::vector<double> out;
  for (const Quantity& q : quantities) out.push_back(value(q, state_));
  return out;
}

std::vector<double> StaticAdjoint::along(const std::vector<double>& change) const {
  std::vector<double> out;
  for (const std::vector<double>& y : y_) {
    double sum = 0;
    for (std::size_t i = 0; i < y.size(); ++i) sum += y[i] * change[i];
    out.push_back(sum);
  }
  return out;
}

// x (+) step, multipliers by those of the kept rows.
State StaticAdjoint::moved(const std::vector<double>& step) const {
  State s = state_;
  mechanism_.system.retract(state_.q, {step.data(), n_}, s.q);
  for (std::size_t r = 0; r < rows_.size(); ++r) s.lambda[static_cast<std::size_t>(rows_[r])] += step[n_ + r];
  return s;
}

State StaticAdjoint::moved(std::size_t coordinate, double way) const {
  std::vector<double> step(n_ + rows_.size(), 0.0);
  step[coordinate] = way;
  return moved(step);
}

// What moves the fastest point by the extent of the model.
double StaticAdjoint::step_along(const std::vector<double>& dq) {
  const double largest = max_norm({dq.data(), n_});
  if (largest == 0) return 0;
  State s = state_;
  s.v.assign(dq.begin(), dq.begin() + static_cast<std::ptrdiff_t>(n_));
  if (const double way = scene_.extent_over_speed(s); way > 0 && way * largest < 1e300) return way;
  // A single point, or what no picture shows.
  std::vector<double> size(n_);
  mechanism_.system.magnitude(state_.q, size);
  const double extent = max_norm(size);
  return (extent > 0 ? extent : 1) / largest;
}

// Coordinates first ... last - 1 are moved at random; halves that change nothing are left.
void StaticAdjoint::find_support(const Quantity& quantity, std::size_t first, std::size_t last,
                                 std::vector<std::size_t>& found) {
  if (first == last) return;
  std::mt19937_64 random(first * 1000003 + last);
  std::uniform_real_distribution<double> amount(0.5, 1);
  std::vector<double> step(n_ + rows_.size(), 0.0);
  for (std::size_t i = first; i < last; ++i) step[i] = amount(random) * ((random() & 1) != 0 ? 1 : -1);
  const double way = kProbeStep * step_along(step);
  for (std::size_t i = first; i < last; ++i) step[i] *= i < n_ ? way : kProbeStep * multiplier_step_;
  const std::vector<double> none(step.size(), 0.0);
  if (value(quantity, moved(step)) == value(quantity, moved(none))) return;
  if (last - first == 1) {
    found.push_back(first);
    return;
  }
  const std::size_t middle = first + (last - first) / 2;
  find_support(quantity, first, middle, found);
  find_support(quantity, middle, last, found);
}

std::vector<double> StaticAdjoint::gradient(const Quantity& quantity) {
  std::vector<std::size_t> support;
  find_support(quantity, 0, n_, support);
  find_support(quantity, n_, n_ + rows_.size(), support);
  std::vector<double> g(n_ + rows_.size(), 0.0), unit(n_, 0.0);
  for (const std::size_t i : support) {
    double step = kStep * multiplier_step_;
    if (i < n_) {
      unit[i] = 1;
      step = kStep * step_along(unit);
      unit[i] = 0;
    }
    g[i] = difference(step, [&](double way) { return value(quantity, moved(i, way)); });
    if (!std::isfinite(g[i]))
      throw Error(StatusCode::accuracy_not_reached,
                  fmt::format("adjoint: the quantity {} is no number beside the equilibrium", quantity.name));
  }
  return g;
}

void StaticAdjoint::measure_defect(Solver& solver) {
  std::mt19937_64 random(20);
  std::uniform_real_distribution<double> amount(-1, 1);
  std::vector<double> r(n_ + rows_.size(), 0.0), z(r.size());
  for (std::size_t i = 0; i < n_; ++i) r[i] = amount(random);
  const SolveResult solved = solver.solve(r, z, 1);
  if (!solved.status.ok()) throw Error(solved.status.code, "adjoint: " + solved.status.message);
  // Neither bodies nor reactions are to change by more than a small part of what they are.
  const double way = step_along(z), largest = max_norm({z.data() + n_, z.size() - n_});
  double step = way > 0 ? kDefectStep * way : std::numeric_limits<double>::infinity();
  if (largest > 0) step = std::min(step, multiplier_step_ / largest);
  if (!std::isfinite(step)) return;
  Equations equations(mechanism_.system, nullptr, &mechanism_.pool);
  equations.set_dropped(dropped_);
  const auto motion = [&](double factor) {
    std::vector<double> move = z, f(n_);
    for (double& x : move) x *= factor * step;
    const State s = moved(move);
    equations.evaluate_constraints(s.t, s.q, {});
    equations.motion(s.view(), f);
    return f;
  };
  const std::vector<double> at[4] = {motion(-2), motion(-1), motion(1), motion(2)};
  for (std::size_t i = 0; i < n_; ++i) {
    const double found = (8 * (at[2][i] - at[1][i]) - (at[3][i] - at[0][i])) / (12 * step);
    defect_ = std::max(defect_, std::abs(found - r[i]));
  }
}

}  // namespace espalier::dynamics::model
