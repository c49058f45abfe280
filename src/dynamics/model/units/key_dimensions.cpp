#include "dynamics/model/units/key_dimensions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>

namespace espalier::dynamics::model {
namespace {

constexpr std::string_view kFramesTable = "markers.*", kInLineTable = "joints|forces.*.a|b|c|d|through",
                           kHeldTable = "supports.*", kJointTable = "joints.*", kForceTable = "forces.*",
                           kBodyTable = "bodies.*", kMeshTable = "bodies.*.mesh", kMaterialTable = "materials.*",
                           kOwnMaterialTable = "bodies.*.material", kSurfaceTable = "surfaces.*",
                           kContactTable = "contacts.*", kLimitsTable = "joints.*.limits",
                           kFrictionTable = "joints.*.friction", kStaticsTable = "statics",
                           kFirstTable = "initial.statics", kRunTable = "integrator";

constexpr KeyRow kKeyRows[] = {
    {"", "", "gravity", "length/time^2"},
    {"parameters|inputs", "", "*", "any"},

    {kMaterialTable, "", "young", "force/length^2"},
    {kMaterialTable, "", "poisson", "1"},
    {kMaterialTable, "", "density", "mass/length^3"},
    {kOwnMaterialTable, "", "young", "force/length^2"},
    {kOwnMaterialTable, "", "poisson", "1"},
    {kOwnMaterialTable, "", "density", "mass/length^3"},

    {kBodyTable, "type=rigid|point", "mass", "mass"},
    {kBodyTable, "type=rigid", "density", "mass/length^3"},
    {kBodyTable, "", "inertia", "mass*length^2"},
    {kBodyTable, "", "box position start end points origin length thickness offset radius height width", "length"},
    {kBodyTable, "", "velocity", "length/time"},
    {kBodyTable, "", "angular_velocity", "angle/time"},
    {kBodyTable, "", "gravity", "length/time^2"},
    {kBodyTable, "", "rotation", "angle"},
    {kBodyTable, "type=shell", "x y", "length"},
    {kBodyTable, "type=shell", "curvature", "1/length|angle/length"},
    {kBodyTable, "type=beam", "curvature", "angle/length|1/length"},
    {kBodyTable, "type=beam", "y direction", "1"},
    {kBodyTable, "", "axial shear_y shear_z section_normal section_shear", "force"},
    {kBodyTable, "", "bending torsion bending_y bending_z", "force*length^2"},
    {kBodyTable, "", "mass_per_length", "mass/length"},
    {kBodyTable, "", "inertia_y inertia_z", "mass*length"},
    {kBodyTable, "", "elements nx ny lines", "1"},
    {"bodies.*.nodes", "", "position", "length"},
    {"bodies.*.nodes", "", "label components", "1"},
    {"bodies.*.damping", "", "ratio loss_factor", "1"},
    {"bodies.*.damping", "", "mass", "1/time"},
    {"bodies.*.damping", "", "stiffness", "time"},
    {"bodies.*.damping", "", "frequency frequencies", "1/time"},
    {"bodies.*.erosion", "", "strain", "1"},
    {"bodies.*.erosion", "", "stress principal_stress", "force/length^2"},
    {"bodies.*.reduce", "", "modes damping", "1"},
    {"bodies.*.reduce", "", "frequency", "1/time"},

    {kMeshTable, "", "scale unknowns divisions blades teeth sectors blade_fraction blade_taper disc_position step",
     "1"},
    {kMeshTable, "", "angle pressure_angle opening blade_twist", "angle"},
    {kMeshTable, "", "lx ly lz length big_inner big_outer small_inner small_outer shank_big shank_small thickness",
     "length"},
    {kMeshTable, "", "pitch inner outer waist throw_radius journal_radius pin_radius web_big web_small web_neck",
     "length"},
    {kMeshTable, "", "journal_length web_thickness pin_length lead radius height width bore_radius shaft_radius",
     "length"},
    {kMeshTable, "", "disc_radius tip_radius shaft_length disc_thickness bearing_length section_radius module",
     "length"},
    {kMeshTable, "", "backlash tip_relief", "length"},

    {kFramesTable, "", "point near radius", "length"},
    {kFramesTable, "", "axis x_axis node nodes weights along most_nodes", "1"},
    {kFramesTable, "", "rotation", "angle"},
    {kInLineTable, "", "point near radius", "length"},
    {kInLineTable, "", "axis x_axis node nodes weights along most_nodes", "1"},
    {kInLineTable, "", "rotation", "angle"},
    {kHeldTable, "", "near radius", "length"},
    {kHeldTable, "", "symmetry node nodes along", "1"},
    {kHeldTable, "", "rotation", "angle"},
    {"supports.*.motion", "", "x y z", "length"},
    {"equations.*", "", "value", "length"},
    {"equations.*", "", "stiffness", "force/length"},
    {"equations.*", "", "damping", "force*time/length"},
    {"equations.*.terms", "", "near radius", "length"},
    {"equations.*.terms", "", "factor node nodes along", "1"},
    {"ties.*", "", "near radius tolerance", "length"},
    {"ties.*", "", "node nodes along", "1"},
    {"markers|supports|ties.*.bore", "", "point radius length", "length"},
    {"markers|supports|ties.*.bore", "", "axis", "1"},
    {"joints|forces.*.a|b|c|d|through.bore", "", "point radius length", "length"},
    {"joints|forces.*.a|b|c|d|through.bore", "", "axis", "1"},
    {"bodies|markers|supports|surfaces|joints|forces.*.rotation", "", "angle", "angle"},
    {"bodies|markers|supports|surfaces|joints|forces.*.rotation", "", "axis quaternion", "1"},
    {"joints|forces.*.a|b|c|d|through.rotation", "", "angle", "angle"},
    {"joints|forces.*.a|b|c|d|through.rotation", "", "axis quaternion", "1"},

    {kJointTable, "", "at length radius rim lead points half_axes x y heights", "length"},
    {kJointTable, "", "axis x_axis ratio teeth scale", "1"},
    {kJointTable, "type=point-on-surface", "angle", "angle"},
    {kJointTable, "", "rotation pressure_angle", "angle"},
    {kJointTable, "type=revolute", "armature", "mass*length^2"},
    {kJointTable, "type=prismatic", "armature", "mass"},
    {kJointTable, "type=rotation-motor", "motion", "angle"},
    {kJointTable, "type=translation-motor|prescribed|point-on-curve", "motion", "length"},
    {kLimitsTable, "type=revolute|parallel-axes|constant-velocity", "lower upper smoothing", "angle"},
    {kLimitsTable, "type=revolute|parallel-axes|constant-velocity", "stiffness", "force*length/angle"},
    {kLimitsTable, "type=revolute|parallel-axes|constant-velocity", "damping", "time/angle"},
    {kLimitsTable, "type=prismatic|cylindrical|screw|in-line|point-on-line|point-on-curve", "lower upper smoothing",
     "length"},
    {kLimitsTable, "type=prismatic|cylindrical|screw|in-line|point-on-line|point-on-curve", "stiffness",
     "force/length"},
    {kLimitsTable, "type=prismatic|cylindrical|screw|in-line|point-on-line|point-on-curve", "damping", "time/length"},
    {"joints.*.angle_limits", "", "lower upper smoothing", "angle"},
    {"joints.*.angle_limits", "", "stiffness", "force*length/angle"},
    {"joints.*.angle_limits", "", "damping", "time/angle"},
    {kFrictionTable, "", "coefficient static", "1"},
    {kFrictionTable, "", "slip_speed stribeck_speed", "length/time"},
    {kFrictionTable, "", "preload", "force"},
    {kFrictionTable, "", "radius bending_arm torsion_arm collar_radius", "length"},
    {kFrictionTable, "type=revolute|parallel-axes", "viscous", "force*length*time/angle"},
    {kFrictionTable,
     "type=prismatic|cylindrical|screw|in-line|point-on-line|point-on-curve|in-plane|point-on-surface|worm|gear-pair|"
     "rack-pair",
     "viscous", "force*time/length"},
    {kFrictionTable, "", "angular_viscous", "force*length*time/angle"},

    {kForceTable, "", "at start lengths length", "length"},
    {kForceTable, "", "axis x_axis factor", "1"},
    {kForceTable, "", "rotation", "angle"},
    {kForceTable, "type=spring|axial-spring|bushing|guide|cable", "stiffness", "force/length"},
    {kForceTable, "type=spring|axial-spring|bushing|guide|cable", "damping", "force*time/length"},
    {kForceTable, "type=spring|axial-spring", "rest", "length"},
    {kForceTable, "type=spring|axial-spring", "preload actuator", "force"},
    {kForceTable, "type=rotational-spring", "stiffness", "force*length/angle"},
    {kForceTable, "type=rotational-spring", "damping", "force*length*time/angle"},
    {kForceTable, "type=rotational-spring", "rest", "angle"},
    {kForceTable, "type=rotational-spring", "preload actuator", "force*length"},
    {kForceTable, "", "angular_stiffness", "force*length/angle"},
    {kForceTable, "", "angular_damping", "force*length*time/angle"},
    {kForceTable, "type=line-load", "near radius", "length"},
    {kForceTable, "type=line-load", "node nodes along", "1"},
    {kForceTable, "type=line-load", "force", "force/length"},
    {kForceTable, "type=line-load", "moment", "force"},
    {kForceTable, "", "force", "force"},
    {kForceTable, "", "moment torque", "force*length"},
    {kForceTable, "", "pressure", "force/length^2"},
    {kForceTable, "type=load", "acceleration", "length/time^2"},
    {kForceTable, "type=load", "force_density", "force/length^3"},
    {kForceTable, "type=load", "angular_velocity", "angle/time"},
    {kForceTable, "type=load", "point", "length"},
    {kForceTable, "", "friction", "1"},
    {kForceTable, "", "slip_speed", "length/time"},
    {kForceTable, "", "smoothing", "length"},
    {kForceTable, "", "direction", "angle"},
    {kForceTable, "", "curvatures", "1/length|angle/length"},

    {kSurfaceTable, "", "point radius length size pitch roller_radius width", "length"},
    {kSurfaceTable, "", "axis normal scale teeth divisions tip", "1"},
    {kSurfaceTable, "", "rotation", "angle"},
    {kContactTable, "", "stiffness", "force/length^e|force/length^2/length^e|force/length/length^e"},
    {kContactTable, "", "exponent restitution friction static", "1"},
    {kContactTable, "", "smoothing margin overlap penetration", "length"},
    {kContactTable, "", "damping", "time/length"},
    {kContactTable, "", "stribeck_speed", "length/time"},
    {kContactTable, "", "tangential_stiffness", "force/length|force/length^3|force/length^2"},
    {kContactTable, "", "tangential_damping", "force*time/length|force*time/length^3|force*time/length^2"},

    {"splines.*", "", "points x_scale y_scale", "any"},
    {"events.*", "", "tolerance", "time"},
    {"events.*", "", "position_tolerance", "length"},
    {"events.*.set", "", "*", "any"},

    {kRunTable, "", "start end initial_step max_step min_step step", "time"},
    {kRunTable, "", "absolute", "length"},
    {kRunTable, "", "absolute_velocity", "length/time"},
    {kRunTable, "", "relative constraint_tolerance newton_tolerance tolerance refactor_rate refactor_step", "1"},
    {kRunTable, "", "spectral_radius hht_alpha steps max_order order max_newton", "1"},
    {kStaticsTable, "", "time pseudo_time", "time"},
    {kStaticsTable, "", "load tolerance first_step largest_step smallest_step", "1"},
    {kStaticsTable, "", "max_steps max_iterations max_factorizations", "1"},
    {kFirstTable, "", "pseudo_time", "time"},
    {kFirstTable, "", "load tolerance first_step largest_step smallest_step", "1"},
    {kFirstTable, "", "max_steps max_iterations max_factorizations", "1"},
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

/// Which of the three dimensions of a contact's stiffness and damping its surfaces ask for: 0 force, 1 of faces by
/// area, 2 of lines by length; nothing where they are patterns, or not there.
std::optional<std::size_t> shape_of_contact(const KeyPath& path) {
  const Value* surfaces = path.tables.front()->find("surfaces");
  if (surfaces == nullptr) return std::nullopt;
  std::optional<std::size_t> kind;
  for (const char* side : {"surfaces", "against"}) {
    const Value* names = path.tables.back()->find(side);
    if (names == nullptr) continue;
    const std::span<const Value> list = names->type == Value::Type::array ? names->items : std::span(names, 1);
    for (const Value& name : list) {
      const Value* surface = name.type == Value::Type::text ? surfaces->find(name.text) : nullptr;
      const Value* shape = surface == nullptr ? nullptr : surface->find("shape");
      if (shape == nullptr || shape->type != Value::Type::text) return std::nullopt;
      const std::size_t of_shape = shape->text == "faces" ? 1 : shape->text == "line" ? 2 : 0;
      if (!kind || *kind == 0 || of_shape == 1) kind = of_shape;
    }
  }
  return kind;
}

/// The exponent of a contact: a number, or a text "3/2"; nothing where it is an expression of parameters.
std::optional<double> exponent_of(const Value* value) {
  if (value == nullptr) return 1;
  if (value->type != Value::Type::text) return value->real;
  double numbers[2] = {0, 1};
  const char *at = value->text.data(), *const end = at + value->text.size();
  for (double& number : numbers) {
    const auto [rest, error] = std::from_chars(at, end, number);
    if (error != std::errc()) return std::nullopt;
    if (rest == end) return numbers[0] / numbers[1];
    if (*rest != '/') return std::nullopt;
    at = rest + 1;
  }
  return std::nullopt;
}

}  // namespace

std::span<const KeyRow> key_rows() { return kKeyRows; }

std::vector<std::string> dimensions_of(const KeyPath& path, const std::string& key) {
  for (const KeyRow& row : kKeyRows) {
    if (!one_of(key, row.keys, ' ') || !stands_in(path, row.tables) || !says(path, row.where)) continue;
    std::vector<std::string> result;
    for (const std::string_view words : pieces(row.dimension, '|')) {
      result.emplace_back(words);
      const std::size_t at = result.back().find("^e");
      if (at == std::string::npos) continue;
      const auto exponent = exponent_of(path.tables.back()->find("exponent"));
      if (!exponent) return {"1"};  // the unit cannot be looked at
      result.back().replace(at, 2, fmt::format("^{}", *exponent));
    }
    if (row.tables == kContactTable && result.size() == 3)
      if (const auto kind = shape_of_contact(path)) return {result[*kind]};
    return result;
  }
  return {};
}

}  // namespace espalier::dynamics::model
