// Error against step of generalized-alpha, HHT and BDF. Truth: the same equations as an ordinary differential equation
// of index 1, by extrapolation (step_cases.hpp), which is itself compared with published values and extended precision.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"
#include "dynamics/integrators/step_cases.hpp"
#include "dynamics/reference/andrews_truth.hpp"

namespace espalier::dynamics {
namespace {

State truth_of(const StepCase& c) { return index_one_truth(*c.system, c.start, c.end, c.truth); }

// Truth: half the step; for Andrews' mechanism the program in extended precision.
TEST(StepTruth, IsConverged) {
  for (const auto make : step_cases()) {
    StepCase c = make();
    c.end /= 8;
    const State truth = truth_of(c), finer = index_one_truth(*c.system, c.start, c.end, c.truth / 2);
    const StepErrors e = step_errors(*c.system, truth, finer);
    EXPECT_LT(e.q, 1e-11) << c.name;
    EXPECT_LT(e.v, 1e-9) << c.name;
    EXPECT_LT(e.a, 1e-7) << c.name;  // the flexible one, whose axial modes are fast
    EXPECT_LT(e.lambda, 1e-8) << c.name;
  }
}

TEST(StepTruth, AgreesWithExtendedPrecision) {
  const StepCase c = andrews_mechanism();
  const State s = truth_of(c);
  const AndrewsTruth truth = andrews_truth(600);
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_NEAR(s.q[i], static_cast<double>(truth.y[i]), 1e-11) << i;
    EXPECT_NEAR(s.v[i], static_cast<double>(truth.y[7 + i]), 1e-8) << i;
  }
}

// Published: IVP test set, car axis at t = 3.
TEST(StepTruth, AgreesWithTheTestSetOnTheCarAxis) {
  const State s = truth_of(car_axis());
  const double q[] = {0.4934557842755629e-1, 0.4969894602303324, 0.1041742524885400e1, 0.3739110272652214};
  const double v[] = {-0.7705836840321485e-1, 0.7446866596327776e-2, 0.1755681574942899e-1, 0.7703410437794031};
  const double lambda[] = {0.4736886750784630e-2, 0.1104680411345730e-2};  // their sign is the opposite
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(s.q[i], q[i], 1e-10) << i;
    EXPECT_NEAR(s.v[i], v[i], 1e-9) << i;
  }
  for (std::size_t i = 0; i < 2; ++i) EXPECT_NEAR(s.lambda[i], lambda[i], 1e-9) << i;
}

// ---- Errors fall with h^2, by generalized-alpha and HHT.

struct Method {
  const char* name;
  double radius, hht;
};
constexpr Method kMethods[] = {{"rho 0.8", 0.8, 1}, {"rho 0", 0, 1}, {"HHT -0.1", 0.8, -0.1}, {"HHT -0.3", 0.8, -0.3}};

State run(const StepCase& c, const Method& m, double h, IntegratorCounts* counts = nullptr) {
  Equations equations(*c.system);
  AlphaOptions o;
  o.step = h;
  o.spectral_radius = m.radius;
  o.hht_alpha = m.hht;
  GeneralizedAlpha alpha(equations, o);
  alpha.start(c.start);
  alpha.integrate(c.end);
  if (counts != nullptr) *counts = alpha.counts();
  return alpha.state();
}

/// Steps of a case, the end of its motion over them: from where order 2 is seen in all kinds of numbers.
struct Range {
  StepCase (*make)();
  double end;
  long coarse, fine;
};
const Range kRanges[] = {{&spatial_slider_crank, 0.05, 50, 3200}, {&car_axis, 0.25, 800, 12800},
                         {&sundials_slider_crank, 1, 100, 6400},  {&andrews_mechanism, 0.015, 1600, 6400},
                         {&heavy_top, 0.02, 320, 5120},           {&flexible_pendulum, 0.02, 1000, 4000}};

