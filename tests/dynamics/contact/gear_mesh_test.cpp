// The tooth of spur gears. Truth: the formula of the involute, the rack that generates it, and gears that roll.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "dynamics/meshers/involute.hpp"

namespace espalier::dynamics {
namespace gear_mesh_test {

constexpr double kPi = std::numbers::pi;

GearShape gear_of(int teeth, double degrees, double backlash = 0) {
  GearShape s;
  s.teeth = teeth;
  s.pressure_angle = degrees * kPi / 180;
  s.bore_radius = 0.2 * s.module * teeth;
  s.backlash = backlash;
  return s;
}

double involute_of(double angle) { return std::tan(angle) - angle; }

// Half the angle of a tooth at a radius, from the profile by bisection.
double half_angle(const ToothProfile& p, double radius) {
  const bool on_involute = radius >= p.involute(0)[0];
  double low = 0, high = 1;
  for (int k = 0; k < 60; ++k) {
    const double u = 0.5 * (low + high), r = on_involute ? p.involute(u)[0] : p.fillet(u)[0];
    (r < radius ? low : high) = u;
  }
  return on_involute ? p.involute(low)[1] : p.fillet(low)[1];
}

// Truth: inv a = tan a - a. A tooth that is pi m / 2 - backlash / 2 thick on the pitch circle has the half angle
// pi / 2z - backlash / 4r + inv a0 - inv a where cos a = r_base / r.
TEST(GearMesh, FlanksAreInvolutes) {
  for (const double backlash : {0.0, 2e-4}) {
    const GearShape shape = gear_of(21, 20, backlash);
    const Mesh mesh = make_spur_gear(shape, 7, 3, 1, ElementType::hex20);
    const ToothProfile profile(shape);
    const double base = profile.pitch_radius() * std::cos(shape.pressure_angle), begin = profile.involute(0)[0];
    int found = 0;
    for (const Index n : mesh.node_set("teeth")) {
      const Point& x = mesh.nodes[static_cast<std::size_t>(n)];
      const double r = std::hypot(x[0], x[1]), pitch = 2 * kPi / shape.teeth, angle = std::atan2(x[1], x[0]);
      if (r < begin * (1 - 1e-9) || r > profile.tip_radius() * (1 - 1e-9)) continue;
      const double truth = 0.5 * kPi / shape.teeth - 0.25 * backlash / profile.pitch_radius() +
                           involute_of(shape.pressure_angle) - involute_of(std::acos(base / r));
      EXPECT_NEAR(std::abs(angle - pitch * std::round(angle / pitch)), truth, 1e-12);
      ++found;
    }
    // On two flanks of a tooth: three layers at the ends of an element, two between, without the tip.
    EXPECT_EQ(found, 21 * 2 * (2 * 14 + 7));
  }
}

// Truth: the rack itself. Rolled along, it touches every point of the profile and cuts none of it.
TEST(GearMesh, TheRackGeneratesTheProfile) {
  for (const auto& [teeth, degrees] : {std::pair{18, 20.0}, {60, 20.0}, {40, 14.5}, {14, 25.0}}) {
    SCOPED_TRACE(std::to_string(teeth) + " teeth");
    const GearShape shape = gear_of(teeth, degrees);
    const ToothProfile profile(shape);
    const double m = shape.module, a = shape.pressure_angle, r = profile.pitch_radius();
    const double rounding = m * std::min(0.38, (0.25 * kPi - 1.25 * std::tan(a)) / std::tan(0.25 * kPi - 0.5 * a));
    const double cx = 0.25 * kPi * m + 1.25 * m * std::tan(a) + rounding * std::tan(0.25 * kPi - 0.5 * a),
                 cy = rounding - 1.25 * m;
    // Distance from the rack's material beside the tooth (x > 0), shifted by s: a wedge with a rounded corner.
    const auto distance = [&](double x, double y, double s) {
      const double flank = (0.25 * kPi * m - y * std::tan(a) - (x - s)) * std::cos(a), tip = -1.25 * m - y;
      const double outside = std::max(flank, -y - 1.25 * m);
      const double dx = x - s - cx, dy = y - cy;
      const bool corner = dx < 0 && dy < 0 && flank > -rounding && tip > -rounding && std::atan2(-dy, -dx) > a &&
                          std::atan2(-dy, -dx) < 0.5 * kPi;
      return corner ? std::hypot(dx, dy) - rounding : outside;
    };
    for (int k = 0; k <= 40; ++k) {
      const auto place = k <= 20 ? profile.fillet(k / 20.0) : profile.involute((k - 20) / 20.0);
      double least = 1;
      for (int i = -6000; i <= 6000; ++i) {
        const double turn = i * 1e-4 * 18.0 / teeth, angle = place[1] + turn;  // clockwise with the rack
        least = std::min(least, distance(place[0] * std::sin(angle), place[0] * std::cos(angle) - r, r * turn));
      }
      // Steps of the search miss the touch by their square.
      EXPECT_NEAR(least, 0, 1e-4 * m) << k;
      EXPECT_GT(least, -1e-12) << k;
    }
  }
}

// Truth: rigid gears at the nominal distance of their axes that turn with the ratio of their teeth touch and do not
// overlap, all the way of a pitch; with backlash each flank is half of it away.
TEST(GearMesh, GearsRollWithoutOverlap) {
  for (const double backlash : {0.0, 1e-4})
    for (const auto& [z1, z2] : {std::pair{18, 27}, {20, 20}, {25, 80}}) {
      SCOPED_TRACE(std::to_string(z1) + " and " + std::to_string(z2) + " teeth");
      const ToothProfile pinion(gear_of(z1, 20, backlash)), gear(gear_of(z2, 20, backlash));
      const double centre = pinion.pitch_radius() + gear.pitch_radius();
      double least = 1;
      for (int step = 0; step < 20; ++step) {
        const double turn = step / 20.0 * 2 * kPi / z1, back = kPi + kPi / z2 - turn * z1 / z2;
        for (int tooth = -3; tooth <= 3; ++tooth)
          for (int k = -100; k <= 100; ++k) {
            const auto place = gear.involute(std::abs(k) / 100.0);
            const double angle = back + 2 * kPi * tooth / z2 + std::copysign(place[1], k);
            const double x = centre + place[0] * std::cos(angle), y = place[0] * std::sin(angle);
            const double r = std::hypot(x, y), pitch = 2 * kPi / z1, at = std::atan2(y, x) - turn;
            if (r > pinion.tip_radius()) continue;
            ASSERT_GT(r, pinion.root_radius() + 0.2 * 0.002) << "a quarter of a module is free at the root";
            // Lengths along the base circle are those along the line of action.
            const double gap = std::abs(at - pitch * std::round(at / pitch)) - half_angle(pinion, r);
            least = std::min(least, gap * pinion.base_radius());
          }
      }
      const double truth = 0.5 * backlash * std::cos(20 * kPi / 180);
      EXPECT_GT(least, truth - 1e-9);
      EXPECT_LT(least, truth + 1e-6);  // 100 points on a flank
    }
}

// Truth: on a circle about the axis the flank stands back along the tangent of the base circle by the relief at the
// tip, by nothing up to half of the addendum, and in between by what the tangent's length says.
TEST(GearMesh, TipReliefTakesFromTheTips) {
  constexpr double kRelief = 3e-5;
  GearShape shape = gear_of(20, 20);
  const ToothProfile whole(shape);
  shape.tip_relief = kRelief;
  const ToothProfile relieved(shape);
  const double base = whole.base_radius(), tip = whole.tip_radius(), from = whole.pitch_radius() + 0.5 * shape.module;
  const auto tangent = [&](double r) { return std::sqrt(r * r - base * base); };
  for (const double r : {whole.pitch_radius(), from, 0.3 * from + 0.7 * tip, tip - 1e-12}) {
    const double share = (tangent(r) - tangent(from)) / (tangent(tip) - tangent(from));
    EXPECT_NEAR((half_angle(whole, r) - half_angle(relieved, r)) * base, kRelief * std::max(0.0, share), 1e-11) << r;
  }
}

// Truth: the area inside the profile, 1/2 of the integral of r^2 over the angle, from 2,000 points.
TEST(GearMesh, VolumeIsThatOfTheProfile) {
  const GearShape shape = gear_of(24, 20);
  const ToothProfile p(shape);
  double area = 0;
  const auto add = [&](const ToothProfile::Place& a, const ToothProfile::Place& b) {
    area += 0.5 * a[0] * b[0] * std::sin(a[1] - b[1]);  // a triangle with the centre
  };
  constexpr int kPoints = 2000;
  for (int k = 0; k < kPoints; ++k) {
    const double u = static_cast<double>(k) / kPoints, v = static_cast<double>(k + 1) / kPoints;
    add(p.fillet(u), p.fillet(v));
    add(p.involute(u), p.involute(v));
  }
  area += 0.5 * std::pow(p.root_radius(), 2) * (p.half_pitch() - p.fillet(0)[1]);
  area += 0.5 * std::pow(p.tip_radius(), 2) * p.involute(1)[1];
  area = 2 * shape.teeth * area - kPi * std::pow(shape.bore_radius, 2);
  for (const ElementType type : {ElementType::hex8, ElementType::hex20}) {
    const Mesh mesh = make_spur_gear(shape, 12, 6, 1, type);
    double volume = 0;  // by the divergence theorem: planar quadrilaterals in x and y
    for (const MeshFace& face : mesh.face_set("front")) {
      const auto nodes = mesh.face_nodes(face);
      const auto corners =
          nodes.size() == 4 ? std::vector<std::size_t>{0, 1, 2, 3} : std::vector<std::size_t>{0, 4, 1, 5, 2, 6, 3, 7};
      for (std::size_t k = 0; k < corners.size(); ++k) {
        const Point &a = mesh.nodes[static_cast<std::size_t>(nodes[corners[k]])],
                    &b = mesh.nodes[static_cast<std::size_t>(nodes[corners[(k + 1) % corners.size()]])];
        volume += 0.5 * (a[0] * b[1] - a[1] * b[0]) * shape.width;
      }
    }
    EXPECT_NEAR(volume / (area * shape.width), 1, type == ElementType::hex8 ? 4e-3 : 1e-3);
  }
}

TEST(GearMesh, ImpossibleTeethAreRefused) {
  const auto message_of = [](const GearShape& s) -> std::string {
    try {
      static_cast<void>(make_spur_gear(s, 2, 2, 1));
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_EQ(message_of(gear_of(18, 20)), "");
  EXPECT_NE(message_of(gear_of(17, 20)).find("undercut at this pressure angle; take 18 or more"), std::string::npos);
  EXPECT_NE(message_of(gear_of(20, 31)).find("between 14 and 30 degrees"), std::string::npos);
  EXPECT_NE(message_of(gear_of(20, 20, 3e-3)).find("pointed"), std::string::npos);
  GearShape relieved = gear_of(20, 20);
  relieved.tip_relief = 1e-3;
  EXPECT_NE(message_of(relieved).find("pointed"), std::string::npos);
  relieved.tip_relief = -1e-6;
  EXPECT_NE(message_of(relieved).find("no negative backlash or tip relief"), std::string::npos);
  GearShape bore = gear_of(20, 20);
  bore.bore_radius = 0.016;
  EXPECT_NE(message_of(bore).find("the bore's radius must stay below"), std::string::npos);
  EXPECT_THROW(static_cast<void>(make_spur_gear(gear_of(20, 20), 0, 2, 1)), std::invalid_argument);
}

}  // namespace gear_mesh_test
}  // namespace espalier::dynamics
