// Truth: Hertz. Radius of the area from the second moment of the pressure, force by its sum, largest pressure.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/SparseCholesky>
#include <cmath>
#include <functional>
#include <numbers>

#include "dynamics/contact/solid_contact.hpp"

namespace espalier::dynamics {
namespace {

using contact::FaceSurface;
using contact::SolidContact;

/// From 0: equal steps up to `fine`, then growing ones up to `end`.
std::vector<double> graded(double step, double fine, double end, double growth) {
  std::vector<double> x = {0};
  while (x.back() < fine - 1e-9) x.push_back(x.back() + step);
  for (double h = step * growth; x.back() < end; h *= growth) x.push_back(x.back() + h);
  return x;
}

/// Hexahedra between rising coordinates; `move` shapes them. Face set "top": the side of the last z.
Mesh grid(const std::vector<double>& x, const std::vector<double>& y, const std::vector<double>& z,
          const std::function<Vec3(const Vec3&)>& move) {
  Mesh mesh;
  for (const double c : z)
    for (const double b : y)
      for (const double a : x) {
        const Vec3 p = move({a, b, c});
        mesh.nodes.push_back({p[0], p[1], p[2]});
      }
  const auto node = [&](std::size_t i, std::size_t j, std::size_t k) {
    return static_cast<Index>((k * y.size() + j) * x.size() + i);
  };
  for (std::size_t k = 0; k + 1 < z.size(); ++k)
    for (std::size_t j = 0; j + 1 < y.size(); ++j)
      for (std::size_t i = 0; i + 1 < x.size(); ++i) {
        const std::array<Index, 8> nodes = {
            node(i, j, k),     node(i + 1, j, k),     node(i + 1, j + 1, k),     node(i, j + 1, k),
            node(i, j, k + 1), node(i + 1, j, k + 1), node(i + 1, j + 1, k + 1), node(i, j + 1, k + 1)};
        const Index e = mesh.add_element(ElementType::hex8, nodes);
        if (k + 2 == z.size()) mesh.face_sets["top"].push_back({e, 1});
      }
  return mesh;
}

/// Newton's method for a system in which some coordinates do not move.
class HeldSystem {
 public:
  AssembledSystem system;
  std::vector<double> q;
  std::vector<char> held;

  void begin() {
    system.finish();
    const Sizes sizes = system.sizes();
    q.resize(static_cast<std::size_t>(sizes.configuration));
    held.assign(static_cast<std::size_t>(sizes.velocity), 0);
    std::vector<double> v(held.size());
    system.initial(q, v);
    zero_.assign(held.size(), 0);
  }
  [[nodiscard]] StateView state() const { return {0, q, zero_, zero_, {}}; }

  /// @return passes, or -1
  int solve() {
    for (int pass = 1; pass <= 40; ++pass) {
      system.update_pattern(q);
      const auto n = static_cast<Eigen::Index>(held.size());
      Eigen::VectorXd f(n);
      system.residual(state(), {f.data(), held.size()});
      const SparsePattern& p = system.tangent_pattern();
      std::vector<double> w(static_cast<std::size_t>(p.nonzeros()));
      system.tangent(state(), {0, 0, 1}, w);
      std::vector<Eigen::Triplet<double>> entries;
      for (Index j = 0; j < static_cast<Index>(n); ++j) {
        if (held[static_cast<std::size_t>(j)] != 0) entries.emplace_back(j, j, 1.0), f[j] = 0;
        for (Offset e = p.ptr[static_cast<std::size_t>(j)]; e < p.ptr[static_cast<std::size_t>(j) + 1]; ++e) {
          const Index i = p.ind[static_cast<std::size_t>(e)];
          if (held[static_cast<std::size_t>(i)] == 0 && held[static_cast<std::size_t>(j)] == 0)
            entries.emplace_back(i, j, w[static_cast<std::size_t>(e)]);
        }
      }
      Eigen::SparseMatrix<double> k(n, n);
      k.setFromTriplets(entries.begin(), entries.end());
      Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(k);
      const Eigen::VectorXd step = solver.solve(-f);
      double largest = 0, size = 0;
      for (std::size_t i = 0; i < q.size(); ++i) {
        q[i] += step[static_cast<Eigen::Index>(i)];
        largest = std::max(largest, std::abs(step[static_cast<Eigen::Index>(i)]));
        size = std::max(size, std::abs(q[i]));
      }
      if (!std::isfinite(largest)) return -1;
      if (largest < 1e-12 * size) return pass;
    }
    return -1;
  }

 private:
  std::vector<double> zero_;
};

/// What was found, over what Hertz says.
struct Found {
  double radius = 0, peak = 0;
  int passes = 0;
};

FlexibleBody& add_body(HeldSystem& held, const char* name, const Mesh& mesh, double young, double poisson) {
  Material material;
  material.young = young;
  material.poisson = poisson;
  material.density = 1;
  return held.system.add(make_solid_body(name, mesh, material));
}

void hold(HeldSystem& held, const FlexibleBody& body, int axis, const std::function<bool(const Vec3&)>& where) {
  for (Index n = 0; n < body.nodes(); ++n) {
    const double* x = body.reference().data() + 3 * n;
    if (where({x[0], x[1], x[2]})) held.held[static_cast<std::size_t>(body.coordinate(n) + axis)] = 1;
  }
}
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