// From step to step a quarter of the length: errors of q and v fall at least by 8 and of a and the multipliers by 4 (16
// is order 2; errors of single numbers at one time swing a little), or are rounding: 1e-9, and 3e3 eps / h^2 over the
// size of a. Newton used to end at a change of q of 1e-8, which made errors grow below 1e-3 (spatial crank, car axis).
TEST(StepErrors, FallWithTheSquareOfTheStepUntilRounding) {
  for (const Range& range : kRanges) {
    StepCase c = range.make();
    c.end = range.end;
    const State truth = truth_of(c);
    const double largest_a = max_norm(truth.a), largest_q = max_norm(truth.q);
    for (const Method& m : kMethods) {
      if (m.radius == 0 && c.name == "flexible") continue;  // damps the axial modes: order 2 begins later
      StepErrors before;
      for (long steps = range.coarse; steps <= range.fine; steps *= 4) {
        const double h = c.end / static_cast<double>(steps);
        IntegratorCounts counts;
        const StepErrors e = step_errors(*c.system, run(c, m, h, &counts), truth);
        const double rounding = 3e3 * std::numeric_limits<double>::epsilon() * largest_q / (h * h * largest_a) + 1e-9;
        const std::string where = c.name + ", " + m.name + ", steps " + std::to_string(steps);
        if (steps > range.coarse) {
          EXPECT_LT(e.q, std::max(before.q / 8, 1e-9)) << where;
          EXPECT_LT(e.v, std::max(before.v / 8, 1e-9)) << where;
          EXPECT_LT(e.a, std::max(before.a / 4, rounding)) << where;
          EXPECT_LT(e.lambda, std::max(before.lambda / 4, rounding)) << where;
        }
        EXPECT_EQ(counts.divisions, 0) << where;
        before = e;
      }
    }
  }
}

// Where rounding rules, positions and velocities do not get worse, and the integrator says what accelerations are
// worth.
TEST(StepErrors, RoundingIsSaidAndDoesNotDrift) {
  for (const auto make : {&spatial_slider_crank, &sundials_slider_crank}) {
    StepCase c = make();
    c.end = 0.1;
    const State truth = truth_of(c);
    for (const Method& m : kMethods) {
      IntegratorCounts counts;
      const StepErrors e = step_errors(*c.system, run(c, m, 5e-6, &counts), truth);
      EXPECT_LT(e.q, 1e-8) << c.name << m.name;
      EXPECT_LT(e.v, 1e-8) << c.name << m.name;
      EXPECT_GT(counts.rounded, counts.steps / 2);
      EXPECT_GT(1000 * counts.largest_rounding, e.a) << c.name << m.name;
      EXPECT_LT(counts.largest_rounding, 1e-3);
    }
  }
}

// Every start is an end of a run of other steps: errors of the multipliers over the first steps are of order 2, too
// (they were of order 1), and steps of changing length keep that (they were 30 times as large). Truth: as above.
TEST(StepErrors, StartsAndChangesOfTheStepDoNotShakeTheJoints) {
  const StepCase c = sundials_slider_crank();
  double first[2] = {}, changing[2] = {};
  for (const int k : {0, 1}) {
    const double h = 0.01 / (1 + k);
    Equations equations(*c.system);
    AlphaOptions o;
    o.step = h;
    GeneralizedAlpha alpha(equations, o);
    State from = index_one_truth(*c.system, c.start, 0.3, c.truth);
    alpha.start(from);
    double t = 0.3;
    for (int n = 0; n < 30; ++n) {
      const double length = n < 10 || n % 3 == 0 ? h : 0.6 * h;
      alpha.step(t + length);
      from = index_one_truth(*c.system, from, t + length, c.truth);
      t += length;
      double& worst = n < 10 ? first[k] : changing[k];
      worst = std::max(worst, step_errors(*c.system, alpha.state(), from).lambda);
    }
  }
  EXPECT_LT(first[1], first[0] / 3);
  EXPECT_LT(changing[1], changing[0] / 3);
  EXPECT_LT(changing[0], 10 * first[0]);
}

// ---- BDF with constant steps, every order: an error of h^k until rounding.

