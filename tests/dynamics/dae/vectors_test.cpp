// Loops over long vectors: blocks, sums, largest values, and integrators that are made of them.
#include "dynamics/dae/vectors.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "dynamics/bodies/point_mass.hpp"
#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/dae/products.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace vectors_test {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::vector<double> random_vector(std::size_t n, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<double> x(n);
  for (double& value : x) value = uniform(generator);
  return x;
}

// None, one, around a block, around the length that threads begin at, and no multiple of either.
const std::size_t kLengths[] = {0,
                                1,
                                3,
                                kVectorBlock - 1,
                                kVectorBlock,
                                kVectorBlock + 1,
                                kLongVector - 1,
                                kLongVector,
                                kLongVector + 1,
                                3 * kLongVector + 137};

TEST(Vectors, EachEntryIsVisitedOnce) {
  for (const int threads : {1, 3}) {
    base::ThreadPool pool(threads);
    for (const std::size_t n : kLengths) {
      std::vector<int> visits(n, 0);
      for_each_entry(&pool, n, [&](std::size_t i) { ++visits[i]; });
      EXPECT_EQ(visits, std::vector<int>(n, 1)) << n << ", threads: " << threads;
    }
  }
}

// Truth: the sum in long double; its error is at most n eps of the sum of all sizes.
TEST(Vectors, SumsAreRightAndHaveTheSameBitsForAnyThreads) {
  for (const std::size_t n : kLengths) {
    const std::vector<double> x = random_vector(n, static_cast<unsigned>(n) + 1);
    long double truth = 0, size = 0;
    for (const double value : x) truth += value, size += std::abs(value);
    const auto sum = [&](base::ThreadPool* pool) { return sum_of(pool, n, [&](std::size_t i) { return x[i]; }); };
    const double alone = sum(nullptr);
    const auto allowed = static_cast<double>(size) * static_cast<double>(n) * std::numeric_limits<double>::epsilon();
    EXPECT_NEAR(alone, static_cast<double>(truth), allowed) << n;
    for (const int threads : {1, 2, 3, 8}) {
      base::ThreadPool pool(threads);
      EXPECT_EQ(sum(&pool), alone) << n << ", threads: " << threads;
    }
  }
}

TEST(Vectors, LargestValueIsFoundWhereverItStandsAndNaNIsLarger) {
  base::ThreadPool pool(3);
  for (const std::size_t n : kLengths) {
    std::vector<double> x = random_vector(n, static_cast<unsigned>(n) + 2);
    for (const std::size_t at : {std::size_t{0}, n / 2, n == 0 ? 0 : n - 1}) {
      if (n == 0) break;
      const double before = std::exchange(x[at], -3.5);
      EXPECT_EQ(max_norm(&pool, x), 3.5) << n << " " << at;
      x[at] = -std::numeric_limits<double>::infinity();
      EXPECT_EQ(max_norm(&pool, x), std::numeric_limits<double>::infinity()) << n << " " << at;
      for (const double bad : {kNan, -kNan}) {
        x[at] = bad;
        EXPECT_TRUE(std::isnan(max_norm(&pool, x))) << n << " " << at;
      }
      x[at] = before;
    }
  }
  EXPECT_EQ(max_norm(&pool, {}), 0);
  EXPECT_EQ(max_norm(&pool, std::vector<double>{-0.0}), 0);
}

TEST(Vectors, CopiesAndZeros) {
  base::ThreadPool pool(2);
  for (const std::size_t n : kLengths) {
    const std::vector<double> x = random_vector(n, 5);
    std::vector<double> y(n, 1);
    copy(&pool, x, y);
    EXPECT_EQ(x, y) << n;
    copy(&pool, y, y);
    EXPECT_EQ(x, y) << n;
    fill_zero(&pool, y);
    EXPECT_EQ(y, std::vector<double>(n, 0)) << n;
  }
}

// Truth: one column after the other.
TEST(Vectors, ColumnsAreAddedUpInTheirOrder) {
  constexpr std::size_t kRows = 2500;
  base::ThreadPool pool(3);
  for (const std::size_t count : {0, 1, 5, 6, 7, 18, 40}) {
    const std::vector<double> columns = random_vector(count * kRows, 9), factors = random_vector(count, 10);
    std::vector<double> x = random_vector(kRows, 11), expected(x);
    for (std::size_t c = 0; c < count; ++c)
      for (std::size_t i = 0; i < kRows; ++i) expected[i] += factors[c] * columns[c * kRows + i];
    add_columns(columns.data(), factors, x, &pool);
    EXPECT_EQ(x, expected) << count;
  }
}

