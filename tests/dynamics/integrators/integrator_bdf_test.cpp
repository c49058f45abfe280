// Truths: BDF on the state-space form (linear constraints), Newton on the full 3n + m system.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "dynamics/dae/function_system.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/bdf_common.hpp"
#include "dynamics/integrators/initial.hpp"

namespace espalier::dynamics {
namespace integrator_bdf_test {

using namespace test;

// ---- Linear constraints: q = N u + r, three coordinates, one constraint.

constexpr double kMass[3][3] = {{2, 0.3, 0}, {0.3, 1, 0.1}, {0, 0.1, 1.5}};
const Eigen::RowVector3d kConstraint(1, 2, -1);
constexpr double kConstant = 0.3;

Eigen::Vector3d linear_force(double t, const Eigen::Vector3d& q, const Eigen::Vector3d& v) {
  return {-4 * q[0] - 2 * q[0] * q[0] * q[0] - 0.1 * v[0], -3 * q[1] + std::sin(t), -q[2] - 0.5 * q[2] * q[2] * v[2]};
}

DaeFunctions linear_functions() {
  DaeFunctions f;
  f.coordinates = 3;
  f.constraints = 1;
  f.mass = [](ConstSpan, MatrixEntries m) {
    for (Index i = 0; i < 3; ++i) {
      for (Index j = 0; j < 3; ++j) m(i, j) = kMass[i][j];
    }
  };
  f.force = [](double t, ConstSpan q, ConstSpan v, Span out) {
    const Eigen::Vector3d x = linear_force(t, {q[0], q[1], q[2]}, {v[0], v[1], v[2]});
    for (std::size_t i = 0; i < 3; ++i) out[i] = x[static_cast<Eigen::Index>(i)];
  };
  f.constraint = [](double, ConstSpan q, Span phi) { phi[0] = q[0] + 2 * q[1] - q[2] - kConstant; };
  f.constraint_jacobian = [](double, ConstSpan, MatrixEntries g) {
    for (Index j = 0; j < 3; ++j) g(0, j) = kConstraint[j];
  };
  f.constraint_gamma = [](double, ConstSpan, ConstSpan, Span gamma) { gamma[0] = 0; };
  return f;
}

// BDF of fixed order and step on M_u u'' = N^T f, by plain Newton with differences: an independent little program.
class StateSpace {
 public:
  StateSpace(int order, double h) : order_(order), h_(h) {
    basis_ << 1, 0, 0, 1, 1, 2;  // q0 = u0, q1 = u1, q2 = u0 + 2 u1 - c
    offset_ << 0, 0, -kConstant;
    Eigen::Matrix3d mass;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) mass(i, j) = kMass[i][j];
    }
    inverse_mass_ = (basis_.transpose() * mass * basis_).inverse();
  }
  static Eigen::Vector2d start_u(double t) { return {0.4 + 0.3 * t - 0.2 * t * t, -0.1 + 0.5 * t * t}; }
  static Eigen::Vector2d start_w(double t) { return {0.3 - 0.4 * t, t}; }
  [[nodiscard]] Eigen::Vector3d q(const Eigen::Vector2d& u) const { return basis_ * u + offset_; }
  [[nodiscard]] Eigen::Vector3d v(const Eigen::Vector2d& w) const { return basis_ * w; }

  void run(int steps) {
    std::vector<double> nodes(static_cast<std::size_t>(order_)), weights(static_cast<std::size_t>(order_) + 1);
    for (int j = 0; j <= kMaxBdfOrder; ++j) {
      u_.push_back(start_u(-j * h_));
      w_.push_back(start_w(-j * h_));
    }
    for (int s = 1; s <= steps; ++s) {
      for (int j = 0; j < order_; ++j) nodes[static_cast<std::size_t>(j)] = -(j + 1) * h_;
      derivative_weights(0, nodes, weights);
      const double hp = 1 / weights[0];
      Eigen::Vector2d u_hat = Eigen::Vector2d::Zero(), w_hat = u_hat;
      for (std::size_t j = 0; j < static_cast<std::size_t>(order_); ++j) {
        u_hat -= hp * weights[j + 1] * u_[j];
        w_hat -= hp * weights[j + 1] * w_[j];
      }
      // w = w^ + h' u''(u, w), u = u^ + h' w: fixed-point iteration contracts by h' |df| < 0.1 here.
      Eigen::Vector2d w = w_[0], u = u_[0];
      for (int k = 0; k < 200; ++k) {
        u = u_hat + hp * w;
        w = w_hat + hp * (inverse_mass_ * (basis_.transpose() * linear_force(s * h_, q(u), v(w))));
      }
      u = u_hat + hp * w;
      u_.insert(u_.begin(), u);
      w_.insert(w_.begin(), w);
    }
  }
  [[nodiscard]] Eigen::Vector3d q() const { return q(u_[0]); }
  [[nodiscard]] Eigen::Vector3d v() const { return v(w_[0]); }

