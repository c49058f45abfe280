#include "dynamics/meshers/parts.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "dynamics/meshers/block_builder.hpp"
#include "dynamics/meshers/eyes.hpp"
#include "dynamics/meshers/sizing.hpp"

namespace espalier::dynamics {
namespace {

void require(bool holds, const char* part, const char* what) {
  if (!holds) throw std::invalid_argument(fmt::format("{}: need {}", part, what));
}

/// Divisions of a figure with element size h. Opposite arcs of a filled eye must agree.
EyeDivisions eye_divisions(const Eye& big, const Eye& small, double h) {
  EyeDivisions n{};
  const auto a = arc_angles(big), b = arc_angles(small);
  n.radial = divisions(std::max(big.outer - big.inner, small.outer - small.inner), h, 1);
  n.core = divisions(0.5 * std::max(big.inner, small.inner), h, 1);
  const double radius[2] = {0.5 * (big.inner + big.outer), 0.5 * (small.inner + small.outer)};
  const int across = divisions(std::max(a[0] * radius[0], b[0] * radius[1]), h, 2);
  const int side = divisions(std::max(a[1] * radius[0], b[1] * radius[1]), h, 3);
  n.arc[0] = n.arc[2] = across;
  n.arc[1] = n.arc[3] = side;
  return n;
}

double half_angle(double width, double radius) { return std::asin(0.5 * width / radius); }

struct RodNames {
  const char* part;
  const char* big;
  const char* small;
};

Mesh rod(const RodShape& s, const RodNames& names, const MeshSize& size) {
  require(s.big_inner > 0 && s.big_outer > s.big_inner && s.small_inner > 0 && s.small_outer > s.small_inner,
          names.part, "0 < inner radius < outer radius for both eyes");
  require(s.big_outer + s.small_outer < s.length, names.part,
          "the sum of the outer radii below the distance of the eyes");
  require(s.shank_big > 0 && s.shank_big < 2 * s.big_outer && s.shank_small > 0 && s.shank_small < 2 * s.small_outer,
          names.part, "a shank narrower than the eyes");
  const Eye big{0, s.big_inner, s.big_outer, half_angle(s.shank_big, s.big_outer), 1};
  const Eye small{s.length, s.small_inner, s.small_outer, half_angle(s.shank_small, s.small_outer), -1};
  return mesh_to_size(size, s.thickness / 2, [&](double h) {
    BlockBuilder builder(names.part, size.type, 1e-6 * std::min({h, s.thickness, s.big_outer - s.big_inner}),
                         size.pool);
    const EyeDivisions n = eye_divisions(big, small, h);
    const Stretch z{-0.5 * s.thickness, 0.5 * s.thickness, divisions(s.thickness, h)};
    const std::vector<NamedSide> flat = {{BlockSide::w0, "back"}, {BlockSide::w1, "front"}};
    const auto with_bore = [&](const char* bore) {
      std::vector<NamedSide> sides = flat;
      sides.push_back({BlockSide::u0, bore});
      return sides;
    };
    for (const PlaneBlock& b : ring_blocks(big, n)) extrude(builder, b, z, "all", with_bore(names.big));
    for (const PlaneBlock& b : ring_blocks(small, n)) extrude(builder, b, z, "all", with_bore(names.small));
    const int along = divisions(s.length - s.big_outer - s.small_outer, h);
    extrude(builder, shank_block(big, small, along, n), z, "all", flat);
    return builder.finish();
  });
}

/// One axial layer of a crankshaft: which parts of the figure it has, and the names of its surfaces.
struct Layer {
  double length;
  bool journal, pin;    // discs present; both: a web
  const char* surface;  // of the disc, when it stands alone
  const char* low;      // name of the face at its lower end, or null
  const char* high;
};

void add_layer(BlockBuilder& builder, const Layer& layer, const Eye& journal, const Eye& pin, const EyeDivisions& n,
               double begin, double h) {
  const Stretch z{begin, begin + layer.length, divisions(layer.length, h)};
  const auto add_disc = [&](const Eye& eye, const char* set, const char* surface) {
    const auto blocks = disc_blocks(eye, n);
    for (std::size_t k = 0; k < blocks.size(); ++k) {
      std::vector<NamedSide> sides;
      if (surface != nullptr && k < 4) sides.push_back({BlockSide::u1, surface});
      if (layer.low != nullptr) sides.push_back({BlockSide::w0, layer.low});
      if (layer.high != nullptr) sides.push_back({BlockSide::w1, layer.high});
      extrude(builder, blocks[k], z, set, sides);
    }
  };
  const bool web = layer.journal && layer.pin;
  if (layer.journal) add_disc(journal, web ? "webs" : "journals", layer.surface);
  if (layer.pin) add_disc(pin, web ? "webs" : "pin", layer.surface);
  if (!web) return;
  for (const Eye* eye : {&journal, &pin})
    for (const PlaneBlock& b : ring_blocks(*eye, n)) extrude(builder, b, z, "webs", {});
  const int along = divisions(pin.centre_x - journal.outer - pin.outer, h);
  extrude(builder, shank_block(journal, pin, along, n), z, "webs", {});
}

}  // namespace

Mesh make_block(const BlockShape& s, int nx, int ny, int nz, ElementType type) {
  require(s.lx > 0 && s.ly > 0 && s.lz > 0 && nx > 0 && ny > 0 && nz > 0, "block", "positive lengths and divisions");
  BlockBuilder builder("block", type, 1e-6 * std::min({s.lx / nx, s.ly / ny, s.lz / nz}));
  builder.add({nx, ny, nz},
              [&](double u, double v, double w) {
                return Point{s.lx * u, s.ly * v, s.lz * w};
              },
              "all",
              {{BlockSide::u0, "x0"},
               {BlockSide::u1, "x1"},
               {BlockSide::v0, "y0"},
               {BlockSide::v1, "y1"},
               {BlockSide::w0, "z0"},
               {BlockSide::w1, "z1"}});
  return builder.finish();
}

Mesh make_block(const BlockShape& s, const MeshSize& size) {
  return mesh_to_size(size, std::cbrt(s.lx * s.ly * s.lz) / 4, [&](double h) {
    return make_block(s, divisions(s.lx, h), divisions(s.ly, h), divisions(s.lz, h), size.type);
  });
}

Mesh make_connecting_rod(const RodShape& shape, const MeshSize& size) {
  return rod(shape, {"connecting rod", "big_bore", "small_bore"}, size);
}

Mesh make_chain_link(const LinkShape& s, const MeshSize& size) {
  return rod({s.pitch, s.inner, s.outer, s.inner, s.outer, s.waist, s.waist, s.thickness},
             {"chain link", "bore_a", "bore_b"}, size);
}

Mesh make_crank(const CrankShape& s, const MeshSize& size) {
  require(s.journal_radius > 0 && s.pin_radius > 0 && s.web_big > s.journal_radius && s.web_small > s.pin_radius,
          "crank", "webs larger than journal and pin");
  require(s.web_big + s.web_small < s.throw_radius, "crank", "web_big + web_small below throw_radius");
  require(s.web_neck > 0 && s.web_neck < 2 * s.web_small && s.web_neck < 2 * s.web_big, "crank",
          "a web neck narrower than both eyes");
  const Eye journal{0, s.journal_radius, s.web_big, half_angle(s.web_neck, s.web_big), 1};
  const Eye pin{s.throw_radius, s.pin_radius, s.web_small, half_angle(s.web_neck, s.web_small), -1};
  const Layer layers[5] = {{s.journal_length, true, false, "journal_left", "end_left", nullptr},
                           {s.web_thickness, true, true, nullptr, nullptr, nullptr},
                           {s.pin_length, false, true, "pin", nullptr, nullptr},
                           {s.web_thickness, true, true, nullptr, nullptr, nullptr},
                           {s.journal_length, true, false, "journal_right", nullptr, "end_right"}};
  return mesh_to_size(size, s.web_thickness, [&](double h) {
    BlockBuilder builder("crank", size.type, 1e-6 * std::min(h, s.web_big - s.journal_radius), size.pool);
    const EyeDivisions n = eye_divisions(journal, pin, h);
    double z = -(s.journal_length + s.web_thickness + 0.5 * s.pin_length);
    for (const Layer& layer : layers) {
      add_layer(builder, layer, journal, pin, n, z, h);
      z += layer.length;
    }
    return builder.finish();
  });
}

Mesh make_guide(const GuideShape& s, const MeshSize& size) {
  require(s.lead > 0 && s.radius > 0 && s.height > 0 && s.width > 0 && s.angle > 0, "guide", "positive dimensions");
  const double c = std::cos(s.angle), sn = std::sin(s.angle);
  // Station along the rail (v = 0: base, v = 1: running surface, towards the centre of the arc).
  const auto arc = [&](double a, double v) {
    const double r = s.radius + (1 - v) * s.height;
    return std::array<double, 2>{r * std::sin(a), s.radius - r * std::cos(a)};
  };
  const auto straight = [&](double x, double v, bool after) {
    const std::array<double, 2> p = arc(after ? s.angle : 0, v);
    return std::array<double, 2>{p[0] + (after ? c * x : x), p[1] + (after ? sn * x : 0)};
  };
  return mesh_to_size(size, s.height, [&](double h) {
    BlockBuilder builder("guide", size.type, 1e-6 * std::min(h, s.height), size.pool);
    const int ny = divisions(s.height, h), nz = divisions(s.width, h), lead = divisions(s.lead, h);
    const std::vector<NamedSide> sides = {{BlockSide::v0, "base"}, {BlockSide::v1, "running"}};
    const auto add = [&](int nx, const auto& map, const std::vector<NamedSide>& extra) {
      std::vector<NamedSide> all = sides;
      all.insert(all.end(), extra.begin(), extra.end());
      builder.add(
          {nx, ny, nz},
          [&](double u, double v, double w) {
            const std::array<double, 2> p = map(u, v);
            return Point{p[0], p[1], (w - 0.5) * s.width};
          },
          "all", all);
    };
    add(lead, [&](double u, double v) { return straight((u - 1) * s.lead, v, false); }, {{BlockSide::u0, "start"}});
    add(divisions(s.radius * s.angle, h, 4), [&](double u, double v) { return arc(u * s.angle, v); }, {});
    add(lead, [&](double u, double v) { return straight(u * s.lead, v, true); }, {{BlockSide::u1, "end"}});
    return builder.finish();
  });
}

}  // namespace espalier::dynamics
