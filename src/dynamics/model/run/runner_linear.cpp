// Linear statics: small displacements from the given positions.
#include <fmt/format.h>

#include <algorithm>

#include "dynamics/integrators/statics/linear_statics.hpp"
#include "dynamics/model/run/free_motions.hpp"
#include "dynamics/model/run/runner.hpp"

namespace espalier::dynamics::model {

/// Ends the run of a structure that can move.
void Runner::end_with_modes(const std::string& why) {
  summary_.notices.push_back(
      fmt::format("the modes are those of a structure that is free; loads have no answer: {}", why));
  const Sample s = sample(last_report_);
  files_->step(s);
  keep(s);
  files_->end(s);
}

void Runner::run_linear_statics(const SimulationObserver& observer) {
  constexpr double kSmall = 0.1;  // of the extent, or an angle: cos is 0.5 % off
  constexpr double kLost = 0.01, kWorthSaying = 1e-4;
  mechanism_->system.set_load_factor(0);
  begin_statics_files();
  find_modes();
  files_->modes(state_, shapes_);
  give_response();
  const double load = model_.statics->options.load;
  const auto stiff = [this, load] { mechanism_->load_functions_of_state(load); };
  for (std::vector<double>* part : {&state_.v, &state_.a}) std::fill(part->begin(), part->end(), 0.0);
  const State base = state_;
  LinearStatics solved;
  try {
    mechanism_->system.set_load_factor(0);
    stiff();
    if (const std::string loose = loose_bodies(base); !loose.empty())
      throw Error(StatusCode::singular,
                  fmt::format("linear statics: the structure is not held: {}. Joints, supports or springs to the "
                              "ground, or to bodies that are held, take such motions away",
                              loose));
    solved = linear_statics(*equations_, base, load, stiff, stretch_of_shells(*mechanism_, base.v.size()));
    if (!(solved.rounding <= kLost))
      throw Error(
          StatusCode::accuracy_not_reached,
          fmt::format("linear statics: rounding in the stiffness changes {:.2g} of the answer, most of all {}: a "
                      "motion is not held, or a part is very thin for its size; hold it, or take beams, thicker "
                      "parts or a coarser mesh",
                      solved.rounding, solved.softest));
  } catch (const Error& error) {
    mechanism_->system.set_load_factor(0);
    if (error.status().code == StatusCode::cancelled) {
      summary_.interrupted = true;
      return files_->end(sample(last_report_));
    }
    if (error.status().code == StatusCode::singular && model_.initial.modes > 0) return end_with_modes(error.what());
    std::string text = error.what();
    if (error.status().code == StatusCode::singular)
      for (const BuiltBody& body : mechanism_->bodies)
        if (!body.pieces.empty()) text += fmt::format("; '{}': {}", body.spec.name, body.pieces);
    throw Error(error.status().code, text, error.status().row);
  }
  State shared = base;
  shared.lambda = solved.lambda;
  guard_->share_reactions(shared);
  mechanism_->linear =
      std::make_unique<LinearResponse>(mechanism_->system, base, std::move(solved.dq), shared.lambda, load, stiff);
  const LinearResponse& response = *mechanism_->linear;
  mechanism_->system.set_load_factor(load);
  state_ = response.displaced();
  load_ = load;
  last_report_ = {};
  last_report_.index = 1;
  last_report_.t = last_report_.h = load;
  last_report_.factorizations = solved.factorizations;
  last_report_.residual = solved.backward_error;
  summary_.statics_steps = 1;
  summary_.statics_residual = solved.residual;
  summary_.statics_backward_error = solved.backward_error;
  if (response.size() > kSmall)
    summary_.notices.push_back(fmt::format(
        "linear statics takes displacements as small, and the largest is {:.3g} of the extent of the model, or that "
        "angle in radians: take linear out of [statics] where that counts",
        response.size()));
  if (solved.rounding > kWorthSaying)
    summary_.notices.push_back(
        fmt::format("rounding in the stiffness changes {:.1e} of the displacements: a part is very thin for its size",
                    solved.rounding));
  if (!model_.contacts.empty())
    summary_.notices.push_back(
        "linear statics takes contacts as they are at the start: what is open stays open, what is closed is a spring");
  const Phase output("output", summary_.phases.output, trace_.get());
  const Sample s = sample(last_report_);
  files_->step(s);
  keep(s);
  if (observer) {
    SimulationStep told;
    told.index = 1;
    told.t = told.h = load;
    told.factorizations = solved.factorizations;
    told.residual = solved.backward_error;
    observer(told);  // there is nothing left to stop
  }
  files_->end(s);
}

}  // namespace espalier::dynamics::model
