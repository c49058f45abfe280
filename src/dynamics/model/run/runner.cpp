#include "dynamics/model/run/runner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>

#include "base/stage.hpp"
#include "base/stopwatch.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"
#include "dynamics/model/assembly/unclosed_joints.hpp"
#include "dynamics/model/build/default_tolerances.hpp"
#include "dynamics/model/build/element_notices.hpp"
#include "dynamics/model/run/restart.hpp"
#include "dynamics/model/run/start_report.hpp"
#include "dynamics/model/units/unit_system.hpp"
#include "solver/options/option_text.hpp"

namespace espalier::dynamics::model {
namespace {

/// Below it velocities are as good as none.
double speed_that_counts(const IntegratorSpec& integrator) {
  constexpr double kOfAlpha = 1e-8;
  if (integrator.method != Method::bdf) return kOfAlpha;
  return integrator.bdf.absolute_velocity > 0 ? integrator.bdf.absolute_velocity : integrator.bdf.absolute;
}

/// The least slip speed of friction in joints and on guides, as a speed of a coordinate; infinite without any.
double least_slip_speed(const Description& model) {
  double least = std::numeric_limits<double>::infinity();
  for (const JointSpec& j : model.joints)
    if (j.friction && j.friction->curve.static_coefficient > 0)
      least = std::min(least, j.friction->curve.slip_speed / std::max(1.0, j.friction->radius));
  for (const ForceSpec& f : model.forces)
    if (f.friction > 0) least = std::min(least, f.slip_speed);
  return least;
}

using base::Stopwatch;

SimulationStep public_step(const StepReport& r) {
  return {r.index,    r.t,    r.h, r.order, r.newton_iterations, r.factorizations, r.error_failures + r.newton_failures,
          r.residual, r.error};
}

SimulationEnergy to_public(const Energy& e) { return {e.kinetic, e.potential}; }

base::Interruption::Clock::duration period_of(double seconds) {
  return std::chrono::duration_cast<base::Interruption::Clock::duration>(std::chrono::duration<double>(seconds));
}

/// So many times of output can be told apart and reached; more are a slip of the pen.
void check_intervals(const Description& model, double frame_interval) {
  constexpr double kMost = 1e9;
  const double end = model.statics ? model.statics->options.load : model.integrator.end;
  const double duration = end - (model.statics ? 0 : model.integrator.start);
  if (std::isinf(duration)) return;
  for (const double interval : {model.output.csv_interval, model.output.vtu_interval, model.output.restart_interval})
    if (interval > 0 && duration > kMost * interval)
      fail(model.output.place, fmt::format("an interval of {:g} asks for more than {:g} outputs until {:g}; 0 writes "
                                           "every step",
                                           interval, kMost, end));
  constexpr double kMostFrames = 1e6;  // of memory
  if (frame_interval > 0 && duration > kMostFrames * frame_interval)
    throw Error(StatusCode::invalid_input,
                fmt::format("a frame_interval of {:g} asks for more than {:g} pictures until {:g}; 0 keeps every step",
                            frame_interval, kMostFrames, end));
}

}  // namespace

void Runner::set_end(double until) {
  const double start = model_.statics ? 0 : model_.integrator.start;
  if (!(until > start) || !std::isfinite(until))
    throw Error(StatusCode::invalid_input, fmt::format("--until {}: must be a {} than the start, {}", until,
                                                       model_.statics ? "load factor greater" : "time later", start));
  (model_.statics ? model_.statics->options.load : model_.integrator.end) = until;
}

Runner::Runner(Description model, SimulationOptions options, SimulationSummary& summary)
    : model_(std::move(model)),
      options_(std::move(options)),
      interruption_(base::telling(options_.interrupted), period_of(options_.interrupted_every)),
      summary_(summary) {
  const Stopwatch watch(summary_.phases.total);
  const base::Stage stage("model");
  duration_ = model_.integrator.end - model_.integrator.start;
  if (options_.until) set_end(*options_.until);
  if (model_.statics && !options_.restart.empty())
    throw Error(StatusCode::invalid_input, "--restart: a statics run begins anew, it has no restart file");
  check_intervals(model_, options_.frame_interval);
  summary_.title = model_.title;
  summary_.units = model_.units;
  summary_.method = model_.linear()                           ? "linear statics"
                    : model_.statics                          ? "statics"
                    : !model_.moves                           ? "harmonic"
                    : model_.integrator.method == Method::bdf ? "bdf"
                                                              : "generalized-alpha";
  std::vector<std::pair<std::string, std::string>> by_name = model_.solver;
  by_name.insert(by_name.end(), options_.solver.begin(), options_.solver.end());
  {
    const Stopwatch setup(summary_.phases.setup);
    int threads = 0;
    for (const auto& [key, value] : by_name)
      if (key == "threads") threads = run_options({{key, value}}, 0).threads;
    mechanism_ = build(model_, threads);
    if (!mechanism_->impacts.empty() && mechanism_->system.multiplier_pattern() != nullptr)
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}: law = \"impulse\" does not go with forces that depend on reactions (friction in "
                              "joints), which has no impulses",
                              mechanism_->impacts.front()->name()));
    const Sizes sizes = mechanism_->system.sizes();
    // Dense LU of 60 unknowns takes as long as the bookkeeping of a sparse one; who names a device means it.
    constexpr Index kLargestDense = 60;
    const Index unknowns = sizes.velocity + sizes.constraints;
    const bool chosen = std::any_of(by_name.begin(), by_name.end(), [](const auto& o) { return o.first != "threads"; });
    Options solver;
    try {
      solver = run_options(by_name, unknowns);
      solver.interrupted = options_.interrupted;
      solver.interrupted_every = options_.interrupted_every;
    } catch (const Error& error) {
      throw Error(error.status().code, std::string("solver: ") + error.what());
    }
    modes_solver_ = solver;
    const bool dense = unknowns <= kLargestDense && !chosen;
    std::unique_ptr<SharedNewton> shared;
    if (options_.ranks.size() > 1 && !dense) shared = std::make_unique<SharedNewton>(options_.ranks, by_name, unknowns);
    equations_ = std::make_unique<Equations>(
        mechanism_->system,
        make_run_solver(solver, dense, {options_.dump, options_.dump_every, options_.dump_count}, options_.analyses,
                        record_, std::move(shared)),
        mechanism_->step_pool);
    if (options_.record_timeline) trace_ = std::make_unique<PhaseTrace>();
    equations_->set_trace(trace_.get());
    for (const std::string& request : model_.output.quantities) choose(request, model_.output.place);
    for (const std::string& request : options_.quantities) choose(request, {});
    for (const Quantity& q : quantities_) series_.names.push_back(q.name);
    envelopes_ = std::make_unique<Envelopes>(*mechanism_, model_.output.envelopes, model_.output.place);
    for (const PathSpec& path : model_.output.paths) paths_.emplace_back(*mechanism_, path);
  }
  prepare();
  if (!model_.statics) start_integrator();
  finish();
}

