// A solid in contact with itself. Truth: the same faces in two named sets, mirror symmetry, central differences.
#include <gtest/gtest.h>

#include <array>

#include "dynamics/contact/held_system.hpp"
#include "dynamics/contact/solid_contact.hpp"
#include "dynamics/dae/check.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace contact_self_test {

using contact::ContactReport;
using contact::FaceSurface;
using contact::SolidContact;

constexpr double kEnd = 3.05;  // of the arc, to both sides of the lowest point
constexpr double kYoung = 1000;

std::vector<double> equal_steps(double from, double to, int count) {
  std::vector<double> x;
  for (int k = 0; k <= count; ++k) x.push_back(from + (to - from) * k / count);
  return x;
}

/// A strip bent to a C that is open at the top; radius 1, thickness 0.2. Face sets "left" and "right": its ends.
Mesh c_strip(int along, int over_thickness = 2) {
  Mesh mesh = grid(equal_steps(-kEnd, kEnd, along), {0, 0.3}, equal_steps(0, 0.2, over_thickness), [](const Vec3& p) {
    const double r = 1.1 - p[2];
    return Vec3(r * std::sin(p[0]), p[1], -r * std::cos(p[0]));
  });
  for (const MeshFace& f : mesh.boundary_faces()) {
    Vec3 middle = Vec3::Zero();
    for (const Index n : mesh.face_nodes(f)) {
      const Point& x = mesh.nodes[static_cast<std::size_t>(n)];
      middle += 0.25 * Vec3(x[0], x[1], x[2]);
    }
    const double angle = std::atan2(middle[0], -middle[2]);
    if (std::abs(std::abs(angle) - kEnd) < 1e-6) mesh.face_sets[angle < 0 ? "left" : "right"].push_back(f);
  }
  return mesh;
}

/// How the ends are told to touch: all of the skin, the ends as one surface that touches itself, or two surfaces.
enum class Sides { skin, self, both_ways, one_way };

/// The C pressed together at both sides until its ends meet.
struct Closed {
  HeldSystem held;
  FlexibleBody* body = nullptr;
  std::vector<SolidContact*> contacts;
  Mesh mesh;

  explicit Closed(Sides sides, double friction = 0) : mesh(c_strip(20)) {
    body = &add_body(held, "strip", mesh, kYoung, 0.3);
    contact::ContactLaw law;
    law.stiffness = 5e3;
    law.friction = friction;
    law.tangential_stiffness = friction > 0 ? 4e3 : 0;
    const auto set = [&](const char* name) { return FaceSurface(name, *body, mesh, mesh.face_set(name)); };
    const auto add = [&](std::unique_ptr<SolidContact> c) { contacts.push_back(&held.system.add(std::move(c))); };
    std::vector<MeshFace> ends = mesh.face_set("left");
    ends.insert(ends.end(), mesh.face_set("right").begin(), mesh.face_set("right").end());
    if (sides == Sides::skin || sides == Sides::self) {
      if (sides == Sides::skin) ends.clear();
      add(SolidContact::with_itself("contact", law, FaceSurface("skin", *body, mesh, ends), 0));
    } else {
      if (sides == Sides::both_ways) law.stiffness *= 0.5, law.tangential_stiffness *= 0.5;
      add(std::make_unique<SolidContact>("contact", law, set("left"), set("right"), 0));
      if (sides == Sides::both_ways) add(std::make_unique<SolidContact>("back", law, set("right"), set("left"), 0));
    }
    held.begin();
  }

  /// @return whether Newton converged in each step
  bool close(int steps = 8) {
    hold(held, *body, 2, [](const Vec3& x) { return std::abs(x[0]) < 0.2 && x[2] < 0; });
    hold(held, *body, 1, [](const Vec3& x) { return x[1] == 0; });
    const auto side = [](const Vec3& x) { return std::abs(std::atan2(std::abs(x[0]), -x[2]) - 0.6 * kEnd) < 1e-6; };
    hold(held, *body, 0, side);
    constexpr double kBy = 0.04;
    for (int k = 0; k < steps; ++k) {
      for (Index n = 0; n < body->nodes(); ++n)
        held.q[static_cast<std::size_t>(body->configuration(n))] -=
            kBy / steps * body->reference()[static_cast<std::size_t>(3 * n)];
      if (held.solve() < 0) return false;
      held.system.accept(held.state());
    }
    return true;
  }
  [[nodiscard]] double normal_force() {
    double sum = 0;
    for (SolidContact* c : contacts) sum += c->report(held.state()).normal_force;
    return sum;
  }
};

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}

