// Truth: Hertz. Radius of the area from the second moment of the pressure, force by its sum, largest pressure.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/contact/solid_contact.hpp"
#include "held_system.hpp"

namespace espalier::dynamics {
namespace {

using contact::FaceSurface;
using contact::SolidContact;

/// What was found, over what Hertz says.
struct Found {
  double radius = 0, peak = 0;
  int passes = 0;
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
Found cylinders(int over_radius) {
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
  law.stiffness = 5 * kYoung / step;
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
  found.peak = contact.report(held.state()).pressure / peak;
  return found;
}

// A quarter of a rigid sphere on an elastic block: a^3 = 3 F R / (4 E*), E* = E / (1 - nu^2), p0 = 3 F / (2 pi a^2);
// the second moment of the pressure is 2 F a^2 / 5.
Found sphere(int over_radius) {
  constexpr double kRadius = 100, kA = 1, kYoung = 1000, kPoisson = 0.3, kSize = 10, kGrowth = 1.35;
  const double step = kA / over_radius, e_star = kYoung / (1 - kPoisson * kPoisson);
  const std::vector<double> x = graded(step, 1.2 * kA, kSize, kGrowth), z = graded(step, kA, kSize, kGrowth);
  std::vector<double> from_below;
  for (std::size_t k = z.size(); k-- > 0;) from_below.push_back(-z[k]);
  const Mesh mesh = grid(x, x, from_below, [](const Vec3& p) { return p; });
  HeldSystem held;
  FlexibleBody& body = add_body(held, "block", mesh, kYoung, kPoisson);
  contact::ContactLaw law;
  law.stiffness = 20 * kYoung / step;
  contact::RigidSurface ball;
  ball.name = "ball";
  ball.shape = contact::SphereShape{kRadius};
  ball.point = {0, 0, kRadius - kA * kA / kRadius};
  auto& contact = held.system.add(
      std::make_unique<SolidContact>("contact", law, FaceSurface("top", body, mesh, mesh.face_set("top")), ball, 0));
  held.begin();
  hold(held, body, 0, [](const Vec3& p) { return p[0] == 0; });
  hold(held, body, 1, [](const Vec3& p) { return p[1] == 0; });
  hold(held, body, 2, [&](const Vec3& p) { return p[2] == from_below.front(); });
  Found found;
  found.passes = held.solve();
  EXPECT_GT(found.passes, 0);
  const double force = 4 * contact.report(held.state()).normal_force;
  const double radius = std::cbrt(0.75 * force * kRadius / e_star);
  found.radius = std::sqrt(2.5 * second_moment(held, contact, false)) / radius;
  found.peak = contact.report(held.state()).pressure / (1.5 * force / (std::numbers::pi * radius * radius));
  return found;
}

TEST(ContactHertz, CylinderOnCylinder) {
  const Found found = cylinders(6);
  EXPECT_NEAR(found.radius, 1, 0.03);
  EXPECT_NEAR(found.peak, 1, 0.03);
}

TEST(ContactHertz, SphereOnBlock) {
  const Found found = sphere(3);
  EXPECT_NEAR(found.radius, 1, 0.1);  // three elements over the radius
  EXPECT_NEAR(found.peak, 1, 0.06);
}

// The table of docs/guide/contact.md: test_dynamics --gtest_also_run_disabled_tests
// --gtest_filter='*ContactHertz*Table'
TEST(ContactHertz, DISABLED_Table) {
  fmt::print(
      "| elements over the radius | cylinders: radius | largest pressure | sphere: radius | largest pressure |\n");
  for (const int over_radius : {3, 6, 12}) {
    const Found line = cylinders(over_radius), point = over_radius > 6 ? Found{} : sphere(over_radius);
    fmt::print("| {} | {:.4f} | {:.4f} | {:.4f} | {:.4f} |\n", over_radius, line.radius, line.peak, point.radius,
               point.peak);
  }
}

}  // namespace
}  // namespace espalier::dynamics
