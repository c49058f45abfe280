// Truth: central differences of the functions themselves, at states that satisfy nothing in particular.
#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/dae/check.hpp"
#include "dynamics/forces/frame_force.hpp"
#include "dynamics/joints/joint.hpp"
#include "dynamics/model/harmonic.hpp"
#include "dynamics/reference/andrews.hpp"

namespace espalier::dynamics {
namespace jacobian_test {

// Central differences with step 6e-6 carry an error of about 1e-10 of the third derivative plus eps / step = 4e-11 of
// the size of the terms that cancel; states are of size one, so 2e-8 leaves room for sums over them.
constexpr double kTolerance = 2e-8;

class Numbers {
 public:
  explicit Numbers(unsigned seed) : engine_(seed) {}
  double operator()() { return uniform_(engine_); }
  Vec3 vector() { return {(*this)(), (*this)(), (*this)()}; }
  Mat3 rotation() { return rotation_exp(2 * vector()); }
  void fill(std::vector<double>& x) {
    for (double& y : x) y = (*this)();
  }

 private:
  std::mt19937 engine_;
  std::uniform_real_distribution<double> uniform_{-1, 1};
};

RigidBody& add_body(AssembledSystem& system, Numbers& random, const std::string& name) {
  RigidBodyData data;
  data.mass = 2;
  data.inertia << 0.5, 0.1, -0.05, 0.1, 0.7, 0.02, -0.05, 0.02, 0.9;
  data.position = 2 * random.vector();
  data.rotation = quaternion_exp(2 * random.vector());
  data.gravity = {0, 0, -9.81};
  return system.add(std::make_unique<RigidBody>(name, data));
}

using Maker = std::function<std::unique_ptr<Component>(FramePtr, FramePtr)>;

struct Case {
  std::string name;
  Maker make;
  friend void PrintTo(const Case& p, std::ostream* out) { *out << p.name; }
};

class JacobiansOf : public testing::TestWithParam<Case> {};

void check(AssembledSystem& system, Numbers& random, const std::string& what) {
  State s(system.sizes());
  system.initial(s.q, s.v);
  random.fill(s.v);
  random.fill(s.a);
  random.fill(s.lambda);
  s.t = 0.37;
  const JacobianCheck result = check_jacobians(system, s);
  EXPECT_LT(result.largest(), kTolerance)
      << what << ": " << result.worst << " gamma " << result.gamma << " F_q " << result.f_q << " F_v " << result.f_v;
  EXPECT_GT(system.tangent_pattern().nonzeros(), 0);
}

TEST_P(JacobiansOf, AgreeWithDifferences) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    for (const bool ground : {false, true}) {
      Numbers random(seed);
      AssembledSystem system;
      RigidBody& one = add_body(system, random, "one");
      RigidBody& two = add_body(system, random, "two");
      FramePtr a = std::make_unique<RigidFrame>(one, random.vector(), random.rotation());
      if (ground) a = std::make_unique<GroundFrame>(random.vector(), random.rotation());
      FramePtr b = std::make_unique<RigidFrame>(two, random.vector(), random.rotation());
      system.add(GetParam().make(std::move(a), std::move(b)));
      system.finish();
      check(system, random, GetParam().name + ", seed " + std::to_string(seed) + (ground ? ", ground" : ""));
    }
  }
}

SpringLaw spring_law() {
  SpringLaw law;
  law.stiffness = 7;
  law.damping = 0.6;
  law.rest = 0.4;
  law.preload = 0.3;
  law.actuator = harmonic(0.1, 0.5, 2, 0.3);
  law.active = true;
  return law;
}

