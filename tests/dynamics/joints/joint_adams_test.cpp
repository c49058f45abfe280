// Truth: tables computed with MSC Adams for single-body joint models (Project Chrono's unit tests, BSD-3), every 0.01 s
// to 5 s. Common: mass 1, gravity -9.80665 z, start at rest. Bounds on the root mean square of the difference are those
// of the tables' first users: positions 1e-3, velocities 1e-3, accelerations 2e-2, quaternions 1e-3, reactions 1e-2
// (the longest runs have turned over several times by 5 s, and Adams integrated them with its own error).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numbers>
#include <sstream>

#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/forces/frame_force.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/joints/joint.hpp"
#include "places.hpp"

namespace espalier::dynamics {
namespace joint_adams_test {

const std::filesystem::path kTables = espalier::test::shared_data() / "../dynamics_cases/data/adams_joints";

using Table = std::vector<std::vector<double>>;

Table read_table(const std::string& name) {
  std::ifstream in(kTables / name);
  Table table;
  std::string line;
  while (std::getline(in, line)) {
    std::istringstream numbers(line);
    std::vector<double> row;
    for (double x = 0; numbers >> x;) row.push_back(x);
    if (row.size() >= 4) table.push_back(row);
  }
  return table;
}

// What a case compares: a file and the quantity of the same name.
struct Quantity {
  std::string file;
  double bound;
  std::function<std::vector<double>(const StateView&)> value;
};

class AdamsTables : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kTables)) GTEST_SKIP() << kTables << " is not there";
  }

  RigidBody& add_body(Vec3 position, Mat3 rotation, Vec3 inertia, Vec3 velocity = Vec3::Zero()) {
    RigidBodyData data;
    data.inertia = inertia.asDiagonal();
    data.position = position;
    data.rotation = quaternion_of(rotation);
    data.velocity = velocity;
    data.gravity = {0, 0, -9.80665};
    return system_.add(std::make_unique<RigidBody>("bar", data));
  }

  static std::vector<double> list(const Vec3& x) { return {x[0], x[1], x[2]}; }

  std::vector<Quantity> kinematics(const RigidBody& body) {
    const auto spin = [&body](const StateView& s, ConstSpan x) {  // global axes, as the tables
      return list(rotation_matrix(body.quaternion(s.q)) * body.angular(x));
    };
    return {{"Pos", 1e-3, [&body](const StateView& s) { return list(body.position(s.q)); }},
            {"Vel", 1e-3, [&body](const StateView& s) { return list(body.velocity(s.v)); }},
            {"Acc", 2e-2, [&body](const StateView& s) { return list(body.velocity(s.a)); }},
            {"Avel", 1e-3, [=](const StateView& s) { return spin(s, s.v); }},
            {"Aacc", 2e-2, [=](const StateView& s) { return spin(s, s.a); }},
            {"Quat", 1e-3, [&body](const StateView& s) {
               const Quat q = body.quaternion(s.q);
               return std::vector<double>{q[0], q[1], q[2], q[3]};
             }}};
  }

  // Force and moment of a joint on the ground, as Adams reports them.
  static void add_reaction(std::vector<Quantity>& list_of, const Joint& joint, const std::string& suffix) {
    list_of.push_back(
        {"Rforce" + suffix, 1e-2, [&joint](const StateView& s) { return list(joint.reaction(s, 0).force); }});
    list_of.push_back(
        {"Rtorque" + suffix, 1e-2, [&joint](const StateView& s) { return list(joint.reaction(s, 0).moment); }});
  }

  void compare(const std::string& prefix, const std::vector<Quantity>& quantities) {
    system_.finish();
    Equations equations(system_);
    State s(system_.sizes());
    system_.initial(s.q, s.v);
    make_consistent(equations, s);
    BdfOptions options;
    options.relative = options.absolute = 1e-8;
    BdfIntegrator bdf(equations, options);
    bdf.start(s);
    std::vector<Table> tables;
    std::vector<double> squares(quantities.size(), 0.0);
    for (const Quantity& q : quantities) {
      tables.push_back(read_table(prefix + "_ADAMS_" + q.file + ".txt"));
      ASSERT_GT(tables.back().size(), 400U) << prefix << " " << q.file;
    }
    for (std::size_t row = 0; row < tables[0].size(); ++row) {
      const double t = tables[0][row][0];
      if (t > bdf.state().t) bdf.integrate(t);
      for (std::size_t k = 0; k < quantities.size(); ++k) {
        squares[k] += square_difference(tables[k].at(row), quantities[k].value(bdf.state().view()));
      }
    }
    for (std::size_t k = 0; k < quantities.size(); ++k) {
      const double rms = std::sqrt(squares[k] / static_cast<double>(tables[k].size()));
      // Seven printed digits: reactions of hundreds of N m carry errors in proportion.
      double largest = 1;
      for (const auto& row : tables[k])
        largest = std::max(largest, std::abs(*std::max_element(row.begin() + 1, row.end())));
      EXPECT_LT(rms, quantities[k].bound * largest) << prefix << " " << quantities[k].file;
    }
    EXPECT_LT(bdf.counts().largest_position, 1e-9);
  }

  // Quaternions of opposite sign are the same rotation.
  static double square_difference(const std::vector<double>& row, const std::vector<double>& value) {
    double same = 0, opposite = 0;
    for (std::size_t i = 0; i < value.size(); ++i) {
      same += std::pow(row[i + 1] - value[i], 2);
      opposite += std::pow(row[i + 1] + value[i], 2);
    }
    return value.size() == 4 ? std::min(same, opposite) : same;
  }

  static Mat3 about_x(double degrees) { return rotation_exp(degrees * std::numbers::pi / 180 * Vec3::UnitX()); }
  static Mat3 about_y(double degrees) { return rotation_exp(degrees * std::numbers::pi / 180 * Vec3::UnitY()); }
  static Mat3 about_z(double degrees) { return rotation_exp(degrees * std::numbers::pi / 180 * Vec3::UnitZ()); }

  void revolute(const std::string& name, Vec3 place, double degrees) {
    const Mat3 axes = about_x(degrees);
    RigidBody& body = add_body(place + Vec3(2, 0, 0), axes, {0.04, 0.1, 0.1});
    Joint& joint =
        system_.add(revolute_joint("pivot", std::make_unique<GroundFrame>(place, axes), frame_at(body, place, axes)));
    auto quantities = kinematics(body);
    add_reaction(quantities, joint, "");
    compare("revolute_joint/" + name, quantities);
  }

  void prismatic(const std::string& name, Vec3 place, double degrees) {
    const Mat3 axes = about_x(degrees);
    RigidBody& body = add_body(place + Vec3(2, 0, 0), axes, {0.04, 0.1, 0.1});
    Joint& joint =
        system_.add(prismatic_joint("slide", std::make_unique<GroundFrame>(place, axes), frame_at(body, place, axes)));
    auto quantities = kinematics(body);
    add_reaction(quantities, joint, "");
    compare("prismatic_joint/" + name, quantities);
  }

  void distance(const std::string& name, Vec3 ground, Vec3 attachment, Vec3 centre, Mat3 rotation) {
    RigidBody& body = add_body(centre, rotation, {0.04, 0.1, 0.1});
    Joint& joint = system_.add(distance_joint("rod", std::make_unique<GroundFrame>(ground), frame_at(body, attachment),
                                              (attachment - ground).norm()));
    auto quantities = kinematics(body);
    add_reaction(quantities, joint, "");
    compare("distance_constraint/" + name, quantities);
  }

  void revolute_spherical(const std::string& name, Vec3 place, double degrees) {
    const Mat3 axes = about_x(degrees);
    const Vec3 ball = place + Vec3(2, 0, 0);
    RigidBody& body = add_body(ball + Vec3(0, 2, 0), Mat3::Identity(), {0.1, 0.04, 0.1});
    Joint& joint = system_.add(
        revolute_spherical_joint("link", std::make_unique<GroundFrame>(place, axes), frame_at(body, ball), 2));
    auto quantities = kinematics(body);
    add_reaction(quantities, joint, "_Body1");
    compare("revsph_constraint/" + name, quantities);
  }

  void actuator(const std::string& name, double degrees, double speed) {
    const Mat3 axes = about_y(degrees);
    RigidBody& body = add_body(Vec3::Zero(), axes, {0.04, 0.1, 0.1}, speed * axes.col(2));
    Joint& slide = system_.add(prismatic_joint("slide", std::make_unique<GroundFrame>(Vec3::Zero(), axes),
                                               frame_at(body, Vec3::Zero(), axes)));
    Joint& motor = system_.add(translation_motor("motor", std::make_unique<GroundFrame>(Vec3::Zero(), axes),
                                                 frame_at(body, Vec3::Zero(), axes), TimeFunction::linear(0, speed)));
    auto quantities = kinematics(body);
    add_reaction(quantities, slide, "P");
    // the table gives the motor's force on the body
    quantities.push_back({"RforceA", 1e-2, [&motor](const StateView& s) { return list(motor.reaction(s, 1).force); }});
    compare("lin_actuator/" + name, quantities);
  }

  AssembledSystem system_;
};

