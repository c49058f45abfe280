// A factor that serves when bodies have turned. Truth: the factor of the matrix that it stands for, and runs whose
// tolerance decides.
#include "dynamics/dae/turned_factor.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <stdexcept>
#include <vector>

#include "base/at.hpp"
#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/dae/kkt.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace turned_factor_test {

Eigen::Matrix3d rotation(double angle, const Eigen::Vector3d& axis) {
  return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
}

BodyTurn turn_of(Index first, Index vertices, const Eigen::Matrix3d& r) {
  BodyTurn turn{first, vertices, {}};
  for (Index i = 0; i < 9; ++i) turn.rotation[at(i)] = r(i / 3, i % 3);
  return turn;
}

/// Two bodies of 90 and 60 vertices and six coordinates that do not turn; five constraints, of which one is dropped.
class TwoBodies {
 public:
  static constexpr Index kFirst = 90, kSecond = 60, kRest = 6, kMotion = 3 * (kFirst + kSecond) + kRest,
                         kConstraints = 5;

  explicit TwoBodies(unsigned seed, Index constraints = kConstraints) : random_(seed) {
    w_ = {kMotion, kMotion, {0}, {}};
    phi_q_ = {constraints, kMotion, {0}, {}};
    dense_ = Eigen::MatrixXd::Zero(kMotion, kMotion);
    for (Index j = 0; j < kMotion; ++j)  // vertices of a body near each other, whole blocks
      for (Index i = 0; i < kMotion; ++i)
        if (coupled(i, j)) dense_(i, j) = number() + (i == j ? 60 : 0);
    for (Index j = 0; j < kMotion; ++j) {
      for (Index i = 0; i < kMotion; ++i)
        if (coupled(i, j)) w_.ind.push_back(i);
      w_.ptr.push_back(static_cast<Offset>(w_.ind.size()));
    }
    for (Index i = 0; i < constraints; ++i) {  // here and there one coordinate of a vertex alone
      for (Index j = i; j < kMotion; j += 4) phi_q_.ind.push_back(j);
      phi_q_.ptr.push_back(static_cast<Offset>(phi_q_.ind.size()));
    }
    phi_values_.resize(phi_q_.ind.size());
    for (double& v : phi_values_) v = number();
  }
  [[nodiscard]] double number() { return std::uniform_real_distribution<double>(-1, 1)(random_); }
  std::vector<double>& phi_values() { return phi_values_; }

  /// K of R W R^T and the present constraints, factorized.
  void factorize(KktSolver& kkt, const std::vector<BodyTurn>& turns) const {
    Eigen::MatrixXd r = Eigen::MatrixXd::Identity(kMotion, kMotion);
    for (const BodyTurn& t : turns)
      for (Index v = 0; v < t.vertices; ++v)
        for (Index i = 0; i < 3; ++i)
          for (Index j = 0; j < 3; ++j) r(t.first + 3 * v + i, t.first + 3 * v + j) = t.rotation[at(3 * i + j)];
    const Eigen::MatrixXd turned = r * dense_ * r.transpose();
    kkt.set_pattern(w_, phi_q_);
    if (phi_q_.rows > 0) kkt.set_dropped({0, 0, 0, 1, 0});
    for (Index j = 0; j < kMotion; ++j)
      for (Offset k = w_.ptr[at(j)]; k < w_.ptr[at(j) + 1]; ++k)
        kkt.w_values()[static_cast<std::size_t>(k)] = turned(w_.ind[static_cast<std::size_t>(k)], j);
    std::copy(phi_values_.begin(), phi_values_.end(), kkt.phi_q_values().begin());
    kkt.factorize();
  }

 private:
  [[nodiscard]] static int body_of(Index i) { return i < 3 * kFirst ? 0 : i < 3 * (kFirst + kSecond) ? 1 : 2; }
  [[nodiscard]] static bool coupled(Index i, Index j) {
    return body_of(i) == body_of(j) && (body_of(i) == 2 || std::abs(i / 3 - j / 3) <= 6);
  }

  std::mt19937 random_;
  SparsePattern w_, phi_q_;
  Eigen::MatrixXd dense_;
  std::vector<double> phi_values_;
};

constexpr auto kSize = TwoBodies::kMotion + TwoBodies::kConstraints;

KktSolver solver() { return KktSolver(make_espalier_solver(newton_options(kSize))); }

