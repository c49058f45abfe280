// The frequency response of a run.
#include <algorithm>

#include "base/at.hpp"
#include "dynamics/model/answer/harmonic_run.hpp"
#include "dynamics/model/run/runner.hpp"
#include "harmonic/table.hpp"

namespace espalier::dynamics::model {

void Runner::respond() {
  const HarmonicSpec& spec = *model_.harmonic;
  std::vector<Quantity> quantities;
  for (const std::string& request : spec.quantities)
    for (Quantity& q : find_quantities(*mechanism_, request, spec.place)) quantities.push_back(std::move(q));
  if (spec.quantities.empty()) quantities = quantities_;
  // The run and its steps do not swing.
  std::erase_if(quantities,
                [](const Quantity& q) { return q.name.starts_with("step.") || q.name.starts_with("constraints."); });
  std::optional<double> load;
  if (model_.statics) load = load_;
  const bool equilibrium = model_.statics.has_value() || model_.initial.statics;
  std::function<void(State&)> share;
  if (!guard_->redundant().empty()) share = [this](State& s) { guard_->share_reactions(s); };
  response_ = run_harmonic({spec, *mechanism_, *equations_, current(), std::move(quantities), load, equilibrium,
                            modes_solver_, std::move(share)});
  const HarmonicResult& r = response_.response;
  summary_.notices.insert(summary_.notices.end(), response_.notices.begin(), response_.notices.end());
  summary_.harmonic_points = static_cast<Index>(r.points.size());
  summary_.harmonic_solves = r.factorizations;
  summary_.peaks.clear();
  for (const harmonic::Peak& peak : harmonic::highest(r))
    summary_.peaks.push_back({response_.loads[at(peak.load)], response_.quantities[at(peak.output)], peak.frequency,
                              peak.amplitude, peak.phase});
  if (!response_.status.ok()) throw Error(response_.status);
}

void Runner::give_response() {
  if (!model_.harmonic) return;
  const auto write = [this] {
    const Phase output("output", summary_.phases.output, trace_.get());
    files_->harmonic(current(), response_, model_.harmonic->phases);
    show_response();
  };
  // Nothing renews the page of a run until all frequencies are solved: of large systems, who looks sees the rest of it.
  constexpr Index kLarge = 20'000;
  if (page_ && (page_->due() || mechanism_->system.sizes().velocity > kLarge)) write_page({}, true);
  try {
    respond();
  } catch (const Error&) {
    if (!response_.response.points.empty()) write();
    throw;
  }
  write();
}

}  // namespace espalier::dynamics::model