 private:
  int order_;
  double h_;
  Eigen::Matrix<double, 3, 2> basis_;
  Eigen::Vector3d offset_;
  Eigen::Matrix2d inverse_mass_;
  std::vector<Eigen::Vector2d> u_, w_;
};

class LinearConstraints : public testing::TestWithParam<int> {};

TEST_P(LinearConstraints, EqualBdfOnTheStateSpaceForm) {
  const int order = GetParam(), steps = 60;
  const double h = 0.01;
  StateSpace reference(order, h);
  FunctionSystem system(linear_functions());
  Equations equations(system);
  std::vector<State> past;
  for (int j = kMaxBdfOrder; j >= 0; --j) {
    State s(system.sizes());
    s.t = -j * h;
    const Eigen::Vector3d q = reference.q(StateSpace::start_u(s.t)), v = reference.v(StateSpace::start_w(s.t));
    for (std::size_t i = 0; i < 3; ++i) {
      s.q[i] = q[static_cast<Eigen::Index>(i)];
      s.v[i] = v[static_cast<Eigen::Index>(i)];
    }
    past.push_back(s);
  }
  reference.run(steps);
  BdfIntegrator bdf(equations, fixed(h, order));
  bdf.start(past);
  for (int k = 0; k < steps; ++k) bdf.step(10.0);
  // Round-off: steps * eps * order / h' of the differentiated values stays below 60 * 2e-16 * 100.
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(bdf.state().q[i], reference.q()[static_cast<Eigen::Index>(i)], 2e-12) << "q" << i << " order " << order;
    EXPECT_NEAR(bdf.state().v[i], reference.v()[static_cast<Eigen::Index>(i)], 2e-12) << "v" << i << " order " << order;
  }
  EXPECT_GT(std::abs(bdf.state().q[0] - past.back().q[0]), 1e-3);  // it moved
}

INSTANTIATE_TEST_SUITE_P(Orders, LinearConstraints, testing::Values(1, 2, 3, 4, 5));

// ---- Double pendulum of two point masses in Cartesian coordinates (n = 4, m = 2): curved constraints.

DaeFunctions double_pendulum() {
  DaeFunctions f;
  f.coordinates = 4;
  f.constraints = 2;
  f.mass = [](ConstSpan, MatrixEntries m) {
    m(0, 0) = m(1, 1) = 1;
    m(2, 2) = m(3, 3) = 0.7;
  };
  f.force = [](double, ConstSpan, ConstSpan, Span out) {
    out[0] = out[2] = 0;
    out[1] = -9.81;
    out[3] = -9.81 * 0.7;
  };
  f.constraint = [](double, ConstSpan q, Span phi) {
    const double dx = q[2] - q[0], dy = q[3] - q[1];
    phi[0] = 0.5 * (q[0] * q[0] + q[1] * q[1] - 1);
    phi[1] = 0.5 * (dx * dx + dy * dy - 0.64);
  };
  f.constraint_jacobian = [](double, ConstSpan q, MatrixEntries g) {
    g(0, 0) = q[0];
    g(0, 1) = q[1];
    for (const Index k : {0, 1}) {
      const double d = q[static_cast<std::size_t>(k) + 2] - q[static_cast<std::size_t>(k)];
      g(1, k) = -d;
      g(1, k + 2) = d;
    }
  };
  f.constraint_gamma = [](double, ConstSpan, ConstSpan v, Span gamma) {
    const double dx = v[2] - v[0], dy = v[3] - v[1];
    gamma[0] = -(v[0] * v[0] + v[1] * v[1]);
    gamma[1] = -(dx * dx + dy * dy);
  };
  return f;
}

State pendulum_start(Equations& equations) {
  State s(equations.sizes());
  s.q = {1, 0, 1, -0.8};
  s.v = {0, 1, 0.5, 1};
  make_consistent(equations, s);
  return s;
}

struct PendulumRun {
  State end;
  double largest_block = 0;
};