TEST_F(AdamsTables, RevoluteCase01) { revolute("Revolute_Case01", Vec3::Zero(), -90); }
TEST_F(AdamsTables, RevoluteCase02) { revolute("Revolute_Case02", {1, 2, 3}, -45); }
TEST_F(AdamsTables, PrismaticCase01) { prismatic("Prismatic_Case01", Vec3::Zero(), 0); }
TEST_F(AdamsTables, PrismaticCase02) { prismatic("Prismatic_Case02", {1, 2, 3}, -45); }
TEST_F(AdamsTables, PrismaticCase03) { prismatic("Prismatic_Case03", {1, 2, 3}, -90); }
TEST_F(AdamsTables, DistanceCase01) {
  distance("Distance_Case01", Vec3::Zero(), {0, 2, 0}, {0, 2, 0}, Mat3::Identity());
}
TEST_F(AdamsTables, DistanceCase02) { distance("Distance_Case02", {1, 2, 3}, {1, 4, 3}, {-1, 4, 3}, Mat3::Identity()); }
TEST_F(AdamsTables, DistanceCase03) { distance("Distance_Case03", Vec3::Zero(), {0, 2, 0}, {0, 4, 0}, about_z(-90)); }
TEST_F(AdamsTables, RevoluteSphericalCase01) { revolute_spherical("RevSpherical_Case01", Vec3::Zero(), 0); }
TEST_F(AdamsTables, RevoluteSphericalCase02) { revolute_spherical("RevSpherical_Case02", {1, 2, 3}, -45); }
TEST_F(AdamsTables, LinearActuatorCase01) { actuator("LinActuator_Case01", 0, 1); }
TEST_F(AdamsTables, LinearActuatorCase02) { actuator("LinActuator_Case02", 45, 0.5); }

