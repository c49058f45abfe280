// Equilibrium: as a run of its own, and as the start of a motion.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dynamics/bodies/modal_damping.hpp"
#include "dynamics/integrators/vibrations.hpp"
#include "dynamics/model/answer/structural_damping.hpp"
#include "dynamics/model/fields/mode_values.hpp"
#include "dynamics/model/run/free_motions.hpp"
#include "dynamics/model/run/runner.hpp"
#include "dynamics/steady/steady_modes.hpp"

namespace espalier::dynamics::model {

namespace {

StaticsWatch watch_of(const SimulationOptions& options) {
  if (!options.on_search) return {};
  return [&options](const StaticsTrial& t) {
    return options.on_search({t.steps, t.load, t.trial, t.factorizations, t.residual});
  };
}

}  // namespace

Equations& Runner::static_equations() {
  if (!model_.initial.rotation) return *equations_;
  if (!rotating_) {
    const RotationSpec& spec = *model_.initial.rotation;
    SteadyRotation rotation{spec.point, spec.speed * spec.axis, {}};
    for (const std::string& name : spec.bodies) rotation.bodies.push_back(&mechanism_->body(name)->component());
    rotating_ = std::make_unique<RotatingSystem>(mechanism_->system, std::move(rotation));
    const Sizes sizes = mechanism_->system.sizes();
    rotating_equations_ = std::make_unique<Equations>(
        *rotating_, make_linear_solver(sizes.velocity + sizes.constraints), mechanism_->step_pool);
  }
  rotating_equations_->set_dropped(equations_->dropped());
  std::fill(state_.v.begin(), state_.v.end(), 0.0);
  std::fill(state_.a.begin(), state_.a.end(), 0.0);
  return *rotating_equations_;
}

void Runner::turn_steadily() {
  if (!rotating_) return;
  rotating_->set_motion(state_.q, state_.v, state_.a);
  equations_->evaluate_constraints(state_.t, state_.q, state_.v);
}

void Runner::find_equilibrium(const ConsistencyOptions& consistency) {
  equations_->allow_device();
  try {
    note_statics(
        static_equilibrium(static_equations(), state_, model_.initial.statics_options, {}, watch_of(options_)));
    mechanism_->system.set_load_factor(1);
    turn_steadily();
    make_consistent(*equations_, state_, consistency);
    guard_->check(state_);
  } catch (const Error& error) {
    const bool cancelled = error.status().code == StatusCode::cancelled;
    const std::string text = cancelled ? error.what() : explain_statics(error);
    throw Error(error.status().code, "initial.statics: " + text, error.status().row);
  }
}

void Runner::begin_statics_files() {
  const Phase output("output", summary_.phases.output, trace_.get());
  files_ = std::make_unique<RunFiles>(model_.output, options_.out, *mechanism_, quantities_, integrator_);
  const Sample s = sample(last_report_);
  begin_page(s, state_);
  files_->begin(s, state_, false);
  begin_keeping(s, state_);
}

void Runner::run_statics(const SimulationObserver& observer) {
  if (model_.linear()) return run_linear_statics(observer);
  begin_statics_files();
  const auto each = [&](const StaticsStep& step, const State& state) {
    state_ = state;
    load_ = step.load;
    last_report_ = {};
    last_report_.index = step.index;
    last_report_.t = step.load;
    last_report_.h = step.change;
    last_report_.newton_iterations = step.iterations;
    last_report_.factorizations = step.factorizations;
    last_report_.newton_failures = step.failures;
    last_report_.residual = step.residual;
    summary_.statics_iterations += step.iterations;
    const Phase output("output", summary_.phases.output, trace_.get());
    const Sample s = sample(last_report_);
    files_->step(s);
    keep(s);
    if (!observer) return true;
    SimulationStep told;
    told.index = step.index;
    told.t = step.load;
    told.h = step.change;
    told.newton_iterations = step.iterations;
    told.factorizations = step.factorizations;
    told.failures = step.failures;
    told.residual = step.residual;
    if (observer(told)) return true;
    summary_.interrupted = true;
    return false;
  };
  const StaticsOptions& options = model_.statics->options;
  equations_->allow_device();
  Equations& equations = static_equations();
  State state = state_;
  try {
    const StaticsResult result = static_equilibrium(equations, state, options, each, watch_of(options_));
    summary_.interrupted = summary_.interrupted && result.load != options.load;
    note_statics(result);
    if (const std::string& notice = equations_->device_notice(); !notice.empty()) summary_.notices.push_back(notice);
    guard_->check(state_, true);
    turn_steadily();
    set_modal_damping();
    find_modes();
    files_->modes(state_, shapes_);
    show_shapes();
    give_response();
  } catch (const Error& error) {
    if (error.status().code == StatusCode::cancelled) {
      mechanism_->system.set_load_factor(load_);
      summary_.interrupted = true;
      const Phase output("output", summary_.phases.output, trace_.get());
      files_->end(sample(last_report_));
      return;
    }
    const Error explained(error.status().code, explain_statics(error), error.status().row);
    mechanism_->system.set_load_factor(load_);
    throw explained;
  }
  const Phase output("output", summary_.phases.output, trace_.get());
  files_->end(sample(last_report_));
}

/// "'a' can turn about z; 'b' can ..."; empty where all bodies are held.
std::string Runner::loose_bodies(const State& state) {
  constexpr std::size_t kShown = 4;
  const auto [all, unseen] = free_motions(*mechanism_, equations_->dropped(), state);
  std::string text;
  for (std::size_t k = 0; k < std::min(kShown, all.size()); ++k) text += (k > 0 ? "; " : "") + all[k];
  if (all.size() > kShown) text += fmt::format("; and {} bodies more", all.size() - kShown);
  if (unseen > 0 && !all.empty()) text += fmt::format("; {} bodies that hang together were not looked at", unseen);
  return text;
}

/// With what nothing holds in the given positions, without loads.
std::string Runner::explain_statics(const Error& error) {
  std::string text = explain_failure(error);
  State start(mechanism_->system.sizes());
  start.t = state_.t;
  mechanism_->system.initial(start.q, start.v);
  std::fill(start.v.begin(), start.v.end(), 0.0);
  mechanism_->system.set_load_factor(0);
  if (const std::string loose = loose_bodies(start); !loose.empty())
    text += fmt::format(
        "; without loads nothing holds these bodies: {}. Joints or springs to the ground, or to bodies that are held, "
        "take such motions away",
        loose);
  else if (const std::size_t unseen = free_motions(*mechanism_, equations_->dropped(), start).unseen; unseen > 0)
    text += fmt::format("; whether something holds the {} bodies that hang together was not looked at", unseen);
  for (const BuiltBody& body : mechanism_->bodies)
    if (!body.pieces.empty()) text += fmt::format("; '{}': {}", body.spec.name, body.pieces);
  if (model_.statics && error.status().code == StatusCode::accuracy_not_reached)
    text +=
        "; where displacements are to be small, linear = true in [statics] takes stiffness, loads and joints as they "
        "are at the start, and needs no path";
  return text;
}

void Runner::note_statics(const StaticsResult& result) {
  summary_.statics_steps = result.steps;
  summary_.statics_iterations = result.iterations;
  summary_.statics_residual = result.residual;
  summary_.statics_relaxed = result.relaxed;
  if (model_.statics) summary_.largest_violation.position = result.position;  // at the end; on the way joints close
  if (const std::string loose = loose_bodies(state_); !loose.empty())
    summary_.notices.push_back(
        fmt::format("the equilibrium is indifferent: {}. Where they stand is left to chance", loose));
  for (const CriticalPoint& c : result.critical) summary_.critical.push_back({c.load, c.limit});
}

// By the modes of the model as it stands, without damping of its own.
void Runner::set_modal_damping() {
  if (mechanism_->modal_damping == nullptr) return;
  constexpr Index kAll = 300, kMost = 100;  // velocity coordinates of models whose modes are all found; modes of others
  const Index n = mechanism_->system.sizes().velocity, count = n <= kAll ? n : kMost;
  const UndampedModes found = undamped_vibrations(*equations_, state_, count, modes_solver_);
  mechanism_->modal_damping->set(mechanism_->system, state_, found.squares, found.shapes);
  if (n > kAll && static_cast<Index>(found.squares.size()) == count)
    summary_.notices.push_back(
        fmt::format("damping by ratio: the lowest {} modes have it; those above {:.4g} per unit of time are not damped",
                    count, std::sqrt(found.squares.maxCoeff()) / (2 * std::numbers::pi)));
}

void Runner::find_modes() {
  if (model_.initial.modes == 0) return;
  if (page_ && page_->due()) write_page({}, true);
  const auto count = static_cast<Index>(model_.initial.modes);
  State at = state_;
  if (max_norm(state_.v) > 0) {
    SteadyModes found = steady_modes(*equations_, mechanism_->system, state_, count, modes_solver_);
    shapes_.clear();
    for (SteadyMode& m : found.modes) {
      summary_.modes.push_back(
          {m.mode.frequency, m.mode.damping_ratio, m.mode.eigenvalue.real(), m.whirl, m.standing_frequency});
      shapes_.push_back(std::move(m.mode.shape));
    }
    if (!found.modes.empty()) {
      if (StructuralDamping(*mechanism_).any()) found.notice += "; without structural damping";
      return summary_.notices.push_back(found.notice);
    }
    summary_.notices.push_back(
        fmt::format("initial.modes: the motion at the start is not steady, neither from axes at rest nor from axes "
                    "that turn with a "
                    "body {}: the modes are those of the same positions at rest",
                    found.notice));
    std::fill(at.v.begin(), at.v.end(), 0.0);
    make_consistent(*equations_, at);
  }
  if (!model_.statics && !model_.initial.statics && max_norm(at.a) > 1e-9)
    summary_.notices.push_back(
        fmt::format("initial.modes: the model is not in equilibrium where it is linearised (accelerations up to {:g}); "
                    "statics = true in [initial] begins in equilibrium",
                    max_norm(at.a)));
  const StructuralDamping structural(*mechanism_);
  SparseMatrix h;
  if (structural.any()) h = structural.matrix(at);
  Vibrations found = small_vibrations(*equations_, at, count, modes_solver_, structural.any() ? &h : nullptr);
  if (!found.notice.empty()) summary_.notices.push_back(found.notice);
  shapes_.clear();
  std::optional<double> load;
  if (model_.statics) load = load_;
  const ModeValues values(*mechanism_, state_, quantities_, load);
  for (Mode& mode : found.modes) {
    SimulationMode known;
    known.frequency = known.standing_frequency = mode.frequency;
    known.damping_ratio = mode.damping_ratio;
    known.growth = mode.eigenvalue.real();
    summary_.modes.push_back(std::move(known));
    values.add(mode.shape, summary_.modes.back());
    shapes_.push_back(std::move(mode.shape));
  }
}

}  // namespace espalier::dynamics::model
