// The public entry: failures become a Status.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/output_file.hpp"
#include "dynamics/guarded.hpp"
#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/decks/take.hpp"
#include "dynamics/model/read/expand.hpp"
#include "dynamics/model/robots/robots.hpp"
#include "dynamics/model/run/runner.hpp"
#include "espalier/dynamics.hpp"

namespace espalier {

using dynamics::model::Runner;
using dynamics::model::Value;

struct Simulation::Impl {
  SimulationOptions options;
  SimulationSummary summary;
  std::unique_ptr<Runner> runner;

  /// Runs `action`; what it throws becomes the status of the summary.
  template <class Action>
  Status guard(const Action& action) {
    summary.status = {};
    return summary.status = dynamics::guarded(action);
  }

  [[nodiscard]] Runner& loaded() const {
    if (!runner) throw std::logic_error("load() was not called, or failed");
    return *runner;
  }
};

Simulation::Simulation(SimulationOptions options) : impl_(std::make_unique<Impl>()) {
  if (options.dump_every < 1 || options.dump_count < 1)
    throw std::invalid_argument("SimulationOptions: dump_every and dump_count must be at least 1");
  if (!(options.interrupted_every >= 0 && options.interrupted_every <= 3600))
    throw std::invalid_argument("SimulationOptions: interrupted_every must be from 0 to 3600 seconds");
  if (!(options.frame_interval == -1 || (options.frame_interval >= 0 && std::isfinite(options.frame_interval))))
    throw std::invalid_argument("SimulationOptions: frame_interval must be -1, 0 or a positive time");
  if (options.ranks.size() > 1 && !options.analyses.empty())
    throw std::invalid_argument("SimulationOptions: ranks do not keep analyses in a folder; leave out one of the two");
  if (options.ranks.rank() != 0)
    throw std::invalid_argument("SimulationOptions: rank 0 makes simulations; the others call serve_simulations()");
  impl_->options = std::move(options);
}
Simulation::~Simulation() = default;
Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;

Status Simulation::load(const std::string& path) {
  std::string text;
  if (!dynamics::model::robots::is_robot_file(path)) {
    const Status status = impl_->guard([&] { text = dynamics::model::read_model_text(path); });
    return status.ok() ? load_text(text, path) : status;
  }
  dynamics::model::robots::RobotText robot;
  Status read =
      impl_->guard([&] { robot = dynamics::model::robots::robot_as_model(dynamics::read_whole_file(path), path); });
  if (!read.ok()) return read;
  Status loaded = load_text(robot.text, path);
  std::vector<std::string>& notices = impl_->summary.notices;
  notices.insert(notices.begin(), robot.notices.begin(), robot.notices.end());
  return loaded;
}

Status Simulation::load_text(const std::string& text, const std::string& name) {
  impl_->runner.reset();
  impl_->summary = {};
  return impl_->guard([&] {
    for (const std::string* folder : {&impl_->options.out, &impl_->options.dump, &impl_->options.analyses})
      base::check_path(*folder);
    Value root = dynamics::model::parse_toml(text, name);
    dynamics::model::expand(root, impl_->options.set);
    dynamics::model::Description model = dynamics::model::read_description(root, name);
    model.text = text;
    impl_->runner = std::make_unique<Runner>(std::move(model), impl_->options, impl_->summary);
  });
}

Status Simulation::run(const SimulationObserver& observer) {
  Runner& runner = impl_->loaded();
  Status status = impl_->guard([&] { runner.run(observer); });
  auto& p = impl_->summary.phases;
  p.other = std::max(0.0, p.total - p.setup - p.assembly - p.analysis - p.factorization - p.solve - p.output);
  runner.write_page(status);
  return status;
}

Status Simulation::step_to(double t, const SimulationObserver& observer) {
  Runner& runner = impl_->loaded();
  return impl_->guard([&] { runner.step_to(t, observer); });
}

std::string Simulation::save() { return impl_->loaded().save(); }
Status Simulation::restore(std::string_view state) {
  Runner& runner = impl_->loaded();
  return impl_->guard([&] { runner.restore(state); });
}

std::vector<SimulationQuantity> Simulation::quantities() const { return impl_->loaded().all_quantities(); }
const SimulationSeries& Simulation::series() const { return impl_->loaded().series(); }
SimulationMesh Simulation::mesh() const { return impl_->loaded().kept_frames().mesh(); }
SimulationFrame Simulation::frame() const { return impl_->loaded().frame(); }
const std::vector<SimulationFrame>& Simulation::frames() const { return impl_->loaded().kept_frames().frames(); }
std::string Simulation::page() const { return impl_->loaded().page(impl_->summary.status); }
const SimulationSummary& Simulation::summary() const { return impl_->summary; }
Status Simulation::write_trace(const std::string& path) const {
  const Runner& runner = impl_->loaded();
  try {
    runner.write_trace(path);
  } catch (const Error& error) {
    return error.status();
  }
  return {};
}
std::vector<SimulationInput> Simulation::inputs() const {
  std::vector<SimulationInput> list;
  for (const auto& [name, value] : impl_->loaded().inputs()) list.push_back({name, value});
  return list;
}
void Simulation::set_input(const std::string& name, double value) { impl_->loaded().set_input(name, value); }
double Simulation::time() const { return impl_->loaded().time(); }
double Simulation::end_time() const { return impl_->loaded().end_time(); }
double Simulation::value(const std::string& quantity) const { return impl_->loaded().value(quantity); }

}  // namespace espalier
