// The parts of a model text that are not bodies, joints or forces.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <limits>

#include "dynamics/model/check/part_keys.hpp"
#include "dynamics/model/decks/take.hpp"
#include "dynamics/model/description.hpp"
#include "dynamics/model/frames/names.hpp"

namespace espalier::dynamics::model {
namespace {

void read_bdf(Section& s, BdfOptions& o) {
  o.relative = s.positive("relative", o.relative);
  o.absolute = s.positive("absolute", o.absolute);
  o.absolute_velocity = s.positive("absolute_velocity", o.absolute_velocity);
  o.test_velocity = s.flag("test_velocity", o.test_velocity);
  o.max_order = s.integer("max_order", 1, o.max_order);
  o.fixed_order = s.integer("order", 1, o.fixed_order);
  if (o.max_order > kMaxBdfOrder) fail(s.place("max_order"), "must be 1 to 5");
  if (o.fixed_order > kMaxBdfOrder) fail(s.place("order"), "must be 1 to 5");
  o.initial_step = s.positive("initial_step", o.initial_step);
  o.max_step = s.positive("max_step", o.max_step);
  o.min_step = s.positive("min_step", o.min_step);
  if (o.min_step > o.max_step) fail(s.place("min_step"), fmt::format("must not be above max_step, {:g}", o.max_step));
  o.fixed_step = s.positive("step", o.fixed_step);
  o.constraint_tolerance = s.positive("constraint_tolerance", o.constraint_tolerance);
  o.max_newton = s.integer("max_newton", 1, o.max_newton);
  o.newton_tolerance = s.positive("newton_tolerance", o.newton_tolerance);
  o.refactor_rate = s.positive("refactor_rate", o.refactor_rate);
  o.refactor_step = s.positive("refactor_step", o.refactor_step);
  o.iteration = s.one_of("iteration", kBdfIterations, o.iteration);
}

void read_alpha(Section& s, AlphaOptions& o) {
  o.step = s.positive("step");
  o.spectral_radius = s.number("spectral_radius", o.spectral_radius);
  if (!(o.spectral_radius >= 0 && o.spectral_radius <= 1)) fail(s.place("spectral_radius"), "must lie in [0, 1]");
  if (s.has("hht_alpha")) {
    o.hht_alpha = s.number("hht_alpha");
    if (!(o.hht_alpha >= -1.0 / 3 && o.hht_alpha <= 0)) fail(s.place("hht_alpha"), "must lie in [-1/3, 0]");
  }
  o.newton_tolerance = s.positive("newton_tolerance", o.newton_tolerance);
  o.tolerance = s.positive("tolerance", o.tolerance);
  o.relative = s.positive("relative", o.relative);
  o.absolute = s.positive("absolute", o.absolute);
  o.constraint_tolerance = s.positive("constraint_tolerance", o.constraint_tolerance);
  o.max_newton = s.integer("max_newton", 1, o.max_newton);
  if (s.has("refactor_rate")) o.refactor_rate = s.positive("refactor_rate");
}

void read_integrator(Section s, IntegratorSpec& out) {
  out.place = s.place();
  out.start = s.number("start", 0);
  out.steps = s.integer("steps", 1, 0);
  out.end = out.steps > 0 && !s.has("end") ? std::numeric_limits<double>::infinity() : s.number("end");
  if (!(out.end > out.start)) fail(s.place("end"), fmt::format("must be later than the start, {}", out.start));
  out.method = s.one_of("method", kMethods, out.method);
  if (out.method == Method::bdf) {
    for (const char* key : {"relative", "absolute", "absolute_velocity", "test_velocity"})
      out.states_tolerances = out.states_tolerances || s.has(key);
    out.states_constraints = s.has("constraint_tolerance");
    out.states_order = s.has("max_order") || s.has("order");
    read_bdf(s, out.bdf);
  } else {
    read_alpha(s, out.alpha);
  }
  s.finish();
}

/// @param run  a run of its own, which may be linear
void read_statics_options(Section& s, StaticsOptions& o, bool run) {
  if (s.has("linear") && !run)
    fail(
        s.place("linear"),
        "a motion begins in the equilibrium of its own equations, which are not linear; linear = true is for a section "
        "[statics], a run of its own");
  if (run && s.flag("linear", false)) {
    o.path = StaticPath::linear;
    o.load = s.number("load", o.load);
    for (const char* key : {"tolerance", "first_step", "largest_step", "smallest_step", "max_steps", "max_iterations",
                            "max_factorizations", "pseudo_time", "path"})
      if (s.has(key)) fail(s.place(key), "has no meaning in linear statics, which is one solve; take it out");
    return;
  }
  o.tolerance = s.positive("tolerance", o.tolerance);
  constexpr double kCoarsest = 0.1;
  if (o.tolerance > kCoarsest)
    fail(s.place("tolerance"), fmt::format("must not be above {:g}, a part of the loads", kCoarsest));
  o.load = s.number("load", o.load);
  o.first_step = s.positive("first_step", o.first_step);
  o.largest_step = s.positive("largest_step", o.largest_step);
  o.smallest_step = s.positive("smallest_step", o.smallest_step);
  if (o.smallest_step > o.first_step)
    fail(s.place("smallest_step"), fmt::format("must not be above first_step, {:g}", o.first_step));
  o.max_steps = s.integer("max_steps", 1, o.max_steps);
  o.max_iterations = s.integer("max_iterations", 1, o.max_iterations);
  o.max_factorizations = s.integer("max_factorizations", 1, o.max_factorizations);
  o.pseudo_time = s.positive("pseudo_time", o.pseudo_time);
  o.path = s.one_of("path", kStaticPaths, o.path);
}

StaticsSpec read_statics(Section s) {
  StaticsSpec out;
  out.place = s.place();
  out.time = s.number("time", 0);
  read_statics_options(s, out.options, true);
  s.finish();
  return out;
}

RotationSpec read_rotation(Section s) {
  RotationSpec out;
  out.place = s.place();
  out.axis = s.vector("axis");
  if (!(out.axis.norm() > 0)) fail(s.place("axis"), "must not be zero");
  out.axis.normalize();
  out.point = s.vector("point", Vec3::Zero());
  out.speed = s.number("speed");
  out.bodies = s.texts("bodies");
  s.finish();
  return out;
}

void read_initial(Section s, InitialSpec& out) {
  out.place = s.place();
  if (const auto rotation = s.table("rotation")) out.rotation = read_rotation(*rotation);
  if (const Value* statics = s.value("statics"); statics != nullptr && statics->type == Value::Type::table) {
    out.statics = true;
    Section options(*statics);
    read_statics_options(options, out.statics_options, false);
    options.finish();
  } else {
    out.statics = s.flag("statics", false);
  }
  out.project_velocities = s.choice("velocities", {"exact", "project"}, 0) == 1;
  out.position_tolerance = s.positive("position_tolerance", out.position_tolerance);
  out.velocity_tolerance = s.positive("velocity_tolerance", out.velocity_tolerance);
  out.modes = s.integer("modes", 0, 0);
  s.finish();
}

/// A time, or false: none.
double read_interval(Section& s, const std::string& key, double otherwise) {
  const Value* value = s.value(key);
  if (value == nullptr) return otherwise;
  if (value->type == Value::Type::boolean && !value->boolean) return -1;
  const double interval = s.number(key);
  if (interval < 0) fail(value->place, "must be 0 (every step) or greater, or false");
  return interval;
}

PathSpec read_path(const std::string& name, const Value& table) {
  constexpr int kMostPoints = 10'000;
  Section s(table);
  PathSpec path;
  path.place = s.place();
  path.name = name;
  path.body = s.text("body");
  path.through = s.vectors("through");
  if (path.through.size() < 2) fail(s.place("through"), "give two points or more, [[x, y, z], [x, y, z]]");
  path.points = s.integer("points", 2, path.points, kMostPoints);
  path.quantities = s.texts("quantities");
  if (path.quantities.empty())
    fail(s.place("quantities"), "say what is wanted along the path, for instance quantities = [\"stress.von_mises\"]");
  s.finish();
  return path;
}

void read_output(Section s, OutputSpec& out) {
  out.place = s.place();
  out.quantities = s.texts("quantities");
  out.envelopes = s.texts("envelopes");
  out.csv_interval = read_interval(s, "csv_interval", 0);
  out.vtu_interval = read_interval(s, "vtu_interval", -1);
  out.format = s.one_of("format", kPictureFormats, out.format);
  out.restart_interval = read_interval(s, "restart_interval", -1);
  out.energies = s.flag("energies", true);
  out.constraints = s.flag("constraints", true);
  out.reactions = s.flag("reactions", false);
  out.step_data = s.flag("step_data", false);
  out.exact_times = s.flag("exact_times", false);
  out.page = s.flag("page", true);
  s.named("paths", [&](const std::string& name, const Value& table) { out.paths.push_back(read_path(name, table)); });
  s.finish();
}

void read_solver(const Value& table, Description& model) {
  Section check(table);
  for (const auto& [key, value] : table.entries) {
    if (value.type == Value::Type::text) {
      model.solver.emplace_back(key, value.text);
    } else if (value.type == Value::Type::integer || value.type == Value::Type::real) {
      model.solver.emplace_back(key, fmt::format("{}", value.real));
    } else if (value.type == Value::Type::boolean) {
      model.solver.emplace_back(key, value.boolean ? "true" : "false");
    } else {
      fail(value.place, "must be a number, a text, or true or false");
    }
  }
}

/// Without a density there is no weight, nothing swings, and nothing pulls outwards.
void check_densities(const Description& model) {
  for (const BodySpec& body : model.bodies) {
    if (!body.massless) continue;
    const auto refuse = [&](const char* what) {
      fail(body.place,
           fmt::format("needs a density (of its material; mass_per_length and inertias of a section): {}", what));
    };
    if (!body.gravity.value_or(model.gravity).isZero(0)) refuse("there is gravity; gravity = [0, 0, 0] takes it away");
    if (model.initial.modes > 0) refuse("natural frequencies are asked for");
    if (model.harmonic) refuse("a frequency response is asked for");
    if (model.initial.rotation) refuse("[initial] rotation makes it turn, and pulls at its mass");
    if (body.reduction && body.reduction->frequency < std::numeric_limits<double>::max())
      refuse("'reduce' keeps the modes below a frequency");
  }
}

/// One name means one thing: quantities and references must not be ambiguous.
void check_names(const Description& model) {
  std::map<std::string, Place> taken;
  const auto take = [&](const std::string& name, const Place& place) {
    if (name == "ground" || name == "energy" || name == "constraints" || name == "step" || name == "time" ||
        name == "inputs" || name == "sensors")
      fail(place, fmt::format("the name '{}' is taken; choose another", name));
    const auto [it, fresh] = taken.emplace(name, place);
    if (!fresh)
      fail(place,
           fmt::format("the name '{}' is taken by {} (line {}); bodies, markers, joints, supports, forces, contacts "
                       "and controllers share their names",
                       name, it->second.path, it->second.line));
  };
  for (const BodySpec& body : model.bodies) take(body.name, body.place);
  for (const auto& [name, marker] : model.markers) take(name, marker.place);
  for (const JointSpec& joint : model.joints) take(joint.name, joint.place);
  for (const ForceSpec& force : model.forces) take(force.name, force.place);
  for (const SupportSpec& support : model.supports) take(support.name, support.place);
  for (const EquationSpec& equation : model.equations) take(equation.name, equation.place);
  for (const TieSpec& tie : model.ties) take(tie.name, tie.place);
  for (const ContactSpec& contact : model.contacts) take(contact.name, contact.place);
  for (const ControllerSpec& controller : model.controllers) take(controller.name, controller.place);
}

}  // namespace

bool asks_for_linear_statics(const Value& root) {
  const Value* statics = root.find("statics");
  const Value* linear = statics != nullptr && statics->is_table() ? statics->find("linear") : nullptr;
  return linear != nullptr && linear->type == Value::Type::boolean && linear->boolean;
}

void set_rotation(Description& model) {
  if (!model.initial.rotation) return;
  RotationSpec& r = *model.initial.rotation;
  std::vector<std::string> names;
  for (const BodySpec& body : model.bodies) names.push_back(body.name);
  if (r.bodies.empty()) r.bodies = names;
  const Vec3 omega = r.speed * r.axis;
  for (const std::string& name : r.bodies) {
    const auto it = std::find(names.begin(), names.end(), name);
    if (it == names.end()) fail(r.place, fmt::format("bodies: there is no body '{}'{}", name, suggestion(name, names)));
    BodySpec& body = model.bodies[static_cast<std::size_t>(it - names.begin())];
    body.velocity_given = body.angular_velocity_given = true;
    const auto turn = [&](const Vec3& at, Vec3& velocity) { velocity += omega.cross(at - r.point); };
    if (auto* rigid = std::get_if<RigidSpec>(&body.shape)) {
      turn(rigid->data.position, rigid->data.velocity);
      rigid->data.angular_velocity += omega;
    } else if (auto* point = std::get_if<PointSpec>(&body.shape)) {
      turn(point->data.position, point->data.velocity);
    } else {
      turn(body.position, body.velocity);
      body.angular_velocity += omega;
    }
  }
}

namespace {

/// The description of a text in which nothing is taken from decks any more.
Description read_whole(const Value& root_value, const std::string& file) try {
  Description model;
  model.file = file;
  model.folder = std::filesystem::path(file).parent_path().string();
  model.keys = model_keys(root_value);
  Section root(root_value);
  model.title = root.text("title", std::filesystem::path(file).stem().string());
  model.units = root.text("units", "");
  model.gravity = root.vector("gravity", Vec3::Zero());
  if (root.has("statics")) model.statics.emplace();  // bodies then do without densities
  if (asks_for_linear_statics(root_value)) model.statics->options.path = StaticPath::linear;
  read_bodies(root, model);
  root.named("markers",
             [&](const std::string& name, const Value& value) { model.markers[name] = read_marker(value, name); });
  read_splines(root, model);
  read_joints(root, model);
  read_forces(root, model);
  read_supports(root, model);
  read_equations(root, model);
  read_surfaces(root, model);
  read_events(root, model);
  read_controllers(root, model);
  bind_curves(model);
  model.moves = root.has("integrator") || root.has("statics");
  if (!model.moves && !root.has("harmonic"))
    fail({file, 0, ""},
         "needs a section [integrator] with 'end', the time where the run ends, [statics] for an equilibrium, or "
         "[harmonic] for a frequency response");
  if (const auto s = root.table("statics")) model.statics = read_statics(*s);
  if (const auto s = root.table("integrator")) {
    if (model.statics)
      fail(s->place(),
           "a run is a motion, [integrator], or an equilibrium, [statics]; a motion that begins in "
           "equilibrium says statics = true in [initial]");
    read_integrator(*s, model.integrator);
  }
  if (const auto s = root.table("initial")) read_initial(*s, model.initial);
  if (const auto s = root.table("harmonic")) model.harmonic = read_harmonic(*s, model);
  if (const auto s = root.table("output")) read_output(*s, model.output);
  if (const Value* s = root.value("solver")) read_solver(*s, model);
  root.finish();
  check_names(model);
  settle_frame_names(model);
  check_densities(model);
  check_erosion(model);
  set_rotation(model);
  if (!model.controllers.empty() && !(model.moves && !model.statics))
    fail(model.controllers.front().place, "an FMU is stepped through time; the model needs [integrator] for that");
  if (model.bodies.empty()) fail({file, 0, ""}, "has no bodies; add [bodies.NAME]");
  return model;
} catch (const Error& error) {
  if (error.status().code == StatusCode::invalid_input) refuse_unknown_sections(root_value, error);
  throw;
}

}  // namespace

Description read_description(const Value& root, const std::string& file) {
  if (!takes_decks(root)) return read_whole(root, file);
  Value taken = root;
  take_decks(taken, std::filesystem::path(file).parent_path().string());
  return read_whole(taken, file);
}

}  // namespace espalier::dynamics::model
