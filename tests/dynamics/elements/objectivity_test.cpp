// A whole model, moved and turned: nothing that it does may change but for that. Truth: symmetry of space.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace objectivity_test {

using Vec3 = Eigen::Vector3d;

/// x -> turn x + shift
struct Placement {
  Vec3 turn = Vec3::Zero();  // rotation vector
  Vec3 shift = Vec3::Zero();

  [[nodiscard]] Eigen::Matrix3d rotation() const {
    const double angle = turn.norm();
    return angle == 0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
                      : Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
  }
  [[nodiscard]] static std::string list(const Vec3& x) {
    return fmt::format("[{:.17g}, {:.17g}, {:.17g}]", x[0], x[1], x[2]);
  }
  [[nodiscard]] std::string point(double x, double y, double z) const {
    return list(rotation() * Vec3(x, y, z) + shift);
  }
  [[nodiscard]] std::string direction(double x, double y, double z) const { return list(rotation() * Vec3(x, y, z)); }
};

/// One of everything: rigid, solid, cable, beam and shell bodies; joints with friction and stops; springs, a bushing, a
/// pressure, loads and a motor with expressions that do not know where the model is.
std::string everything(const Placement& p) {
  const std::string turned = "rotation = " + Placement::list(p.turn) + "\n";
  std::string text = "gravity = " + p.direction(0.5, -9.81, 2) + "\n";
  text += "[bodies.arm]\ntype = \"rigid\"\nmass = 2\ninertia = [0.1, 0.2, 0.3]\nposition = " + p.point(0.5, 0, 0) +
          "\n" + turned;
  text += "[bodies.wheel]\ntype = \"rigid\"\nmass = 1\ninertia = [0.02, 0.02, 0.04]\nposition = " + p.point(1, 0, 0) +
          "\n" + turned;
  text +=
      "[bodies.block]\ntype = \"solid\"\nmesh = { part = \"block\", lx = 0.6, ly = 0.2, lz = 0.2, divisions = [2, 1, "
      "1] }\nmaterial = { young = 1e6, poisson = 0.3, density = 1000 }\ndamping = { stiffness = 1e-3 }\nposition = " +
      p.point(0, 1, 0) + "\n" + turned;
  text += "[bodies.rope]\ntype = \"cable\"\nstart = " + p.point(0, -1, 0) + "\nend = " + p.point(1, -1, 0.2) +
          "\nelements = 3\naxial = 1e3\nbending = 0.1\nmass_per_length = 0.5\n";
  text += "[bodies.rod]\ntype = \"beam\"\nstart = " + p.point(0, -2, 0) + "\nend = " + p.point(1, -2, 0) +
          "\ny = " + p.direction(0, 1, 0.3) +
          "\nelements = 2\nheight = 0.05\nwidth = 0.03\nmaterial = { young = 1e8, poisson = 0.3, density = 1000 }\n";
  text += "[bodies.plate]\ntype = \"shell\"\norigin = " + p.point(0, 0, 3) + "\nx = " + p.direction(1, 0, 0) +
          "\ny = " + p.direction(0, 0.5, 0) +
          "\nnx = 2\nny = 1\nthickness = 0.02\nmaterial = { young = 1e7, poisson = 0.2, density = 500 }\n";
  const auto ground = [&](double x, double y, double z) {
    return "{ body = \"ground\", point = " + p.point(x, y, z) + ", axis = " + p.direction(0, 0, 1) +
           ", x_axis = " + p.direction(1, 0, 0) + " }";
  };
  text += "[joints]\nhinge = { type = \"revolute\", a = " + ground(0, 0, 0) +
          ", b = { body = \"arm\", point = [-0.5, 0, 0] }, friction = { coefficient = 0.2, slip_speed = 0.1, radius = "
          "0.05 }, limits = { lower = -0.3, stiffness = 500, smoothing = 0.1, damping = 0.1 } }\n";
  text +=
      "axle = { type = \"revolute\", a = { body = \"arm\", point = [0.5, 0, 0], axis = [0, 0, 1] }, b = { body = "
      "\"wheel\" } }\n";
  text += "wall = { type = \"fixed\", a = " + ground(0, 1.1, 0.1) + ", b = { body = \"block\", face = \"x0\" } }\n";
  text += "hook = { type = \"spherical\", a = " + ground(0, -1, 0) + ", b = { body = \"rope\", node = 1 } }\n";
  text += "clamp = { type = \"fixed\", a = " + ground(0, -2, 0) + ", b = { body = \"rod\", node = 1 } }\n";
  text += "edge0 = { type = \"spherical\", a = " + ground(0, 0, 3) + ", b = { body = \"plate\", node = 1 } }\n";
  text += "[markers]\ntip = { body = \"block\", face = \"x1\" }\nend = { body = \"rod\", node = -1 }\n";
  text += "rope_end = { body = \"rope\", node = -1 }\ncorner = { body = \"plate\", node = -1 }\n";
  text +=
      "[forces]\nspring = { type = \"spring\", a = \"rope_end\", b = { body = \"arm\", point = [0, -0.1, 0] }, "
      "stiffness = 20, damping = 0.5, actuator = \"2*(spring.coordinate - 1)^3\" }\n";
  text +=
      "bush = { type = \"bushing\", a = \"tip\", b = { body = \"arm\", point = [0.1, 0.1, 0] }, stiffness = [5, 8, "
      "3], damping = [0.1, 0.1, 0.1], angular_stiffness = [1, 2, 3] }\n";
  text +=
      "gas = { type = \"pressure\", body = \"block\", face = \"y1\", pressure = \"500*(1 + hinge.angle) + "
      "clamp.force.norm\" }\n";
  text +=
      "motor = { type = \"torque-motor\", a = { body = \"arm\", axis = [0, 0, 1] }, b = { body = \"wheel\" }, torque = "
      "\"2 - "
      "0.3*axle.angular_speed\" }\n";
  text += "push = { type = \"load\", a = \"end\", force = " + p.direction(3, -2, 1) +
          ", moment = " + p.direction(0.2, 0.1, -0.3) + " }\n";
  text += "follow = { type = \"load\", a = \"tip\", force = [1, 2, 3], follower = true }\n";
  text += "tie = { type = \"spring\", a = \"corner\", b = \"end\", stiffness = 3 }\n";
  return text;
}

