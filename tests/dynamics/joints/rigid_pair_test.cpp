// Joints between rigid bodies are written out; the general way through frames is the second implementation.
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <random>

#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/joints/joint.hpp"
#include "dynamics/model/harmonic.hpp"

namespace espalier::dynamics {
namespace rigid_pair_test {

// A rigid frame that joints do not know as one.
class Disguised final : public Frame {
 public:
  explicit Disguised(FramePtr frame) : frame_(std::move(frame)) {}
  [[nodiscard]] std::span<const Index> coordinates() const override { return frame_->coordinates(); }
  void motion(ConstSpan q, ConstSpan v, FrameMotion& out) const override { frame_->motion(q, v, out); }
  void jacobian(ConstSpan q, double* j) const override { frame_->jacobian(q, j); }
  [[nodiscard]] bool turns(std::size_t k) const override { return frame_->turns(k); }
  [[nodiscard]] bool has_wrench_stiffness() const override { return frame_->has_wrench_stiffness(); }
  void wrench_stiffness(ConstSpan q, const Vec6& wrench, double scale, double* k) const override {
    frame_->wrench_stiffness(q, wrench, scale, k);
  }

 private:
  FramePtr frame_;
};

using Maker = std::function<std::unique_ptr<Joint>(std::string, FramePtr, FramePtr)>;

struct Kind {
  const char* name;
  Maker make;
  friend void PrintTo(const Kind& p, std::ostream* out) { *out << p.name; }
};

class RigidPairOf : public testing::TestWithParam<Kind> {};

// All that a joint contributes at a state: phi, nu, gamma, Phi_q, and W = F_q.
struct Contribution {
  std::vector<double> phi, nu, gamma, phi_q, w;
};

enum class Ends { two_bodies, ground_first, ground_last, later_body_first };

Contribution contribution(const Maker& make, Ends ends, bool disguise, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto number = [&] { return uniform(engine); };
  const auto vector = [&] { return Vec3(number(), number(), number()); };
  AssembledSystem system;
  std::array<RigidBody*, 2> bodies{};
  for (RigidBody*& body : bodies) {
    RigidBodyData data;
    data.position = 2 * vector();
    data.rotation = quaternion_exp(2 * vector());
    body = &system.add(std::make_unique<RigidBody>(&body == bodies.data() ? "one" : "two", data));
  }
  if (ends == Ends::later_body_first) std::swap(bodies[0], bodies[1]);
  std::array<FramePtr, 2> frames;
  for (std::size_t k = 0; k < 2; ++k) {
    const Vec3 point = vector();
    const Mat3 axes = rotation_exp(2 * vector());
    const bool ground = ends == (k == 0 ? Ends::ground_first : Ends::ground_last);
    frames[k] = ground ? FramePtr(std::make_unique<GroundFrame>(point, axes))
                       : FramePtr(std::make_unique<RigidFrame>(*bodies[k], point, axes));
    if (disguise) frames[k] = std::make_unique<Disguised>(std::move(frames[k]));
  }
  system.add(make("joint", std::move(frames[0]), std::move(frames[1])));
  system.finish();
  const Sizes sizes = system.sizes();
  std::vector<double> q(static_cast<std::size_t>(sizes.configuration)), v(static_cast<std::size_t>(sizes.velocity)),
      a(v.size()), lambda(static_cast<std::size_t>(sizes.constraints));
  system.initial(q, v);
  for (double& x : v) x = number();
  for (double& x : lambda) x = number();
  Contribution c;
  const std::size_t m = lambda.size();
  c.phi.resize(m);
  c.nu.resize(m);
  c.gamma.resize(m);
  constexpr double kStale = 7;  // what a call before may have left must be overwritten
  c.phi_q.assign(static_cast<std::size_t>(system.constraint_pattern().nonzeros()), kStale);
  c.w.resize(static_cast<std::size_t>(system.tangent_pattern().nonzeros()));
  system.constraints(0.3, q, v, {c.phi, c.nu, c.gamma, c.phi_q});
  system.tangent({0.3, q, v, a, lambda}, {0, 0, 1}, c.w);
  return c;
}

void expect_near(const std::vector<double>& x, const std::vector<double>& y, const std::string& what) {
  ASSERT_EQ(x.size(), y.size());
  // Values are sums of some 30 products of numbers below 20.
  const double tolerance = 30 * 20 * std::numeric_limits<double>::epsilon();
  for (std::size_t i = 0; i < x.size(); ++i) EXPECT_NEAR(x[i], y[i], tolerance) << what << ", entry " << i;
}

TEST_P(RigidPairOf, EqualsTheWayThroughFrames) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    for (const Ends ends : {Ends::two_bodies, Ends::ground_first, Ends::ground_last, Ends::later_body_first}) {
      const std::string where = ", seed " + std::to_string(seed) + ", ends " + std::to_string(static_cast<int>(ends));
      const Contribution fast = contribution(GetParam().make, ends, false, seed);
      const Contribution general = contribution(GetParam().make, ends, true, seed);
      expect_near(fast.phi, general.phi, "Phi" + where);
      expect_near(fast.nu, general.nu, "nu" + where);
      expect_near(fast.gamma, general.gamma, "gamma" + where);
      expect_near(fast.phi_q, general.phi_q, "Phi_q" + where);
      expect_near(fast.w, general.w, "F_q" + where);
    }
  }
}

Maker motor() {
  return [](std::string name, FramePtr a, FramePtr b) {
    return translation_motor(std::move(name), std::move(a), std::move(b), harmonic(0.1, 0.5, 2, 1));
  };
}

INSTANTIATE_TEST_SUITE_P(Kinds, RigidPairOf,
                         testing::Values(Kind{"fixed", fixed_joint}, Kind{"revolute", revolute_joint},
                                         Kind{"spherical", spherical_joint}, Kind{"universal", universal_joint},
                                         Kind{"cylindrical", cylindrical_joint}, Kind{"prismatic", prismatic_joint},
                                         Kind{"planar", planar_joint}, Kind{"point_on_line", point_on_line},
                                         Kind{"translation_motor", motor()}),
                         [](const auto& kind) { return kind.param.name; });

}  // namespace rigid_pair_test
}  // namespace espalier::dynamics