TEST(StepErrors, OfConstantStepsOfBdfFallWithTheirOrder) {
  StepCase c = sundials_slider_crank();
  c.end = 1;
  const State truth = truth_of(c);
  for (int order = 1; order <= kMaxBdfOrder; ++order) {
    StepErrors before;
    for (long steps = 50; steps <= 3200; steps *= 4) {
      const double h = c.end / static_cast<double>(steps);
      Equations equations(*c.system);
      BdfOptions o;
      o.fixed_step = h;
      o.fixed_order = order;
      BdfIntegrator bdf(equations, o);
      std::vector<State> past = {c.start};
      for (int k = 1; k <= order; ++k) past.push_back(index_one_truth(*c.system, past.back(), k * h, h));
      bdf.start(past);
      bdf.integrate(c.end);
      const StepErrors e = step_errors(*c.system, bdf.state(), truth);
      const double least = std::pow(4.0, order - 0.4), rounding = 1e-10;
      if (steps > 50) {
        EXPECT_LT(e.q, std::max(before.q / least, rounding)) << order << " " << steps;
        EXPECT_LT(e.v, std::max(before.v / least, rounding)) << order << " " << steps;
        EXPECT_LT(e.a, std::max(before.a / least, 10 * rounding)) << order << " " << steps;
        EXPECT_LT(e.lambda, std::max(before.lambda / least, 10 * rounding)) << order << " " << steps;
      }
      before = e;
    }
  }
}

// From one point alone: the points before come from short steps of their own. A start with order 1 would leave an
// error of h^2. Errors fall with the order until the tolerance of those steps, 1e-10, shows.
TEST(StepErrors, OfBdfThatFindsItsOwnFirstPointsFallWithItsOrderToo) {
  StepCase c = sundials_slider_crank();
  c.end = 1;
  const State truth = truth_of(c);
  for (int order = 3; order <= kMaxBdfOrder; ++order) {
    StepErrors before;
    for (long steps = 50; steps <= 800; steps *= 4) {
      Equations equations(*c.system);
      BdfOptions o;
      o.fixed_step = c.end / static_cast<double>(steps);
      o.fixed_order = order;
      BdfIntegrator bdf(equations, o);
      bdf.start(c.start);
      bdf.integrate(c.end);
      EXPECT_EQ(bdf.counts().steps, steps);
      const StepErrors e = step_errors(*c.system, bdf.state(), truth);
      if (steps > 50) {
        EXPECT_LT(e.q, std::max(before.q / std::pow(4.0, order - 0.6), 1e-9)) << order << " " << steps;
        EXPECT_LT(e.v, std::max(before.v / std::pow(4.0, order - 0.6), 1e-9)) << order << " " << steps;
      }
      before = e;
    }
  }
}

// Truth of what is to be reached: errors of the centre of Exudyn 1.13 (generalized-alpha, index 3, radius 0.8, Euler
// parameters) at the same steps, bench/dynamics/exudyn_steps.py. In body axes ours were 3.5 times as large.
TEST(StepErrors, OfTheHeavyTopAreNoLargerThanExudyns) {
  const StepCase c = heavy_top();
  const State truth = truth_of(c);
  struct Row {
    long steps;
    double q, v, a;
  };
  for (const Row& row : {Row{200, 6.0e-4, 1.1e-3, 6.0e-4}, Row{1000, 2.4e-5, 4.2e-5, 2.4e-5}}) {
    const State s = run(c, {"alpha", 0.8, 1}, c.end / static_cast<double>(row.steps));
    const auto error = [&](const std::vector<double>& x, const std::vector<double>& y, std::size_t first) {
      double worst = 0, largest = 0;
      for (std::size_t i = first; i < first + 3; ++i) {
        worst = std::max(worst, std::abs(x[i] - y[i]));
        largest = std::max(largest, std::abs(y[i]));
      }
      return worst / largest;
    };
    const auto [q, v] = c.points.front();
    EXPECT_LT(error(s.q, truth.q, q), row.q) << row.steps;
    EXPECT_LT(error(s.v, truth.v, v), row.v) << row.steps;
    EXPECT_LT(error(s.a, truth.a, v), row.a) << row.steps;
  }
}

}  // namespace
}  // namespace espalier::dynamics