LoadLaw load_law(bool follower) {
  LoadLaw law;
  law.force = {1, -2, 0.5};
  law.moment = {0.3, 0.7, -1};
  law.factor = harmonic(1, 0.5, 3, 0.1);
  law.follower = follower;
  return law;
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, JacobiansOf,
    testing::Values(
        Case{"fixed", [](FramePtr a, FramePtr b) { return fixed_joint("j", std::move(a), std::move(b)); }},
        Case{"revolute", [](FramePtr a, FramePtr b) { return revolute_joint("j", std::move(a), std::move(b)); }},
        Case{"spherical", [](FramePtr a, FramePtr b) { return spherical_joint("j", std::move(a), std::move(b)); }},
        Case{"universal", [](FramePtr a, FramePtr b) { return universal_joint("j", std::move(a), std::move(b)); }},
        Case{"cylindrical", [](FramePtr a, FramePtr b) { return cylindrical_joint("j", std::move(a), std::move(b)); }},
        Case{"prismatic", [](FramePtr a, FramePtr b) { return prismatic_joint("j", std::move(a), std::move(b)); }},
        Case{"planar", [](FramePtr a, FramePtr b) { return planar_joint("j", std::move(a), std::move(b)); }},
        Case{"point_on_line", [](FramePtr a, FramePtr b) { return point_on_line("j", std::move(a), std::move(b)); }},
        Case{"distance", [](FramePtr a, FramePtr b) { return distance_joint("j", std::move(a), std::move(b), 0.8); }},
        Case{"revolute_spherical",
             [](FramePtr a, FramePtr b) { return revolute_spherical_joint("j", std::move(a), std::move(b), 0.8); }},
        Case{"rotation_motor",
             [](FramePtr a, FramePtr b) {
               return rotation_motor("j", std::move(a), std::move(b), harmonic(0.1, 0.4, 3, 0.2));
             }},
        Case{"translation_motor",
             [](FramePtr a, FramePtr b) {
               return translation_motor("j", std::move(a), std::move(b), harmonic(0.1, 0.4, 3, 0.2));
             }},
        Case{"prescribed",
             [](FramePtr a, FramePtr b) {
               return prescribed_coordinate("j", std::move(a), std::move(b), 1, TimeFunction::smooth_step(0, 0, 1, 2));
             }},
        Case{"rolling_wheel",
             [](FramePtr a, FramePtr b) {
               return rolling_joint("j", std::move(a), std::move(b), {0.4, 0, false});
             }},
        Case{"rolling_tyre",
             [](FramePtr a, FramePtr b) {
               return rolling_joint("j", std::move(a), std::move(b), {0.4, 0.1, false});
             }},
        Case{"rolling_ball",
             [](FramePtr a, FramePtr b) {
               return rolling_joint("j", std::move(a), std::move(b), {0, 0.3, false});
             }},
        Case{"skate",
             [](FramePtr a, FramePtr b) {
               return rolling_joint("j", std::move(a), std::move(b), {0, 0, true});
             }},
        Case{"spring",
             [](FramePtr a, FramePtr b) { return spring_damper("f", std::move(a), std::move(b), spring_law()); }},
        Case{"axial",
             [](FramePtr a, FramePtr b) { return axial_spring("f", std::move(a), std::move(b), spring_law()); }},
        Case{"rotational",
             [](FramePtr a, FramePtr b) { return rotational_spring("f", std::move(a), std::move(b), spring_law()); }},
        Case{"bushing",
             [](FramePtr a, FramePtr b) {
               BushingLaw law;
               law.stiffness = {3, 4, 5};
               law.damping = {0.3, 0.2, 0.1};
               law.angular_stiffness = {1, 2, 3};
               law.angular_damping = {0.2, 0.1, 0.4};
               return bushing("f", std::move(a), std::move(b), law);
             }},
        Case{"load", [](FramePtr /*a*/, FramePtr b) { return load("f", std::move(b), load_law(false)); }},
        Case{"follower", [](FramePtr /*a*/, FramePtr b) { return load("f", std::move(b), load_law(true)); }}),
    [](const auto& instance) { return instance.param.name; });

TEST(JacobiansOfCouplings, GearAndRackAgreeWithDifferences) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    for (const bool gear : {true, false}) {
      Numbers random(seed);
      AssembledSystem system;
      RigidBody& carrier = add_body(system, random, "carrier");
      RigidBody& one = add_body(system, random, "one");
      RigidBody& two = add_body(system, random, "two");
      const auto frame = [&](const RigidBody& body) {
        return std::make_unique<RigidFrame>(body, random.vector(), random.rotation());
      };
      if (gear) {
        system.add(gear_joint("g", frame(carrier), frame(one), frame(carrier), frame(two), 1.7));
      } else {
        system.add(rack_and_pinion("r", frame(carrier), frame(one), frame(carrier), frame(two), 0.3));
      }
      system.finish();
      check(system, random, (gear ? "gear, seed " : "rack, seed ") + std::to_string(seed));
    }
  }
}

TEST(JacobiansOfFunctions, AndrewsWithoutTheLeftOutTerm) {
  FunctionSystem system(andrews_functions());
  Numbers random(7);
  State s = andrews_start();
  random.fill(s.v);
  random.fill(s.a);
  random.fill(s.lambda);
  const JacobianCheck result = check_jacobians(system, s);
  EXPECT_LT(std::max({result.f_a, result.f_v, result.phi_q, result.gamma, result.nu}), kTolerance) << result.worst;
}

// What is left out is made by differences; the check must see nothing, and must see a wrong derivative.
TEST(JacobiansOfFunctions, DifferencesStandInAndErrorsAreFound) {
  DaeFunctions f = andrews_functions();
  f.tangent = nullptr;
  f.constraint_jacobian = nullptr;
  f.constraint_gamma = nullptr;
  Numbers random(3);
  State s = andrews_start();
  random.fill(s.v);
  random.fill(s.a);
  random.fill(s.lambda);
  FunctionSystem by_differences(f);
  // Second differences (gamma from a Phi_q made by differences): eps^(1/3) each time.
  EXPECT_LT(check_jacobians(by_differences, s).largest(), 1e-4);

  DaeFunctions wrong = andrews_functions();
  wrong.constraint_jacobian = [good = wrong.constraint_jacobian](double t, ConstSpan q, MatrixEntries g) {
    good(t, q, g);
    g(3, 4) *= 1.001;
  };
  FunctionSystem broken(wrong);
  const JacobianCheck found = check_jacobians(broken, s);
  EXPECT_GT(found.phi_q, 1e-5);
}

}  // namespace jacobian_test
}  // namespace espalier::dynamics
