#include "dynamics/meshers/tyre.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "dynamics/meshers/block_builder.hpp"
#include "dynamics/meshers/sizing.hpp"

namespace espalier::dynamics {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

double middle_radius(const TyreShape& s) { return s.radius - 0.5 * s.thickness - s.section_radius; }

void check_tyre(const TyreShape& s) {
  const auto need = [](bool holds, const char* what) {
    if (!holds) throw std::invalid_argument(fmt::format("tyre: need {}", what));
  };
  need(s.thickness > 0 && s.thickness < s.section_radius, "0 < thickness < section_radius");
  need(s.opening > 0 && s.opening < 0.5 * std::numbers::pi, "an opening between 0 and pi/2");
  need(s.sectors >= 3, "three sectors or more");
  need(middle_radius(s) > s.section_radius + 0.5 * s.thickness, "a radius above 2 section_radius + thickness");
}

Mesh tyre_of(const TyreShape& s, int around, int across, int through, const MeshSize& size) {
  const double edge = std::min({kTurn * (s.radius - 2 * s.section_radius) / around,
                                (kTurn - 2 * s.opening) * s.section_radius / across, s.thickness / through});
  BlockBuilder builder("tyre", size.type, 1e-5 * edge, size.pool);
  const auto add = [&](int sector, double from, double to, int elements, const std::vector<NamedSide>& sides) {
    builder.add(
        {around / s.sectors, elements, through},
        [&](double u, double v, double w) {
          const double turn = kTurn * (sector + u) / s.sectors;
          const double angle = from + v * (to - from);  // in the section, from the side of the axis
          const double section = s.section_radius + (w - 0.5) * s.thickness;
          const double r = middle_radius(s) - section * std::cos(angle);
          return Point{r * std::cos(turn), section * std::sin(angle), r * std::sin(turn)};
        },
        "all", sides);
  };
  const int seated = divisions(2 * s.opening, (kTurn - 2 * s.opening) / across, 2);
  for (int k = 0; k < s.sectors; ++k) {
    add(k, s.opening, kTurn - s.opening, across, {{BlockSide::w0, "inside"}, {BlockSide::w1, "outside"}});
    add(k, -s.opening, s.opening, seated,
        {{BlockSide::w0, "inside"}, {BlockSide::w1, "rim"}, {BlockSide::w1, fmt::format("rim_{}", k)}});
  }
  return builder.finish();
}

}  // namespace

Mesh make_tyre(const TyreShape& shape, int around, int across, int thickness, ElementType type) {
  check_tyre(shape);
  if (around < shape.sectors || around % shape.sectors != 0 || across < 2 || thickness < 1)
    throw std::invalid_argument(
        fmt::format("tyre: need a multiple of {} (sectors) elements around, two or more across, one or more through "
                    "the thickness",
                    shape.sectors));
  return tyre_of(shape, around, across, thickness, {0, type});
}

Mesh make_tyre(const TyreShape& shape, const MeshSize& size) {
  check_tyre(shape);
  return mesh_to_size(size, 0.5 * shape.section_radius, [&](double h) {
    const double arc = (kTurn - 2 * shape.opening) * shape.section_radius;
    return tyre_of(shape, shape.sectors * divisions(kTurn * shape.radius / shape.sectors, h), divisions(arc, h, 2),
                   divisions(shape.thickness, h), size);
  });
}

}  // namespace espalier::dynamics
