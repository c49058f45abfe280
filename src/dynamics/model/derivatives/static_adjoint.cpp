#include "dynamics/model/derivatives/static_adjoint.hpp"

#include <algorithm>
#include <cmath>
#include <random>

namespace espalier::dynamics::model {

namespace {

// A share of the extent of the model, of the largest multiplier: bent bodies resist their stretching with much of its
// square.
constexpr double kDefectStep = 3e-4;

}  // namespace

StaticAdjoint::StaticAdjoint(Mechanism& mechanism, Equations& equations, const State& state,
                             const std::vector<Quantity>& quantities, double load, Options options)
    : mechanism_(mechanism),
      state_(state),
      rows_(kept_constraints(equations)),
      dropped_(equations.dropped()),
      slopes_(mechanism, rows_, load) {
  const Linearised a = linearise(equations, state);
  n_ = static_cast<std::size_t>(a.n);
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

std::vector<double> StaticAdjoint::values(const std::vector<Quantity>& quantities) const {
  std::vector<double> out;
  for (const Quantity& q : quantities) out.push_back(slopes_.value(q, state_));
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

std::vector<double> StaticAdjoint::gradient(const Quantity& quantity) {
  const StateSlopes slopes = slopes_.at(quantity, state_);
  std::vector<double> g = slopes.q;
  for (const Index row : rows_) g.push_back(slopes.lambda[static_cast<std::size_t>(row)]);
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
  const double way = slopes_.extent_along(state_, z), largest = max_norm({z.data() + n_, z.size() - n_});
  const double reactions = max_norm(state_.lambda);
  double step = way > 0 ? kDefectStep * way : std::numeric_limits<double>::infinity();
  if (largest > 0) step = std::min(step, (reactions > 0 ? reactions : 1) / largest);
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