TEST(ContactSelf, EndsOfACMeetAsTwoSurfacesDo) {
  for (const double friction : {0.0, 0.3}) {
    Closed self(Sides::self, friction), both(Sides::both_ways, friction), one(Sides::one_way, friction);
    ASSERT_TRUE(self.close() && both.close() && one.close(16));
    const ContactReport report = self.contacts.front()->report(self.held.state());
    EXPECT_GT(report.normal_force, 0.01);
    EXPECT_EQ(report.force.norm(), 0);  // on itself
    EXPECT_LT(distance(self.held.q, both.held.q), 1e-11);
    // The same points, each with half of the stiffness: all that is summed up is the same, areas count half of each
    // side.
    std::array<ContactReport, 2> side;
    for (std::size_t k = 0; k < 2; ++k) side[k] = both.contacts[k]->report(both.held.state());
    const auto expect_sum = [&](double ContactReport::*member, double share) {
      const double sum = share * (side[0].*member + side[1].*member);
      EXPECT_GT(sum, 0);
      EXPECT_NEAR(report.*member, sum, 1e-9 * sum);
    };
    expect_sum(&ContactReport::normal_force, 1);
    expect_sum(&ContactReport::energy, 1);
    expect_sum(&ContactReport::points, 1);
    expect_sum(&ContactReport::area, 0.5);
    if (friction > 0) expect_sum(&ContactReport::friction_force, 1);
    const double deepest = std::max(side[0].penetration, side[1].penetration);
    EXPECT_NEAR(report.penetration, deepest, 1e-9 * deepest);
    const double largest = 2 * std::max(side[0].pressure, side[1].pressure);
    EXPECT_NEAR(report.pressure, largest, 1e-9 * largest);
    // Integrated on one side alone: another quadrature of the same stress, on faces that are coarse for it.
    EXPECT_NEAR(self.normal_force(), one.normal_force(), 0.03 * report.normal_force);
  }
  // All of the skin: the edges of the ends find the faces around them, too.
  Closed skin(Sides::skin), self(Sides::self);
  ASSERT_TRUE(skin.close() && self.close());
  EXPECT_NEAR(skin.normal_force(), self.normal_force(), 0.01 * self.normal_force());
}

TEST(ContactSelf, SymmetryStays) {
  Closed self(Sides::skin);
  ASSERT_TRUE(self.close());
  double worst = 0;
  for (Index n = 0; n < self.body->nodes(); ++n)
    for (Index m = 0; m < self.body->nodes(); ++m) {
      const double *a = self.body->reference().data() + 3 * n, *b = self.body->reference().data() + 3 * m;
      if ((Vec3(a[0], a[1], a[2]) - Vec3(-b[0], b[1], b[2])).norm() > 1e-9) continue;
      const double *x = &self.held.q[static_cast<std::size_t>(self.body->configuration(n))],
                   *y = &self.held.q[static_cast<std::size_t>(self.body->configuration(m))];
      worst = std::max(worst, (Vec3(x[0], x[1], x[2]) - Vec3(-y[0], y[1], y[2])).norm());
    }
  EXPECT_LT(worst, 1e-10);
}

TEST(ContactSelf, TangentIsThatOfDifferences) {
  Closed self(Sides::self, 0.3);
  ASSERT_TRUE(self.close());
  State s(self.held.system.sizes());
  s.q = self.held.q;
  // Nearer to the balance, kinks (a point opens or begins to slip) lie within the steps of the differences.
  for (std::size_t i = 0; i < s.q.size(); ++i) {
    s.q[i] += 2e-4 * std::sin(static_cast<double>(3 * i + 1));
    s.v[i] = std::sin(static_cast<double>(5 * i + 2));
  }
  self.held.system.update_pattern(s.q);
  EXPECT_GT(self.contacts.front()->report(s.view()).points, 4);
  const JacobianCheck check = check_jacobians(self.held.system, s);
  EXPECT_LT(check.largest(), 2e-6) << check.worst;
}

// Faces that are wider than the strip is thick: those on its other side are not in contact with them.
TEST(ContactSelf, ThinStripsDoNotTouchTheirOtherSide) {
  for (const int over_thickness : {1, 2, 3, 4}) {
    const Mesh mesh = grid(equal_steps(0, 3, 6), equal_steps(0, 1, 2), equal_steps(0, 0.06, over_thickness),
                           [](const Vec3& p) { return Vec3(p[0], p[1], p[2] + 0.01 * p[0] * p[0]); });
    HeldSystem held;
    FlexibleBody& body = add_body(held, "strip", mesh, kYoung, 0.3);
    contact::ContactLaw law;
    law.stiffness = 1;
    auto& contact = held.system.add(SolidContact::with_itself("contact", law, FaceSurface("skin", body, mesh, {}), 0));
    held.begin();
    EXPECT_EQ(contact.report(held.state()).points, 0) << over_thickness;
  }
}

const std::string kBlock =
    "[bodies.block]\ntype = \"solid\"\nmesh = { part = \"block\", lx = 1, ly = 1, lz = 1, divisions = [2, 2, 2] "
    "}\nmaterial = { young = 1000, poisson = 0.3, density = 1 }\n[surfaces.block]\nbody = \"block\"\nshape = "
    "\"faces\"\n";

TEST(ContactSelf, ModelsSaySelf) {
  const Simulation block = simulated(kBlock +
                                     "[contacts.c]\nsurfaces = [\"block\"]\nself = true\nstiffness = "
                                     "1e4\n[integrator]\nend = 0.1\n[output]\nquantities = [\"c.points\"]\n");
  EXPECT_EQ(block.value("c.points"), 0);
  const auto mistake = [](const std::string& text) {
    Simulation simulation;
    return simulation.load_text(text, "model.toml").message;
  };
  const std::string end = "stiffness = 1\n[integrator]\nend = 1\n";
  const std::string floor = "[surfaces.floor]\nbody = \"ground\"\nshape = \"plane\"\n";
  EXPECT_NE(
      mistake(kBlock + floor + "[contacts.c]\nsurfaces = [\"floor\"]\nself = true\n" + end).find("'self' is of faces"),
      std::string::npos);
  EXPECT_NE(mistake("[bodies.rope]\ntype = \"cable\"\nstart = [0, 0, 0]\nend = [1, 0, 0]\naxial = 1\nbending = "
                    "1\nmass_per_length = 1\n[surfaces.rope]\nbody = \"rope\"\nshape = \"line\"\nradius = 0.1\n"
                    "[contacts.c]\nsurfaces = [\"rope\"]\nself = true\n" +
                    end)
                .find("a line does not touch itself"),
            std::string::npos);
}

}  // namespace contact_self_test
}  // namespace espalier::dynamics
