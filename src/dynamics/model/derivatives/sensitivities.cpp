#include "espalier/sensitivities.hpp"

#include <algorithm>
#include <stdexcept>

#include "dynamics/guarded.hpp"
#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/derivatives/sensitivity_run.hpp"

namespace espalier {

namespace {

std::size_t position_of(const std::vector<std::string>& names, const std::string& name) {
  const auto it = std::find(names.begin(), names.end(), name);
  if (it == names.end()) throw std::out_of_range("there is no '" + name + "' among the sensitivities");
  return static_cast<std::size_t>(it - names.begin());
}

}  // namespace

double SensitivityResult::value(const std::string& quantity) const {
  return values[values.size() - quantities.size() + position_of(quantities, quantity)];
}

double SensitivityResult::derivative(const std::string& quantity, const std::string& parameter) const {
  const std::size_t rows = quantities.size() * parameters.size();
  return derivatives[derivatives.size() - rows + position_of(quantities, quantity) * parameters.size() +
                     position_of(parameters, parameter)];
}

namespace {

SensitivityResult differentiated(const std::string& text, const std::string& name,
                                 const std::vector<SensitivityParameter>& parameters, const SimulationOptions& options,
                                 SensitivityMethod method, const SensitivityObjective& objective) {
  SensitivityResult result;
  const Status status = dynamics::guarded(
      [&] { dynamics::model::SensitivityRun(text, name, parameters, options, method, objective, result).run(); });
  if (!status.ok()) result.status = status;
  result.summary.status = result.status;
  return result;
}

/// `use` of the file's text, unless it cannot be read.
template <class Use>
SensitivityResult of_file(const std::string& path, const Use& use) {
  std::string text;
  SensitivityResult result;
  result.status = dynamics::guarded([&] { text = dynamics::read_whole_file(path); });
  return result.status.ok() ? use(text) : result;
}

}  // namespace

SensitivityResult sensitivities_of_text(const std::string& text, const std::string& name,
                                        const std::vector<SensitivityParameter>& parameters,
                                        const SimulationOptions& options, SensitivityMethod method) {
  return differentiated(text, name, parameters, options, method, nullptr);
}

SensitivityResult sensitivities(const std::string& path, const std::vector<SensitivityParameter>& parameters,
                                const SimulationOptions& options, SensitivityMethod method) {
  return of_file(
      path, [&](const std::string& text) { return sensitivities_of_text(text, path, parameters, options, method); });
}

SensitivityResult objective_gradient_of_text(const std::string& text, const std::string& name,
                                             const std::vector<SensitivityParameter>& parameters,
                                             const SensitivityObjective& objective, const SimulationOptions& options) {
  if (!objective) throw std::invalid_argument("objective_gradient: no objective is given");
  return differentiated(text, name, parameters, options, SensitivityMethod::adjoint, objective);
}

SensitivityResult objective_gradient(const std::string& path, const std::vector<SensitivityParameter>& parameters,
                                     const SensitivityObjective& objective, const SimulationOptions& options) {
  return of_file(path, [&](const std::string& text) {
    return objective_gradient_of_text(text, path, parameters, objective, options);
  });
}

}  // namespace espalier
