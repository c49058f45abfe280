// Pairs of rigid shapes. Truth: central differences of the forces, Newton's third law, distances in closed form.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <random>

#include "dynamics/contact/contact_common.hpp"
#include "dynamics/contact/geometry/narrow.hpp"
#include "dynamics/contact/geometry/sprocket.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace contact_shapes_test {

using namespace contact;  // NOLINT(google-build-using-namespace)

ContactLaw law_of_tests() {
  ContactLaw law;
  law.stiffness = 100;
  law.exponent = 1.5;
  law.damping = 0.3;
  law.friction = 0.4;
  law.tangential_stiffness = 60;
  law.tangential_damping = 0.5;
  return law;
}

struct PairCase {
  const char* name;
  ShapedBody a, b;
  friend void PrintTo(const PairCase& c, std::ostream* out) { *out << c.name; }
};

std::vector<PairCase> pair_cases() {
  const Shape plane = PlaneShape{}, sphere = SphereShape{0.5}, capsule = CapsuleShape{0.3, 0.6},
              cylinder = CylinderShape{0.4, 0.5}, box = contact::BoxShape{{0.5, 0.4, 0.6}},
              mesh = MeshShape{box_of_triangles({0.5, 0.4, 0.6})};
  const Vec3 half_turn(1.5, 0.1, 0.05);
  return {
      {"plane and sphere", {plane}, {sphere, {0.2, 0.1, 0.45}}},
      {"plane and capsule", {plane}, {capsule, {0.2, 0.1, 0.2}, half_turn}},
      {"plane and lying cylinder", {plane}, {cylinder, {0.2, 0.1, 0.3}, half_turn}},
      {"plane and standing cylinder", {plane}, {cylinder, {0.2, 0.1, 0.45}, {0.03, 0.02, 0}}},
      {"plane and box", {plane}, {box, {0.2, 0.1, 0.4}, {0.5, 0.3, 0.1}}},
      {"plane and mesh", {plane}, {mesh, {0.2, 0.1, 0.4}, {0.5, 0.3, 0.1}}},
      {"sphere and sphere", {sphere}, {sphere, {0.5, 0.6, 0.4}}},
      {"sphere and capsule", {capsule}, {sphere, {0.5, 0.4, 0.1}}},
      {"sphere and end of capsule", {sphere, {0.2, 0.3, 1.1}}, {capsule}},
      {"sphere and side of cylinder", {cylinder}, {sphere, {0.6, 0.5, 0.1}}},
      {"sphere and end of cylinder", {cylinder}, {sphere, {0.1, 0.05, 0.9}}},
      {"sphere and rim of cylinder", {cylinder}, {sphere, {0.6, 0.1, 0.75}}},
      {"sphere and face of box", {box}, {sphere, {0.9, 0.1, 0.1}}},
      {"sphere and edge of box", {box}, {sphere, {0.8, 0.7, 0.1}}},
      {"sphere and corner of box", {box}, {sphere, {0.75, 0.65, 0.85}}},
      {"sphere and face of mesh", {mesh}, {sphere, {0.9, 0.1, 0.2}}},
      {"sphere and edge of mesh", {mesh}, {sphere, {0.8, 0.7, 0.1}}},
      {"sphere and corner of mesh", {mesh}, {sphere, {0.75, 0.65, 0.85}}},
      {"crossing capsules", {capsule}, {capsule, {0.5, 0.1, 0.1}, half_turn}},
      {"capsule ends", {capsule}, {capsule, {0.2, 0.1, 1.6}, {0.2, 0.1, 0}}},
      {"parallel capsules", {capsule}, {capsule, {0.55, 0.1, 0.3}, {0.02, 0.01, 0}}},
      {"crossing cylinders", {cylinder}, {cylinder, {0.7, 0.1, 0.05}, half_turn}},
      {"parallel cylinders", {cylinder}, {cylinder, {0.7, 0.1, 0.3}, {0.02, 0.01, 0}}},
      {"capsule on box", {box}, {capsule, {0.7, 0.1, 0.1}}},
      {"box on box", {box}, {box, {0.2, 0.1, 1.15}, {0.05, 0.03, 0.4}}},
      {"edges of boxes", {box}, {box, {0.85, 0.75, 0}, {0.75, 0.75, 0.0}}},
      {"mesh on mesh", {mesh}, {mesh, {0.3, 0.2, 1.1}, {0.3, 0.3, 0.4}}},
      {"edges of meshes", {mesh}, {mesh, {0.85, 0.75, 0.05}, {0.75, 0.75, 0.0}}},
  };
}

class ContactPairs : public testing::TestWithParam<PairCase> {};