std::vector<SimulationQuantity> Runner::all_quantities() const {
  std::vector<SimulationQuantity> list = list_quantities(*mechanism_);
  if (model_.units.empty()) return list;
  const UnitSystem units(model_.units);
  for (SimulationQuantity& q : list) q.unit = units.unit_of(q.dimension);
  return list;
}

// What is chosen twice is there once.
void Runner::choose(const std::string& request, const Place& place) {
  for (Quantity& q : find_quantities(*mechanism_, request, place)) {
    const auto same = [&q](const Quantity& known) { return known.name == q.name; };
    if (std::none_of(quantities_.begin(), quantities_.end(), same)) quantities_.push_back(std::move(q));
  }
}

void Runner::prepare() {
  state_ = State(mechanism_->system.sizes());
  state_.t = model_.statics ? model_.statics->time : model_.integrator.start;
  mechanism_->system.initial(state_.q, state_.v);
  const State given = state_;
  guard_ = std::make_unique<RedundancyGuard>(*equations_);
  if (mechanism_->controls != nullptr) guard_->set_absent(mechanism_->controls->absent_rows(state_.lambda.size()));
  ConsistencyOptions consistency;
  consistency.allowed_position = model_.initial.position_tolerance;
  consistency.kept_velocities = given_velocities(*mechanism_);
  const bool statics = model_.initial.statics && options_.restart.empty();
  try {
    if (statics || model_.statics) {
      guard_->analyze(state_);  // statics closes the joints itself, while it puts the loads on
    } else {
      const ConsistencyResult result = guard_->prepare(state_, consistency);
      summary_.position_change = result.position_change;
      summary_.velocity_change = result.velocity_change;
      if (result.position_change > 0 && options_.restart.empty()) check_overlaps(model_, *mechanism_, state_);
    }
  } catch (const Error& error) {
    state_ = given;  // where the joints could not be closed from
    throw Error(error.status().code, explain_failure(error), error.status().row);
  }
  reference_ = model_.initial.statics ? given : state_;
  describe_system();
  if (options_.restart.empty()) {
    for (const auto& lines : {open_joints(*mechanism_, given), moved_bodies(*mechanism_, given, state_)})
      summary_.notices.insert(summary_.notices.end(), lines.begin(), lines.end());
  }
  if (options_.restart.empty() && !model_.initial.statics && !model_.statics) check_velocities(given, state_);
  if (statics) find_equilibrium(consistency);
  begin_controllers();
  if (!model_.statics) set_modal_damping();
  if (options_.restart.empty() && !model_.statics) find_modes();
  if (model_.statics) mechanism_->system.set_load_factor(0);
  summary_.t_begin = time();
  summary_.energy_begin = to_public(mechanism_->system.energy(state_.view()));
}

