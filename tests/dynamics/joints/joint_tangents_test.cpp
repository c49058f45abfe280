// Derivatives of the joints of joints/{screw, constant_velocity, ... }.cpp, of curves and surfaces. Truth: differences,
// extrapolated, of the functions themselves, at states that satisfy nothing in particular.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/dae/check.hpp"
#include "dynamics/forces/cable_force.hpp"
#include "dynamics/forces/sliding_friction.hpp"
#include "dynamics/forces/stop.hpp"
#include "dynamics/joints/space_curve.hpp"
#include "dynamics/joints/surface_shape.hpp"
#include "dynamics/model/harmonic.hpp"

namespace espalier::dynamics {
namespace joint_tangents_test {

class Draws {
 public:
  explicit Draws(unsigned seed) : engine_(seed) {}
  double operator()() { return uniform_(engine_); }
  Vec3 vector() { return {(*this)(), (*this)(), (*this)()}; }
  void fill(std::vector<double>& x) {
    for (double& y : x) y = (*this)();
  }

 private:
  std::mt19937 engine_;
  std::uniform_real_distribution<double> uniform_{-1, 1};
};

/// A knot that closes, of a given size.
SpaceCurvePtr knotted(double size, int count, bool closed = true) {
  std::vector<Vec3> points;
  for (int k = 0; k < count; ++k) {
    const double u = 2 * std::numbers::pi * k / count;
    points.push_back(
        size * Vec3((2 + std::cos(3 * u)) * std::cos(2 * u), (2 + std::cos(3 * u)) * std::sin(2 * u), std::sin(3 * u)));
  }
  return std::make_shared<const SpaceCurve>(points, closed);
}

SurfacePtr hills(double size) {
  std::vector<double> x, y;
  for (int k = 0; k < 7; ++k) x.push_back(size * (k - 3)), y.push_back(size * (1.3 * k - 4));
  std::vector<std::vector<double>> heights;
  for (const double a : x) {
    heights.emplace_back();
    for (const double b : y) heights.back().push_back(0.3 * size * std::sin(a / size) * std::cos(0.7 * b / size));
  }
  return height_surface(x, y, heights);
}

/// Central differences with steps h and h / 2, extrapolated: errors of order h^4.
template <class F>
auto slope(const F& f, double h) {
  using Value = decltype(f(0.0));
  const auto central = [&](double step) -> Value { return (f(step) - f(-step)) / (2 * step); };
  const Value coarse = central(h), fine = central(h / 2);
  return Value((4 * fine - coarse) / 3);
}

void check_point_function(const PointFunction& f, const Vec3& p, double size, const std::string& what) {
  const PointFunction::At at = f.at(p);
  for (int i = 0; i < 3; ++i) {
    const double by = slope([&](double e) { return f.at(p + e * Vec3::Unit(i)).value; }, 1e-3 * size);
    EXPECT_NEAR(by, at.gradient[i], 1e-8) << what << " " << i << " size " << size;
    const Vec3 bend = slope([&](double e) { return Vec3(f.at(p + e * Vec3::Unit(i)).gradient); }, 1e-3 * size);
    EXPECT_LT((bend - at.hessian.col(i)).norm() * size, 1e-7) << what << " " << i << " size " << size;
  }
  EXPECT_LE((at.hessian - at.hessian.transpose()).norm(), 1e-14 * at.hessian.norm()) << what;
}

TEST(PointFunctions, SurfacesAgreeWithDifferences) {
  for (const double size : {1e-3, 1.0, 1e3}) {
    const std::vector<std::pair<std::string, SurfacePtr>> surfaces = {
        {"plane", plane_surface()},
        {"sphere", sphere_surface(0.8 * size)},
        {"ellipsoid", ellipsoid_surface(size * Vec3(0.7, 1.1, 1.6))},
        {"cylinder", cylinder_surface(0.6 * size)},
        {"cone", cone_surface(0.4)},
        {"torus", torus_surface(1.2 * size, 0.3 * size)},
        {"heights", hills(size)}};
    Draws draws(3);
    for (const auto& [name, surface] : surfaces)
      for (int k = 0; k < 5; ++k)
        check_point_function(*surface, size * (draws.vector() + Vec3(0.3, 1.9, 1.4)), size, name);
  }
}

TEST(PointFunctions, SurfacesAreZeroWhereTheyShould) {
  EXPECT_NEAR(sphere_surface(2)->at({0, 1.2, 1.6}).value, 0, 1e-15);
  EXPECT_NEAR(ellipsoid_surface({1, 2, 3})->at({0, 0, 3}).value, 0, 1e-15);
  EXPECT_NEAR(cylinder_surface(5)->at({3, 4, 17}).value, 0, 1e-15);
  EXPECT_NEAR(cone_surface(std::atan(0.5))->at({1, 0, 2}).value, 0, 1e-15);
  EXPECT_NEAR(torus_surface(3, 1)->at({0, 4, 0}).value, 0, 1e-15);
  // Products of cubics are met exactly.
  const auto f = [](double x, double y) { return (1 + x - 0.2 * x * x * x) * (2 - y + 0.3 * y * y); };
  std::vector<double> x = {-1, -0.3, 0.2, 1.1, 2}, y = {0, 0.5, 0.9, 2};
  std::vector<std::vector<double>> heights;
  for (const double a : x) {
    heights.emplace_back();
    for (const double b : y) heights.back().push_back(f(a, b));
  }
  const SurfacePtr s = height_surface(x, y, heights);
  for (const auto& [a, b] : {std::pair(0.77, 1.3), {-0.9, 0.1}, {1.9, 1.99}})
    EXPECT_NEAR(s->at({a, b, f(a, b)}).value, 0, 1e-13);
  // Beyond the edge it goes on straight.
  const double edge = s->at({2, 1, 0}).value, out = s->at({2.5, 1, 0}).value, far = s->at({3, 1, 0}).value;
  EXPECT_NEAR(far - out, out - edge, 1e-13);
}

TEST(PointFunctions, CurvesAgreeWithDifferences) {
  for (const double size : {1e-3, 1.0, 1e3})
    for (const bool closed : {true, false}) {
      const SpaceCurvePtr curve = knotted(size, 60, closed);
      const auto follower = std::make_shared<const CurveFollower>(curve);
      Draws draws(5);
      for (int k = 0; k < 8; ++k) {
        // Inside of a piece: at the points the third derivative jumps.
        const double u = curve->least() + (0.31 + 7 * k) / 60 * (curve->most() - curve->least());
        const Vec3 p = curve->at(u).x + 0.1 * size * draws.vector();
        for (const auto& [name, f] :
             {std::pair("first", beside_curve(follower, false)), std::pair("second", beside_curve(follower, true)),
              std::pair("along", along_curve(follower))})
          check_point_function(dynamic_cast<const PointFunction&>(*f), p, 0.1 * size, name);
      }
    }
}

TEST(SpaceCurves, MeetTheirPointsAndBendAsTheCircle) {
  // Errors of the cubic spline fall with the fourth power of the distance of the points.
  double before = 0;
  for (const int count : {16, 32, 64}) {
    std::vector<Vec3> points;
    for (int k = 0; k < count; ++k)
      points.emplace_back(std::cos(2 * std::numbers::pi * k / count), 0, std::sin(2 * std::numbers::pi * k / count));
    const SpaceCurve curve(points, true);
    double worst = std::abs(curve.length() - 2 * std::numbers::pi);
    for (int k = 0; k < 3 * count; ++k) {
      const double u = curve.most() * k / (3.0 * count);
      worst = std::max(worst, std::abs(curve.at(u).x.norm() - 1));
      EXPECT_NEAR(curve.at(u).x.y(), 0, 1e-15);
      EXPECT_NEAR(curve.normal(u).x.cross(Vec3::UnitY()).norm(), 0, 1e-12);
    }
    if (before > 0) {
      EXPECT_LT(worst, before / 12) << count;
    }
    EXPECT_LT(worst, 3e-4);
    before = worst;
    // Round after round.
    EXPECT_NEAR(curve.arc(2.25 * curve.most()), 2.25 * curve.length(), 1e-12);
    EXPECT_NEAR(curve.arc(-0.5 * curve.most()), -0.5 * curve.length(), 1e-12);
  }
  // Two points: a straight line, that goes on beyond its ends.
  const SpaceCurve line({{0, 0, 0}, {3, 4, 0}}, false);
  EXPECT_NEAR(line.length(), 5, 1e-14);
  EXPECT_NEAR(line.arc(line.nearest({6, 8, 1})), 10, 1e-13);
  EXPECT_NEAR(line.arc(line.nearest({-0.3, -0.4, 2})), -0.5, 1e-13);
  // The nearest of all places, from anywhere; also where the opposite of a point lies near the beginning.
  const SpaceCurve bow({{1, 0, 0}, {2, 2, 1}, {0, 4, 0}, {-1, 1, 2}}, false);
  for (const Vec3& p : {Vec3(-1, 0, 0), Vec3(-0.9, 0.3, 1), Vec3(1, 4, -1), Vec3(2, 2, 2), Vec3(0, 0, 0)}) {
    double least = (p - bow.at(bow.least()).x).norm();
    for (int k = 0; k <= 1000; ++k)
      least = std::min(least, (p - bow.at(bow.least() + k * (bow.most() - bow.least()) / 1000).x).norm());
    EXPECT_LE((p - bow.at(bow.nearest(p)).x).norm(), least + 1e-12) << p.transpose();
  }
  // Three: a parabola; more, of third degree at most: met exactly.
  const SpaceCurve parabola({{-1, 1, 0}, {0, 0, 0}, {1, 1, 0}}, false);
  for (const double u : {0.2, 0.9, 2.3}) EXPECT_NEAR(parabola.at(u).x.y(), std::pow(parabola.at(u).x.x(), 2), 1e-14);
}

TEST(SpaceCurves, DegenerateOnesAreRefused) {
  const auto says = [](std::vector<Vec3> points, bool closed) -> std::string {
    try {
      const SpaceCurve curve(std::move(points), closed);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(says({}, false).find("two different points"), std::string::npos);
  EXPECT_NE(says({{1, 2, 3}}, false).find("two different points"), std::string::npos);
  EXPECT_NE(says({{1, 2, 3}, {1, 2, 3}}, false).find("the points 1 and 2 of the curve are one"), std::string::npos);
  EXPECT_NE(says({{0, 0, 0}, {1, 0, 0}, {1, 0, 0}, {2, 0, 0}}, false).find("2 and 3"), std::string::npos);
  EXPECT_NE(says({{0, 0, 0}, {1, 0, 0}}, true).find("three different points"), std::string::npos);
  EXPECT_NE(says({{0, 0, 0}, {1, 0, 0}, {0, 1, NAN}}, false).find("finite"), std::string::npos);
  EXPECT_EQ(says({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0}}, true), "");  // the last is the first again
  // There and back on one line: the spline turns round in a cusp.
  EXPECT_NE(says({{0, 0, 0}, {1, 0, 0}, {0, 0, 0}}, false).find("cusp"), std::string::npos);
  EXPECT_NE(says({{0, 5, 0}, {1, 5, 0}, {2, 5, 0}, {1, 5, 0}}, false).find("cusp"), std::string::npos);
  EXPECT_NE(says({{0, 0, 0}, {0.3, 0, 0}, {2.1, 0, 0}, {1.7, 0, 0}, {1.6, 0, 0}}, false).find("cusp"),
            std::string::npos);
  EXPECT_EQ(says({{0, 0, 0}, {1, 0, 0}, {1.1, 0.1, 0}, {1, 0.2, 0}, {0, 0.2, 0}}, false), "");  // a hairpin
}

RigidBody& add_drawn_body(AssembledSystem& system, Draws& draws, const std::string& name, double size) {
  RigidBodyData data;
  data.mass = 2;
  data.inertia << 0.5, 0.1, -0.05, 0.1, 0.7, 0.02, -0.05, 0.02, 0.9;
  data.position = size * draws.vector();
  data.rotation = quaternion_exp(0.4 * draws.vector());
  return system.add(std::make_unique<RigidBody>(name, data));
}

// Differences of step 6e-6: see jacobian_test.cpp.
void check_system(AssembledSystem& system, Draws& draws, const std::string& what) {
  State s(system.sizes());
  system.initial(s.q, s.v);
  draws.fill(s.v);
  draws.fill(s.a);
  draws.fill(s.lambda);
  s.t = 0.37;
  const JacobianCheck result = check_jacobians(system, s);
  EXPECT_LT(result.largest(), 2e-8) << what << ": " << result.worst << " gamma " << result.gamma << " F_q "
                                    << result.f_q << " F_v " << result.f_v;
  EXPECT_GT(system.tangent_pattern().nonzeros(), 0);
}

struct Made {
  std::string name;
  std::function<std::unique_ptr<Component>(FramePtr, FramePtr)> make;
  friend void PrintTo(const Made& p, std::ostream* out) { *out << p.name; }
};

class TangentsOf : public testing::TestWithParam<Made> {};

TEST_P(TangentsOf, AgreeWithDifferences) {
  for (unsigned seed = 1; seed <= 4; ++seed)
    for (const bool ground : {false, true}) {
      Draws draws(seed);
      AssembledSystem system;
      RigidBody& one = add_drawn_body(system, draws, "one", 0.2);
      RigidBody& two = add_drawn_body(system, draws, "two", 0.2);
      // About a unit apart along x, and turned against each other about y by a right angle and something.
      const Mat3 turned = rotation_exp({0, 1.2, 0}) * rotation_exp(0.3 * draws.vector());
      FramePtr a = std::make_unique<RigidFrame>(one, 0.2 * draws.vector(), rotation_exp(0.3 * draws.vector()));
      if (ground) a = std::make_unique<GroundFrame>(0.2 * draws.vector(), rotation_exp(0.3 * draws.vector()));
      FramePtr b = std::make_unique<RigidFrame>(two, Vec3(1.3, 0.4, 0.3) + 0.2 * draws.vector(), turned);
      system.add(GetParam().make(std::move(a), std::move(b)));
      system.finish();
      check_system(system, draws, GetParam().name + ", seed " + std::to_string(seed) + (ground ? ", ground" : ""));
    }
}

template <class Make, class... More>
auto pair_of(Make make, More... more) {
  return [=](FramePtr a, FramePtr b) { return make("j", std::move(a), std::move(b), more...); };
}

std::unique_ptr<Component> rubbing(FramePtr a, FramePtr b, SurfacePtr surface) {
  class Constant final : public StateFunction {
   public:
    [[nodiscard]] double value(const StateView& /*s*/) const override { return 1.7; }

   protected:
    void add_gradient(const StateView& /*s*/, StateGradient& /*out*/) const override {}
  };
  auto force = sliding_friction("f", std::move(a), std::move(b), std::move(surface), {0.3, 0.5, 2.0, 1.0}, 0.2);
  force->set_inputs({std::make_shared<Constant>()});
  return force;
}

std::unique_ptr<Component> bend_stop(FramePtr a, FramePtr b) {
  StopLaw law;
  law.upper = 0.6;
  law.stiffness = 3;
  law.damping = 0.1;
  law.smoothing = 0.1;
  return std::make_unique<CoordinateForce>("f", std::move(a), std::move(b), PairCoordinate{Relative::bend},
                                           stop_law(law));
}

const WormShape kWormShape{0.4, -0.9, 0.4};

INSTANTIATE_TEST_SUITE_P(
    Kinds, TangentsOf,
    testing::Values(
        Made{"screw", pair_of(screw_joint, 0.7)}, Made{"constant_velocity", pair_of(constant_velocity_joint)},
        Made{"parallel_axes", pair_of(parallel_axes_joint)}, Made{"in_plane", pair_of(in_plane_joint)},
        Made{"gear_pair", pair_of(gear_pair, 0.7, -1.9)}, Made{"rack_pair", pair_of(rack_pair, 0.8)},
        Made{"worm", pair_of(worm_joint, kWormShape)},
        Made{"worm_slip",
             [](FramePtr a, FramePtr b) {
               PairCoordinate slip;
               slip.function = worm_slip(kWormShape);
               StopLaw law;
               law.upper = -7;
               law.stiffness = 1;
               law.damping = 0.1;
               law.smoothing = 2;
               return std::make_unique<CoordinateForce>("f", std::move(a), std::move(b), slip, stop_law(law));
             }},
        Made{"bend_stop", bend_stop},
        Made{"curve",
             [](FramePtr a, FramePtr b) {
               return point_on_curve("j", std::move(a), std::move(b), knotted(0.6, 40), harmonic(0.1, 0.4, 3, 0.2));
             }},
        Made{"surface",
             [](FramePtr a, FramePtr b) {
               return point_on_surface("j", std::move(a), std::move(b), torus_surface(1.1, 0.3));
             }},
        Made{"sliding_on_a_torus",
             [](FramePtr a, FramePtr b) { return rubbing(std::move(a), std::move(b), torus_surface(1.1, 0.3)); }},
        Made{"sliding_on_a_plane",
             [](FramePtr a, FramePtr b) { return rubbing(std::move(a), std::move(b), plane_surface()); }}),
    [](const auto& instance) { return instance.param.name; });

TEST(TangentsOfCables, AgreeWithDifferences) {
  for (const int count : {2, 3, 6, 12}) {
    Draws draws(static_cast<unsigned>(count));
    AssembledSystem system;
    std::vector<FramePtr> frames;
    for (int k = 0; k < count; ++k) {
      if (k == 1) {
        frames.push_back(std::make_unique<GroundFrame>(draws.vector()));
        continue;
      }
      RigidBody& body = add_drawn_body(system, draws, "body" + std::to_string(k), 2);
      frames.push_back(std::make_unique<RigidFrame>(body, draws.vector()));
    }
    system.add(cable_joint("c", std::move(frames), 3.0));
    system.finish();
    check_system(system, draws, "cable of " + std::to_string(count));
  }
}

TEST(TangentsOfCables, ElasticOnesThatRubAgreeToo) {
  for (const int count : {2, 3, 5, 12})
    for (const double friction : {0.0, 0.3}) {
      Draws draws(static_cast<unsigned>(count));
      AssembledSystem system;
      std::vector<FramePtr> frames;
      for (int k = 0; k < count; ++k) {
        if (k == 1) {
          frames.push_back(std::make_unique<GroundFrame>(draws.vector()));
          continue;
        }
        RigidBody& body = add_drawn_body(system, draws, "body" + std::to_string(k), 2);
        frames.push_back(std::make_unique<RigidFrame>(body, draws.vector()));
      }
      system.add(std::make_unique<CableForce>("c", std::move(frames), CableForceLaw{3, 0.2, 0.5, friction, 0.7}));
      system.finish();
      check_system(system, draws, "cable of " + std::to_string(count));
    }
}

}  // namespace joint_tangents_test
}  // namespace espalier::dynamics
