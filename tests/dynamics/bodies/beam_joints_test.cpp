// Moments at the ends of beams and at joints between them: what is exact must be exact for any number of elements and
// pieces. Truth: closed forms (constant strains), and statics (the reaction of a joint is what hangs on it).
#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "dynamics/bodies/rotation.hpp"
#include "dynamics/reference/flexible_chain.hpp"

namespace espalier::dynamics::test {
namespace {

const Material kSteel{SolidLaw::st_venant_kirchhoff, 2.1e11, 0.3, 7850};

double turn_about_x(const Mat3& r) { return std::atan2(r(2, 1), r(1, 1)); }

/// `pieces` beams of `elements` each along `shape` cut into equal parts of constant curvature.
BeamChain arc_chain(const ArcAxis& shape, Index pieces, Index elements, const BeamSection& section) {
  BeamChain chain;
  const BeamAxis cuts = make_beam_axis(shape, {0, 1, 0}, pieces);
  for (Index k = 0; k < pieces; ++k) {
    const AxisNode& at = cuts.nodes[static_cast<std::size_t>(k)];
    const Vec3 y = at.axes.col(1);
    chain.add(make_beam_body("piece " + std::to_string(k + 1),
                             ArcAxis{at.position, at.axes.col(0), shape.length / pieces, shape.curvature},
                             {y.x(), y.y(), y.z()}, elements, section));
  }
  chain.join();
  return chain;
}

struct Cut {
  Index pieces, elements;
};

// Truth: theta = M L / (G J) = 0.1. Before, every end of every piece added M / (2 section_shear h), which has no limit
// as elements become shorter: 0.100128 with one beam of 64 elements, 0.1328 with 32 beams of 16.
TEST(BeamJoints, TorsionIsExactForAnyNumberOfElementsAndPieces) {
  const BeamSection section = circular_section(kSteel, 0.05);
  const double length = 2, moment = 0.1 * section.torsion / length;
  for (const Cut cut : {Cut{1, 1}, {1, 2}, {1, 16}, {1, 64}, {1, 512}, {2, 1}, {16, 16}, {32, 1}, {32, 16}}) {
    BeamChain chain = arc_chain({{0, 0, 0}, {1, 0, 0}, length, {0, 0, 0}}, cut.pieces, cut.elements, section);
    chain.load_end({0, 0, 0}, {moment, 0, 0});
    ASSERT_TRUE(chain.solve());
    EXPECT_NEAR(turn_about_x(chain.end().rot), 0.1, 1e-8) << cut.pieces << " x " << cut.elements;
    EXPECT_LT((chain.end().r - Vec3(length, 0, 0)).norm(), 1e-8);
    EXPECT_LT(chain.section_strain(), 1e-11) << "a moment strains no section";
  }
}

/// Strains at a point of a beam under a moment m at its end and nothing else: kappa = natural + C^-1 R^T m. For beams
/// of a circular section with E I = G J = c the curvature vector follows the moment: R^T m / c turns with the section,
/// and in global axes the curvature of the loaded beam is that of R0(s) turned, plus m / c.
///
/// Truth of the patch tests: a beam with natural curvature k0 (section axes) is given constant curvature k0 + dk by the
/// moment C dk in section axes where k0 and dk are parallel (then R(s) dk is the same at all s, so m is constant): an
/// arc or helix by closed form (ArcAxis).
void expect_patch(const Vec3& natural, const Vec3& change, const Cut& cut, int steps) {
  BeamSection section = circular_section(kSteel, 0.05);
  section.torsion *= 0.83;  // so that a mixed-up axis shows
  section.bending_y *= 1.21;
  const Vec3 stiffness(section.torsion, section.bending_y, section.bending_z);
  const double length = 2;
  BeamChain chain = arc_chain({{0, 0, 0}, {1, 0, 0}, length, natural}, cut.pieces, cut.elements, section);
  chain.load_end({0, 0, 0}, stiffness.cwiseProduct(change));  // R(0) = identity
  ASSERT_TRUE(chain.solve(steps));
  const BeamAxis truth =
      make_beam_axis(ArcAxis{{0, 0, 0}, {1, 0, 0}, length, natural + change}, {0, 1, 0}, cut.pieces * cut.elements);
  const auto text = ::testing::Message() << "natural " << natural.transpose() << ", change " << change.transpose()
                                         << ", " << cut.pieces << " x " << cut.elements;
  for (Index p = 0; p < cut.pieces; ++p)
    for (Index n = 0; n <= cut.elements; ++n) {
      const AxisNode& at = truth.nodes[static_cast<std::size_t>(p * cut.elements + n)];
      const FrameMotion now = chain.node(static_cast<std::size_t>(p), n);
      const Mat3 axes =
          now.rot * make_beam_axis(ArcAxis{{0, 0, 0}, {1, 0, 0}, length, natural}, {0, 1, 0}, cut.pieces * cut.elements)
                        .nodes[static_cast<std::size_t>(p * cut.elements + n)]
                        .axes;
      ASSERT_LT((now.r - at.position).norm(), 1e-8) << text << ", piece " << p << ", node " << n;
      ASSERT_LT((axes - at.axes).norm(), 1e-8) << text << ", piece " << p << ", node " << n;
    }
  EXPECT_LT(chain.section_strain(), 1e-10) << text;
}

TEST(BeamJoints, MomentsAboutEveryAxisBendToArcsAndHelicesExactly) {
  for (const Cut cut : {Cut{1, 1}, {1, 2}, {1, 7}, {2, 3}, {5, 1}, {8, 4}})
    for (int axis = 0; axis < 3; ++axis)
      for (const double natural : {0.0, 0.7, -0.4}) {
        const Vec3 unit = Vec3::Unit(axis);
        expect_patch(natural * unit, 0.5 * unit, cut, 4);
      }
}

// Truth: statics. Moments M_k at every joint: between joints the moment is their sum from there on, and with parallel
// moments every piece has constant strains: the end turns by sum_k (sum_(j >= k) M_j) l / C about the axis.
TEST(BeamJoints, AMomentAtEveryJointTurnsWhatHangsOnIt) {
  const BeamSection section = rectangular_section(kSteel, 0.06, 0.04);
  const Vec3 stiffness(section.torsion, section.bending_y, section.bending_z);
  const double length = 0.5;
  for (int axis = 0; axis < 3; ++axis)
    for (const Cut cut : {Cut{2, 1}, {4, 2}, {8, 8}, {3, 64}}) {
      BeamChain chain;
      for (Index k = 0; k < cut.pieces; ++k)
        chain.add(
            make_beam_body("piece", {length * k, 0, 0}, {length * (k + 1), 0, 0}, {0, 1, 0}, cut.elements, section));
      chain.join();
      double turn = 0;
      for (Index k = 0; k < cut.pieces; ++k) {
        const double moment = (k % 2 == 0 ? 0.2 : -0.07) * stiffness[axis];
        // Half of it on each side of the joint, at its end to the last one.
        chain.load(static_cast<std::size_t>(k), cut.elements, {0, 0, 0}, moment * Vec3::Unit(axis));
        turn += moment * length * (k + 1) / stiffness[axis];
      }
      ASSERT_TRUE(chain.solve(2));
      const Mat3 truth = rotation_exp(turn * Vec3::Unit(axis));
      EXPECT_LT((chain.end().rot - truth).norm(), 1e-8) << "axis " << axis << ", " << cut.pieces << " pieces";
      EXPECT_LT(chain.section_strain(), 1e-10);
      double rest = 0;
      for (Index k = cut.pieces; k-- > 0;) {
        rest += (k % 2 == 0 ? 0.2 : -0.07) * stiffness[axis];
        const Wrench w = chain.reaction(static_cast<std::size_t>(k));
        EXPECT_LT((w.moment + rest * Vec3::Unit(axis)).norm(), 1e-7 * stiffness[axis]) << "joint " << k;
        EXPECT_LT(w.force.norm(), 1e-5 * stiffness[axis]);
      }
    }
}

// Truth: E I 2 pi / L rolls a beam up to a full circle, whose end comes back to its start. The statics ran to
// nan with 4, 128 and 256 elements. At most 20 load steps; two elements turn by half a circle each.
TEST(BeamJoints, RollsUpToAFullCircle) {
  const BeamSection section = rectangular_section(kSteel, 0.02, 0.02);
  const double length = 2, moment = 2 * std::numbers::pi * section.bending_z / length;
  for (const Index n : {2, 3, 4, 8, 32, 128, 256, 512}) {
    BeamChain chain = arc_chain({{0, 0, 0}, {1, 0, 0}, length, {0, 0, 0}}, 1, n, section);
    chain.load_end({0, 0, 0}, {0, 0, moment});
    ASSERT_TRUE(chain.solve(n < 128 ? 20 : 8)) << n << " elements";
    EXPECT_LT(chain.end().r.norm(), 1e-7 * length) << n << " elements";
    EXPECT_LT((chain.end().rot - Mat3::Identity()).norm(), 1e-7) << n << " elements";
    const Vec3 half = chain.node(0, n / 2).r;
    if (n % 2 == 0) {
      EXPECT_LT((half - Vec3(0, length / std::numbers::pi, 0)).norm(), 1e-7) << n << " elements";
    }
  }
}

}  // namespace
}  // namespace espalier::dynamics::test
