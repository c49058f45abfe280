// Frames on flexible bodies: rigid motion exactly, derivatives by differences.
#include "dynamics/bodies/flexible_frame.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "dynamics/bodies/carried_frame.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/meshers/parts.hpp"

namespace espalier::dynamics::test {
namespace {

constexpr double kUnit = 2.220446049250313e-16;

const Vec3 kArm(0.3, -0.2, 0.5);

struct Framed {
  AssembledSystem system;
  FlexibleBody* body;
  std::vector<double> q, v;
  std::unique_ptr<Frame> frame;

  /// @param carried with an arm and axes of its own
  Framed(bool beam, double noise, bool carried = false) {
    const Material m{SolidLaw::st_venant_kirchhoff, 200, 0.3, 7};
    const Mesh mesh = make_block({1, 1, 1}, 2, 2, 1);
    body =
        &system.add(beam ? make_beam_body("beam", {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 2, rectangular_section(m, 0.1, 0.2))
                         : make_solid_body("block", mesh, m));
    system.finish();
    frame = beam ? make_beam_frame(*body, 1) : make_face_frame(*body, mesh, mesh.face_set("x1"));
    if (carried)
      frame =
          std::make_unique<CarriedFrame>(std::move(frame), kArm, Eigen::AngleAxisd(0.4, kArm.normalized()).matrix());
    const double c = std::cos(0.8), s = std::sin(0.8);
    body->set_initial_motion({c, -s, 0, s, c, 0, 0, 0, 1}, {1, 2, 3}, {0.5, 0.1, 0.2}, {0.3, -0.4, 0.9});
    q.resize(static_cast<std::size_t>(system.sizes().configuration));
    v.resize(q.size());
    system.initial(q, v);
    std::mt19937 generator(4);
    std::uniform_real_distribution<double> uniform(-noise, noise);
    for (double& x : q) x += uniform(generator);
    for (double& x : v) x += uniform(generator);
  }
};

// Truth: under rigid motion a frame moves like the rigid body: r = R X + t, rot = R, omega.
TEST(FlexibleFrame, FollowsRigidMotion) {
  for (const int kind : {0, 1, 2, 3}) {
    const bool beam = kind % 2 == 1, carried = kind >= 2;
    Framed s(beam, 0, carried);
    FrameMotion m;
    s.frame->motion(s.q, s.v, m);
    const Mat3 r = Eigen::AngleAxisd(0.8, Vec3::UnitZ()).toRotationMatrix();
    const Vec3 own = beam ? Vec3(0.5, 0, 0) : Vec3(1, 0.5, 0.5), omega(0.3, -0.4, 0.9);
    const Vec3 at = carried ? Vec3(own + kArm) : own;
    const Mat3 turn = Eigen::AngleAxisd(carried ? 0.4 : 0, kArm.normalized()).matrix();
    EXPECT_LT((m.r - (r * at + Vec3(1, 2, 3))).norm(), 50 * kUnit);
    EXPECT_LT((m.rot - r * turn).norm(), 50 * kUnit);
    EXPECT_LT((m.omega - omega).norm(), 100 * kUnit);
    EXPECT_LT((m.vel - (Vec3(0.5, 0.1, 0.2) + omega.cross(m.r))).norm(), 100 * kUnit);
  }
}

// Truth: central differences of rotation, of J v along the motion, and of J^T wrench.
TEST(FlexibleFrame, DerivativesMatchFiniteDifferences) {
  for (const int kind : {0, 1, 2, 3}) {
    Framed s(kind % 2 == 1, 0.05, kind >= 2);
    const auto coordinates = s.frame->coordinates();
    const auto n = static_cast<Eigen::Index>(coordinates.size());
    const double h = std::cbrt(kUnit), tolerance = 100 * h * h;
    Eigen::MatrixXd j(6, n), high(6, n), low(6, n);
    s.frame->jacobian(s.q, j.data());
    Vec6 wrench;
    wrench << 1, -2, 3, 0.7, 0.4, -0.6;
    Eigen::MatrixXd k = Eigen::MatrixXd::Zero(n, n);
    s.frame->wrench_stiffness(s.q, wrench, 2, k.data());
    Eigen::MatrixXd rate(6, n);
    s.frame->rate_jacobian(s.q, s.v, rate.data());
    FrameMotion a, b, now, fast, slow;
    s.frame->motion(s.q, s.v, now);
    Vec6 twist = Vec6::Zero();
    for (Eigen::Index c = 0; c < n; ++c) {
      const auto i = static_cast<std::size_t>(coordinates[static_cast<std::size_t>(c)]);
      twist += j.col(c) * s.v[i];
      const double keep = s.q[i];
      s.q[i] = keep + h;
      s.frame->motion(s.q, {}, a);
      s.frame->motion(s.q, s.v, fast);
      s.frame->jacobian(s.q, high.data());
      s.q[i] = keep - h;
      s.frame->motion(s.q, {}, b);
      s.frame->motion(s.q, s.v, slow);
      s.frame->jacobian(s.q, low.data());
      s.q[i] = keep;
      const Eigen::AngleAxisd turn(Mat3(a.rot * b.rot.transpose()));
      EXPECT_LT((j.col(c).tail<3>() - turn.angle() * turn.axis() / (2 * h)).norm(), tolerance);
      EXPECT_LT((j.col(c).head<3>() - (a.r - b.r) / (2 * h)).norm(), tolerance);
      EXPECT_LT((rate.col(c).tail<3>() - (fast.omega - slow.omega) / (2 * h)).norm(), 50 * tolerance);
      EXPECT_LT((rate.col(c).head<3>() - (fast.vel - slow.vel) / (2 * h)).norm(), 50 * tolerance);
      if (!s.frame->turns(static_cast<std::size_t>(c))) {
        EXPECT_EQ(j.col(c).tail<3>().norm(), 0);
      }
      EXPECT_LT((k.col(c) - 2 * (high - low).transpose() * wrench / (2 * h)).norm(), 50 * tolerance);
    }
    EXPECT_LT((twist.head<3>() - now.vel).norm() + (twist.tail<3>() - now.omega).norm(), 1e3 * kUnit);
    auto ahead = s.q, behind = s.q;
    for (std::size_t i = 0; i < s.q.size(); ++i) {
      ahead[i] += h * s.v[i];
      behind[i] -= h * s.v[i];
    }
    s.frame->motion(ahead, s.v, a);
    s.frame->motion(behind, s.v, b);
    EXPECT_LT((now.bias_alpha - (a.omega - b.omega) / (2 * h)).norm(), 50 * tolerance);
    EXPECT_LT((now.bias_acc - (a.vel - b.vel) / (2 * h)).norm(), 50 * tolerance);
  }
}

TEST(FlexibleFrame, NodesAndMistakes) {
  const Mesh mesh = make_block({1, 1, 1}, 1, 1, 1);
  const auto body = make_solid_body("block", mesh, {SolidLaw::st_venant_kirchhoff, 200, 0.3, 7});
  EXPECT_FALSE(make_node_frame(*body, 3)->has_rotation());
  EXPECT_THROW(static_cast<void>(make_face_frame(*body, mesh, {})), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(make_beam_frame(*body, 0)), std::invalid_argument);
}

}  // namespace
}  // namespace espalier::dynamics::test