// Torsion spring on a revolute joint: 200 N m/rad and 10 N m s/rad, which follow from single rows of the table (the
// .adm file beside it has other constants).
TEST_F(AdamsTables, RotationalSpringCase01) {
  const Mat3 axes = about_x(-90);
  RigidBody& body = add_body({2, 0, 0}, axes, {0.04, 0.1, 0.1});
  const auto ground = [&] { return std::make_unique<GroundFrame>(Vec3::Zero(), axes); };
  Joint& joint = system_.add(revolute_joint("pivot", ground(), frame_at(body, Vec3::Zero(), axes)));
  SpringLaw law;
  law.stiffness = 200;
  law.damping = 10;
  FrameForce& spring = system_.add(rotational_spring("spring", ground(), frame_at(body, Vec3::Zero(), axes), law));
  auto quantities = kinematics(body);
  quantities.push_back({"Rforce", 1e-2, [&joint](const StateView& s) { return list(joint.reaction(s, 0).force); }});
  // moment of joint and spring together on the ground
  quantities.push_back({"Rtorque", 1e-2, [&](const StateView& s) {
                          return list(joint.reaction(s, 0).moment + spring.applied(s, 0).moment);
                        }});
  compare("rotspring_force/RotSpring_Case01", quantities);
}

// Springs to a fixed point; constants follow from single rows of the tables (m (a - g) = k (r - 2) + c r'): 10 N/m,
// 0.5 N s/m with the fixed point 2 m above, and 100 N/m, 5 N s/m with the fixed point at the origin.
class AdamsSprings : public AdamsTables {
 protected:
  void spring(int which) {
    RigidBody& body = add_body(which == 1 ? Vec3(0, 0, 0) : Vec3(0, 2, 0), Mat3::Identity(), {0.04, 0.1, 0.1});
    SpringLaw law;
    law.rest = 2;
    law.stiffness = which == 1 ? 10 : 100;
    law.damping = which == 1 ? 0.5 : 5;
    FrameForce& force =
        system_.add(spring_damper("spring", std::make_unique<GroundFrame>(which == 1 ? Vec3(0, 0, 2) : Vec3::Zero()),
                                  frame_at(body, body.data().position), law));
    auto quantities = kinematics(body);
    quantities.push_back({"Rforce", 1e-2, [&force](const StateView& s) { return list(force.applied(s, 0).force); }});
    compare("transpring_force/TranSpring_Case0" + std::to_string(which), quantities);
  }
};

TEST_F(AdamsSprings, TranslationalCase01) { spring(1); }
TEST_F(AdamsSprings, TranslationalCase02) { spring(2); }

}  // namespace joint_adams_test
}  // namespace espalier::dynamics
