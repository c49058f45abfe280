#include "dynamics/meshers/eyes.hpp"

#include <cmath>
#include <numbers>

namespace espalier::dynamics {
namespace {

using Plane = std::array<double, 2>;

/// Corner angles of the four arcs, from the shank's axis; corner 4 is corner 0 plus a full turn.
std::array<double, 5> corner_angles(const Eye& eye) {
  const double rest = (2 * std::numbers::pi - 2 * eye.half_angle) / 3;
  return {-eye.half_angle, eye.half_angle, eye.half_angle + rest, eye.half_angle + 2 * rest,
          2 * std::numbers::pi - eye.half_angle};
}

/// Point at `radius`; turning the whole eye by half a turn (direction -1) keeps the handedness.
Plane on_circle(const Eye& eye, double radius, double angle) {
  return {eye.centre_x + eye.direction * radius * std::cos(angle), eye.direction * radius * std::sin(angle)};
}

Plane blend(const Plane& a, const Plane& b, double s) { return {(1 - s) * a[0] + s * b[0], (1 - s) * a[1] + s * b[1]}; }

/// Point on the core of a disc: halfway between the chord and the arc of a circle with half of the radius.
Plane on_core(const Eye& eye, double from, double to, double v) {
  const double radius = 0.5 * eye.inner;
  const Plane chord = blend(on_circle(eye, radius, from), on_circle(eye, radius, to), v);
  return blend(chord, on_circle(eye, radius, from + v * (to - from)), 0.5);
}

}  // namespace

std::array<double, 4> arc_angles(const Eye& eye) {
  const auto c = corner_angles(eye);
  return {c[1] - c[0], c[2] - c[1], c[3] - c[2], c[4] - c[3]};
}

std::vector<PlaneBlock> ring_blocks(const Eye& eye, const EyeDivisions& n) {
  const auto c = corner_angles(eye);
  std::vector<PlaneBlock> blocks;
  for (std::size_t k = 0; k < 4; ++k)
    blocks.push_back({[eye, from = c[k], to = c[k + 1]](double u, double v) {
                        return on_circle(eye, eye.inner + u * (eye.outer - eye.inner), from + v * (to - from));
                      },
                      n.radial, n.arc[k]});
  return blocks;
}

std::vector<PlaneBlock> disc_blocks(const Eye& eye, const EyeDivisions& n) {
  const auto c = corner_angles(eye);
  std::vector<PlaneBlock> blocks;
  for (std::size_t k = 0; k < 4; ++k)
    blocks.push_back({[eye, from = c[k], to = c[k + 1]](double u, double v) {
                        return blend(on_core(eye, from, to, v), on_circle(eye, eye.inner, from + v * (to - from)), u);
                      },
                      n.core, n.arc[k]});
  // Coons patch between the four core curves; arcs 0 and 2 face each other, 1 and 3 too.
  const auto core = [eye, c](double u, double v) {
    const Plane right = on_core(eye, c[0], c[1], v), left = on_core(eye, c[2], c[3], 1 - v);
    const Plane top = on_core(eye, c[1], c[2], 1 - u), bottom = on_core(eye, c[3], c[4], u);
    const Plane corner[4] = {on_core(eye, c[3], c[4], 0), on_core(eye, c[0], c[1], 0), on_core(eye, c[0], c[1], 1),
                             on_core(eye, c[1], c[2], 1)};  // (0,0) (1,0) (1,1) (0,1)
    Plane p{};
    for (std::size_t i = 0; i < 2; ++i)
      p[i] = (1 - u) * left[i] + u * right[i] + (1 - v) * bottom[i] + v * top[i] -
             ((1 - u) * (1 - v) * corner[0][i] + u * (1 - v) * corner[1][i] + u * v * corner[2][i] +
              (1 - u) * v * corner[3][i]);
    return p;
  };
  blocks.push_back({core, n.arc[1], n.arc[0]});
  return blocks;
}

PlaneBlock shank_block(const Eye& from, const Eye& to, int along, const EyeDivisions& n) {
  return {[from, to](double u, double v) {
            const Plane a = on_circle(from, from.outer, (2 * v - 1) * from.half_angle);
            const Plane b = on_circle(to, to.outer, (1 - 2 * v) * to.half_angle);
            return blend(a, b, u);
          },
          along, n.arc[0]};
}

void extrude(BlockBuilder& builder, const PlaneBlock& block, const Stretch& z, const std::string& set,
             const std::vector<NamedSide>& sides) {
  builder.add(
      {block.nu, block.nv, z.elements},
      [&](double u, double v, double w) {
        const Plane p = block.map(u, v);
        return Point{p[0], p[1], z.at(w)};
      },
      set, sides);
}

}  // namespace espalier::dynamics