TEST_P(ContactPairs, TangentIsThatOfDifferences) {
  const PairCase& c = GetParam();
  int touching = 0;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    ShapeSystem pair({c.a, c.b}, law_of_tests());
    State before = pair.anywhere(seed, 0.01), s = pair.anywhere(seed, 0.02);
    for (const bool with_history : {false, true}) {
      if (with_history) pair.system.accept(before.view());
      const ContactReport report = pair.contact->report(s.view());
      touching += report.points > 0 ? 1 : 0;
      const JacobianCheck check = check_jacobians(pair.system, s);
      EXPECT_LT(check.largest(), 1e-6) << c.name << ", seed " << seed << ": " << check.worst;
    }
  }
  EXPECT_GT(touching, 2) << c.name;
}

// Forces are equal and opposite and share a line: no momentum comes of them, nor angular momentum.
TEST_P(ContactPairs, ForcesAreEqualAndOpposite) {
  const PairCase& c = GetParam();
  ShapeSystem pair({c.a, c.b}, law_of_tests());
  pair.system.accept(pair.anywhere(5, 0.01).view());
  unsigned seed = 5;
  while (seed < 50 && pair.contact->report(pair.anywhere(seed, 0.02).view()).points == 0) ++seed;
  State s = pair.anywhere(seed, 0.02);
  for (double& a : s.a) a = 0;
  for (double& v : s.v) v *= 0.2;  // damping leaves something
  std::vector<double> f(s.v.size()), without(s.v.size());
  pair.system.residual(s.view(), f);
  pair.contact->set_active(false);
  pair.system.residual(s.view(), without);
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  double size = 0;
  for (std::size_t b = 0; b < 2; ++b) {
    const auto part = [&](std::size_t k) { return f[6 * b + k] - without[6 * b + k]; };
    const Vec3 own(part(0), part(1), part(2));
    force += own;
    moment += pair.bodies[b]->position(s.q).cross(own) +
              rotation_matrix(pair.bodies[b]->quaternion(s.q)) * Vec3(part(3), part(4), part(5));
    size = std::max(size, own.norm());
  }
  EXPECT_GT(size, 1e-5);
  EXPECT_LT(force.norm(), 1e-12 * size);
  EXPECT_LT(moment.norm(), 1e-12 * size);
}

// Everything moved and turned together: the same forces, moved and turned.
TEST_P(ContactPairs, ForcesTurnWithEverything) {
  const PairCase& c = GetParam();
  const Vec3 turn(0.4, -0.7, 1.1), shift(3, -2, 5);
  const Mat3 rotation = rotation_exp(turn);
  ShapeSystem pair({c.a, c.b}, law_of_tests()), moved({c.a, c.b}, law_of_tests());
  const auto placed = [&](State s) {
    for (std::size_t b = 0; b < 2; ++b) {
      const Eigen::Map<const Vec3> x(&s.q[7 * b]);
      const Vec3 at = rotation * x + shift;
      const Quat q =
          multiply(quaternion_exp(turn), Quat(s.q[7 * b + 3], s.q[7 * b + 4], s.q[7 * b + 5], s.q[7 * b + 6]));
      const Vec3 v = rotation * Eigen::Map<const Vec3>(&s.v[6 * b]);
      for (std::size_t k = 0; k < 3; ++k)
        s.q[7 * b + k] = at[static_cast<int>(k)], s.v[6 * b + k] = v[static_cast<int>(k)];
      for (std::size_t k = 0; k < 4; ++k) s.q[7 * b + 3 + k] = q[static_cast<int>(k)];
    }
    return s;
  };
  unsigned seed = 7;
  while (seed < 50 && pair.contact->report(pair.anywhere(seed, 0.02).view()).points == 0) ++seed;
  const State before = pair.anywhere(7, 0.01), s = pair.anywhere(seed, 0.02);
  pair.system.accept(before.view());
  moved.system.accept(placed(before).view());
  const ContactReport a = pair.contact->report(s.view()), b = moved.contact->report(placed(s).view());
  EXPECT_GT(a.force.norm(), 1e-5);
  EXPECT_LT((rotation * a.force - b.force).norm(), 1e-9 * a.force.norm());
}

INSTANTIATE_TEST_SUITE_P(Shapes, ContactPairs, testing::ValuesIn(pair_cases()), [](const auto& instance) {
  std::string name = instance.param.name;
  for (char& c : name)
    if (c == ' ') c = '_';
  return name;
});