TEST(TurnedFactor, SolvesAsTheFactorOfTheTurnedMatrix) {
  TwoBodies system(3);
  KktSolver turned = solver();
  system.factorize(turned, {});
  for (const double angle : {1e-3, 0.4, 2.9}) {
    SCOPED_TRACE(angle);
    const std::vector<BodyTurn> turns = {
        turn_of(0, TwoBodies::kFirst, rotation(angle, {1, 2, -1})),
        turn_of(3 * TwoBodies::kFirst, TwoBodies::kSecond, rotation(-0.7 * angle, {0, 1, 5}))};
    for (double& v : system.phi_values()) v += angle * system.number();
    KktSolver truth = solver();
    system.factorize(truth, turns);
    ASSERT_GE(turned.turn(turns, system.phi_values()), 0);
    for (const Index normal : {0, 1, 2}) {
      std::vector<double> x(2 * at(kSize)), y;
      for (Index i = 0; i < 2 * kSize; ++i) x[at(i)] = system.number();
      for (Index c = 2 - normal; c < 2; ++c)
        for (Index i = 0; i < TwoBodies::kMotion; ++i) x[at(c * kSize + i)] = 0;
      for (Index c = 0; c < 2; ++c) x[at(c * kSize + TwoBodies::kMotion + 3)] = 0;  // of the dropped one
      y = x;
      turned.solve(x, 2, normal);
      truth.solve(y, 2);
      double size = 0, error = 0;
      for (std::size_t i = 0; i < x.size(); ++i) {
        size = std::max(size, std::abs(y[i]));
        error = std::max(error, std::abs(x[i] - y[i]));
      }
      EXPECT_GT(size, 1e-3);
      EXPECT_LE(error, 1e-11 * size) << normal;
    }
  }
  // A new factor is not turned.
  turned.forget_analysis();
  system.factorize(turned, {});
  KktSolver truth = solver();
  system.factorize(truth, {});
  std::vector<double> x(at(kSize), 1.0), y = x;
  x[TwoBodies::kMotion + 3] = y[TwoBodies::kMotion + 3] = 0;
  turned.solve(x, 1);
  truth.solve(y, 1);
  EXPECT_EQ(x, y);
}

TEST(TurnedFactor, WithoutConstraintsItIsARotation) {
  TwoBodies system(5, 0);
  KktSolver turned = solver(), truth = solver();
  system.factorize(turned, {});
  const std::vector<BodyTurn> turns = {turn_of(0, TwoBodies::kFirst, rotation(1.3, {1, 2, -1}))};
  system.factorize(truth, turns);
  ASSERT_EQ(turned.turn(turns, {}), 0);
  std::vector<double> x(at(TwoBodies::kMotion)), y;
  for (double& v : x) v = system.number();
  y = x;
  turned.solve(x, 1);
  truth.solve(y, 1);
  for (std::size_t i = 0; i < x.size(); ++i) EXPECT_NEAR(x[i], y[i], 1e-13);
}

// What was half made when a solve was stopped must not be taken for columns of the inverse.
TEST(TurnedFactor, AnInterruptedSolveLeavesNothingBehind) {
  constexpr Index kMotions = 6, kRows = 2;  // one body of two vertices
  const SparsePattern phi_q{kRows, kMotions, {0, 3, 6}, {0, 1, 4, 2, 3, 5}};
  const std::vector<double> before{1, -0.5, 2, 0.3, 1.5, -1}, now{0.9, -0.7, 2.1, 0.2, 1.4, -1.2};
  const auto dense = [&](const std::vector<double>& values, const Eigen::Matrix3d& turned) {
    std::mt19937 random(5);
    Eigen::MatrixXd k = Eigen::MatrixXd::Zero(kMotions + kRows, kMotions + kRows), r = Eigen::MatrixXd::Identity(6, 6);
    for (Index i = 0; i < kMotions; ++i)
      for (Index j = 0; j < kMotions; ++j)
        k(i, j) = std::uniform_real_distribution<double>(-1, 1)(random) + (i == j ? 5 : 0);
    r.topLeftCorner(3, 3) = r.bottomRightCorner(3, 3) = turned;
    k.topLeftCorner(6, 6) = (r * k.topLeftCorner(6, 6) * r.transpose()).eval();
    for (Index i = 0; i < kRows; ++i)
      for (Offset p = phi_q.ptr[at(i)]; p < phi_q.ptr[at(i) + 1]; ++p)
        k(kMotions + i, phi_q.ind[static_cast<std::size_t>(p)]) =
            k(phi_q.ind[static_cast<std::size_t>(p)], kMotions + i) = values[static_cast<std::size_t>(p)];
    return k;
  };
  const Eigen::PartialPivLU<Eigen::MatrixXd> k_0(dense(before, Eigen::Matrix3d::Identity()));
  const TurnedFactor::Solve solve = [&](Span b, Index columns) {
    Eigen::Map<Eigen::MatrixXd> x(b.data(), kMotions + kRows, columns);
    x = k_0.solve(x).eval();
  };
  const Eigen::Matrix3d r = rotation(0.4, {1, 2, -1});
  TurnedFactor factor;
  factor.start(phi_q, before, {0, 0});
  EXPECT_THROW((void)factor.turn(
                   {turn_of(0, 2, r)}, now, [](Span, Index) { throw std::runtime_error("stopped"); }, nullptr),
               std::runtime_error);
  EXPECT_FALSE(factor.active());
  ASSERT_TRUE(factor.turn({turn_of(0, 2, r)}, now, solve, nullptr));
  const Eigen::MatrixXd truth = dense(now, r).inverse();
  Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(kMotions + kRows, -1, 2);
  const Eigen::VectorXd x = truth * b;
  factor.solve({b.data(), static_cast<std::size_t>(b.size())}, 1, solve, nullptr);
  EXPECT_LT((b - x).norm(), 1e-12 * x.norm());
  const base::LazyVector<double> columns = factor.response(nullptr);
  const Eigen::Map<const Eigen::MatrixXd> response(columns.data(), kMotions + kRows, kRows);
  EXPECT_LT((response - truth.rightCols(kRows)).norm(), 1e-12 * truth.norm());
}

