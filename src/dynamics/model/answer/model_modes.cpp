// The public entry of modes over a number of a model: failures become a status.
#include "espalier/model_modes.hpp"

#include <fmt/format.h>

#include <cmath>

#include "base/stage.hpp"
#include "dynamics/guarded.hpp"
#include "dynamics/mesh/read/formats.hpp"
#include "dynamics/model/decks/take.hpp"
#include "dynamics/model/read/expand.hpp"
#include "dynamics/model/run/runner.hpp"

namespace espalier {

namespace {

/// The speed of rotation may be a parameter of the model, on which drives depend as well: it is that which changes
/// then.
std::string source_of(const std::string& text, const std::string& name, const std::string& number) {
  if (number != "initial.rotation.speed") return number;
  const dynamics::model::Value root = dynamics::model::parse_toml(text, name);
  const dynamics::model::Value* initial = root.find("initial");
  const dynamics::model::Value* rotation = initial == nullptr ? nullptr : initial->find("rotation");
  if (rotation == nullptr)
    throw Error(StatusCode::invalid_input,
                name +
                    ": has no [initial] rotation, whose speed would change; add rotation = { axis = [..], speed = .. "
                    "} to [initial], or say which other number is to change");
  const dynamics::model::Value* speed = rotation->find("speed");
  const dynamics::model::Value* parameters = root.find("parameters");
  if (speed == nullptr || speed->type != dynamics::model::Value::Type::text || parameters == nullptr) return number;
  return parameters->find(speed->text) != nullptr ? "parameters." + speed->text : number;
}

ModelModesPoint modes_at(const std::string& text, const std::string& name, const std::string& number, double value,
                         int count, SimulationOptions options) {
  constexpr int kCount = 6;
  if (!number.empty()) options.set.push_back(fmt::format("{}={}", number, value));
  options.out.clear();
  dynamics::model::Value root = dynamics::model::parse_toml(text, name);
  dynamics::model::expand(root, options.set);
  if (root.find("integrator") == nullptr && root.find("statics") == nullptr &&
      !dynamics::is_deck(name))  // nothing is run
    set_value(root, "integrator.end", dynamics::model::parse_assignment("end=1").value);
  dynamics::model::Description model = dynamics::model::read_description(root, name);
  if (count > 0) model.initial.modes = count;
  if (model.initial.modes == 0) model.initial.modes = kCount;
  model.harmonic.reset();
  SimulationSummary summary;
  dynamics::model::Runner runner(model, options, summary);
  if (model.statics) runner.run({});
  if (summary.interrupted) throw Error(StatusCode::cancelled, "the caller has stopped the search for an equilibrium");
  return {value, summary.modes, summary.notices};
}

}  // namespace

ModelModesResult model_modes_of_text(const std::string& text, const std::string& name, const std::string& number,
                                     const std::vector<double>& values, int count, const SimulationOptions& options) {
  ModelModesResult result;
  result.number = number;
  const Status failed = dynamics::guarded([&] {
    if (values.empty()) throw Error(StatusCode::invalid_input, "modes: no value of '" + number + "' is given");
    const std::string source = source_of(text, name, number);
    // Where there is one value alone, what is done for it counts.
    const bool several = values.size() > 1;
    base::Stage stage("modes", static_cast<double>(values.size()), several ? "points" : "");
    for (const double value : values) {
      if (options.interrupted && options.interrupted()) throw Error(StatusCode::cancelled, "the caller has stopped it");
      try {
        result.points.push_back(modes_at(text, name, source, value, count, options));
        stage.add(1);
      } catch (const Error& error) {
        Status status = error.status();
        if (!number.empty()) status.message = fmt::format("{} = {:g}: {}", number, value, status.message);
        throw Error(status);
      }
    }
  });
  if (!failed.ok()) result.status = failed;
  return result;
}

ModelModesResult model_modes(const std::string& path, const std::string& number, const std::vector<double>& values,
                             int count, const SimulationOptions& options) {
  std::string text;
  ModelModesResult result;
  result.status = dynamics::guarded([&] { text = dynamics::model::read_model_text(path); });
  return result.status.ok() ? model_modes_of_text(text, path, number, values, count, options) : result;
}

std::string modes_table(const ModelModesResult& result) {
  const bool sweep = !result.number.empty();
  std::string text = sweep ? result.number + "," : "";
  text += "mode,frequency,damping_ratio,growth,whirl,standing_frequency\n";
  for (const ModelModesPoint& p : result.points)
    for (std::size_t k = 0; k < p.modes.size(); ++k) {
      const SimulationMode& m = p.modes[k];
      if (sweep) text += fmt::format("{},", p.value);
      text += fmt::format("{},{},{},{},{},{}\n", k + 1, m.frequency, m.damping_ratio, m.growth, m.whirl,
                          std::isnan(m.standing_frequency) ? "" : fmt::format("{}", m.standing_frequency));
    }
  return text;
}

}  // namespace espalier
