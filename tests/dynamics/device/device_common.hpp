/// \file
/// What tests of bodies on a GPU share.
#pragma once

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "dynamics/model/mechanism.hpp"
#include "dynamics/model/read/expand.hpp"
#include "places.hpp"

namespace espalier::dynamics::test {

/// A model of models/ with other numbers.
inline std::unique_ptr<model::Mechanism> built_from(const std::string& name, const std::vector<std::string>& overrides,
                                                    int threads) {
  std::ifstream file(espalier::test::source_folder() / "models" / name);
  std::stringstream text;
  text << file.rdbuf();
  model::Value root = model::parse_toml(text.str(), name);
  model::expand(root, overrides);
  return model::build(model::read_description(root, name), threads);
}

/// A rigid top that spins on the end of a flexible arm: no joint declares the diagonal of its part of W.
inline const std::string kTopOnAnArm = R"(
gravity = [0, 0, -9.81]
[bodies.arm]
type = "solid"
material = { young = 2e9, poisson = 0.3, density = 1500 }
damping = { stiffness = 1e-5 }
mesh = { part = "block", lx = 0.3, ly = 0.02, lz = 0.02, divisions = [12, 2, 2] }
[bodies.top]
type = "rigid"
mass = 0.5
box = [0.08, 0.06, 0.02]
position = [0.3, 0.01, 0.05]
velocity = [0.2, -0.8, 0]
angular_velocity = [20, 5, 150]
[markers]
root = { body = "arm", face = "x0" }
tip = { body = "arm", face = "x1" }
[joints]
wall = { type = "fixed", a = { body = "ground", point = [0, 0.01, 0.01] }, b = "root" }
pivot = { type = "spherical", a = "tip", b = { body = "top", point = [0, 0, -0.04] } }
[integrator]
end = 1e-3
)";

/// The largest |a_i - b_i| over the largest |b_i|; a NaN gets through.
inline double difference(ConstSpan a, ConstSpan b) {
  double worst = 0, largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = std::abs(a[i] - b[i]);
    if (!(d <= worst)) worst = d;
    largest = std::max(largest, std::abs(b[i]));
  }
  return worst / std::max(largest, 1e-300);
}

}  // namespace espalier::dynamics::test
