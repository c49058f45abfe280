// The public entry of frequency responses: failures become a status.
#include "espalier/model_harmonic.hpp"

#include "dynamics/guarded.hpp"
#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/read/expand.hpp"
#include "dynamics/model/run/runner.hpp"

namespace espalier {

ModelHarmonicResult model_harmonic_of_text(const std::string& text, const std::string& name,
                                           const SimulationOptions& options) {
  ModelHarmonicResult result;
  const Status failed = dynamics::guarded([&] {
    dynamics::model::Value root = dynamics::model::parse_toml(text, name);
    dynamics::model::expand(root, options.set);
    const dynamics::model::Description model = dynamics::model::read_description(root, name);
    if (!model.harmonic)
      throw Error(StatusCode::invalid_input, name + ": there is no section [harmonic], which says what to respond to");
    SimulationSummary summary;
    SimulationOptions own = options;
    own.page = false;  // a page is a simulation's
    dynamics::model::Runner runner(model, own, summary);
    try {
      if (model.statics)
        runner.run({});
      else
        runner.respond();
    } catch (const Error& error) {
      result = runner.response();
      result.status = error.status();
      return;
    }
    result = runner.response();
    if (summary.interrupted && result.status.ok())
      result.status = {StatusCode::cancelled, "the caller has stopped the search for an equilibrium", -1};
  });
  if (!failed.ok()) result.status = failed;
  return result;
}

ModelHarmonicResult model_harmonic(const std::string& path, const SimulationOptions& options) {
  std::string text;
  ModelHarmonicResult result;
  result.status = dynamics::guarded([&] { text = dynamics::read_whole_file(path); });
  return result.status.ok() ? model_harmonic_of_text(text, path, options) : result;
}

}  // namespace espalier
