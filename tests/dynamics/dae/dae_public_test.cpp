// The public generic layer: closed forms, sparse against dense, given against differenced derivatives, wrong use.
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/dae/function_system.hpp"
#include "espalier/dae.hpp"

namespace espalier::dynamics::test {
namespace {

using Numbers = std::span<const double>;
using Out = std::span<double>;

/// The pendulum with a period of exactly 2 s: x^2 + y^2 = 1, released from (1, 0); gravity
/// (2 K(1/sqrt 2))^2 (reference_cases.md, A6).
constexpr double kGravity = 13.750371636040741;

DaeFunctions pendulum() {
  DaeFunctions f;
  f.coordinates = 2;
  f.constraints = 1;
  f.mass = [](Numbers, MatrixEntries m) { m(0, 0) = m(1, 1) = 1; };
  f.force = [](double, Numbers, Numbers, Out out) { out[1] = -kGravity; };
  f.constraint = [](double, Numbers q, Out phi) { phi[0] = (q[0] * q[0] + q[1] * q[1] - 1) / 2; };
  f.constraint_jacobian = [](double, Numbers q, MatrixEntries j) { j(0, 0) = q[0], j(0, 1) = q[1]; };
  f.constraint_gamma = [](double, Numbers, Numbers v, Out gamma) { gamma[0] = -v[0] * v[0] - v[1] * v[1]; };
  f.energy = [](const StateView& s) { return Energy{(s.v[0] * s.v[0] + s.v[1] * s.v[1]) / 2, kGravity * s.q[1]}; };
  return f;
}

const double kStart[] = {1, 0}, kRest[] = {0, 0};

// Truth: the period. Both with given derivatives and with differences; the error allowed is that of the tolerance,
// 1e-9 a step, summed over about 500 steps and magnified by the acceleration.
TEST(DaePublic, PendulumReturnsAfterTwoSeconds) {
  for (const bool given : {true, false}) {
    DaeFunctions f = pendulum();
    if (!given) f.constraint_jacobian = nullptr, f.constraint_gamma = nullptr;
    DaeOptions options;
    options.relative = options.absolute = given ? 1e-10 : 1e-8;
    Dae dae(f, options);
    ASSERT_TRUE(dae.start(0, kStart, kRest).ok());
    EXPECT_EQ(dae.summary().degrees_of_freedom, 1);
    EXPECT_LT(dae.check_jacobians().largest(), 1e-6);
    long seen = 0;
    const Status status = dae.integrate(2, [&](const DaeStep& s) { return s.index == ++seen; });
    ASSERT_TRUE(status.ok()) << status.message;
    EXPECT_EQ(dae.state().t, 2);
    EXPECT_NEAR(dae.state().q[0], 1, given ? 1e-8 : 1e-6);
    EXPECT_NEAR(dae.state().q[1], 0, given ? 1e-6 : 1e-4);
    EXPECT_NEAR(dae.energy().total(), 0, given ? 1e-6 : 1e-4);
    EXPECT_LT(dae.summary().largest_position, 1e-10);
    EXPECT_EQ(dae.summary().steps, seen);
  }
}

// Truth: the formula of the multiplier, lambda = -(v^2 + g y ... ) of a unit pendulum: at rest at the bottom lambda =
// -g y.
TEST(DaePublic, StartFindsAccelerationsAndMultipliers) {
  Dae dae(pendulum());
  const double bottom[] = {0, -1}, v[] = {2, 0};
  ASSERT_TRUE(dae.start(0, bottom, v).ok());
  EXPECT_NEAR(dae.state().a[1], 4, 1e-11);  // centripetal
  EXPECT_NEAR(dae.state().lambda[0], 4 + kGravity, 1e-11);
}

/// A chain of n masses on springs, the first one moved as sin t by a constraint.
DaeFunctions chain(Index n, bool sparse) {
  DaeFunctions f;
  f.coordinates = n;
  f.constraints = 1;
  f.mass = [n](Numbers, MatrixEntries m) {
    for (Index i = 0; i < n; ++i) m(i, i) = 1 + 0.1 * (i % 3);
  };
  f.force = [n](double, Numbers q, Numbers v, Out out) {
    for (std::size_t i = 0; i + 1 < static_cast<std::size_t>(n); ++i) {
      const double stretch = q[i + 1] - q[i], pull = 40 * stretch + 5 * stretch * stretch * stretch;
      out[i] += pull - 0.1 * v[i];
      out[i + 1] -= pull;
    }
  };
  f.constraint = [](double t, Numbers q, Out phi) { phi[0] = q[0] - std::sin(t); };
  f.constraint_rate = [](double t, Numbers, Out rate) { rate[0] = -std::cos(t); };
  if (sparse) {
    for (Index i = 0; i < n; ++i)
      for (Index j = std::max<Index>(0, i - 1); j < std::min<Index>(n, i + 2); ++j)
        f.tangent_pattern.emplace_back(i, j);
    f.constraint_pattern = {{0, 0}};
  }
  return f;
}

// Truth: a declared pattern changes the cost, not the motion: dense and sparse runs agree to the accuracy of the
// differences, and a tridiagonal pattern takes three groups of columns.
TEST(DaePublic, SparsePatternsGiveTheSameMotion) {
  constexpr Index n = 40;
  const std::vector<double> zero(n, 0.0);
  std::vector<double> v(n, 0.0);
  v[0] = 1;
  std::vector<double> ends[2];
  long residuals[2];
  for (const bool sparse : {false, true}) {
    Dae dae(chain(n, sparse));
    ASSERT_TRUE(dae.start(0, zero, v).ok());
    EXPECT_LT(dae.check_jacobians().largest(), 1e-6) << dae.check_jacobians().worst;
    const Status status = dae.integrate(2);
    ASSERT_TRUE(status.ok()) << status.message;
    EXPECT_NEAR(dae.state().q[0], std::sin(2), 1e-10);
    ends[sparse].assign(dae.state().q.begin(), dae.state().q.end());
    residuals[sparse] = dae.summary().steps;
  }
  EXPECT_EQ(residuals[0], residuals[1]);
  for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) EXPECT_NEAR(ends[0][i], ends[1][i], 1e-7) << i;
}

TEST(DaePublic, ColumnsWithoutCommonRowsShareAGroup) {
  std::vector<std::vector<Index>> columns;
  for (Index j = 0; j < 9; ++j) columns.push_back({std::max<Index>(0, j - 1), j, std::min<Index>(8, j + 1)});
  EXPECT_EQ(independent_columns(columns, 9), (std::vector<std::vector<Index>>{{0, 3, 6}, {1, 4, 7}, {2, 5, 8}}));
}

// A thousand masses: only the sparse patterns make this affordable.
TEST(DaePublic, LargeSparseSystem) {
  constexpr Index n = 2000;
  const std::vector<double> zero(n, 0.0);
  std::vector<double> v(n, 0.0);
  v[0] = 1;
  DaeOptions options;
  options.relative = options.absolute = 1e-4;
  Dae dae(chain(n, true), options);
  ASSERT_TRUE(dae.start(0, zero, v).ok());
  ASSERT_TRUE(dae.integrate(0.5).ok());
  EXPECT_NEAR(dae.state().q[0], std::sin(0.5), 1e-10);
  EXPECT_EQ(dae.summary().degrees_of_freedom, n - 1);
}

// Truth: an error put in on purpose is found, with its place.
TEST(DaePublic, WrongJacobianIsNamed) {
  DaeFunctions f = pendulum();
  f.constraint_jacobian = [](double, Numbers q, MatrixEntries j) { j(0, 0) = q[0], j(0, 1) = 1.01 * q[1] + 0.3; };
  Dae dae(f);
  const double q[] = {0.6, 0.8};
  const JacobianCheck check = dae.check_jacobians({0, q, kRest, {}, {}});
  EXPECT_GT(check.phi_q, 0.1);
  EXPECT_FALSE(check.worst.empty());
}

// Truth: two equal constraints leave one; contradicting ones are an error that names them.
TEST(DaePublic, RedundantAndContradictingConstraints) {
  DaeFunctions f = pendulum();
  f.constraints = 2;
  f.constraint_names = {"rod", "second rod"};
  f.constraint_jacobian = nullptr;
  f.constraint_gamma = nullptr;
  double length = 1;
  f.constraint = [&length](double, Numbers q, Out phi) {
    phi[0] = (q[0] * q[0] + q[1] * q[1] - 1) / 2;
    phi[1] = q[0] * q[0] + q[1] * q[1] - length;
  };
  Dae dae(f);
  ASSERT_TRUE(dae.start(0, kStart, kRest).ok());
  ASSERT_EQ(dae.summary().redundant.size(), 1U);
  EXPECT_NE(dae.summary().redundant[0].find("second rod"), std::string::npos) << dae.summary().redundant[0];
  EXPECT_TRUE(dae.integrate(0.1).ok());
  length = 1.5;
  const Status status = dae.start(0, kStart, kRest);
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.message.find("second rod"), std::string::npos) << status.message;
  EXPECT_THROW(static_cast<void>(dae.integrate(1)), std::logic_error) << "start() failed";
}

