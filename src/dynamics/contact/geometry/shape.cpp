#include "dynamics/contact/geometry/shape.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace espalier::dynamics::contact {
namespace {

template <class... Cases>
struct Overloaded : Cases... {
  using Cases::operator()...;
};
template <class... Cases>
Overloaded(Cases...) -> Overloaded<Cases...>;

void check_length(double value, const char* what) {
  if (!(value > 0) || !std::isfinite(value))
    throw std::invalid_argument(fmt::format("the {} of a shape must be greater than 0, not {:g}", what, value));
}

}  // namespace

void check_shape(const Shape& shape) {
  std::visit(Overloaded{[](const PlaneShape&) {}, [](const SphereShape& s) { check_length(s.radius, "radius"); },
                        [](const CapsuleShape& c) {
                          check_length(c.radius, "radius");
                          check_length(c.half_length, "length");
                        },
                        [](const CylinderShape& c) {
                          check_length(c.radius, "radius");
                          check_length(c.half_length, "length");
                        },
                        [](const BoxShape& b) {
                          for (int i = 0; i < 3; ++i) check_length(b.half[i], "size");
                        },
                        [](const MeshShape& m) {
                          if (!m.surface) throw std::invalid_argument("the surface of a shape is missing");
                        }},
             shape);
}

Box box_around(const PlacedShape& p) {
  Box box;
  const auto segment = [&](double half_length, const Vec3& extent) {
    box.add(Vec3(p.origin + half_length * p.z()));
    box.add(Vec3(p.origin - half_length * p.z()));
    box.low -= extent;
    box.high += extent;
  };
  const auto turned = [&](const Vec3& middle, const Vec3& half) {
    const Vec3 centre = p.to_global(middle), extent = p.axes.cwiseAbs() * half;
    box = {centre - extent, centre + extent};
  };
  std::visit(Overloaded{[](const PlaneShape&) {}, [&](const SphereShape& s) { segment(0, Vec3::Constant(s.radius)); },
                        [&](const CapsuleShape& c) { segment(c.half_length, Vec3::Constant(c.radius)); },
                        [&](const CylinderShape& c) {
                          // a disc with the normal z reaches radius * sqrt(1 - z_i^2) along axis i
                          const Vec3 reach = (1 - p.z().array().square()).max(0).sqrt() * c.radius;
                          segment(c.half_length, reach);
                        },
                        [&](const BoxShape& b) { turned(Vec3::Zero(), b.half); },
                        [&](const MeshShape& m) {
                          const Box own = m.surface->tree().all();
                          turned(0.5 * (own.low + own.high), 0.5 * (own.high - own.low));
                        }},
             *p.shape);
  return box;
}

double least_extent(const Shape& shape) {
  return std::visit(
      Overloaded{[](const PlaneShape&) { return std::numeric_limits<double>::infinity(); },
                 [](const SphereShape& s) { return s.radius; }, [](const CapsuleShape& c) { return c.radius; },
                 [](const CylinderShape& c) { return std::min(c.radius, c.half_length); },
                 [](const BoxShape& b) { return b.half.minCoeff(); },
                 [](const MeshShape& m) { return 2 * m.surface->depth(); }},
      shape);
}

}  // namespace espalier::dynamics::contact
