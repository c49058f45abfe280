// A spur gear: every tooth is one block on a foot of three, on a ring down to the bore.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dynamics/meshers/block_builder.hpp"
#include "dynamics/meshers/eyes.hpp"
#include "dynamics/meshers/involute.hpp"
#include "dynamics/meshers/sizing.hpp"

namespace espalier::dynamics {
namespace {

using Plane = std::array<double, 2>;

/// Element counts of a gear.
struct GearDivisions {
  int flank = 8;   ///< along an involute
  int across = 4;  ///< a tooth
  int width = 1;
  [[nodiscard]] int foot() const {
    return std::max(1, (across + 1) / 3);
  }  ///< from a gap's middle to a tooth; below the root
  [[nodiscard]] int fillet() const { return std::max(2, flank / 3); }  ///< along the upper half of a fillet
};

class Gear {
 public:
  Gear(const GearShape& shape, const GearDivisions& n, const MeshSize& size)
      : s_(shape),
        profile_(shape),
        n_(n),
        builder_("spur gear", size.type, 1e-5 * smallest_edge(), size.pool),
        inner_(profile_.root_radius() - kFoot * shape.module),
        foot_angle_(0.8 * profile_.fillet(kSplit)[1]) {
    root_share_ = root_length() / (root_length() + fillet_length());
  }

  Mesh build() {
    for (int k = 0; k < s_.teeth; ++k) tooth(2 * k * profile_.half_pitch());
    return builder_.finish();
  }

 private:
  static constexpr double kFoot = 0.7;   // modules of the foot below the root
  static constexpr double kSplit = 0.5;  // of the fillet, between the foot and the tooth

  [[nodiscard]] double smallest_edge() const {
    return std::min({s_.module / (n_.flank + n_.across), s_.width / n_.width, s_.bore_radius / s_.teeth});
  }
  [[nodiscard]] double root_length() const {
    return profile_.root_radius() * (profile_.half_pitch() - profile_.fillet(0)[1]);
  }
  [[nodiscard]] double fillet_length() const {
    const auto a = profile_.fillet(0), b = profile_.fillet(kSplit);
    return std::hypot(b[0] - a[0], a[0] * (a[1] - b[1]));
  }

  /// From the middle of the gap (v = 0) along root and fillet to the tooth (v = 1): radius and angle.
  [[nodiscard]] ToothProfile::Place root_edge(double v) const {
    if (v >= root_share_) return profile_.fillet(kSplit * (v - root_share_) / (1 - root_share_));
    const double end = profile_.fillet(0)[1];
    return {profile_.root_radius(), profile_.half_pitch() + v / root_share_ * (end - profile_.half_pitch())};
  }

  static Plane polar(double radius, double angle) { return {radius * std::cos(angle), radius * std::sin(angle)}; }
  static Plane blend(const Plane& a, const Plane& b, double s) {
    return {(1 - s) * a[0] + s * b[0], (1 - s) * a[1] + s * b[1]};
  }

  /// (u, v): outwards and anticlockwise, of the tooth on the x axis, turned by `turn`.
  template <class Map>
  void block(int nu, int nv, double turn, const Map& map, std::vector<NamedSide> sides) {
    sides.insert(sides.end(), {{BlockSide::w0, "back"}, {BlockSide::w1, "front"}});
    const double c = std::cos(turn), sn = std::sin(turn);
    extrude(builder_,
            {[&map, c, sn](double u, double v) {
               const Plane p = map(u, v);
               return Plane{c * p[0] - sn * p[1], sn * p[0] + c * p[1]};
             },
             nu, nv},
            {-0.5 * s_.width, 0.5 * s_.width, n_.width}, "all", sides);
  }

  void tooth(double turn) {
    const double half = profile_.half_pitch();
    ring(turn, -half, -foot_angle_, n_.foot());
    ring(turn, -foot_angle_, foot_angle_, n_.across);
    ring(turn, foot_angle_, half, n_.foot());
    // Beside the tooth, from the inner circle to root and fillet.
    for (const double side : {-1.0, 1.0})
      block(n_.foot(), n_.foot(), turn,
            [&](double u, double v) {
              const double w = side < 0 ? v : 1 - v;
              const auto edge = root_edge(w);
              return blend(polar(inner_, side * (half + w * (foot_angle_ - half))), polar(edge[0], side * edge[1]), u);
            },
            {{BlockSide::u1, "teeth"}});
    // Under the tooth, to the chord between the middles of its fillets; then the tooth up to the involutes and the tip.
    const auto base = profile_.fillet(kSplit);
    block(n_.foot(), n_.across, turn,
          [&](double u, double v) { return blend(polar(inner_, (2 * v - 1) * foot_angle_), across(base, v), u); }, {});
    std::vector<NamedSide> sides = {{BlockSide::v0, "teeth"}, {BlockSide::v1, "teeth"}};
    block(
        n_.fillet(), n_.across, turn,
        [&](double u, double v) { return across(profile_.fillet(kSplit + (1 - kSplit) * u), v); }, sides);
    sides.push_back({BlockSide::u1, "teeth"});
    block(
        n_.flank, n_.across, turn,
        [&](double u, double v) {
          const auto edge = profile_.involute(u);
          // The chord at the fillet becomes the arc of the tip.
          return blend(across(edge, v), polar(edge[0], (2 * v - 1) * edge[1]), u);
        },
        sides);
  }

  static Plane across(const ToothProfile::Place& edge, double v) {
    return blend(polar(edge[0], -edge[1]), polar(edge[0], edge[1]), v);
  }

  void ring(double turn, double from, double to, int n) {
    const double edge = 2 * inner_ * profile_.half_pitch() / (n_.across + 2 * n_.foot());
    block(divisions(inner_ - s_.bore_radius, 1.5 * edge), n, turn,
          [&](double u, double v) {
            return polar(s_.bore_radius + u * (inner_ - s_.bore_radius), from + v * (to - from));
          },
          {{BlockSide::u0, "bore"}});
  }

  GearShape s_;
  ToothProfile profile_;
  GearDivisions n_;
  BlockBuilder builder_;
  double inner_, foot_angle_;  // the circle under the feet; half of the foot's angle on it
  double root_share_ = 0;      // of root_edge() on the root circle
};

}  // namespace

Mesh make_spur_gear(const GearShape& shape, int flank, int across, int width, ElementType type) {
  if (flank < 1 || across < 1 || width < 1)
    throw std::invalid_argument("spur gear: need at least one element along the flank, across the tooth and the width");
  return Gear(shape, {flank, across, width}, {0, type}).build();
}

Mesh make_spur_gear(const GearShape& shape, const MeshSize& size) {
  const double flank = ToothProfile(shape).involute_length();
  return mesh_to_size(size, 0.5 * flank, [&](double h) {
    return Gear(shape, {divisions(flank, h, 2), divisions(1.6 * shape.module, h, 2), divisions(shape.width, 4 * h)},
                size)
        .build();
  });
}

}  // namespace espalier::dynamics