TEST(DaePublic, WrongUseThrows) {
  EXPECT_THROW(Dae(DaeFunctions{}), std::invalid_argument);
  DaeFunctions f = pendulum();
  f.constraint = nullptr;
  EXPECT_THROW(Dae{f}, std::invalid_argument);
  f = pendulum();
  f.tangent_pattern = {{0, 2}};
  EXPECT_THROW(Dae{f}, std::invalid_argument) << "outside of the matrix";
  f = pendulum();
  f.constraint_pattern = {{0, 0}};
  Dae missing(f);
  EXPECT_THROW(static_cast<void>(missing.start(0, kStart, kRest)), std::logic_error) << "(0, 1) was not declared";
  DaeOptions alpha;
  alpha.method = DaeMethod::generalized_alpha;
  EXPECT_THROW(Dae(pendulum(), alpha), std::invalid_argument) << "no step";
  Dae dae(pendulum());
  EXPECT_THROW(static_cast<void>(dae.state()), std::logic_error);
  EXPECT_THROW(static_cast<void>(dae.start(0, kStart, {})), std::invalid_argument);
  ASSERT_TRUE(dae.start(0, kStart, kRest).ok());
  EXPECT_THROW(static_cast<void>(dae.integrate(-1)), std::invalid_argument);
  const double nan = std::numeric_limits<double>::quiet_NaN(), lost[] = {1, nan};
  EXPECT_THROW(static_cast<void>(dae.start(nan, kStart, kRest)), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(dae.start(0, lost, kRest)), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(dae.start(0, kStart, lost)), std::invalid_argument);
}