void Runner::describe_system() {
  const Sizes sizes = mechanism_->system.sizes();
  summary_.redundant = guard_->notices();
  for (const BuiltBody& body : mechanism_->bodies)
    for (const std::string& notice : body.notices) summary_.notices.push_back(body.spec.name + ": " + notice);
  summary_.notices.insert(summary_.notices.end(), mechanism_->notices.begin(), mechanism_->notices.end());
  summary_.bodies = static_cast<Index>(mechanism_->bodies.size());
  summary_.joints = static_cast<Index>(mechanism_->joints.size());
  summary_.forces = static_cast<Index>(model_.forces.size());
  summary_.velocities = sizes.velocity;
  summary_.constraints = sizes.constraints;
  summary_.degrees_of_freedom = guard_->degrees_of_freedom();
}

void Runner::check_velocities(const State& given, const State& consistent) {
  const double allowed = model_.initial.velocity_tolerance * std::max(max_norm(consistent.v), max_norm(given.v));
  const std::optional<MovedVelocity> kept = changed_velocity(*mechanism_, given, consistent, allowed, true);
  if (kept && !model_.initial.project_velocities)
    fail(kept->body->spec.place,
         fmt::format(
             "the initial velocity contradicts the constraints: the velocity of {} is {:g} in the text, {:g} is "
             "the nearest that all given velocities allow for; correct those of the bodies joined to '{}', or "
             "set initial.velocities = \"project\" to take the nearest",
             mechanism_->system.coordinate_name(kept->coordinate), kept->given, kept->found, kept->body->spec.name));
  const std::vector<std::string> lines = velocity_notices(*mechanism_, given, consistent, allowed);
  summary_.notices.insert(summary_.notices.end(), lines.begin(), lines.end());
}

void Runner::start_integrator() {
  if (model_.integrator.method == Method::bdf) {
    if (wants_default_tolerances(model_.integrator))
      set_default_tolerances(model_.integrator, *equations_, *mechanism_, model_, state_, duration_);
    model_.integrator.bdf.slip_speed = least_slip_speed(model_);
    integrator_ = std::make_unique<BdfIntegrator>(*equations_, model_.integrator.bdf);
  } else {
    AlphaOptions alpha = model_.integrator.alpha;
    alpha.search = !model_.contacts.empty();
    integrator_ = std::make_unique<GeneralizedAlpha>(*equations_, alpha);
  }
  integrator_->start(state_);
  equations_->allow_device();
  if (const std::string& notice = equations_->device_notice(); !notice.empty()) summary_.notices.push_back(notice);
  events_ = std::make_unique<EventWatch>(model_, *mechanism_);
  if (!options_.restart.empty()) {
    for (const std::string& change : read_restart(options_.restart, options_.accept_changes, *mechanism_, *integrator_))
      summary_.notices.push_back("accepted: " + change);
    take_up_switches();
    guard_->check(current());
    // A run that was killed after its last restart file has nothing to do but to write its results.
    if (time() > model_.integrator.end)
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}: the state is at t = {:g}, the run ends at {:g} already; give a later --until",
                              options_.restart, time(), model_.integrator.end));
    if (reached(model_.integrator.end))
      summary_.notices.push_back(
          fmt::format("{}: the run is complete, nothing was left to do; a later --until goes on", options_.restart));
    summary_.t_begin = time();
    summary_.energy_begin = to_public(mechanism_->system.energy(current().view()));
  }
  last_report_.t = time();
  dropped_at_start_ = equations_->dropped();
}