// Truth: each component's own operations, one after the other. Points form a vector space, rigid bodies do not.
TEST(Vectors, ASystemMovesAllComponentsAsTheyMoveThemselves) {
  base::ThreadPool pool(3);
  AssembledSystem system;
  system.set_pool(&pool);
  std::vector<OwnCoordinates> all;
  for (int k = 0; k < 6; ++k) {
    if (k == 0 || k == 3)
      all.emplace_back(system.add(std::make_unique<RigidBody>("body", RigidBodyData{})));
    else
      all.emplace_back(system.add(std::make_unique<PointMass>("point", PointMassData{})));
  }
  system.finish();
  const auto n = static_cast<std::size_t>(system.sizes().velocity);
  const auto size = static_cast<std::size_t>(system.sizes().configuration);
  std::vector<double> q(size), v(n), moved(size), expected_q(size), theta(n), expected(n), other(n);
  system.initial(q, v);
  const std::vector<double> step = random_vector(n, 7), rate = random_vector(n, 8);
  system.retract(q, step, moved);
  for (const OwnCoordinates& c : all) c.retract(q, step, expected_q);
  EXPECT_EQ(moved, expected_q);
  system.local(q, moved, theta);
  for (const OwnCoordinates& c : all) c.local(q, moved, expected);
  EXPECT_EQ(theta, expected);
  for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(theta[i], step[i], 1e-14);
  system.velocity_of_rate(theta, rate, other);
  for (const OwnCoordinates& c : all) c.velocity_of_rate(theta, rate, expected);
  EXPECT_EQ(other, expected);
  system.rate_of_velocity(theta, other, other);  // in place
  for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(other[i], rate[i], 1e-14);
  std::vector<double> opposite(theta), carried(rate), also(rate);
  for (double& x : opposite) x = -x;
  system.velocity_of_rate(theta, rate, expected);
  system.rate_of_velocity(opposite, expected, expected);
  const std::vector<Span> both = {carried, also};
  system.carry(theta, both);
  EXPECT_EQ(carried, also);
  for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(carried[i], expected[i], 1e-14);
  system.retract(moved, step, moved);  // in place
  for (const OwnCoordinates& c : all) c.retract(expected_q, step, expected_q);
  EXPECT_EQ(moved, expected_q);
}

// A cable with more coordinates than kLongVector: the state after some steps, with all that the coming steps depend on.
std::string state_after_steps(const std::string& integrator, const std::string& threads) {
  SimulationOptions options;
  options.solver = {{"threads", threads}};
  Simulation s = simulated(R"(gravity = [0, 0, -10]
[bodies.cable]
type = "cable"
start = [0, 0, 0]
end = [30, 0, 0]
elements = 2800
axial = 1e5
bending = 1
mass_per_length = 3
[joints.hook]
type = "spherical"
a = { body = "ground" }
b = { body = "cable", node = 1 }
[integrator]
)" + integrator,
                           options);
  EXPECT_GE(s.summary().velocities, kLongVector);
  EXPECT_GE(s.summary().steps, 4);
  return s.save();
}

// The steps of a model as small as this one stay with one thread unless more are asked for.
TEST(Vectors, SmallModelsGiveTheSameBitsForAnyThreads) {
  const auto state = [](std::vector<std::pair<std::string, std::string>> solver) {
    SimulationOptions options;
    options.solver = std::move(solver);
    Simulation s = simulated(R"(gravity = [0, 0, -10]
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 0.3, ly = 0.1, lz = 0.1, divisions = [8, 3, 3] }
material = { young = 2e8, poisson = 0.3, density = 1000 }
[joints.clamp]
type = "fixed"
a = { body = "ground" }
b = { body = "block", face = "x0" }
[integrator]
method = "bdf"
end = 1e-3
)",
                             options);
    EXPECT_GE(s.summary().steps, 4);
    return s.save();
  };
  const std::string alone = state({{"threads", "1"}});
  EXPECT_EQ(state({}), alone);
  EXPECT_EQ(state({{"threads", "3"}}), alone);
}

TEST(Vectors, IntegratorsGiveTheSameBitsForAnyThreads) {
  for (const std::string integrator :
       {"method = \"bdf\"\nend = 1e-4\n", "method = \"generalized-alpha\"\nstep = 1e-4\nend = 4e-4\n"}) {
    const std::string alone = state_after_steps(integrator, "1");
    for (const std::string threads : {"2", "5"}) EXPECT_EQ(state_after_steps(integrator, threads), alone) << integrator;
  }
}

}  // namespace vectors_test
}  // namespace espalier::dynamics
