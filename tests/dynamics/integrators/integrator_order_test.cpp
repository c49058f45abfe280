// Truths: motions known exactly (a driven point on a circle), and Euler's equations of a free body by Runge-Kutta: the
// orders of BDF and generalized-alpha on every level.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>

#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/dae/function_system.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/bdf_common.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"
#include "dynamics/integrators/initial.hpp"

namespace espalier::dynamics {
namespace integrator_order_test {

using namespace test;

// ---- Orders, on a motion known exactly: a point on the unit circle driven so that the angle is s(t).

struct Exact {
  static double angle(double t) { return 0.4 + 0.9 * t + 0.5 * std::sin(1.3 * t); }
  static State at(double t) {
    const double s = angle(t), s1 = 0.9 + 0.65 * std::cos(1.3 * t), s2 = -0.845 * std::sin(1.3 * t);
    State x(Sizes{2, 2, 1});
    x.t = t;
    x.q = {std::cos(s), std::sin(s)};
    x.v = {-std::sin(s) * s1, std::cos(s) * s1};
    x.a = {-std::cos(s) * s1 * s1 - std::sin(s) * s2, -std::sin(s) * s1 * s1 + std::cos(s) * s2};
    x.lambda = {2 + std::cos(t)};
    return x;
  }
};

DaeFunctions circle() {
  DaeFunctions f;
  f.coordinates = 2;
  f.constraints = 1;
  f.mass = [](ConstSpan, MatrixEntries m) { m(0, 0) = m(1, 1) = 1; };
  f.force = [](double t, ConstSpan q, ConstSpan v, Span out) {
    const State x = Exact::at(t);
    // the exact solution satisfies M a + Phi_q^T lambda = f; a stiffness and a damping around it leave it unchanged
    for (std::size_t i = 0; i < 2; ++i) {
      out[i] = x.a[i] + x.q[i] * x.lambda[0] - 3 * (q[i] - x.q[i]) - 0.5 * (v[i] - x.v[i]);
    }
  };
  f.constraint = [](double, ConstSpan q, Span phi) { phi[0] = 0.5 * (q[0] * q[0] + q[1] * q[1] - 1); };
  f.constraint_jacobian = [](double, ConstSpan q, MatrixEntries g) {
    g(0, 0) = q[0];
    g(0, 1) = q[1];
  };
  f.constraint_gamma = [](double, ConstSpan, ConstSpan v, Span g) { g[0] = -(v[0] * v[0] + v[1] * v[1]); };
  return f;
}

std::array<double, 4> circle_error(int order, int steps) {
  FunctionSystem system(circle());
  Equations equations(system);
  const double h = 1.0 / steps;
  std::vector<State> past;
  for (int j = kMaxBdfOrder; j >= 0; --j) past.push_back(Exact::at(-j * h));
  BdfOptions options = fixed(h, order);
  options.refactor_rate = 0;  // a new K, and so the same kind of U, in every step
  BdfIntegrator bdf(equations, options);
  bdf.start(past);
  bdf.integrate(1.0);
  const State exact = Exact::at(1.0);
  const State& s = bdf.state();
  return {distance(s.q, exact.q), distance(s.v, exact.v), distance(s.a, exact.a), distance(s.lambda, exact.lambda)};
}

class BdfOrder : public testing::TestWithParam<int> {};

TEST_P(BdfOrder, IsObservedOnAllLevelsByStepHalving) {
  const int k = GetParam();
  // Fine enough to see the leading term, coarse enough to stay above round-off.
  const int steps = std::array{640, 320, 160, 80, 60}[static_cast<std::size_t>(k) - 1];
  const auto coarse = circle_error(k, steps), fine = circle_error(k, 2 * steps);
  for (std::size_t i = 0; i < 4; ++i) {
    const double observed = std::log2(coarse[i] / fine[i]);
    EXPECT_GT(fine[i], 1e-13);
    EXPECT_NEAR(observed, k, 0.3) << "level " << i << ": " << coarse[i] << " " << fine[i];
    RecordProperty("order_of_level_" + std::to_string(i), std::to_string(observed));
  }
}

INSTANTIATE_TEST_SUITE_P(Orders, BdfOrder, testing::Values(1, 2, 3, 4, 5));

TEST(GeneralizedAlphaOrder, IsTwoInPositionVelocityAndMultiplier) {
  constexpr double kNoHht = 1;
  const std::vector<std::pair<double, double>> methods = {
      {0.0, kNoHht}, {0.8, kNoHht}, {1.0, kNoHht}, {1.0, -0.3}, {1.0, -0.1}};
  for (const auto& [rho, hht] : methods) {
    std::array<std::array<double, 3>, 2> error{};
    for (const std::size_t r : {0U, 1U}) {
      FunctionSystem system(circle());
      Equations equations(system);
      AlphaOptions o;
      o.step = r == 0 ? 0.01 : 0.005;
      o.spectral_radius = rho;
      o.hht_alpha = hht;
      o.tolerance = 1e-13;
      o.constraint_tolerance = 1e-13;
      GeneralizedAlpha alpha(equations, o);
      alpha.start(Exact::at(0));
      alpha.integrate(1.0);
      const State exact = Exact::at(1.0);
      error[r] = {distance(alpha.state().q, exact.q), distance(alpha.state().v, exact.v),
                  distance(alpha.state().lambda, exact.lambda)};
    }
    // rho = 1 damps nothing: its multiplier keeps the oscillation of the start for ever and is not compared.
    for (std::size_t i = 0; i < (rho == 1.0 && hht == kNoHht ? 2U : 3U); ++i) {
      EXPECT_NEAR(std::log2(error[0][i] / error[1][i]), 2, 0.3)
          << "rho " << rho << ", HHT's alpha " << hht << ", level " << i << ": " << error[0][i] << " " << error[1][i];
    }
  }
}

// ---- The group: a free body with three different moments of inertia, against its Euler equations by RK4.

struct Spin {
  Quat q{1, 0, 0, 0};
  Vec3 w{1.0, 2.0, -1.5};
};

const Vec3 kInertia(0.5, 1.0, 1.7);

Spin advance(Spin s, double duration, int steps) {
  using Full = Eigen::Matrix<double, 7, 1>;
  const auto rate = [](const Full& x) {
    const Vec3 w = x.tail<3>();
    Full dx;
    dx.head<4>() = 0.5 * multiply(x.head<4>(), Quat(0, w[0], w[1], w[2]));
    dx.tail<3>() = -w.cross(kInertia.cwiseProduct(w)).cwiseQuotient(kInertia);
    return dx;
  };
  Full x;
  x << s.q, s.w;
  const double h = duration / steps;
  for (int k = 0; k < steps; ++k) {
    const Full a = rate(x), b = rate(x + h / 2 * a), c = rate(x + h / 2 * b), d = rate(x + h * c);
    x += h / 6 * (a + 2 * b + 2 * c + d);
  }
  s.q = x.head<4>() / x.head<4>().norm();
  s.w = x.tail<3>();
  return s;
}

std::unique_ptr<AssembledSystem> free_body() {
  auto system = std::make_unique<AssembledSystem>();
  RigidBodyData data;
  data.inertia = kInertia.asDiagonal();
  data.angular_velocity = Spin{}.w;
  system->add(std::make_unique<RigidBody>("top", data));
  system->finish();
  return system;
}

double spin_error(int order, int steps) {
  const auto system = free_body();
  Equations equations(*system);
  const double h = 2.0 / steps;
  std::vector<State> past;
  for (int j = kMaxBdfOrder; j >= 0; --j) {
    const Spin s = advance({}, -j * h, 200);
    State x(system->sizes());
    system->initial(x.q, x.v);
    x.t = -j * h;
    std::copy_n(s.q.data(), 4, x.q.begin() + 3);
    std::copy_n(s.w.data(), 3, x.v.begin() + 3);
    past.push_back(x);
  }
  BdfIntegrator bdf(equations, fixed(h, order));
  bdf.start(past);
  bdf.integrate(2.0);
  const Spin end = advance({}, 2.0, 20000);
  const Quat q(bdf.state().q.data() + 3);
  const Vec3 w(bdf.state().v.data() + 3);
  return std::max((rotation_matrix(q) - rotation_matrix(end.q)).cwiseAbs().maxCoeff(),
                  (w - end.w).cwiseAbs().maxCoeff());
}

TEST_P(BdfOrder, IsKeptOnTheRotationGroup) {
  const int k = GetParam();
  const double coarse = spin_error(k, 200), fine = spin_error(k, 400);
  EXPECT_NEAR(std::log2(coarse / fine), k, 0.4) << coarse << " " << fine;
}

}  // namespace integrator_order_test
}  // namespace espalier::dynamics
