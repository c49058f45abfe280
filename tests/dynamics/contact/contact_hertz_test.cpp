// Truth: Hertz. Radius of the area from the second moment of the pressure, force by its sum, largest pressure.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numbers>

#include "dynamics/contact/held_system.hpp"
#include "dynamics/contact/solid_contact.hpp"

namespace espalier::dynamics {
namespace contact_hertz_test {

using contact::FaceSurface;
using contact::SolidContact;

/// What was found, over what Hertz says for the force (of a given approach: for the approach).
struct Found {
  double force = 0;
  double radius = 0;         ///< by the second moment of the pressure at nodes
  double radius_moment = 0;  ///< by the first moment of the pressure at the points of integration
  double radius_norm = 0;    ///< by the integral of its square
  double peak = 0;           ///< largest pressure at a node
  int passes = 0;
};

/// How stiff the contact is: k = factor E / h, or the same with another power of h over the radius a:
/// k = factor E / h (a / h)^power.
struct Penalty {
  double factor = 5, power = 0;
  [[nodiscard]] double stiffness(double young, double step) const {
    return factor * young / step * std::pow(1 / step, power);
  }
};

void lift(HeldSystem& held, const FlexibleBody& body, double by) {
  for (Index n = 0; n < body.nodes(); ++n) held.q[static_cast<std::size_t>(body.configuration(n)) + 2] += by;
}

/// Sum of p r^2 dA at nodes of a surface, over the sum of p dA; r in the x-y plane (line contact: x alone).
double second_moment(HeldSystem& held, SolidContact& contact, bool line) {
  const std::vector<double> pressures = contact.node_pressures(held.state());
  const FaceSurface& surface = contact.first();
  double force = 0, moment = 0;
  for (const contact::SurfaceFace& face : surface.faces()) {
    // the pressure is bilinear over the face
    constexpr double kGauss = 0.7745966692414834;
    for (int i = -1; i <= 1; ++i)
      for (int j = -1; j <= 1; ++j) {
        const double xi[2] = {i * kGauss, j * kGauss}, w = (i == 0 ? 8 : 5) * (j == 0 ? 8 : 5) / 81.0;
        const contact::FacePlace at = contact::face_place(face, face.reference, xi);
        double p = 0;
        for (std::size_t a = 0; a < face.names.size(); ++a) {
          const auto& nodes = surface.nodes();
          const auto place = std::lower_bound(nodes.begin(), nodes.end(), face.names[a]) - nodes.begin();
          p += at.value[a] * pressures[static_cast<std::size_t>(place)];
        }
        const double r2 = at.x[0] * at.x[0] + (line ? 0 : at.x[1] * at.x[1]);
        force += w * p * at.normal_area().norm();
        moment += w * p * r2 * at.normal_area().norm();
      }
  }
  return moment / force;
}

// A half of two elastic cylinders (a curved block on a flat one) without lateral contraction, where plane strain is
// plane stress: a^2 = 4 F R / (pi E*), p0 = 2 F / (pi a), 1 / E* = 2 / E (K. L. Johnson, Contact Mechanics (1985), 4.43
// to 4.46); the second moment of the pressure is F a^2 / 4.
Found cylinders(int over_radius, const Penalty& penalty = {5}) {
  constexpr double kRadius = 200, kA = 1, kYoung = 1000, kThick = 0.3, kSize = 12, kGrowth = 1.4;
  const double e_star = kYoung / 2, step = kA / over_radius;
  const std::vector<double> z = graded(step, 1.2 * kA, kSize, kGrowth), y = {0, kThick};
  const double top = z.back();
  HeldSystem held;
  std::vector<double> from_below;  // fine at the top
  for (std::size_t k = z.size(); k-- > 0;) from_below.push_back(-z[k]);
  // The upper block is turned about x, so that its top looks down.
  const Mesh flat = grid(graded(1.07 * step, 1.3 * kA, kSize, kGrowth), y, from_below, [](const Vec3& p) { return p; });
  const Mesh curved = grid(graded(step, 1.3 * kA, kSize, kGrowth), y, from_below, [&](const Vec3& p) {
    const double rise = p[0] * p[0] / (2 * kRadius) * (1 + p[2] / top);  // none at the far side
    return Vec3(p[0], kThick - p[1], -p[2] + rise);
  });
  FlexibleBody& a = add_body(held, "flat", flat, kYoung, 0);
  FlexibleBody& b = add_body(held, "curved", curved, kYoung, 0);
  contact::ContactLaw law;
  law.stiffness = penalty.stiffness(kYoung, step);
  auto& contact = held.system.add(
      std::make_unique<SolidContact>("contact", law, FaceSurface("curved", b, curved, curved.face_set("top")),
                                     FaceSurface("flat", a, flat, flat.face_set("top")), 0));
  held.begin();
  for (FlexibleBody* body : {&a, &b}) {
    hold(held, *body, 0, [](const Vec3& x) { return x[0] == 0; });
    hold(held, *body, 1, [](const Vec3&) { return true; });
  }
  hold(held, a, 2, [&](const Vec3& x) { return x[2] < -top + 1e-9; });
  hold(held, b, 2, [&](const Vec3& x) { return x[2] > top - 1e-9; });
  Found found;
  double force = 0;
  const double wanted = std::numbers::pi * e_star * kA * kA / (8 * kRadius) * kThick;  // of the half
  double by = -2 * kA * kA / kRadius;
  for (int k = 0; k < 4; ++k) {  // the approach that gives the force
    lift(held, b, by);
    const int passes = held.solve();
    EXPECT_GT(passes, 0);
    found.passes += passes;
    const double now = contact.report(held.state()).normal_force;
    by = k == 0 ? 0.5 * by : (wanted - now) * by / (now - force);
    if (k == 0 && now > wanted) by = -0.3 * by;
    force = now;
    if (std::abs(force - wanted) < 0.02 * wanted) break;
  }
  const double radius = std::sqrt(8 * force / kThick * kRadius / (std::numbers::pi * e_star));
  const double peak = 4 * force / kThick / (std::numbers::pi * radius);
  found.radius = std::sqrt(4 * second_moment(held, contact, true)) / radius;
  const contact::ContactReport report = contact.report(held.state());
  found.peak = report.pressure / peak;
  found.force = force / wanted;
  // Moments of the half: the integral of p x is F 4 a / (3 pi), that of p^2 over the width F'^2 16 / (3 pi^2 a), F' = 2
  // F.
  found.radius_moment = std::abs(report.moment[1]) / force * 0.75 * std::numbers::pi / radius;
  const double square = 2 * 2 * law.stiffness * report.energy / kThick, line = 2 * force / kThick;
  found.radius_norm = 16 * line * line / (3 * std::numbers::pi * std::numbers::pi * square) / radius;
  return found;
}

/// Displacement of an elastic half space z < 0 by a force down at its origin (K. L. Johnson, Contact Mechanics
/// (1985), 3.18).
Vec3 boussinesq(const Vec3& x, double force, double young, double poisson) {
  const double depth = -x[2], rho = x.norm(), shear = young / (2 + 2 * poisson);
  const double aside = depth / (rho * rho * rho) - (1 - 2 * poisson) / (rho * (rho + depth));
  const double down = depth * depth / (rho * rho * rho) + 2 * (1 - poisson) / rho;
  return force / (4 * std::numbers::pi * shear) * Vec3(x[0] * aside, x[1] * aside, -down);
}

// A quarter of a rigid sphere on an elastic half space: F = 4 E* a^3 / (3 R) for the approach a^2 / R, E* = E / (1 -
// nu^2), p0 = 3 F / (2 pi a^2); the second moment of the pressure is 2 F a^2 / 5 (Johnson, 4.22 to 4.24). The far sides
// of the block move as those of the half space do under F at a point, which is exact but for (a / size)^3.
Found sphere(int over_radius, const Penalty& penalty = {20}) {
  constexpr double kRadius = 1000, kA = 1, kYoung = 1000, kPoisson = 0.3, kSize = 10, kGrowth = 1.35;
  const double step = kA / over_radius, e_star = kYoung / (1 - kPoisson * kPoisson);
  const double wanted = 4 * e_star * kA * kA * kA / (3 * kRadius);
  const std::vector<double> x = graded(step, 1.2 * kA, kSize, kGrowth), z = graded(step, kA, kSize, kGrowth);
  std::vector<double> from_below;
  for (std::size_t k = z.size(); k-- > 0;) from_below.push_back(-z[k]);
  const Mesh mesh = grid(x, x, from_below, [](const Vec3& p) { return p; });
  HeldSystem held;
  FlexibleBody& body = add_body(held, "block", mesh, kYoung, kPoisson);
  contact::ContactLaw law;
  law.stiffness = penalty.stiffness(kYoung, step);
  contact::RigidSurface ball;
  ball.name = "ball";
  ball.shape = contact::SphereShape{kRadius};
  ball.point = {0, 0, kRadius - kA * kA / kRadius};
  auto& contact = held.system.add(
      std::make_unique<SolidContact>("contact", law, FaceSurface("top", body, mesh, mesh.face_set("top")), ball, 0));
  held.begin();
  const auto far = [&](const Vec3& p) { return p[0] == x.back() || p[1] == x.back() || p[2] == from_below.front(); };
  for (int axis = 0; axis < 3; ++axis)
    hold(held, body, axis, [&](const Vec3& p) { return far(p) || (axis < 2 && p[axis] == 0); });
  for (Index n = 0; n < body.nodes(); ++n) {
    const double* p = body.reference().data() + 3 * n;
    if (!far({p[0], p[1], p[2]})) continue;
    const Vec3 u = boussinesq({p[0], p[1], p[2]}, wanted, kYoung, kPoisson);
    for (int k = 0; k < 3; ++k) held.q[static_cast<std::size_t>(body.configuration(n) + k)] += u[k];
  }
  Found found;
  found.passes = held.solve();
  EXPECT_GT(found.passes, 0);
  const contact::ContactReport report = contact.report(held.state());
  const double force = 4 * report.normal_force;
  const double radius = std::cbrt(0.75 * force * kRadius / e_star);
  found.force = force / wanted;
  found.radius = std::sqrt(2.5 * second_moment(held, contact, false)) / radius;
  // Moments of the quarter: the integral of p x is F 3 a / 8; that of p^2 over all is 9 F^2 / (8 pi a^2).
  found.radius_moment = std::abs(report.moment[1]) / report.normal_force * 8 / 3 / radius;
  const double square = 4 * 2 * law.stiffness * report.energy;
  found.radius_norm = std::sqrt(9 * force * force / (8 * std::numbers::pi * square)) / radius;
  found.peak = report.pressure / (1.5 * force / (std::numbers::pi * radius * radius));
  return found;
}

// By the first moment of the pressure and by the integral of its square, both over the points of integration. Pressures
// at nodes are means around them, which smear the edge of the area: their radius is for comparison.
TEST(ContactHertz, CylinderOnCylinder) {
  const Found found = cylinders(6);
  EXPECT_NEAR(found.radius_moment, 1, 0.004);
  EXPECT_NEAR(found.radius_norm, 1, 0.015);
  EXPECT_NEAR(found.radius, 1, 0.03);
  EXPECT_NEAR(found.peak, 1, 0.03);
}

TEST(ContactHertz, SphereOnBlock) {
  const Found found = sphere(4);
  EXPECT_NEAR(found.force, 1, 0.01);
  EXPECT_NEAR(found.radius_moment, 1, 0.01);
  EXPECT_NEAR(found.radius_norm, 1, 0.025);
  EXPECT_NEAR(found.radius, 1, 0.05);
  EXPECT_NEAR(found.peak, 1, 0.02);
}

void print_row(const char* what, int over_radius, const Penalty& penalty, const Found& f) {
  fmt::print("| {} | {} | {:g} | {:g} | {:.4f} | {:.4f} | {:.4f} | {:.4f} | {:.4f} | {} |\n", what, over_radius,
             penalty.factor, 1 + penalty.power, f.force, f.radius_moment, f.radius_norm, f.radius, f.peak, f.passes);
  std::fflush(stdout);
}

// The table of docs/notebook/contact.md: test_dynamics --gtest_also_run_disabled_tests
// --gtest_filter='*ContactHertz*Table'
TEST(ContactHertz, DISABLED_Table) {
  fmt::print(
      "| case | elements over the radius | factor of k | k grows as 1 / h to the | force | radius by first moment | "
      "radius by "
      "p^2 | radius by nodes | largest pressure at a node | passes |\n|---|---|---|---|---|---|---|---|---|---|\n");
  for (const double power : {0.0, 1.0})
    for (const int over_radius : {4, 6, 8, 12}) {
      const Penalty soft{5, power}, stiff{20, power};
      print_row("cylinders", over_radius, soft, cylinders(over_radius, soft));
      print_row("sphere", over_radius, stiff, sphere(over_radius, stiff));
    }
}

}  // namespace contact_hertz_test
}  // namespace espalier::dynamics
