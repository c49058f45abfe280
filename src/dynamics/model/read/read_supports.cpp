// The section [supports]: nodes that are held or led.
#include <fmt/format.h>

#include <algorithm>

#include "dynamics/model/description.hpp"

namespace espalier::dynamics::model {
namespace {

const char* const kDirections[] = {"x", "y", "z"};

/// "x", "xz", "all", or ["x", "z"].
void read_hold(Section& s, SupportSpec& out) {
  for (const std::string& text : s.texts("hold")) {
    if (text == "all") {
      out.held = {true, true, true};
      out.slopes = true;
      continue;
    }
    if (text.empty() || text.find_first_not_of("xyz") != std::string::npos)
      fail(s.place("hold"),
           fmt::format("must be \"all\", a clamp, or directions like \"x\", \"yz\", [\"x\", \"z\"], not "
                       "\"{}\"",
                       text));
    for (const char c : text) out.held[at(c - 'x')] = true;
  }
}

/// "x", "xz": axes about which nodes do not turn.
void read_rotations(Section& s, SupportSpec& out) {
  for (const std::string& text : s.texts("rotations")) {
    if (text.empty() || text.find_first_not_of("xyz") != std::string::npos)
      fail(s.place("rotations"), fmt::format("must be axes like \"x\", \"yz\", [\"x\", \"z\"], not \"{}\"", text));
    for (const char c : text) out.rotations[at(c - 'x')] = true;
  }
}

/// { x = 1e-3, z = "table(t)" }
void read_motion(Section s, SupportSpec& out) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (!s.has(kDirections[i])) continue;
    out.motion[i] = s.function(kDirections[i]);
    out.held[i] = true;
  }
  s.finish();
}

/// Axes whose first is the normal of the plane.
void read_symmetry(Section& s, SupportSpec& out) {
  for (const char* other : {"hold", "rotations", "motion", "rotation"})
    if (s.has(other))
      fail(s.place(other), "does not go with 'symmetry', which says all; give the rest a support of its own");
  Vec3 normal = Vec3::Zero();
  if (const Value* value = s.value("symmetry"); value->type == Value::Type::text)
    normal[s.choice("symmetry", {"x", "y", "z"})] = 1;
  else
    normal = s.vector("symmetry");
  if (!(normal.norm() > 0)) fail(s.place("symmetry"), "must not be zero: it is the normal of the plane of symmetry");
  normal.normalize();
  Eigen::Index least = 0;
  normal.cwiseAbs().minCoeff(&least);
  const Vec3 across = normal.cross(Vec3(Vec3::Unit(least))).normalized();
  out.where.axes << normal, across, normal.cross(across);
  if (normal.cwiseAbs().maxCoeff(&least) == 1) {  // without rounding
    out.where.axes.setZero();
    for (Eigen::Index i = 0; i < 3; ++i) out.where.axes((least + i) % 3, i) = 1;
  }
  out.held = {true, false, false};
  out.symmetry = true;
}

SupportSpec read_support(const std::string& name, const Value& value) {
  Section s(value);
  SupportSpec out;
  out.place = out.where.place = value.place;
  out.name = name;
  out.where.body = s.text("body");
  read_where(s, out.where);
  if (s.has("symmetry")) {
    read_symmetry(s, out);
  } else {
    out.where.axes = s.rotation("rotation");
    read_hold(s, out);
    read_rotations(s, out);
    if (auto motion = s.table("motion")) read_motion(*motion, out);
    const auto is_held = [](bool held) { return held; };
    if (std::none_of(out.held.begin(), out.held.end(), is_held) &&
        std::none_of(out.rotations.begin(), out.rotations.end(), is_held))
      fail(s.place(),
           "needs what is held: hold = \"all\" (a clamp) or directions (\"x\", \"yz\"), rotations = \"x\", "
           "symmetry = \"x\" (the normal of a plane), or motion = { z = 1e-3 } (displacements, numbers or functions "
           "of t)");
  }
  s.finish();
  return out;
}

}  // namespace

void read_supports(Section& root, Description& model) {
  root.named("supports",
             [&](const std::string& name, const Value& value) { model.supports.push_back(read_support(name, value)); });
}

}  // namespace espalier::dynamics::model