PendulumRun run_pendulum(DaeIteration iteration, double h, int order, int steps) {
  FunctionSystem system(double_pendulum());
  Equations equations(system);
  BdfOptions o = fixed(h, order);
  o.iteration = iteration;
  o.measure_blocks = true;
  o.refactor_rate = 0;  // a new K in every step, as the reference has
  BdfIntegrator bdf(equations, o);
  bdf.start(pendulum_start(equations));
  PendulumRun result;
  for (int k = 0; k < steps; ++k) {
    bdf.step(10.0);
    const auto& b = bdf.blocks();
    for (const double x : {b.motion, b.acceleration, b.velocity, b.position, b.tangential_v, b.tangential_q}) {
      result.largest_block = std::max(result.largest_block, x);
    }
  }
  result.end = bdf.state();
  return result;
}

TEST(ReducedIteration, SolvesEveryBlockAndAgreesWithTheFullSystem) {
  for (const double h : {0.02, 0.005, 0.001}) {
    for (const int order : {1, 2}) {
      const PendulumRun reduced = run_pendulum(DaeIteration::reduced, h, order, 5);
      const PendulumRun full = run_pendulum(DaeIteration::full_matched, h, order, 5);
      // Accelerations are of size 20 and carry 1 / h times the round-off of v: 1e-12 on q and v, relative to size on a.
      EXPECT_LT(distance(reduced.end.q, full.end.q), 1e-12) << h;
      EXPECT_LT(distance(reduced.end.v, full.end.v), 1e-12) << h;
      EXPECT_LT(distance(reduced.end.a, full.end.a), 1e-11) << h;
      EXPECT_LT(distance(reduced.end.lambda, full.end.lambda), 1e-11) << h;
      EXPECT_LT(reduced.largest_block, 1e-11) << h;
      EXPECT_LT(full.largest_block, 1e-11) << h;
    }
  }
}

// Other choices of U give another discrete solution; all converge to the same motion with the order of the formula.
TEST(ReducedIteration, OtherParametrisationsDifferByTheOrderOfTheMethod) {
  for (const DaeIteration kind : {DaeIteration::full_tangent, DaeIteration::full_boolean}) {
    double previous = 0;
    for (const int steps : {10, 20, 40}) {
      const PendulumRun reduced = run_pendulum(DaeIteration::reduced, 0.1 / steps, 2, steps);
      const PendulumRun other = run_pendulum(kind, 0.1 / steps, 2, steps);
      EXPECT_LT(other.largest_block, 1e-11);
      const double difference = distance(reduced.end.q, other.end.q);
      EXPECT_GT(difference, 1e-13);
      if (previous > 0) {
        EXPECT_GT(previous / difference, 2.5) << steps;  // 4 for order 2, in the limit
      }
      previous = difference;
    }
  }
}

// ---- First points of a constant step

/// Two oscillators, cos(t) and, from `amplitude` at rest on, cos(1e4 t).
DaeFunctions slow_and_fast() {
  DaeFunctions f;
  f.coordinates = 2;
  f.mass = [](ConstSpan, MatrixEntries m) { m(0, 0) = m(1, 1) = 1; };
  f.force = [](double, ConstSpan q, ConstSpan, Span out) {
    out[0] = -q[0];
    out[1] = -1e8 * q[1];
  };
  return f;
}

double slow_error(double amplitude, int order, int steps, long& evaluations) {
  FunctionSystem system(slow_and_fast());
  Equations equations(system);
  State s(equations.sizes());
  s.q = {1, amplitude};
  make_consistent(equations, s);
  BdfOptions o = fixed(0.01, order);
  o.relative = o.absolute = 1e-6;
  BdfIntegrator bdf(equations, o);
  bdf.start(s);
  for (int k = 0; k < steps; ++k) bdf.step(10.0);
  evaluations = equations.counts().residuals;
  EXPECT_LT(std::abs(bdf.state().q[1]), 1e-6);  // damped, as BDF does with what the step does not resolve
  return std::abs(bdf.state().q[0] - std::cos(bdf.state().t));
}

// Truth: cos(t). At rest the first points are as good as the formula; a vibration of 10 m/s would take the short steps
// that look for them thousands of steps, so after 300 the order comes up from 1, whose first step leaves h^2 / 2.
TEST(FirstPoints, OrderComesUpFromOneWhereShortStepsWouldTakeTooMany) {
  const double h = 0.01;
  for (const int order : {3, 4}) {
    long quiet = 0, shaken = 0;
    EXPECT_LT(slow_error(0, order, 60, quiet), 3e-7) << order;
    const double error = slow_error(1e-3, order, 60, shaken);
    EXPECT_LT(error, h * h) << order;
    EXPECT_GT(error, h * h / 10) << order;
    EXPECT_GT(shaken, quiet + 300) << order;  // it was tried
  }
}

}  // namespace integrator_bdf_test
}  // namespace espalier::dynamics