TEST(TurnedFactor, ABodyKnowsItsTurn) {
  const auto body = make_beam_body("beam", {0, 0, 0}, {1, 0.2, 0}, {0, 1, 0}, 4,
                                   circular_section({SolidLaw::st_venant_kirchhoff, 210e9, 0.3, 7850}, 0.02));
  body->place({});
  const Sizes sizes = body->sizes();
  std::vector<double> q(at(sizes.configuration)), v(at(sizes.velocity)), moved(q);
  body->initial(q, v);
  const Eigen::Matrix3d r = rotation(2.2, {1, -3, 0.5});
  for (Index k = 0; k < body->vertices(); ++k) {
    const Eigen::Map<const Eigen::Vector3d> x(q.data() + 3 * k);
    Eigen::Map<Eigen::Vector3d> y(moved.data() + 3 * k);
    y = r * x;
    if (k % body->vertices_per_node() == 0) y += Eigen::Vector3d(4, -1, 7);
  }
  const auto turn = body->turn(q, moved);
  ASSERT_TRUE(turn);
  EXPECT_EQ(turn->vertices, body->vertices());
  for (Index i = 0; i < 9; ++i) EXPECT_NEAR(turn->rotation[at(i)], r(i / 3, i % 3), 1e-13);
}

TEST(TurnedFactor, PointsOnALineDoNotTellATurn) {
  const auto cable = make_cable_body("cable", {0, 0, 0}, {1, 0, 0}, 4, {1e6, 10, 1});
  cable->place({});
  std::vector<double> q(at(cable->sizes().configuration)), v(q.size());
  cable->initial(q, v);
  EXPECT_FALSE(cable->turn(q, q));
}

// 69 steps take 37 factorizations; where factors do not turn, 72.
// Truth: a run with tolerances of a hundredth.
TEST(TurnedFactor, ServesMostStepsOfAnEngine) {
  const auto run = [](const std::string& by) {
    SimulationOptions options;
    options.set = {"parameters.unknowns=1000", "integrator.relative=3e-5*" + by, "integrator.absolute=1e-7*" + by,
                   "integrator.absolute_velocity=5e-4*" + by};
    options.until = 0.006;
    Simulation simulation(std::move(options));
    Status status = simulation.load((espalier::test::source_folder() / "models/engine.toml").string());
    if (status.ok()) status = simulation.run();
    EXPECT_TRUE(status.ok()) << status.message;
    return simulation;
  };
  const Simulation coarse = run("1"), fine = run("0.01");
  const SimulationSummary& s = coarse.summary();
  EXPECT_GT(s.turned, s.steps / 4);
  EXPECT_LT(s.factorizations, 2 * s.steps / 3);
  for (const char* name : {"piston.position.x", "piston.velocity.x", "crank_pin.force.x", "motor.moment.z"}) {
    const double truth = fine.value(name);
    EXPECT_NEAR(coarse.value(name), truth, 0.03 * std::abs(truth)) << name;
  }
}

}  // namespace turned_factor_test
}  // namespace espalier::dynamics
