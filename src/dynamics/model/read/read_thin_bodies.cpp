// Cables, beams and shells.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>

#include "dynamics/model/read/body_readers.hpp"

namespace espalier::dynamics::model {
namespace {

/// Lines of a file, in the place of an axis.
LineFile read_lines_of_file(Section& s, Section mesh, BodyMaterials& materials) {
  for (const char* other : {"start", "end", "direction", "length", "curvature", "points", "elements"})
    if (s.has(other)) fail(s.place(other), "does not go with 'mesh', which says where the line is");
  LineFile out;
  out.file = read_mesh_file(mesh, materials.model(), "of a beam or cable");
  out.element_set = s.text("element_set", "");
  out.section_given = s.has("radius") || s.has("height") || s.has("axial");
  if (!s.has("axial")) out.material = materials.material(s);
  return out;
}

/// `start` and `end`, or `start`, `direction`, `length` and `curvature`, or `points`.
AxisShape read_axis(Section& s) {
  if (s.has("points")) {
    for (const char* other : {"start", "end", "direction", "length", "curvature"})
      if (s.has(other)) fail(s.place(other), "does not go with 'points', which say all of the axis");
    return SplineAxis{s.vectors("points")};
  }
  if (!s.has("curvature")) return StraightAxis{s.vector("start"), s.vector("end")};
  if (s.has("end")) fail(s.place("end"), "does not go with 'curvature'; give 'direction' and 'length'");
  return ArcAxis{s.vector("start"), s.vector("direction"), s.positive("length"), s.vector("curvature")};
}

Vec3 first_direction(const AxisShape& shape) {
  if (const auto* straight = std::get_if<StraightAxis>(&shape)) return (straight->end - straight->start).normalized();
  if (const auto* arc = std::get_if<ArcAxis>(&shape)) return arc->direction.normalized();
  const auto& points = std::get<SplineAxis>(shape).points;
  return points.size() < 2 ? Vec3::UnitX() : Vec3((points[1] - points[0]).normalized());
}

/// Surface elements of a file.
ShellSpec read_shell_of_file(Section& s, Section mesh, BodyMaterials& materials) {
  for (const char* other : {"origin", "x", "y", "curvature", "nx", "ny"})
    if (s.has(other)) fail(s.place(other), "does not go with 'mesh', which says where the shell is");
  ShellSpec shell;
  shell.file = read_mesh_file(mesh, materials.model(), "of a shell");
  shell.element_set = s.text("element_set", "");
  const std::optional<Material> given = materials.material(s);
  shell.material_of_file = !given;
  if (given) shell.material = *given;
  if (s.has("thickness")) shell.thickness = s.positive("thickness");
  shell.offset_given = s.has("offset");
  shell.offset = s.number("offset", 0);
  return shell;
}

/// One number, or those of the four corners.
void read_thickness(Section& s, ShellSpec& shell) {
  if (!s.has("thickness") || s.value("thickness")->type != Value::Type::array) {
    shell.thickness = s.positive("thickness");
    return;
  }
  shell.corners = s.numbers("thickness");
  if (shell.corners.size() != 4 || !(*std::min_element(shell.corners.begin(), shell.corners.end()) > 0))
    fail(s.place("thickness"),
         "needs a number above 0, or those of the four corners: at the origin, at x, at x + y, at y");
  shell.thickness = 0.25 * (shell.corners[0] + shell.corners[1] + shell.corners[2] + shell.corners[3]);
}

}  // namespace

BodyShape read_cable(Section& s, BodyMaterials& materials) {
  CableSpec c;
  if (auto mesh = s.table("mesh")) {
    c.file = read_lines_of_file(s, *mesh, materials);
    if (s.has("radius")) c.outline = SectionOutline{0, s.positive("radius")};
    if (s.has("radius") || !c.file->section_given) return c;
  } else {
    c = {s.vector("start"), s.vector("end"), read_elements(s, "elements", 10), {}};
  }
  if (s.has("radius")) {  // a round wire
    const double r = s.positive("radius"), area = std::numbers::pi * r * r;
    const Material m = materials.needed(s);
    c.section = {m.young * area, m.young * area * r * r / 4, m.density * area};
    c.outline = SectionOutline{m.young, r};
  } else {
    c.section = {s.positive("axial"), s.number("bending"), materials.noted(materials.inertia(s, "mass_per_length"))};
    if (c.section.bending < 0) fail(s.place("bending"), "must not be negative");
  }
  return c;
}

BodyShape read_beam(Section& s, BodyMaterials& materials) {
  BeamSpec b;
  if (auto mesh = s.table("mesh")) {
    b.file = read_lines_of_file(s, *mesh, materials);
    b.file->y_given = s.has("y");
    b.y = s.vector("y", Vec3::UnitY());
    if (s.has("radius")) b.outline = SectionOutline{0, s.positive("radius")};
    if (s.has("height")) b.outline = SectionOutline{0, 0, s.positive("height"), s.positive("width")};
    if (b.outline || !b.file->section_given) return b;
  } else {
    b = {std::make_shared<const AxisShape>(read_axis(s)), Vec3::Zero(), read_elements(s, "elements", 10), {}};
    const Vec3 along = first_direction(*b.axis);
    b.y = s.vector("y", std::abs(along.y()) < 0.9 ? Vec3::UnitY() : Vec3::UnitX());
  }
  if (s.has("radius")) {
    const Material m = materials.needed(s);
    b.outline = SectionOutline{m.young, s.positive("radius")};
    b.section = circular_section(m, b.outline->radius);
  } else if (s.has("height")) {
    const Material m = materials.needed(s);
    b.outline = SectionOutline{m.young, 0, s.positive("height"), s.positive("width")};
    b.section = rectangular_section(m, b.outline->height, b.outline->width);
  } else {
    for (const auto& [key, value] :
         std::initializer_list<std::pair<const char*, double*>>{{"axial", &b.section.axial},
                                                                {"shear_y", &b.section.shear_y},
                                                                {"shear_z", &b.section.shear_z},
                                                                {"torsion", &b.section.torsion},
                                                                {"bending_y", &b.section.bending_y},
                                                                {"bending_z", &b.section.bending_z},
                                                                {"section_normal", &b.section.section_normal},
                                                                {"section_shear", &b.section.section_shear}})
      *value = s.positive(key);
    b.section.mass_per_length = materials.noted(materials.inertia(s, "mass_per_length"));
    b.section.inertia_y = materials.noted(materials.inertia(s, "inertia_y"));
    b.section.inertia_z = materials.noted(materials.inertia(s, "inertia_z"));
  }
  return b;
}

BodyShape read_shell(Section& s, BodyMaterials& materials) {
  if (auto mesh = s.table("mesh")) return read_shell_of_file(s, *mesh, materials);
  ShellSpec shell{s.vector("origin", Vec3::Zero()),
                  s.vector("x"),
                  s.vector("y"),
                  s.number("curvature", 0),
                  read_elements(s, "nx", 4),
                  read_elements(s, "ny", 4),
                  materials.needed(s),
                  0};
  read_thickness(s, shell);
  shell.offset = s.number("offset", 0);
  if (!(shell.x.cross(shell.y).norm() > 0)) fail(s.place("y"), "x and y must not be parallel");
  if (shell.curvature != 0) {
    if (!(std::abs(shell.x.dot(shell.y)) <= 1e-9 * shell.x.norm() * shell.y.norm()))
      fail(s.place("curvature"), "needs x and y at a right angle: x is bent about y");
    if (!(std::abs(shell.curvature) * shell.x.norm() < 2 * std::numbers::pi))
      fail(s.place("curvature"), "times the length of x must be less than a full turn, 2 pi");
  }
  if (static_cast<double>(shell.nx) * shell.ny > kMostElements)
    fail(s.place("nx"), fmt::format("nx times ny must not be above {:g}", kMostElements));
  return shell;
}

}  // namespace espalier::dynamics::model