/// Where the markers and bodies are, brought back to the axes of the model as it was, and numbers that have no axes.
std::vector<double> outcome(const Placement& p, const std::string& run) {
  const Simulation s = simulated(everything(p) + run);
  std::vector<double> values;
  for (const char* name : {"arm", "wheel", "tip", "end", "rope_end", "corner"}) {
    const std::string place = std::string(name) + ".position.";
    const Vec3 back =
        p.rotation().transpose() * (Vec3(s.value(place + "x"), s.value(place + "y"), s.value(place + "z")) - p.shift);
    values.insert(values.end(), {back[0], back[1], back[2]});
  }
  for (const char* name : {"hinge.angle", "axle.angular_speed", "hinge.force.norm", "wall.moment.norm",
                           "hinge.friction_moment", "spring.strength", "gas.pressure"})
    values.push_back(s.value(name));
  return values;
}

void compare(const std::string& run, double tolerance) {
  const std::vector<double> truth = outcome({}, run);
  for (const Placement& p : {Placement{{0.7, -1.1, 0.4}, {0, 0, 0}}, Placement{{0, 0, 0}, {10, -20, 5}},
                             Placement{{-2, 1, 1.5}, {-3, 2, 7}}}) {
    const std::vector<double> moved = outcome(p, run);
    for (std::size_t i = 0; i < truth.size(); ++i)
      EXPECT_NEAR(moved[i], truth[i], tolerance * std::max(1.0, std::abs(truth[i])))
          << "number " << i << ", turned by " << p.turn.transpose() << ", moved by " << p.shift.transpose();
  }
}

TEST(Objectivity, OfAMotionWithAConstantStep) {
  compare("[integrator]\nmethod = \"generalized-alpha\"\nstep = 2e-3\nend = 0.1\nnewton_tolerance = 1e-4\n", 1e-6);
}

TEST(Objectivity, OfAMotionByBdf) {
  compare("[integrator]\nstep = 1e-3\norder = 2\nend = 0.05\nnewton_tolerance = 1e-4\n", 1e-6);
}

TEST(Objectivity, OfAnEquilibrium) {
  compare(
      "[joints.brake]\ntype = \"distance\"\na = { body = \"arm\", point = [0.5, 0.3, 0] }\n"
      "b = { body = \"wheel\", point = [0.2, 0.2, 0] }\n[forces.turn]\ntype = \"rotational-spring\"\n"
      "stiffness = 50\na = { body = \"arm\", axis = [0, 0, 1] }\nb = { body = \"wheel\" }\n[statics]\nload = 0.05\n",
      1e-6);
}

}  // namespace objectivity_test
}  // namespace espalier::dynamics
