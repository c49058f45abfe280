// ANCF beams against geometrically exact beams (Reissner, Simo), solved by shooting in reference/reissner_beam.py:
// python3 tests/dynamics/reference/reissner_beam.py prints the numbers below.
#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "dynamics/bodies/flexible_statics.hpp"
#include "dynamics/bodies/rotation.hpp"
#include "dynamics/reference/flexible_chain.hpp"

namespace espalier::dynamics::test {
namespace {

constexpr double kRadius = 100, kAngle = std::numbers::pi / 4;

BeamSection unit_square() { return rectangular_section({SolidLaw::st_venant_kirchhoff, 1e7, 0, 1}, 1, 1); }

/// Bathe and Bolourchi's bend in the x-y plane, along x at the clamped end.
ArcAxis bend() { return {{0, 0, 0}, {1, 0, 0}, kRadius * kAngle, {0, 0, 1 / kRadius}}; }

Vec3 point_of_bend(double share) {
  const double a = kAngle * share;
  return {kRadius * std::sin(a), kRadius * (1 - std::cos(a)), 0};
}

struct BendCut {
  Index pieces, elements;
};
struct Load {
  Vec3 force, moment, end;
};
const std::vector<Load> kBends = {
    {{0, 0, 300}, {0, 0, 0}, {58.535709237, 22.112513805, 40.480757377}},
    {{0, 0, 450}, {0, 0, 0}, {51.969424578, 18.369163043, 48.705348941}},
    {{0, 0, 600}, {0, 0, 0}, {46.891586391, 15.557676239, 53.607986317}},
    {{0, 0, 300}, {4e4, -3e4, 5e4}, {21.745934986, -5.6299811158, 18.416900424}},
};

/// The end of the bend as a chain of beams; everything (beams, loads) turned by `turn`, and the answer turned back.
Vec3 bent_end(const Load& load, const BendCut& cut, int steps, const Mat3& turn = Mat3::Identity()) {
  BeamChain chain;
  const BeamAxis cuts = make_beam_axis(bend(), {0, 1, 0}, cut.pieces);
  for (Index k = 0; k < cut.pieces; ++k) {
    const AxisNode& at = cuts.nodes[static_cast<std::size_t>(k)];
    const Mat3 axes = turn * at.axes;
    const ArcAxis piece{turn * at.position, axes.col(0), bend().length / cut.pieces, bend().curvature};
    chain.add(make_beam_body("piece", piece, {axes(0, 1), axes(1, 1), axes(2, 1)}, cut.elements, unit_square()));
  }
  chain.join();
  chain.load_end(turn * load.force, turn * load.moment);
  EXPECT_TRUE(chain.solve(steps));
  return turn.transpose() * chain.end().r;
}

double bend_error(const Load& load, const BendCut& cut) {
  const double size = (load.end - point_of_bend(1)).norm();
  return (bent_end(load, cut, load.moment.norm() > 0 ? 24 : 6) - load.end).norm() / size;
}

// Six digits of the displacement with 32 elements under a force, with 64 where moments roll the bend up further.
// Order 4.
TEST(BeamReference, BatheAndBolourchi) {
  for (const Load& load : kBends) {
    const Index n = load.moment.norm() > 0 ? 64 : 32;
    const double coarse = bend_error(load, {1, n / 4}), fine = bend_error(load, {1, n});
    EXPECT_LT(fine, 1e-6) << load.force.transpose() << "; " << load.moment.transpose();
    EXPECT_GT(std::log2(coarse / fine) / 2, 3.8) << "observed order, " << coarse << " to " << fine;
  }
}

// The same in pieces, which are fixed to each other. Before, refinement made it worse (3.6, 2.5, 1.9 digits).
TEST(BeamReference, BatheAndBolourchiInPieces) {
  for (const BendCut& cut : {BendCut{2, 16}, {8, 4}, {32, 1}, {32, 2}})
    EXPECT_LT(bend_error(kBends[2], cut), 1e-6) << cut.pieces << " pieces of " << cut.elements << " elements";
  EXPECT_LT(bend_error(kBends[3], {16, 4}), 1e-6);
}

// The load may come in any number of steps.
TEST(BeamReference, LoadStepsDoNotMatter) {
  const Vec3 once = bent_end(kBends[2], {1, 16}, 6);
  for (const int steps : {10, 40}) EXPECT_LT((bent_end(kBends[2], {1, 16}, steps) - once).norm(), 1e-9);
}

// A rigid motion of everything, joints and loads too, changes nothing.
TEST(BeamReference, RigidMotionOfEverything) {
  for (const Load& load : {kBends[2], kBends[3]}) {
    const Vec3 truth = bent_end(load, {4, 4}, 24);
    for (const Vec3& axis : {Vec3(0.3, -1.2, 0.9), Vec3(3.1, 0, 0), Vec3(0, -2, 0.1)})
      EXPECT_LT((bent_end(load, {4, 4}, 24, rotation_exp(axis)) - truth).norm(), 1e-9) << axis.transpose();
  }
}

// Truth: the same bend given by points on the arc. A spline's error falls with the fourth power of their distance.
TEST(BeamReference, BendGivenByPoints) {
  double error[3];
  int at = 0;
  for (const int points : {9, 17, 33}) {
    SplineAxis axis;
    for (int k = 0; k < points; ++k) axis.points.push_back(point_of_bend(static_cast<double>(k) / (points - 1)));
    BeamChain chain;
    chain.add(make_beam_body("bend", axis, {0, 1, 0}, 64, unit_square()));
    chain.join();
    chain.load_end(kBends[2].force, kBends[2].moment);
    ASSERT_TRUE(chain.solve(8));
    error[at++] = (chain.end().r - bent_end(kBends[2], {1, 64}, 8)).norm();
  }
  EXPECT_LT(error[2], 1e-6 * 53.6);
  EXPECT_GT(std::log2(error[0] / error[1]), 3.5);
}

// Curved about all three axes, force and moment.
TEST(BeamReference, Helix) {
  const BeamSection section = rectangular_section({SolidLaw::st_venant_kirchhoff, 1e7, 0.3, 1}, 1, 0.5);
  const ArcAxis axis{{0, 0, 0}, {1, 0, 0}, 60, {0.01, -0.02, 0.015}};
  const Vec3 truth(50.316736889, -12.617187366, 24.398265724);
  double error[2];
  for (const Index n : {16, 64}) {
    BeamChain chain;
    chain.add(make_beam_body("helix", axis, {0, 1, 0}, n, section));
    chain.join();
    chain.load_end({50, -75, 100}, {2500, 5000, -2500});
    ASSERT_TRUE(chain.solve(10));
    error[n == 64] = (chain.end().r - truth).norm() / 60;
  }
  EXPECT_LT(error[1], 1e-7);
  EXPECT_GT(std::log2(error[0] / error[1]) / 2, 3.8);
}

// Truth: P = 4.012599 sqrt(E I_z G J) / L^2 for a strip that is stiff in the plane of the load (Timoshenko and Gere,
// Theory of Elastic Stability, 6.3), times 1 / sqrt((1 - E I_z / E I_y) (1 - G J / E I_y)) for the bending before
// (Hodges and Peters 1975). The load at which the smallest eigenvalue of the tangent passes through zero.
TEST(BeamReference, LateralBuckling) {
  const BeamSection section = rectangular_section({SolidLaw::st_venant_kirchhoff, 7e10, 0.3, 2700}, 0.002, 0.1);
  const double length = 2;
  const double soft = section.bending_z, stiff = section.bending_y;
  const double truth = 4.012599 * std::sqrt(soft * section.torsion) / (length * length) /
                       std::sqrt((1 - soft / stiff) * (1 - section.torsion / stiff));
  double found[2];
  for (const Index n : {4, 16}) {
    const auto unstable = [&](double p) {
      Statics s(make_beam_body("strip", {0, 0, 0}, {length, 0, 0}, {0, 1, 0}, n, section));
      for (const Index v : {0, 2, 3}) s.fix(v);
      s.set_load(4 * n, {0, 0, -p});
      s.solve(4);
      const Eigen::MatrixXd k = Eigen::MatrixXd(s.tangent());
      std::vector<Eigen::Index> free;
      for (Eigen::Index d = 0; d < k.rows(); ++d)
        if (d / 3 != 0 && d / 3 != 2 && d / 3 != 3) free.push_back(d);
      return Eigen::LDLT<Eigen::MatrixXd>(k(free, free)).vectorD().minCoeff() < 0;
    };
    double low = 0.8 * truth, high = 1.2 * truth;
    ASSERT_FALSE(unstable(low));
    ASSERT_TRUE(unstable(high));
    while (high - low > 1e-6 * truth) (unstable(0.5 * (low + high)) ? high : low) = 0.5 * (low + high);
    found[n == 16] = low / truth - 1;
  }
  EXPECT_LT(std::abs(found[0]), 5e-3);
  EXPECT_LT(std::abs(found[1]), 5e-4);
}

}  // namespace
}  // namespace espalier::dynamics::test
