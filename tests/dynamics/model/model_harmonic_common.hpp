/// \file
/// Frequency responses of models as text.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <string>

#include "espalier/model_harmonic.hpp"

namespace espalier::dynamics::test {

using Complex = std::complex<double>;
inline constexpr double kTwoPi = 2 * std::numbers::pi;
inline constexpr Complex kI{0, 1};

inline ModelHarmonicResult responded(const std::string& text, const std::vector<std::string>& set = {}) {
  SimulationOptions o;
  o.set = set;
  o.solver = {{"threads", "1"}};
  return model_harmonic_of_text(text, "model.toml", o);
}

/// The value of the first load.
inline Complex value_of(const ModelHarmonicResult& r, std::size_t point, const std::string& quantity) {
  const auto it = std::find(r.quantities.begin(), r.quantities.end(), quantity);
  EXPECT_NE(it, r.quantities.end()) << quantity;
  return r.response.response(point, 0, static_cast<Index>(it - r.quantities.begin()));
}

/// A steel wire of length 1 along x, clamped at its start; a load of 1 N along z at its end. The text
/// ends inside of [harmonic].
inline std::string cantilever(int elements, double loss_factor, const std::string& more = "", double radius = 0.005) {
  return fmt::format(R"(
[bodies.arm]
type = "beam"
start = [0, 0, 0]
end = [1, 0, 0]
elements = {}
radius = {}
material = {{ young = 2e11, poisson = 0.3, density = 7800 }}
[joints.wall]
type = "fixed"
a = {{ body = "ground" }}
b = {{ body = "arm", node = 1 }}
[markers.tip]
body = "arm"
node = -1
[forces.shaker]
type = "load"
a = "tip"
force = [0, 0, 1]
factor = 0
{}
[harmonic]
loss_factor = {}
)",
                     elements, radius, more, loss_factor);
}

/// Deflection at the end for a unit force there (Euler and Bernoulli): (sin b cosh b - cos b sinh b) / (EI b^3 (1 + cos
/// b cosh b)) with b^4 = rho A w^2 / EI at length 1. @param ei  complex where there is damping
inline Complex cantilever_compliance(Complex ei, double mass_per_length, double w) {
  const Complex b = std::pow(mass_per_length * w * w / ei, 0.25);
  return (std::sin(b) * std::cosh(b) - std::cos(b) * std::sinh(b)) /
         (ei * b * b * b * (1.0 + std::cos(b) * std::cosh(b)));
}

}  // namespace espalier::dynamics::test
