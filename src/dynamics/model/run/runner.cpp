#include "dynamics/model/run/runner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/stage.hpp"
#include "base/stopwatch.hpp"
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

using base::Stopwatch;

SimulationStep public_step(const StepReport& r) {
  return {r.index,    r.t,    r.h, r.order, r.newton_iterations, r.factorizations, r.error_failures + r.newton_failures,
          r.residual, r.error};
}

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
  summary_.method = model_.linear()  ? "linear statics"
                    : model_.statics ? "statics"
                    : !model_.moves  ? "harmonic"
                                     : name_of(kMethods, model_.integrator.method);
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

void Runner::write_trace(const std::string& path) const {
  if (!trace_) throw std::logic_error("Simulation::write_trace: SimulationOptions::record_timeline was not set");
  trace_->write(path);
}

}  // namespace espalier::dynamics::model
