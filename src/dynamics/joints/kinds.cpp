// The kinds of joints as lists of equations.
#include <stdexcept>

#include "dynamics/joints/joint.hpp"
#include "dynamics/joints/rows.hpp"

namespace espalier::dynamics {

namespace {

using joint_rows::add_coincidence, joint_rows::add_parallel, joint_rows::counted, joint_rows::make, joint_rows::row;

JointRow driven(std::string label, JointRow::Term term, TimeFunction f) {
  JointRow r = row(std::move(label), std::move(term));
  r.function = std::move(f);
  r.driven = true;
  return r;
}

JointRow::Term along(int axis) { return {Relative::along, axis}; }

void add_no_spin(std::vector<JointRow>& rows) { rows.push_back(row("rotation about z", {Relative::dot, 0, 1})); }

void check_length(double length, const char* kind, const std::string& name) {
  if (!(length > 0)) {
    throw std::invalid_argument(std::string(kind) + " \"" + name +
                                "\": the length must be positive; for zero take a spherical joint");
  }
}

}  // namespace

std::unique_ptr<Joint> fixed_joint(std::string name, FramePtr a, FramePtr b) {
  std::vector<JointRow> rows;
  add_coincidence(rows);
  add_parallel(rows);
  add_no_spin(rows);
  return make("fixed", std::move(name), std::move(a), std::move(b), std::move(rows));
}

std::unique_ptr<Joint> revolute_joint(std::string name, FramePtr a, FramePtr b) {
  std::vector<JointRow> rows;
  add_coincidence(rows);
  add_parallel(rows);
  return counted(make("revolute", std::move(name), std::move(a), std::move(b), std::move(rows)));
}

std::unique_ptr<Joint> spherical_joint(std::string name, FramePtr a, FramePtr b) {
  std::vector<JointRow> rows;
  add_coincidence(rows);
  return make("spherical", std::move(name), std::move(a), std::move(b), std::move(rows));
}

std::unique_ptr<Joint> universal_joint(std::string name, FramePtr a, FramePtr b) {
  std::vector<JointRow> rows;
  add_coincidence(rows);
  rows.push_back(row("rotation about the third axis", {Relative::dot, 0, 1}));
  return make("universal", std::move(name), std::move(a), std::move(b), std::move(rows));
}

std::unique_ptr<Joint> cylindrical_joint(std::string name, FramePtr a, FramePtr b) {
  std::vector<JointRow> rows = {row("translation along x", along(0)), row("translation along y", along(1))};
  add_parallel(rows);
  return counted(make("cylindrical", std::move(name), std::move(a), std::move(b), std::move(rows)));
}

std::unique_ptr<Joint> prismatic_joint(std::string name, FramePtr a, FramePtr b) {
  std::vector<JointRow> rows = {row("translation along x", along(0)), row("translation along y", along(1))};
  add_parallel(rows);
  add_no_spin(rows);
  return make("prismatic", std::move(name), std::move(a), std::move(b), std::move(rows));
}

std::unique_ptr<Joint> planar_joint(std::string name, FramePtr a, FramePtr b) {
  std::vector<JointRow> rows = {row("translation along z", along(2))};
  add_parallel(rows);
  return counted(make("planar", std::move(name), std::move(a), std::move(b), std::move(rows)));
}

std::unique_ptr<Joint> point_on_line(std::string name, FramePtr a, FramePtr b) {
  auto joint = make("point on line", std::move(name), std::move(a), std::move(b),
                    {row("translation along x", along(0)), row("translation along y", along(1))});
  joint->add_motion({"displacement", "speed", {Relative::along, 2}});
  return joint;
}

std::unique_ptr<Joint> distance_joint(std::string name, FramePtr a, FramePtr b, double length) {
  check_length(length, "distance", name);
  return make("distance", std::move(name), std::move(a), std::move(b), {row("distance", {Relative::distance}, length)});
}

std::unique_ptr<Joint> revolute_spherical_joint(std::string name, FramePtr a, FramePtr b, double length) {
  check_length(length, "revolute-spherical", name);
  return make("revolute-spherical", std::move(name), std::move(a), std::move(b),
              {row("distance", {Relative::distance}, length), row("translation along z", along(2))});
}

std::unique_ptr<Joint> rotation_motor(std::string name, FramePtr a, FramePtr b, TimeFunction f) {
  return counted(make("rotation motor", std::move(name), std::move(a), std::move(b),
                      {driven("angle about z", {Relative::angle}, std::move(f))}));
}

std::unique_ptr<Joint> translation_motor(std::string name, FramePtr a, FramePtr b, TimeFunction f) {
  return make("translation motor", std::move(name), std::move(a), std::move(b),
              {driven("translation along z", along(2), std::move(f))});
}

std::unique_ptr<Joint> prescribed_coordinate(std::string name, FramePtr a, FramePtr b, int axis, TimeFunction f) {
  if (axis < 0 || axis > 2) throw std::invalid_argument("prescribed coordinate: the axis must be 0, 1 or 2");
  return make("prescribed coordinate", std::move(name), std::move(a), std::move(b),
              {driven(
                  std::string("translation along global ") + "xyz" [axis], { Relative::global, axis }, std::move(f))});
}

namespace {

std::unique_ptr<Joint> couple(const char* kind, std::string name, std::array<FramePtr, 4> frames, JointRow::Term first,
                              JointRow::Term second) {
  JointRow r;
  r.label = "coupling";
  r.terms = {std::move(first), std::move(second)};
  r.measure_offset = true;
  std::vector<FramePtr> list;
  for (FramePtr& f : frames) list.push_back(std::move(f));
  return std::make_unique<Joint>(kind, std::move(name), std::move(list), std::vector<JointRow>{r});
}

}  // namespace

std::unique_ptr<Joint> gear_joint(std::string name, FramePtr a, FramePtr b, FramePtr c, FramePtr d, double ratio) {
  return couple("gear", std::move(name), {std::move(a), std::move(b), std::move(c), std::move(d)},
                {Relative::angle, 0, 0, 0, 1, ratio}, {Relative::angle, 0, 0, 2, 3, 1.0});
}

std::unique_ptr<Joint> rolling_joint(std::string name, FramePtr a, FramePtr b, const RollingShape& shape) {
  std::vector<JointRow> rows;
  const auto add = [&](const char* label, RollingDirection direction) {
    JointRow::Term term;
    term.i = static_cast<int>(direction);
    term.rolling = shape;
    rows.push_back(row(label, term));
    rows.back().of_velocity = direction != RollingDirection::normal;
  };
  add("height above the plane", RollingDirection::normal);
  if (!shape.edge) add(shape.directed() ? "longitudinal slip" : "slip along x", RollingDirection::longitudinal);
  add(shape.directed() ? "lateral slip" : "slip along y", RollingDirection::lateral);
  return make(shape.edge ? "skate" : "rolling", std::move(name), std::move(a), std::move(b), std::move(rows));
}

std::unique_ptr<Joint> rack_and_pinion(std::string name, FramePtr a, FramePtr b, FramePtr c, FramePtr d,
                                       double radius) {
  return couple("rack and pinion", std::move(name), {std::move(a), std::move(b), std::move(c), std::move(d)},
                {Relative::angle, 0, 0, 0, 1, -radius}, {Relative::along, 2, 0, 2, 3, 1.0});
}

}  // namespace espalier::dynamics
