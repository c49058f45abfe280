#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "dynamics/meshers/block_builder.hpp"
#include "dynamics/meshers/parts.hpp"
#include "dynamics/meshers/sizing.hpp"

namespace espalier::dynamics {
namespace {

void check(const RotorShape& s) {
  const bool radii = s.bore_radius > 0 && s.shaft_radius > s.bore_radius && s.disc_radius > s.shaft_radius &&
                     s.tip_radius > s.disc_radius;
  const double half = 0.5 * s.disc_thickness, middle = s.disc_position * s.shaft_length;
  const bool lengths = s.disc_thickness > 0 && s.bearing_length > 0 && middle - half > s.bearing_length &&
                       middle + half < s.shaft_length - s.bearing_length;
  if (s.blades < 2 || !radii || !lengths || !(s.blade_fraction > 0 && s.blade_fraction < 1) ||
      !(s.blade_taper >= 0 && s.blade_taper < 1))
    throw std::invalid_argument(
        "bladed rotor: need at least 2 blades, bore < shaft < disc < tip radius, a disc between the bearings, "
        "0 < blade_fraction < 1 and 0 <= blade_taper < 1");
}

/// Angular sectors of the rotor: a blade's foot, then the gap to the next, for every blade.
struct Sector {
  double from, to;
  int n;
  bool blade;
};

class Rotor {
 public:
  Rotor(const RotorShape& shape, const MeshSize& size, double h)
      : s_(shape), h_(h), builder_("bladed rotor", size.type, 1e-6 * std::min(h, smallest_length()), size.pool) {
    const double sector = 2 * std::numbers::pi / s_.blades, foot = s_.blade_fraction * sector;
    // The rim decides the number of elements around; the shaft has the same number.
    const int n_foot = divisions(foot * s_.disc_radius, 2 * h),
              n_gap = divisions((sector - foot) * s_.disc_radius, 2 * h);
    for (int k = 0; k < s_.blades; ++k) {
      sectors_.push_back({k * sector - 0.5 * foot, k * sector + 0.5 * foot, n_foot, true});
      sectors_.push_back({k * sector + 0.5 * foot, (k + 1) * sector - 0.5 * foot, n_gap, false});
    }
  }

  Mesh build() {
    const double l = s_.shaft_length, middle = s_.disc_position * l, half = 0.5 * s_.disc_thickness;
    const double z[6] = {0, s_.bearing_length, middle - half, middle + half, l - s_.bearing_length, l};
    const int n_disc = divisions(s_.disc_thickness, h_);
    for (int k = 0; k < 5; ++k) {
      std::vector<NamedSide> sides = {{BlockSide::u0, "bore"}};
      if (k == 0) sides.insert(sides.end(), {{BlockSide::u1, "bearing_left"}, {BlockSide::w0, "end_left"}});
      if (k == 4) sides.insert(sides.end(), {{BlockSide::u1, "bearing_right"}, {BlockSide::w1, "end_right"}});
      const int nz = k == 2 ? n_disc : divisions(z[k + 1] - z[k], 1.5 * h_);
      for (const Sector& p : sectors_)
        ring(p, s_.bore_radius, s_.shaft_radius, {z[k] - middle, z[k + 1] - middle, nz}, "shaft", sides);
    }
    for (const Sector& p : sectors_) {
      ring(p, s_.shaft_radius, s_.disc_radius, {-half, half, n_disc}, "disc", {});
      if (p.blade) blade(p, n_disc);
    }
    return builder_.finish();
  }

 private:
  [[nodiscard]] double smallest_length() const {
    return std::min({s_.bore_radius, s_.shaft_radius - s_.bore_radius, s_.disc_thickness});
  }

  void ring(const Sector& p, double r0, double r1, const Stretch& z, const char* set,
            const std::vector<NamedSide>& sides) {
    builder_.add(
        {divisions(r1 - r0, h_), p.n, z.elements},
        [&](double u, double v, double w) {
          const double r = r0 + u * (r1 - r0), a = p.from + v * (p.to - p.from);
          return Point{r * std::cos(a), r * std::sin(a), z.at(w)};
        },
        set, sides);
  }

  /// The foot is the rim's arc; outwards the section flattens, tapers and twists about the blade's radial axis.
  void blade(const Sector& p, int n_disc) {
    const double centre = 0.5 * (p.from + p.to), er[2] = {std::cos(centre), std::sin(centre)};
    builder_.add({divisions(s_.tip_radius - s_.disc_radius, h_), p.n, n_disc},
                 [&](double u, double v, double w) {
                   const double offset = (v - 0.5) * (p.to - p.from);
                   const double bulge = s_.disc_radius * (std::cos(offset) - 1) * (1 - u);
                   const double radial = s_.disc_radius + u * (s_.tip_radius - s_.disc_radius) + bulge;
                   const double y = s_.disc_radius * std::sin(offset) * (1 - s_.blade_taper * u);
                   const double z = (w - 0.5) * s_.disc_thickness;
                   const double c = std::cos(s_.blade_twist * u), sn = std::sin(s_.blade_twist * u);
                   const double tangential = c * y - sn * z, axial = sn * y + c * z;
                   return Point{radial * er[0] - tangential * er[1], radial * er[1] + tangential * er[0], axial};
                 },
                 "blades", {{BlockSide::u1, "blade_tips"}});
  }

  RotorShape s_;
  double h_;
  BlockBuilder builder_;
  std::vector<Sector> sectors_;
};

}  // namespace

Mesh make_bladed_rotor(const RotorShape& shape, const MeshSize& size) {
  check(shape);
  return mesh_to_size(size, shape.disc_thickness, [&](double h) { return Rotor(shape, size, h).build(); });
}

}  // namespace espalier::dynamics
