// What a run says of itself: its summary, notices, and why it failed.
#include <fmt/format.h>

#include <algorithm>

#include "dynamics/model/assembly/unclosed_joints.hpp"
#include "dynamics/model/build/element_notices.hpp"
#include "dynamics/model/run/runner.hpp"
#include "solver/options/option_text.hpp"

namespace espalier::dynamics::model {

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
    if (equations_->dropped()[at(row.row)] || ++count > 4) continue;
    names += (names.empty() ? "" : "; ") + mechanism_->system.constraint_name(row.row);
    if (!row.partners.empty()) names += " (with " + mechanism_->system.constraint_name(row.partners.front()) + ")";
  }
  if (!names.empty())
    text += fmt::format("; near a singular position at t = {:g}: these constraints are about to depend on others: {}",
                        s.t, names);
  return text;
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
