#include <algorithm>
#include <numbers>

#include "dynamics/joints/surface_shape.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

SurfacePtr read_heights(Section& s) {
  const std::vector<double> x = s.numbers("x"), y = s.numbers("y");
  for (const auto& [key, line] : {std::pair{"x", &x}, std::pair{"y", &y}})
    if (line->size() < 2 || !std::is_sorted(line->begin(), line->end(), std::less_equal<>()))
      fail(s.place(key), "needs two places of the grid and more, each greater than the one before it");
  const Value* rows = s.value("heights");
  const auto bad = [&](const Place& place) {
    fail(place, "must be a list of rows, one for each number of 'x', with a height for each number of 'y'");
  };
  if (rows == nullptr || rows->type != Value::Type::array || rows->items.size() != x.size())
    bad(rows == nullptr ? s.place() : rows->place);
  std::vector<std::vector<double>> heights;
  for (const Value& row : rows->items) {
    if (row.type != Value::Type::array || row.items.size() != y.size()) bad(row.place);
    heights.emplace_back();
    for (const Value& height : row.items) heights.back().push_back(Section::plain_number(height));
  }
  return height_surface(x, y, std::move(heights));
}

SurfacePtr read_sphere(Section& s) { return sphere_surface(s.positive("radius")); }

SurfacePtr read_ellipsoid(Section& s) {
  const Vec3 axes = s.vector("half_axes");
  if (!(axes.minCoeff() > 0)) fail(s.place("half_axes"), "must be greater than 0, all three");
  return ellipsoid_surface(axes);
}

SurfacePtr read_cylinder(Section& s) { return cylinder_surface(s.positive("radius")); }

SurfacePtr read_cone(Section& s) {
  const double angle = s.positive("angle");
  if (!(angle < std::numbers::pi / 2))
    fail(s.place("angle"), "between the axis and the surface must be less than a right angle, pi/2");
  return cone_surface(angle);
}

SurfacePtr read_torus(Section& s) {
  const double radius = s.positive("radius"), rim = s.positive("rim");
  if (!(rim < radius)) fail(s.place("rim"), "must be less than 'radius', that of the circle in the tube");
  return torus_surface(radius, rim);
}

constexpr base::Named<SurfacePtr (*)(Section&)> kForms[] = {{"sphere", read_sphere},     {"ellipsoid", read_ellipsoid},
                                                            {"cylinder", read_cylinder}, {"cone", read_cone},
                                                            {"torus", read_torus},       {"heights", read_heights}};

void read_point_on_surface(Section& s, JointSpec& j, Description& /*model*/) {
  j.surface = s.one_of("shape", kForms)(s);
}

std::unique_ptr<Joint> make_point_on_surface(const JointSpec& j, std::vector<FramePtr> f, const JointStart& /*start*/) {
  return point_on_surface(j.name, std::move(f[0]), std::move(f[1]), j.surface);
}

}  // namespace

const JointKind kPointOnSurface = {.type = JointType::point_on_surface,
                                   .name = "point-on-surface",
                                   .read = read_point_on_surface,
                                   .make = make_point_on_surface,
                                   .turns_b = false,
                                   .freedom = {.surface = true, .whole_force = true}};

}  // namespace espalier::dynamics::model