Sample Runner::sample(const StepReport& report) {
  Sample s{&current(), report};
  if (!guard_->redundant().empty() && !mechanism_->linear) {
    shown_ = current();
    guard_->share_reactions(shown_);
    s.state = &shown_;
  }
  if (model_.statics) s.load = load_;
  if (mechanism_->linear) return s;  // which meets the constraints to first order
  equations_->evaluate_constraints(s.state->t, s.state->q, s.state->v);
  std::vector<double> level(s.state->lambda.size());
  s.report.levels.position = max_norm(equations_->phi());
  equations_->level(s.state->v, equations_->nu(), level);
  s.report.levels.velocity = max_norm(level);
  equations_->level(s.state->a, equations_->gamma(), level);
  s.report.levels.acceleration = max_norm(level);
  return s;
}

double Runner::value(const std::string& quantity) {
  std::vector<Quantity> found;
  try {
    found = find_quantities(*mechanism_, quantity, {});
  } catch (const Error& error) {
    throw std::invalid_argument(error.what());
  }
  if (found.size() != 1) throw std::invalid_argument("\"" + quantity + "\" is a vector; add .x, .y, .z or .norm");
  return found[0].value(sample(last_report_));
}

void Runner::guarded(const std::function<void()>& body) {
  const Stopwatch watch(summary_.phases.total);
  try {
    body();
  } catch (const Error& error) {
    if (integrator_) note_steps();
    going_ = false;
    const Error explained(error.status().code, explain_failure(error), error.status().row);
    if (files_) files_->emergency(sample(last_report_));
    finish();
    throw explained;
  }
  finish();
}

void Runner::run(const SimulationObserver& observer) {
  guarded([&] {
    if (model_.statics) return run_statics(observer);
    stopped_ = false;
    try {
      if (!going_) go();
    } catch (const Error& error) {  // of the frequency response: nothing has moved
      if (error.status().code != StatusCode::cancelled) throw;
      summary_.interrupted = true;
      return files_->end(sample(last_report_));
    }
    advance(model_.integrator.end, observer);
    guard_->check(current());
    {
      const Phase output("output", summary_.phases.output, trace_.get());
      files_->end(sample(last_report_));
      going_ = false;
    }
    note_steps();
  });
}

void Runner::go() {
  {
    const Phase output("output", summary_.phases.output, trace_.get());
    files_.reset();  // of a run that an observer broke off
    files_ = std::make_unique<RunFiles>(model_.output, options_.out, *mechanism_, quantities_, integrator_);
    const Sample s = sample(last_report_);
    begin_page(s, reference_);
    files_->begin(s, reference_, !options_.restart.empty());
    files_->modes(state_, shapes_);
    begin_keeping(s, reference_);
    show_shapes();
  }
  if (options_.restart.empty()) give_response();
  going_ = true;
  happen();
  if (!balance_) balance_ = std::make_unique<EnergyBalance>(*equations_, speed_that_counts(model_.integrator));
  watch_from_here();
}

// Steps until `end`, an event, the observer or the caller's interruption.
void Runner::advance(double end, const SimulationObserver& observer) {
  summary_.interrupted = false;
  const base::Interruption::Call call(interruption_);
  const double begin = time();
  base::Stage stage("motion", std::isfinite(end) ? end - begin : 0, "time");
  while (!stopped_ && !reached(end)) {
    try {
      interruption_.check();
      if (!exchange()) break;
      step(std::min({end, files_->next_exact_time(), next_exchange()}));
    } catch (const Error& error) {
      if (error.status().code != StatusCode::cancelled) throw;
      return halt();
    }
    stage.reach(time() - begin);
    if (observer && !observer(public_step(last_report_))) {
      summary_.interrupted = !stopped_ && !reached(end);
      break;
    }
  }
}

void Runner::step(double limit) {
  constexpr long kWatchEvery = 100, kLookEvery = 10;
  double seconds = 0;  // counted in other phases
  {
    Phase phase("step", seconds, trace_.get(), PhaseRow::steps);
    phase.set_number(last_report_.index + 1);
    last_report_ = events_->empty() ? integrator_->step(limit) : events_->step(integrator_, limit);
  }
  balance_->step(current());
  if (model_.integrator.method == Method::bdf && model_.integrator.bdf.fixed_step == 0) held_.step(current());
  happen();
  if (erode()) happen();
  if (last_report_.index % kWatchEvery == 0) guard_->check(current());
  if (last_report_.index % kLookEvery == 0) note_elements();
  const Phase output("output", summary_.phases.output, trace_.get());
  const Sample s = sample(last_report_);
  auto& most = summary_.largest_violation;
  most.position = std::max(most.position, s.report.levels.position);
  most.velocity = std::max(most.velocity, s.report.levels.velocity);
  most.acceleration = std::max(most.acceleration, s.report.levels.acceleration);
  files_->step(s);
  keep(s);
}

