#include "dynamics/contact/geometry/outline.hpp"

#include <cmath>
#include <numbers>

#include "base/at.hpp"

namespace espalier::dynamics::contact {
namespace {

constexpr int kAround = 24;

/// A body of revolution about z from its profile: radii and heights, rising, with the poles at its ends.
Outline turned(const std::vector<std::array<double, 2>>& profile) {
  Outline o;
  for (const auto& [radius, z] : profile)
    for (int k = 0; k < kAround; ++k) {
      const double turn = 2 * std::numbers::pi * k / kAround;
      o.points.emplace_back(radius * std::cos(turn), radius * std::sin(turn), z);
    }
  const auto rings = static_cast<Index>(profile.size());
  for (Index r = 0; r + 1 < rings; ++r)
    for (Index k = 0; k < kAround; ++k) {
      const Index next = (k + 1) % kAround, low = r * kAround, high = low + kAround;
      o.faces.push_back({low + k, low + next, high + next, high + k});
    }
  for (const Index ring : {Index{0}, rings - 1}) {
    const auto pole = static_cast<Index>(o.points.size());
    o.points.emplace_back(0, 0, profile[at(ring)][1]);
    for (Index k = 0; k < kAround; ++k) {
      const Index a = ring * kAround + k, b = ring * kAround + (k + 1) % kAround;
      if (ring == 0)
        o.faces.push_back({pole, b, a});
      else
        o.faces.push_back({pole, a, b});
    }
  }
  return o;
}

Outline round_ends(double radius, double half_length) {
  constexpr int kRings = 6;  // of a quarter
  std::vector<std::array<double, 2>> profile;
  for (int k = -kRings; k <= kRings; ++k) {
    const double turn = 0.5 * std::numbers::pi * k / kRings;
    const double side = k == 0 ? 0 : std::copysign(half_length, k);
    if (k == 0 && half_length > 0) {
      profile.push_back({radius, -half_length});
      profile.push_back({radius, half_length});
    } else {
      profile.push_back({radius * std::cos(turn), side + radius * std::sin(turn)});
    }
  }
  return turned(profile);
}

Outline box_faces(const Vec3& half) {
  Outline o;
  for (int k = 0; k < 8; ++k)
    o.points.emplace_back((k & 1) != 0 ? half[0] : -half[0], (k & 2) != 0 ? half[1] : -half[1],
                          (k & 4) != 0 ? half[2] : -half[2]);
  o.faces = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  return o;
}

}  // namespace

Outline outline_of(const Shape& shape) {
  if (const auto* s = std::get_if<SphereShape>(&shape)) return round_ends(s->radius, 0);
  if (const auto* c = std::get_if<CapsuleShape>(&shape)) return round_ends(c->radius, c->half_length);
  if (const auto* c = std::get_if<CylinderShape>(&shape))
    return turned({{c->radius, -c->half_length}, {c->radius, c->half_length}});
  if (const auto* b = std::get_if<BoxShape>(&shape)) return box_faces(b->half);
  Outline o;
  if (const auto* m = std::get_if<MeshShape>(&shape)) {
    o.points = m->surface->points();
    for (const auto& t : m->surface->triangles()) o.faces.push_back({t[0], t[1], t[2]});
  }
  return o;
}

}  // namespace espalier::dynamics::contact
