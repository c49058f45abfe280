// Ties of shells and loads per length: their derivatives beside central differences, anywhere. What they are good for
// is held against closed forms in python/tests/models/thin.
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/model/built_model.hpp"

namespace espalier::dynamics {
namespace thin_bodies_test {

const std::string kShells = R"(
[bodies.floor]
type = "shell"
x = [1, 0, 0]
y = [0, 1, 0]
nx = 2
ny = 2
thickness = 0.2
material = { young = 1, poisson = 0.3, density = 1 }
[bodies.wall]
type = "shell"
origin = [0.5, 0, 0]
x = [0, 1, 0]
y = [0, 0.3, 1]
nx = 3
ny = 1
thickness = 0.2
offset = 0.1
material = { young = 1, poisson = 0.3, density = 1 }
[bodies.rib]
type = "beam"
start = [0, 1, 0]
end = [1, 1, 0.2]
elements = 2
height = 0.3
width = 0.2
material = { young = 1, poisson = 0.3, density = 1 }
)";

void expect_derivatives(const std::string& text, const char* what) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const auto mechanism = built(kShells + text + "[integrator]\nend = 1\n");
    const JacobianCheck check = check_jacobians(mechanism->system, anywhere(*mechanism, seed, 0.05));
    EXPECT_LT(check.largest(), 1e-6) << what << ", seed " << seed << ": " << check.worst;
  }
}

TEST(ThinBodies, DerivativesOfTies) {
  expect_derivatives("[ties]\nedge = { body = \"wall\", edge = \"y0\", to = { body = \"floor\" } }\n", "a corner");
  expect_derivatives("[ties]\nseam = { body = \"floor\", edge = \"y1\", to = { body = \"rib\" } }\n", "a rib");
  expect_derivatives("[ties]\nend = { body = \"wall\", near = [0.5, 1, 0], to = { body = \"rib\" }, tolerance = 1 }\n",
                     "a shell on a beam");
}

TEST(ThinBodies, DerivativesOfLoadsPerLength) {
  for (const char* follower : {"false", "true"})
    for (const char* where : {"body = \"floor\", edge = \"x1\"", "body = \"wall\", edge = \"y1\"", "body = \"rib\""})
      expect_derivatives(
          std::string("[forces]\nq = { type = \"line-load\", ") + where +
              ", force = [1, 2, 3], moment = [0.3, 0.2, 0.1], factor = \"2 + sin(t)\", follower = " + follower + " }\n",
          where);
}

// The virtual power of a load per length for a turn about any point is that of its moment: what it does to directors
// and slopes is what a body that moves as a whole feels.
TEST(ThinBodies, LoadsPerLengthHaveTheirMoment) {
  for (const char* where : {"body = \"floor\", edge = \"x1\"", "body = \"wall\", edge = \"y1\"", "body = \"rib\""}) {
    const auto mechanism = built(kShells + "[forces]\nq = { type = \"line-load\", " + where +
                                 ", force = [1, 2, 3], moment = [0.3, 0.2, 0.1] }\n[integrator]\nend = 1\n");
    const auto bare = built(kShells + "[integrator]\nend = 1\n");
    const std::string name = std::string(where).substr(8, std::string(where).find('"', 8) - 8);
    const FlexibleBody& body = *mechanism->body(name)->flexible;
    State s(mechanism->system.sizes());
    mechanism->system.initial(s.q, s.v);
    std::vector<double> f(s.v.size()), without(s.v.size());
    mechanism->system.residual(s.view(), f);
    bare->system.residual(s.view(), without);
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
    for (Index v = 0; v < body.vertices(); ++v) {
      Vec3 own;
      for (Index i = 0; i < 3; ++i) {
        const auto at = static_cast<std::size_t>(body.coordinate(v) + i);
        own[i] = without[at] - f[at];
      }
      const Vec3 x = Eigen::Map<const Vec3>(s.q.data() + body.configuration(v));
      if (v % body.vertices_per_node() == 0) force += own;
      moment += x.cross(own);
    }
    Vec3 begin(1, 0, 0), end(1, 1, 0);
    if (name == "wall") {  // where the nodes are: beside the middle
      begin = {0.5, 0.3, 1};
      end = {0.5, 1.3, 1};
    }
    if (name == "rib") {
      begin = {0, 1, 0};
      end = {1, 1, 0.2};
    }
    const double length = (end - begin).norm();
    const Vec3 line(1, 2, 3), couple(0.3, 0.2, 0.1);
    EXPECT_LT((force - length * line).norm(), 1e-12) << where;
    EXPECT_LT((moment - length * (couple + (0.5 * (begin + end)).cross(line))).norm(), 1e-12) << where;
  }
}

}  // namespace thin_bodies_test
}  // namespace espalier::dynamics