// There is no factor, or half of one.
void Runner::halt() {
  summary_.interrupted = true;
  integrator_ = integrator_->clone();
  equations_->forget_analysis();
}

bool Runner::reached(double end) const {
  if (model_.integrator.steps > 0 && integrator_->counts().steps >= model_.integrator.steps) return true;
  return std::isfinite(end) && !(end - time() > 4e-16 * std::max(std::abs(end), std::abs(time())));
}

void Runner::note_steps() {
  // What found no room on a GPU may have looked for it in the middle of the run.
  std::vector<std::string>& notices = summary_.notices;
  if (const std::string& notice = equations_->device_notice();
      !notice.empty() && std::find(notices.begin(), notices.end(), notice) == notices.end())
    notices.push_back(notice);
  if (record_.unsymmetric > 0)
    summary_.notices.push_back(fmt::format(
        "kind = ldlt took {} unsymmetric Newton matrices for symmetric ones (a_ij and a_ji differ by up to {:.1e} of "
        "the largest entry: gyroscopic terms, followers, friction, forces as functions of state). The results hold, "
        "Newton takes more iterations ({} in {} steps); kind = lu has the whole matrix",
        record_.unsymmetric, record_.largest_asymmetry, integrator_->counts().newton_iterations,
        integrator_->counts().steps));
  if (const std::optional<std::string> notice = balance_ ? balance_->notice() : std::nullopt)
    notices.push_back(*notice);
  if (const std::optional<std::string> notice = held_.notice()) notices.push_back(*notice);
  note_erosion();
  const IntegratorCounts& c = integrator_->counts();
  // Less than that hides behind the errors of the methods; a few steps of a run do not matter.
  constexpr double kWorthSaying = 1e-6;
  if (c.rounded > c.steps / 2 && c.largest_rounding > kWorthSaying)
    summary_.notices.push_back(fmt::format(
        "the steps are so short that rounding shows: in {} of {} steps Newton's iteration ended with changes of "
        "accelerations and multipliers of up to {:.1e} of the largest; longer steps give them more exactly",
        c.rounded, c.steps, c.largest_rounding));
  if (c.divisions == 0) return;
  summary_.notices.push_back(
      fmt::format("steps of {:g} in which Newton did not converge were divided: {} halvings, the first at t = {:g}, "
                  "down to {:.3g}",
                  model_.integrator.alpha.step, c.divisions, c.first_division, c.shortest_step));
}

std::optional<std::string> Runner::explain_positions(const Error& error) {
  const StatusCode code = error.status().code;
  if (code != StatusCode::invalid_input && code != StatusCode::singular && code != StatusCode::accuracy_not_reached)
    return std::nullopt;
  try {
    if (std::optional<std::string> why = unclosed_joints(*mechanism_, current(), model_.units)) return why;
    if (!integrator_) return std::nullopt;
    return unreached_motion(*mechanism_, current(), model_.integrator.end, model_.units);
  } catch (const Error&) {  // the failure that brought us here is the one to report
    return std::nullopt;
  }
}

std::string Runner::explain_failure(const Error& error) {
  std::string text = error.what();
  if (const std::optional<std::string> why = explain_positions(error); why && text.find(*why) == std::string::npos) {
    if (!integrator_)
      return error.status().code == StatusCode::singular ? *why : *why + "; the search ended with: " + text;
    text = *why + "; " + text;
  }
  text += mechanism_->inverted_elements();
  for (const BuiltBody& body : mechanism_->bodies)
    if (const std::optional<std::string> notice = compression_notice(body, current().q)) text += "; " + *notice;
  if (error.status().code == StatusCode::invalid_input || state_.lambda.empty()) return text;
  // A mechanism in a singular position is the usual reason: rows of Phi_q that nearly depend on each other, beyond
  // those left out already.
  const State& s = current();
  equations_->evaluate_constraints(s.t, s.q, {});
  const auto rows = find_dependent_rows(mechanism_->system.constraint_pattern(), equations_->phi_q(), 1e-3);
  std::string names;
  int count = 0;
  for (const DependentRow& row : rows) {
    if (equations_->dropped()[static_cast<std::size_t>(row.row)] || ++count > 4) continue;
    names += (names.empty() ? "" : "; ") + mechanism_->system.constraint_name(row.row);
    if (!row.partners.empty()) names += " (with " + mechanism_->system.constraint_name(row.partners.front()) + ")";
  }
  if (!names.empty())
    text += fmt::format("; near a singular position at t = {:g}: these constraints are about to depend on others: {}",
                        s.t, names);
  return text;
}