double gap_of(const ShapedBody& a, const ShapedBody& b) {
  const PlacedShape first{&a.shape, a.position, rotation_exp(a.turn)},
      second{&b.shape, b.position, rotation_exp(b.turn)};
  std::vector<Touch> touches;
  find_touches(first, second, 10, touches);
  double least = 1e300;
  for (const Touch& t : touches) least = std::min(least, t.gap);
  return least;
}

TEST(ContactShapes, GapsInClosedForm) {
  const double root2 = std::sqrt(2.0), root3 = std::sqrt(3.0);
  const Shape box = contact::BoxShape{{1, 1, 1}}, sphere = SphereShape{0.5}, cylinder = CylinderShape{1, 1},
              plane = PlaneShape{};
  const Shape capsule = CapsuleShape{0.5, 1};
  EXPECT_NEAR(gap_of({sphere}, {sphere, {3, 4, 0}}), 4, 1e-14);
  EXPECT_NEAR(gap_of({box}, {sphere, {3, 0, 0}}), 1.5, 1e-14);
  EXPECT_NEAR(gap_of({box}, {sphere, {2, 2, 0}}), root2 - 0.5, 1e-14);
  EXPECT_NEAR(gap_of({box}, {sphere, {2, 2, 2}}), root3 - 0.5, 1e-14);
  EXPECT_NEAR(gap_of({cylinder}, {sphere, {3, 0, 3}}), 2 * root2 - 0.5, 1e-14);
  EXPECT_NEAR(gap_of({plane, {0, 0, 1}}, {sphere, {7, 8, 3}}), 1.5, 1e-14);
  EXPECT_NEAR(gap_of({capsule}, {capsule, {3, 0, 0}, {M_PI / 2, 0, 0}}), 2, 1e-14);
  EXPECT_NEAR(gap_of({capsule}, {capsule, {0, 0, 5}}), 2, 1e-14);
  EXPECT_NEAR(gap_of({box}, {box, {0.3, 0.2, 2.5}}), 0.5, 1e-14);
  // a cylinder that leans on its rim: centre height - (r sin + h cos)
  EXPECT_NEAR(gap_of({plane}, {cylinder, {0, 0, 3}, {0.6, 0, 0}}), 3 - std::sin(0.6) - std::cos(0.6), 1e-14);
}

