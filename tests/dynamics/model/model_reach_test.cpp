// Places that double precision cannot tell apart beside the bodies are refused with their names.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

/// A rod whose hinge lies at x; the rod itself begins there, too, or stays at the origin.
std::string rod(double x, bool with_it) {
  return fmt::format(R"([bodies.rod]
type = "rigid"
mass = 1
box = [1, 0.1, 0.1]
position = [{}, 0, 0]
[joints.hinge]
type = "revolute"
bodies = ["ground", "rod"]
at = [{}, 0, 0]
axis = [0, 1, 0]
[integrator]
end = 1e-3
)",
                     with_it ? x : 0.0, x);
}

std::string mistake(const std::string& text) {
  Simulation s;
  const Status status = s.load_text(text, "model.toml");
  EXPECT_EQ(status.code, StatusCode::invalid_input);
  return status.message;
}

TEST(ModelReach, FarPlacesAreRefusedByName) {
  for (const double x : {1e300, -1e200, 1e120, 1e30, 1e12}) {
    const std::string joint = mistake(rod(x, false)), body = mistake(rod(x, true));
    EXPECT_NE(joint.find("joint 'hinge' lies"), std::string::npos) << joint;
    EXPECT_NE(joint.find("joints.hinge"), std::string::npos) << joint;
    EXPECT_NE(body.find("body 'rod' lies"), std::string::npos) << body;
  }
}

TEST(ModelReach, OthersAreNot) {
  for (const double x : {1e3, 1e6, 1e9}) {
    Simulation s;
    const Status status = s.load_text(rod(x, true), "model.toml");
    EXPECT_TRUE(status.ok()) << status.message;
  }
}

}  // namespace
}  // namespace espalier::dynamics
