#include "dynamics/model/units/key_dimensions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

namespace espalier::dynamics::model {
namespace {

constexpr std::string_view kFrames = "markers.*", kInLine = "joints|forces.*.a|b|c|d", kHeld = "supports.*",
                           kJoint = "joints.*", kForce = "forces.*", kBody = "bodies.*", kMesh = "bodies.*.mesh",
                           kMaterial = "materials.*", kOwnMaterial = "bodies.*.material", kSurface = "surfaces.*",
                           kContact = "contacts.*", kLimits = "joints.*.limits", kFriction = "joints.*.friction",
                           kStatics = "statics", kFirst = "initial.statics", kRun = "integrator";

constexpr KeyRow kRows[] = {
    {"", "", "gravity", "length/time^2"},
    {"parameters|inputs", "", "*", "any"},

    {kMaterial, "", "young", "force/length^2"},
    {kMaterial, "", "poisson", "1"},
    {kMaterial, "", "density", "mass/length^3"},
    {kOwnMaterial, "", "young", "force/length^2"},
    {kOwnMaterial, "", "poisson", "1"},
    {kOwnMaterial, "", "density", "mass/length^3"},

    {kBody, "type=rigid|point", "mass", "mass"},
    {kBody, "", "inertia", "mass*length^2"},
    {kBody, "", "box position start end points origin length thickness radius height width", "length"},
    {kBody, "", "velocity", "length/time"},
    {kBody, "", "angular_velocity", "angle/time"},
    {kBody, "", "gravity", "length/time^2"},
    {kBody, "", "rotation", "angle"},
    {kBody, "type=shell", "x y", "length"},
    {kBody, "type=shell", "curvature", "1/length|angle/length"},
    {kBody, "type=beam", "curvature", "angle/length|1/length"},
    {kBody, "type=beam", "y direction", "1"},
    {kBody, "", "axial shear_y shear_z section_normal section_shear", "force"},
    {kBody, "", "bending torsion bending_y bending_z", "force*length^2"},
    {kBody, "", "mass_per_length", "mass/length"},
    {kBody, "", "inertia_y inertia_z", "mass*length"},
    {kBody, "", "elements nx ny lines", "1"},
    {"bodies.*.nodes", "", "position", "length"},
    {"bodies.*.nodes", "", "label components", "1"},
    {"bodies.*.damping", "", "ratio loss_factor", "1"},
    {"bodies.*.damping", "", "mass", "1/time"},
    {"bodies.*.damping", "", "stiffness", "time"},
    {"bodies.*.damping", "", "frequency frequencies", "1/time"},
    {"bodies.*.reduce", "", "modes damping", "1"},
    {"bodies.*.reduce", "", "frequency", "1/time"},

    {kMesh, "", "scale unknowns divisions blades teeth sectors blade_fraction blade_taper disc_position", "1"},
    {kMesh, "", "angle pressure_angle opening blade_twist", "angle"},
    {kMesh, "", "lx ly lz length big_inner big_outer small_inner small_outer shank_big shank_small thickness",
     "length"},
    {kMesh, "", "pitch inner outer waist throw_radius journal_radius pin_radius web_big web_small web_neck", "length"},
    {kMesh, "", "journal_length web_thickness pin_length lead radius height width bore_radius shaft_radius", "length"},
    {kMesh, "", "disc_radius tip_radius shaft_length disc_thickness bearing_length section_radius module", "length"},
    {kMesh, "", "backlash tip_relief", "length"},

    {kFrames, "", "point near radius", "length"},
    {kFrames, "", "axis x_axis node nodes most_nodes", "1"},
    {kFrames, "", "rotation", "angle"},
    {kInLine, "", "point near radius", "length"},
    {kInLine, "", "axis x_axis node nodes most_nodes", "1"},
    {kInLine, "", "rotation", "angle"},
    {kHeld, "", "near radius", "length"},
    {kHeld, "", "symmetry node nodes", "1"},
    {kHeld, "", "rotation", "angle"},
    {"supports.*.motion", "", "x y z", "length"},
    {"markers|supports.*.bore", "", "point radius length", "length"},
    {"markers|supports.*.bore", "", "axis", "1"},
    {"joints|forces.*.a|b|c|d.bore", "", "point radius length", "length"},
    {"joints|forces.*.a|b|c|d.bore", "", "axis", "1"},
    {"bodies|markers|supports|surfaces|joints|forces.*.rotation", "", "angle", "angle"},
    {"bodies|markers|supports|surfaces|joints|forces.*.rotation", "", "axis quaternion", "1"},
    {"joints|forces.*.a|b|c|d.rotation", "", "angle", "angle"},
    {"joints|forces.*.a|b|c|d.rotation", "", "axis quaternion", "1"},

    {kJoint, "", "at length radius rim", "length"},
    {kJoint, "", "axis x_axis ratio", "1"},
    {kJoint, "", "rotation", "angle"},
    {kJoint, "type=rotation-motor", "motion", "angle"},
    {kJoint, "type=translation-motor|prescribed", "motion", "length"},
    {kLimits, "type=revolute", "lower upper smoothing", "angle"},
    {kLimits, "type=revolute", "stiffness", "force*length/angle"},
    {kLimits, "type=revolute", "damping", "time/angle"},
    {kLimits, "type=prismatic|cylindrical", "lower upper smoothing", "length"},
    {kLimits, "type=prismatic|cylindrical", "stiffness", "force/length"},
    {kLimits, "type=prismatic|cylindrical", "damping", "time/length"},
    {"joints.*.angle_limits", "", "lower upper smoothing", "angle"},
    {"joints.*.angle_limits", "", "stiffness", "force*length/angle"},
    {"joints.*.angle_limits", "", "damping", "time/angle"},
    {kFriction, "", "coefficient static", "1"},
    {kFriction, "", "slip_speed stribeck_speed", "length/time"},
    {kFriction, "", "preload", "force"},
    {kFriction, "", "radius bending_arm torsion_arm collar_radius", "length"},
    {kFriction, "type=revolute", "viscous", "force*length*time/angle"},
    {kFriction, "type=prismatic|cylindrical", "viscous", "force*time/length"},
    {kFriction, "", "angular_viscous", "force*length*time/angle"},

    {kForce, "", "at start lengths", "length"},
    {kForce, "", "axis x_axis factor", "1"},
    {kForce, "", "rotation", "angle"},
    {kForce, "type=spring|axial-spring|bushing|guide", "stiffness", "force/length"},
    {kForce, "type=spring|axial-spring|bushing|guide", "damping", "force*time/length"},
    {kForce, "type=spring|axial-spring", "rest", "length"},
    {kForce, "type=spring|axial-spring", "preload actuator", "force"},
    {kForce, "type=rotational-spring", "stiffness", "force*length/angle"},
    {kForce, "type=rotational-spring", "damping", "force*length*time/angle"},
    {kForce, "type=rotational-spring", "rest", "angle"},
    {kForce, "type=rotational-spring", "preload actuator", "force*length"},
    {kForce, "", "angular_stiffness", "force*length/angle"},
    {kForce, "", "angular_damping", "force*length*time/angle"},
    {kForce, "", "force", "force"},
    {kForce, "", "moment torque", "force*length"},
    {kForce, "", "pressure", "force/length^2"},
    {kForce, "", "friction", "1"},
    {kForce, "", "slip_speed", "length/time"},
    {kForce, "", "smoothing", "length"},
    {kForce, "", "direction", "angle"},
    {kForce, "", "curvatures", "1/length|angle/length"},

    {kSurface, "", "point radius length size pitch roller_radius width", "length"},
    {kSurface, "", "axis normal scale teeth divisions tip", "1"},
    {kSurface, "", "rotation", "angle"},
    {kContact, "", "stiffness", "force/length^e|force/length^2/length^e|force/length/length^e"},
    {kContact, "", "exponent restitution friction static", "1"},
    {kContact, "", "smoothing margin overlap penetration", "length"},
    {kContact, "", "damping", "time/length"},
    {kContact, "", "stribeck_speed", "length/time"},
    {kContact, "", "tangential_stiffness", "force/length|force/length^3|force/length^2"},
    {kContact, "", "tangential_damping", "force*time/length|force*time/length^3|force*time/length^2"},

    {"splines.*", "", "points x_scale y_scale", "any"},
    {"events.*", "", "tolerance", "time"},
    {"events.*", "", "position_tolerance", "length"},
    {"events.*.set", "", "*", "any"},

    {kRun, "", "start end initial_step max_step min_step step", "time"},
    {kRun, "", "absolute", "length"},
    {kRun, "", "absolute_velocity", "length/time"},
    {kRun, "", "relative constraint_tolerance newton_tolerance tolerance refactor_rate refactor_step", "1"},
    {kRun, "", "spectral_radius hht_alpha steps max_order order max_newton", "1"},
    {kStatics, "", "time pseudo_time", "time"},
    {kStatics, "", "load tolerance first_step largest_step smallest_step", "1"},
    {kStatics, "", "max_steps max_iterations max_factorizations", "1"},
    {kFirst, "", "pseudo_time", "time"},
    {kFirst, "", "load tolerance first_step largest_step smallest_step", "1"},
    {kFirst, "", "max_steps max_iterations max_factorizations", "1"},
    {"initial", "", "position_tolerance", "length"},
    {"initial", "", "velocity_tolerance modes", "1"},
    {"initial.rotation", "", "axis", "1"},
    {"initial.rotation", "", "point", "length"},
    {"initial.rotation", "", "speed", "angle/time"},
    {"harmonic", "", "from to frequencies shapes", "1/time"},
    {"harmonic", "", "tolerance loss_factor points phases max_solves", "1"},
    {"harmonic.loads", "", "*", "any"},
    {"harmonic.loads.*", "", "phase", "degree"},
    {"harmonic.loads.*", "", "*", "any"},
    {"harmonic.loads.*.*", "", "phase", "degree"},
    {"harmonic.loads.*.*", "", "amplitude", "any"},
    {"output", "", "csv_interval vtu_interval restart_interval", "time|1"},
    {"output.paths.*", "", "through", "length"},
    {"output.paths.*", "", "points", "1"},
};

std::vector<std::string_view> pieces(std::string_view text, char mark) {
  std::vector<std::string_view> result;
  for (std::size_t from = 0; from <= text.size();) {
    const std::size_t to = std::min(text.find(mark, from), text.size());
    if (to > from) result.push_back(text.substr(from, to - from));
    from = to + 1;
  }
  return result;
}

bool one_of(std::string_view word, std::string_view words, char mark) {
  const auto all = pieces(words, mark);
  return words == "*" || std::find(all.begin(), all.end(), word) != all.end();
}

bool stands_in(const KeyPath& path, std::string_view tables) {
  const auto parts = pieces(tables, '.');
  if (parts.size() != path.keys.size()) return false;
  for (std::size_t k = 0; k < parts.size(); ++k)
    if (!one_of(path.keys[k], parts[k], '|')) return false;
  return true;
}

/// "type=spring|load", in the innermost table that has the key.
bool says(const KeyPath& path, std::string_view where) {
  if (where.empty()) return true;
  const std::size_t equals = where.find('=');
  for (auto table = path.tables.rbegin(); table != path.tables.rend(); ++table)
    if (const Value* value = (*table)->find(where.substr(0, equals)); value != nullptr)
      return value->type == Value::Type::text && one_of(value->text, where.substr(equals + 1), '|');
  return false;
}

}  // namespace

std::span<const KeyRow> key_rows() { return kRows; }

std::vector<std::string> dimensions_of(const KeyPath& path, const std::string& key) {
  for (const KeyRow& row : kRows) {
    if (!one_of(key, row.keys, ' ') || !stands_in(path, row.tables) || !says(path, row.where)) continue;
    std::vector<std::string> result;
    for (const std::string_view words : pieces(row.dimension, '|')) {
      result.emplace_back(words);
      const Value* exponent = path.tables.back()->find("exponent");
      if (const std::size_t at = result.back().find("^e"); at != std::string::npos)
        result.back().replace(at, 2, fmt::format("^{}", exponent == nullptr ? 1.0 : exponent->real));
    }
    return result;
  }
  return {};
}

}  // namespace espalier::dynamics::model