void Runner::write_trace(const std::string& path) const {
  if (!trace_) throw std::logic_error("Simulation::write_trace: SimulationOptions::record_timeline was not set");
  trace_->write(path);
}

void Runner::note_elements() {
  if (mechanism_->linear) return;  // which knows no large strains
  for (const BuiltBody& body : mechanism_->bodies) {
    if (compressed_.count(body.spec.name) > 0) continue;
    const std::optional<std::string> notice = compression_notice(body, current().q);
    if (!notice) continue;
    compressed_.insert(body.spec.name);
    summary_.notices.push_back(*notice);
  }
}

void Runner::write_table_of_paths() {
  if (options_.out.empty()) return;
  const std::string file = options_.out + "/paths.csv";
  try {
    write_paths(file, summary_.paths);
    summary_.files.push_back(file);
  } catch (const Error& error) {  // the run is none the worse
    summary_.notices.emplace_back(error.what());
  }
}

void Runner::finish() {
  note_elements();
  summary_.t_end = time();
  const IntegratorCounts c = integrator_ ? integrator_->counts() : IntegratorCounts{};
  summary_.steps = model_.statics ? last_report_.index : c.steps;
  summary_.newton_iterations = model_.statics ? summary_.statics_iterations : c.newton_iterations;
  summary_.error_failures = c.error_failures;
  summary_.newton_failures = c.newton_failures;
  summary_.crossings = c.crossings;
  summary_.divisions = c.divisions;
  summary_.rounded = c.rounded;
  summary_.largest_rounding = c.largest_rounding;
  summary_.refactor_first = c.refactor_first;
  summary_.refactor_step = c.refactor_step;
  summary_.refactor_rate = c.refactor_rate;
  summary_.refactor_failed = c.refactor_failed;
  const EquationCounts& e = equations_->counts();
  summary_.residuals = e.residuals;
  summary_.tangents = e.tangents;
  summary_.analyses = e.analyses;
  summary_.followed = record_.followed;
  summary_.factorizations = e.factorizations;
  summary_.solves = e.solves;
  summary_.turned = e.turns;
  SimulationPhases& p = summary_.phases;
  p.assembly = e.assembly_seconds;
  p.analysis = record_.analysis_seconds;
  p.factorization = std::max(0.0, e.analysis_seconds + e.factor_seconds - record_.analysis_seconds);
  p.solve = e.solve_seconds;
  summary_.kind = record_.dense ? "dense" : std::string(solver::name_of(record_.analysis.kind));
  summary_.precision = std::string(solver::name_of(record_.options.precision));
  summary_.device = record_.dense ? "host" : record_.analysis.device;
  summary_.nonzeros_factor = record_.analysis.nonzeros_factor;
  summary_.factor_flops = record_.analysis.flops;
  summary_.predicted_bytes = record_.analysis.predicted_bytes;
  summary_.peak_bytes = record_.factor.peak_host_bytes;
  summary_.dumped = record_.dumped;
  summary_.energy_end = mechanism_->linear
                            ? SimulationEnergy{0, mechanism_->linear->energy([this](const State& at_load) {
                                                 return mechanism_->system.energy(at_load.view()).potential;
                                               })}
                            : to_public(mechanism_->system.energy(current().view()));
  if (balance_) {
    summary_.energy_work = balance_->work();
    summary_.energy_gain = balance_->gain();
  }
  const Sample s = sample(last_report_);
  summary_.values.clear();
  for (const Quantity& q : quantities_) summary_.values.emplace_back(q.name, q.value(s));
  summary_.envelopes = envelopes_->found();
  summary_.paths.clear();
  for (const FieldPath& path : paths_) summary_.paths.push_back(path.at(s));
  if (files_) summary_.files = files_->written();
  if (files_ && !paths_.empty()) write_table_of_paths();
  if (page_ && !page_->written().empty()) summary_.files.push_back(page_->written());
}

}  // namespace espalier::dynamics::model