TEST(ContactShapes, TreeFindsWhatPairsFind) {
  std::mt19937 engine(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (const std::size_t count : {0U, 1U, 2U, 3U, 100U}) {
    std::vector<Box> boxes(count);
    const auto shuffle = [&](double size) {
      for (Box& box : boxes) {
        const Vec3 low(uniform(engine), uniform(engine), uniform(engine));
        box = {low, low + Vec3::Constant(size)};
      }
    };
    shuffle(0.1);
    BoxTree tree;
    tree.build(boxes);
    for (int round = 0; round < 5; ++round) {  // small moves, then far ones
      shuffle(0.1 + 0.1 * round);
      tree.refit(boxes);
      for (const Box& box : boxes) {
        std::size_t found = 0, expected = 0;
        tree.query(box, [&](Index) { ++found; });
        for (const Box& other : boxes) expected += box.meets(other) ? 1 : 0;
        EXPECT_EQ(found, expected);
      }
    }
  }
}

// Truth: all of the surface within reach, of which the first one is the nearest.
TEST(ContactShapes, TheNearestIsTheFirstOfAll) {
  const auto box = box_of_triangles({0.5, 0.4, 0.6});
  const TriangleSurface sprocket = sprocket_surface({12, 0.3, 0.1, 0.2, 0.35});
  std::mt19937 random(1);
  std::uniform_real_distribution<double> any(-1, 1);
  int found = 0;
  for (const TriangleSurface* surface : {box.get(), &sprocket})
    for (int k = 0; k < 2000; ++k) {
      const Vec3 x(any(random), any(random), 0.5 * any(random));
      std::vector<TriangleSurface::Near> all, nearest;
      surface->near(x, 0.3, false, all);
      surface->near(x, 0.3, true, nearest);
      ASSERT_EQ(nearest.size(), std::min<std::size_t>(all.size(), 1)) << x.transpose();
      if (all.empty()) continue;
      ++found;
      // Two at the same distance but for rounding are both right.
      EXPECT_NEAR(std::abs(nearest[0].distance), std::abs(all[0].distance), 1e-14) << x.transpose();
    }
  EXPECT_GT(found, 1000);
}

TEST(ContactShapes, SurfacesThatAreNone) {
  const std::vector<Vec3> p = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const std::vector<std::array<Index, 3>> outwards = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  EXPECT_NO_THROW(TriangleSurface(p, outwards));
  std::vector<std::array<Index, 3>> inwards = outwards;
  for (auto& t : inwards) std::swap(t[0], t[1]);
  EXPECT_THROW(TriangleSurface(p, inwards), std::invalid_argument);
  EXPECT_THROW(TriangleSurface(p, {}), std::invalid_argument);
  EXPECT_THROW(TriangleSurface(p, {{0, 1, 1}}), std::invalid_argument);
  EXPECT_THROW(TriangleSurface(p, {{0, 1, 7}}), std::invalid_argument);
  EXPECT_THROW(TriangleSurface(p, {{0, 1, 2}, {0, 1, 3}}), std::invalid_argument);  // twisted
  EXPECT_THROW(TriangleSurface({{0, 0, 0}, {1, 0, 0}, {0, NAN, 0}}, {{0, 1, 2}}), std::invalid_argument);
}

TEST(ContactShapes, FilesGiveTheSameSurface) {
  const ScratchFolder folder;
  const auto file = [&](const char* name, const std::string& text) {
    std::ofstream(folder.path() + "/" + name, std::ios::binary) << text;
    return folder.path() + "/" + name;
  };
  const std::string obj =
      "# a tetrahedron\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1/1 2/2 4\nf 2//3 3 4\nf -2 1 4\n";
  std::string stl = "solid x\n", binary(80, ' ');
  const std::uint32_t count = 4;
  binary.append(reinterpret_cast<const char*>(&count), 4);
  const float corner[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (const auto& t : {std::array{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}) {
    stl += "facet normal 0 0 0\nouter loop\n";
    binary.append(12, '\0');
    for (const int k : t) {
      const float* x = corner[k];
      stl += fmt::format("vertex {:f} {:f} {:f}\n", x[0], x[1], x[2]);
      binary.append(reinterpret_cast<const char*>(x), 12);
    }
    stl += "endloop\nendfacet\n";
    binary.append(2, '\0');
  }
  for (const std::string& path : {file("a.obj", obj), file("a.stl", stl), file("b.STL", binary)}) {
    const TriangleSurface s = read_surface(path, 2);
    EXPECT_EQ(s.points().size(), 4U) << path;
    EXPECT_EQ(s.triangles().size(), 4U) << path;
    EXPECT_EQ(s.edges().size(), 6U) << path;
    EXPECT_TRUE(s.closed()) << path;
    EXPECT_EQ(s.tree().all().high, Vec3(2, 2, 2)) << path;
  }
  EXPECT_THROW((void)read_surface(file("c.obj", "v 1 2\n"), 1), Error);
  EXPECT_THROW((void)read_surface(file("d.obj", "v 1 2 3\nf 1 2 3\n"), 1), Error);
  EXPECT_THROW((void)read_surface(file("e.stl", "solid\nvertex 1 2 3\n"), 1), Error);
  EXPECT_THROW((void)read_surface(file("f.stl", ""), 1), Error);
  EXPECT_THROW((void)read_surface(folder.path() + "/none.stl", 1), Error);
}

TEST(ContactShapes, LawsThatAreNone) {
  const auto with = [](auto&& change) {
    ContactLaw law = law_of_tests();
    change(law);
    return law;
  };
  EXPECT_NO_THROW(law_of_tests().check());
  EXPECT_THROW(with([](auto& l) { l.stiffness = 0; }).check(), std::invalid_argument);
  EXPECT_THROW(with([](auto& l) { l.stiffness = NAN; }).check(), std::invalid_argument);
  EXPECT_THROW(with([](auto& l) { l.exponent = 0.5; }).check(), std::invalid_argument);
  EXPECT_THROW(with([](auto& l) { l.smoothing = 1; }).check(), std::invalid_argument);
  EXPECT_THROW(with([](auto& l) { l.restitution = 0.5; }).check(), std::invalid_argument);
  EXPECT_THROW(with([](auto& l) { l.tangential_stiffness = 0; }).check(), std::invalid_argument);
  EXPECT_THROW(ShapeSystem({{PlaneShape{}}, {PlaneShape{}}}, law_of_tests()), std::invalid_argument);
  EXPECT_THROW(ShapeSystem({{SphereShape{1}}}, law_of_tests()), std::invalid_argument);
  EXPECT_THROW(ShapeSystem({{SphereShape{-1}}, {PlaneShape{}}}, law_of_tests()), std::invalid_argument);
}

// The pattern is made anew when a pair comes near that it lacks, and at no other time.
TEST(ContactShapes, PatternFollowsThePairs) {
  ShapeSystem three({{SphereShape{1}}, {SphereShape{1}, {5, 0, 0}}, {SphereShape{1}, {0, 9, 0}}}, law_of_tests());
  State s = three.initial();
  const auto version = [&](double x, double y) {
    s.q[7] = x;
    s.q[15] = y;
    three.system.update_pattern(s.q);
    return three.system.pattern_version();
  };
  const std::uint64_t first = version(5, 9);
  EXPECT_EQ(version(4, 9), first);
  const std::uint64_t second = version(1.9, 9);
  EXPECT_GT(second, first);
  const Offset entries = three.system.tangent_pattern().nonzeros();
  EXPECT_EQ(version(1.95, 9), second);
  EXPECT_EQ(version(8, 9), second);  // apart again: the superset stays
  EXPECT_EQ(version(1.9, 9), second);
  EXPECT_GT(version(1.9, 1.9), second);
  EXPECT_GT(three.system.tangent_pattern().nonzeros(), entries);
  EXPECT_EQ(three.contact->patterns(), 2);
  EXPECT_LT(check_jacobians(three.system, s).largest(), 1e-6);
}

// A run that goes on from a saved state makes its patterns where the one that was not stopped does, to the same bits.
TEST(ContactShapes, ASavedSearchGoesOn) {
  const auto make = [] {
    return std::make_unique<ShapeSystem>(
        std::vector<ShapedBody>{{SphereShape{1}}, {SphereShape{1}, {5, 0, 0}}, {SphereShape{1}, {0, 6, 0}}},
        law_of_tests());
  };
  constexpr int kMoves = 400;
  const auto move = [](ShapeSystem& three, int k) {
    State s = three.initial();
    s.q[7] = 5 - 0.008 * k;
    s.q[15] = 6 - 0.0101 * k;
    three.system.update_pattern(s.q);
    return three.system.tangent_pattern().nonzeros();
  };
  const auto whole = make();
  std::vector<Offset> entries;
  std::vector<std::vector<double>> saved(kMoves);
  for (int k = 0; k < kMoves; ++k) {
    entries.push_back(move(*whole, k));
    whole->contact->save(saved[static_cast<std::size_t>(k)]);
  }
  EXPECT_EQ(whole->contact->patterns(), 2);
  for (int from = 0; from < kMoves; from += 7) {
    const auto again = make();
    ConstSpan numbers = saved[static_cast<std::size_t>(from)];
    again->contact->restore(numbers);
    EXPECT_TRUE(numbers.empty());
    for (int k = from; k < kMoves; ++k)
      ASSERT_EQ(move(*again, k), entries[static_cast<std::size_t>(k)]) << "saved at " << from << ", now at " << k;
  }
}

// Without friction a sphere about the centre of mass is pushed, not turned: three of its coordinates take part.
TEST(ContactShapes, CentralSpheresCoupleTheirPlacesAlone) {
  ContactLaw smooth = law_of_tests();
  smooth.friction = 0;
  const Shape sphere = SphereShape{0.5}, box = contact::BoxShape{{0.5, 0.4, 0.6}};
  const auto entries = [&](const Shape& first, const ContactLaw& law, const Vec3& point) {
    ShapeSystem pair({{first}, {sphere, {0.8, 0.3, 0.1}}}, law, point);
    int touching = 0;
    for (unsigned seed = 1; seed <= 4; ++seed) {
      State s = pair.anywhere(seed, 0.05);
      pair.system.accept(pair.anywhere(seed, 0.03).view());
      touching += static_cast<int>(pair.contact->report(s.view()).points);
      EXPECT_LT(check_jacobians(pair.system, s).largest(), 1e-6) << "seed " << seed;
    }
    EXPECT_GT(touching, 2);
    return pair.system.tangent_pattern().nonzeros();
  };
  const Vec3 centre = Vec3::Zero(), beside(0.01, -0.02, 0.015);
  // Blocks of 6 x 6 on the diagonal (3 x 3 and the gyroscopic part for a central sphere), and two beside it.
  const Offset all = entries(sphere, smooth, beside);
  EXPECT_EQ(entries(sphere, law_of_tests(), centre), all);
  EXPECT_EQ(all - entries(sphere, smooth, centre), 2 * 18 + 2 * 27);
  EXPECT_EQ(all - entries(box, smooth, centre), 18 + 2 * 18);
}

// Truth: the equation of which it is the root.
TEST(ContactShapes, DampingNumber) {
  for (const double r : {0.05, 0.1, 0.5, 0.9, 0.999}) {
    const double x = damping_number(r);
    EXPECT_NEAR((1 + r) * x, std::log((1 + x) / (1 - r * x)), 1e-9 * x) << r;
    EXPECT_GT(x, 0) << r;
  }
  EXPECT_EQ(damping_number(1), 0);
}

}  // namespace contact_shapes_test
}  // namespace espalier::dynamics
