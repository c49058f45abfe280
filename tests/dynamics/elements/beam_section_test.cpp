// Cross-sections of beams. Truth: integrals over small squares, Bredt's formula and Cowper's factors in their limits.
#include "dynamics/elements/beam_section.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace espalier::dynamics {
namespace {

namespace beam_section_test {

Material steel() {
  Material m;
  m.young = 2.1e11;
  m.poisson = 0.3;
  m.density = 7850;
  return m;
}

struct Integrals {
  double area = 0, y2 = 0, z2 = 0;
};

// Over a grid whose lines all edges of the section lie on: exact but for the squares' own inertia, which is added.
template <class Inside>
Integrals integrate(double height, double width, double square, const Inside& inside) {
  Integrals sum;
  for (double y = -height / 2 + square / 2; y < height / 2; y += square)
    for (double z = -width / 2 + square / 2; z < width / 2; z += square)
      if (inside(y, z)) {
        const double a = square * square, own = a * a / 12;
        sum.area += a;
        sum.y2 += a * y * y + own;
        sum.z2 += a * z * z + own;
      }
  return sum;
}

void expect_integrals(const BeamSection& s, const Integrals& sum) {
  const Material m = steel();
  EXPECT_NEAR(s.axial / m.young, sum.area, 1e-10 * sum.area);
  EXPECT_NEAR(s.mass_per_length / m.density, sum.area, 1e-10 * sum.area);
  EXPECT_NEAR(s.bending_z / m.young, sum.y2, 1e-10 * sum.y2);
  EXPECT_NEAR(s.bending_y / m.young, sum.z2, 1e-10 * sum.z2);
  EXPECT_NEAR(s.inertia_y / m.density, sum.y2, 1e-10 * sum.y2);
  EXPECT_NEAR(s.inertia_z / m.density, sum.z2, 1e-10 * sum.z2);
}

TEST(BeamSection, BoxesAreIntegralsAndBredts) {
  const BoxShape b{0.2, 0.1, 0.02, 0.01};
  const BeamSection s = box_section(steel(), b);
  expect_integrals(
      s, integrate(0.2, 0.1, 0.01, [](double y, double z) { return std::abs(y) > 0.08 || std::abs(z) > 0.04; }));
  const double g = steel().mu(), h = 0.18, w = 0.09;
  EXPECT_NEAR(s.torsion, g * 4 * std::pow(h * w, 2) / (2 * h / 0.01 + 2 * w / 0.02), 1e-12 * s.torsion);
  EXPECT_NEAR(s.shear_y, g * 2 * h * 0.01, 1e-12 * s.shear_y);
  EXPECT_NEAR(s.shear_z, g * 2 * w * 0.02, 1e-12 * s.shear_z);
}

TEST(BeamSection, IsAreIntegralsAndSumsOfStrips) {
  const IShape i{0.2, 0.12, 0.02, 0.01};
  const BeamSection s = i_section(steel(), i);
  expect_integrals(
      s, integrate(0.2, 0.12, 0.005, [](double y, double z) { return std::abs(y) > 0.08 || std::abs(z) < 0.005; }));
  const double g = steel().mu();
  EXPECT_NEAR(s.torsion, g * (2 * 0.12 * std::pow(0.02, 3) + 0.18 * std::pow(0.01, 3)) / 3, 1e-12 * s.torsion);
  EXPECT_NEAR(s.shear_y, g * 0.18 * 0.01, 1e-12 * s.shear_y);
  EXPECT_NEAR(s.shear_z, g * 2 * 0.12 * 0.02 * 5 / 6, 1e-12 * s.shear_z);
}

TEST(BeamSection, TubesLieBetweenTheCircleAndTheThinOne) {
  const Material m = steel();
  const BeamSection solid = circular_section(m, 0.1), thick = tube_section(m, 0.1, 0.1);
  for (double BeamSection::*of : {&BeamSection::axial, &BeamSection::shear_y, &BeamSection::torsion,
                                  &BeamSection::bending_y, &BeamSection::bending_z, &BeamSection::mass_per_length})
    EXPECT_NEAR(thick.*of, solid.*of, 1e-12 * solid.*of);
  const BeamSection tube = tube_section(m, 0.1, 0.04);
  EXPECT_NEAR(tube.axial, m.young * std::numbers::pi * (0.01 - 0.0036), 1e-12 * tube.axial);
  EXPECT_NEAR(tube.bending_y, m.young * std::numbers::pi / 4 * (1e-4 - std::pow(0.06, 4)), 1e-12 * tube.bending_y);
  EXPECT_NEAR(tube.torsion, 2 * m.mu() / m.young * tube.bending_y, 1e-12 * tube.torsion);
  // Cowper: 2 (1 + nu) / (4 + 3 nu) for walls of no thickness; at m^2 = 0.36 and nu = 0.3 by hand.
  const BeamSection thin = tube_section(m, 0.1, 1e-7);
  EXPECT_NEAR(thin.shear_y / thin.section_shear, 2.6 / 4.9, 1e-6);
  const double more = 1.36 * 1.36;
  EXPECT_NEAR(tube.shear_z / tube.section_shear, 7.8 * more / (8.8 * more + 23.6 * 0.36), 1e-12);
}

}  // namespace beam_section_test

}  // namespace
}  // namespace espalier::dynamics