TEST(DaePublic, OptionsThatCannotBeAreMisuse) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<void (*)(DaeOptions&, double)> wrong = {
      [](DaeOptions& o, double) { o.method = static_cast<DaeMethod>(5); },
      [](DaeOptions& o, double) { o.relative = -1; },
      [](DaeOptions& o, double x) { o.absolute = x; },
      [](DaeOptions& o, double) { o.max_order = 9; },
      [](DaeOptions& o, double) { o.step = -1; },
      [](DaeOptions& o, double x) { o.step = x; },
      [](DaeOptions& o, double x) { o.initial_step = x; },
      [](DaeOptions& o, double) { o.max_step = 0; },
      [](DaeOptions& o, double x) { o.max_step = x; },
      [](DaeOptions& o, double) { o.spectral_radius = 3; },
      [](DaeOptions& o, double x) { o.constraint_tolerance = x; },
      [](DaeOptions& o, double) { o.max_newton = -1; },
      [](DaeOptions& o, double x) { o.allowed_position = x; },
      [](DaeOptions& o, double) { o.order = 6; },
      [](DaeOptions& o, double x) { o.min_step = x; },
      [](DaeOptions& o, double) { o.min_step = 2, o.max_step = 1; },
      [](DaeOptions& o, double) { o.hht_alpha = -0.4; },
      [](DaeOptions& o, double x) { o.hht_alpha = x; },
      [](DaeOptions& o, double x) { o.newton_change = x; },
      [](DaeOptions& o, double) { o.newton_tolerance = 0; },
      [](DaeOptions& o, double x) { o.refactor_rate = x; },
      [](DaeOptions& o, double x) { o.refactor_step = x; },
      [](DaeOptions& o, double) { o.iteration = static_cast<DaeIteration>(4); },
      [](DaeOptions& o, double x) { o.allowed_velocity = x; },
  };
  for (std::size_t k = 0; k < wrong.size(); ++k) {
    DaeOptions o;
    wrong[k](o, nan);
    EXPECT_THROW(Dae(pendulum(), o), std::invalid_argument) << k;
  }
}

TEST(DaePublic, ForceThatIsNotANumberIsSaid) {
  DaeFunctions f = pendulum();
  f.force = [](double, auto, auto, std::span<double> out) { out[1] = std::numeric_limits<double>::quiet_NaN(); };
  const Status status = Dae(f).start(0, kStart, kRest);
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.message.find("not a finite number"), std::string::npos) << status.message;
}

// Truth: after a quarter of the period the pendulum hangs at its lowest point; halving the constant step of
// generalized-alpha divides the error by four.
TEST(DaePublic, GeneralizedAlphaIsOfSecondOrder) {
  double error[2];
  for (const int k : {0, 1}) {
    DaeOptions options;
    options.method = DaeMethod::generalized_alpha;
    options.step = 0.01 / (1 + k);
    Dae dae(pendulum(), options);
    ASSERT_TRUE(dae.start(0, kStart, kRest).ok());
    ASSERT_TRUE(dae.integrate(1.5).ok());
    error[k] = std::abs(dae.state().q[0]);
  }
  EXPECT_NEAR(std::log2(error[0] / error[1]), 2, 0.2);
}

}  // namespace
}  // namespace espalier::dynamics::test
