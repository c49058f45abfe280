// Derivatives of a model that switches, beside whole runs.
#include <algorithm>
#include <cmath>

#include "dynamics/contact/contact.hpp"
#include "dynamics/model/build/default_tolerances.hpp"
#include "dynamics/model/derivatives/sensitivity_run.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr double kWay = 5e-3;  // of a parameter, to a run that checks derivatives

}  // namespace

bool SensitivityRun::switches() const {
  for (const Switching* law : switching_laws(nominal_->mechanism().system)) {
    Branches branches;
    law->branches(nominal_->state().view(), branches);
    if (!branches.empty() || dynamic_cast<const contact::Contact*>(law) != nullptr) return true;
  }
  return false;
}

void SensitivityRun::check_by_other_runs() {
  if (statics_ || result_.summary.interrupted || !switches()) return;
  const std::size_t np = given_.size();
  const IntegratorSpec fine = of_check(nominal_->integrator());
  const double extent = nominal_->integrator().bdf.budget.extent;
  const bool adaptive = nominal_->integrator().method == Method::bdf && !(nominal_->integrator().bdf.fixed_step > 0);
  DerivativesToCheck what;
  what.numbers = result_.quantities;
  what.parameters = result_.parameters;
  what.values = result_.parameter_values;
  for (std::size_t p = 0; p < np; ++p)
    what.ways.push_back(what.values[p] != 0 ? kWay * std::abs(what.values[p])
                                            : kWay / kRelativeStep * given_[p].step());
  // How far two adaptive runs may be apart.
  what.noise = [fine, adaptive, extent](double x) {
    constexpr double kTolerances = 100, kAccuracies = 3;
    if (!adaptive) return 1e-12 * std::abs(x);
    if (wants_default_tolerances(fine)) return kAccuracies * fine.accuracy * (std::abs(x) + extent);
    return kTolerances * (fine.bdf.relative * std::abs(x) + fine.bdf.absolute);
  };
  what.replace = !objective_;  // sums over the times of a run change with them
  const std::size_t rows = result_.quantities.size() * np;
  try {
    const std::string wrong = check_by_runs(
        what, [this](const MovedParameters& moved) { return end_of_run(moved); },
        std::span<double>(result_.derivatives).last(rows));
    if (!wrong.empty())
      result_.summary.notices.push_back(
          "derivatives: something switches at another time, or another way, where a "
          "parameter is another: " +
          wrong);
  } catch (const Error& error) {
    if (error.status().code == StatusCode::cancelled) throw;
    result_.summary.notices.push_back(
        fmt::format("derivatives: the model switches, and they could not be compared with runs beside this one: {}",
                    error.status().message));
  }
}

IntegratorSpec SensitivityRun::of_check(IntegratorSpec spec) const {
  constexpr double kFiner = 0.01, kFinest = 1e-12;
  for (double* tolerance : {&spec.bdf.relative, &spec.bdf.absolute, &spec.bdf.absolute_velocity})
    *tolerance = std::max(kFiner * *tolerance, std::min(kFinest, *tolerance));
  spec.accuracy *= kFiner;
  spec.steps = 0;
  spec.end = nominal_->time();
  return spec;
}

std::vector<double> SensitivityRun::end_of_run(const MovedParameters& moved) const {
  std::vector<std::string> set;
  for (const auto& [p, value] : moved) set.push_back(fmt::format("{}={:.17e}", given_[p].path, value));
  Description model = describe(set);
  model.integrator = of_check(model.integrator);
  SimulationOptions options = quiet_options();
  options.until.reset();
  SimulationSummary summary;
  Runner run(model, options, summary);
  const std::vector<Quantity> quantities = run.chosen();
  std::vector<double> t, values;
  const auto sample = [&] {
    t.push_back(run.time());
    for (const Quantity& q : quantities) values.push_back(q.value(Sample{&run.state(), {}}));
  };
  sample();
  run.run([&](const SimulationStep&) {
    if (!objective_) t.clear(), values.clear();
    sample();
    return true;
  });
  if (summary.interrupted) throw Error(StatusCode::cancelled, "the derivatives were interrupted");
  if (!objective_) return values;
  std::vector<double> slopes(values.size(), 0.0);
  return {objective_(t, values, slopes)};
}

}  // namespace espalier::dynamics::model
