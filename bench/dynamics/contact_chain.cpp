// The roller chain of models/sprocket.toml, lifted by contact with the teeth of its sprocket, beside the same chain
// whose pins run on a guide, the path of their pitch line, and whose free end is hauled. Both have the same links,
// joints, friction, weight, motion, integrator and step. The chain on its sprocket runs twice: with analyses that
// follow the changes of the pattern (Solver::analyze_change) and with full analyses.
//   build/release/bench/espalier_bench_contact_chain [--links 60] [--until 0.2] [--threads 2] [--device gpu:0]
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "espalier/dynamics.hpp"

namespace {

using namespace espalier;

struct Arguments {
  std::string model = "models/sprocket.toml", json, device = "cpu";
  std::vector<std::string> set;
  int links = 60, rounds = 1;
  double until = 0.2;
  int threads = 2;
};

Arguments parse(int argc, char** argv) {
  Arguments a;
  CLI::App app{"A roller chain on its sprocket beside the same chain on a guide"};
  app.add_option("--model", a.model, "models/sprocket.toml")->check(CLI::ExistingFile);
  app.add_option("--links", a.links, "of the chain; 18 of them are not on the weight's side")
      ->check(CLI::Range(20, 1000));
  app.add_option("--until", a.until, "end of the runs, s")->check(CLI::PositiveNumber);
  app.add_option("--threads", a.threads, "")->check(CLI::Range(1, 1024));
  app.add_option("--rounds", a.rounds, "each run so often, in turns; the fastest one counts")
      ->check(CLI::Range(1, 100));
  app.add_option("--device", a.device, "of the solver, as of `espalier simulate`: cpu, gpu:0");
  app.add_option("--set", a.set, "PATH=VALUE of the model, of the runs on the sprocket; may be repeated");
  app.add_option("--json", a.json, "write the figures to this file, too");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    std::exit(app.exit(e));
  }
  return a;
}

/// The text without the sections (header to header) whose header contains one of `names`.
std::string without(const std::string& text, const std::vector<std::string>& names) {
  std::istringstream in(text);
  std::string out, line, pending;
  bool kept = true;
  while (std::getline(in, line)) {
    // "[[repeat]]" belongs to what is repeated.
    if (line.rfind("[[repeat]]", 0) == 0 || (!pending.empty() && line.rfind('[', 0) != 0)) {
      pending += line + "\n";
      continue;
    }
    if (line.rfind('[', 0) == 0)
      kept = std::none_of(names.begin(), names.end(),
                          [&](const std::string& n) { return line.find(n) != std::string::npos; });
    if (kept) out += pending + line + "\n";
    pending.clear();
  }
  return out;
}

/// Pins of the same chain on a guide instead of rollers on teeth. It goes up on the left, over the top and down on the
/// right: pins stay on its left, outside. The free end is pulled down as fast as the sprocket would take it.
std::string on_guide(const std::string& text) {
  return without(text, {"sprocket", "surfaces", "contacts", "shaft", "motor", "output"}) + R"toml(
[[repeat]]
to = "links - 1"
[repeat.forces."guide{i}"]
type = "guide"
a = { body = "ground" }
b = { body = "link{i}", point = ["-pitch/2", 0, 0] }
start = ["-radius", "-2*links*pitch", 0]
direction = "pi/2"
lengths = ["2*links*pitch", "pi*radius", "2*links*pitch"]
curvatures = [0, "-1/radius", 0]
stiffness = "stiffness"
damping = 20
smoothing = 1e-6
friction = 0.1
slip_speed = 0.01

[joints.haul]
type = "prescribed"
direction = "y"
a = { body = "ground" }
b = { body = "link0" }
motion = "-omega*radius*ramp(t, 0.02, 0.08)"
from = "initial"

[output]
quantities = ["weight.position.y", "weight.velocity.y", "hook.force.norm"]
)toml";
}

struct Run {
  std::string name;
  std::string text;
  bool full = false, guided = false;
  SimulationSummary summary;
  double seconds = 1e300, height = 0;

  void go(const Arguments& a) {
    SimulationOptions o;
    o.set = {fmt::format("parameters.weight_side={}", a.links - 18), "output.csv_interval=false"};
    o.until = a.until;
    o.solver = {{"threads", std::to_string(a.threads)}, {"device", a.device}};
    if (!guided) o.set.insert(o.set.end(), a.set.begin(), a.set.end());
    // Kept analyses are looked up by their pattern, not followed. This folder is not there: all are made anew.
    if (full) o.analyses = "/nonexistent/espalier";
    Simulation s(o);
    Status status = s.load_text(text, a.model);
    if (status.ok()) status = s.run();
    if (!status.ok()) {
      fmt::print(stderr, "{}: {}\n", name, status.message);
      std::exit(1);
    }
    const SimulationPhases& p = s.summary().phases;
    if (const double own = p.total - p.setup; own < seconds) {
      seconds = own;
      summary = s.summary();
      height = s.value("weight.position.y");
    }
  }

  [[nodiscard]] nlohmann::json record() const {
    const SimulationSummary& s = summary;
    return {{"name", name},
            {"seconds", seconds},
            {"steps", s.steps},
            {"newton_iterations", s.newton_iterations},
            {"analyses", s.analyses},
            {"followed", s.followed},
            {"analysis_seconds", s.phases.analysis},
            {"factorizations", s.factorizations},
            {"weight_height", height}};
  }
};

}  // namespace

int main(int argc, char** argv) {
  const Arguments a = parse(argc, argv);
  std::ifstream in(a.model);
  std::stringstream text;
  text << in.rdbuf();
  std::vector<Run> runs(3);
  runs[0].name = "guide";
  runs[0].text = on_guide(text.str());
  runs[0].guided = true;
  runs[1].name = "sprocket, analyses follow";
  runs[2].name = "sprocket, full analyses";
  runs[1].text = runs[2].text = text.str();
  runs[2].full = true;
  for (int round = 0; round < a.rounds; ++round)
    for (Run& r : runs) r.go(a);
  fmt::print("{} links, to {} s, {} threads, {}\n", a.links, a.until, a.threads, a.device);
  fmt::print("{:<26} {:>8} {:>7} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}\n", "", "seconds", "steps", "Newton",
             "factors", "analyses", "followed", "their ms", "share %", "assembly", "solve");
  nlohmann::json records = nlohmann::json::array();
  for (const Run& r : runs) {
    const SimulationSummary& s = r.summary;
    fmt::print("{:<26} {:>8.2f} {:>7} {:>9} {:>9} {:>9} {:>9} {:>9.2f} {:>9.3f} {:>9.2f} {:>9.2f}\n", r.name, r.seconds,
               s.steps, s.newton_iterations, s.factorizations, s.analyses, s.followed, 1e3 * s.phases.analysis,
               100 * s.phases.analysis / r.seconds, s.phases.assembly, s.phases.solve);
    records.push_back(r.record());
  }
  fmt::print("sprocket over guide: {:.2f}; analysis followed over full: {:.2f}\n", runs[1].seconds / runs[0].seconds,
             runs[1].summary.phases.analysis / runs[2].summary.phases.analysis);
  if (!a.json.empty()) std::ofstream(a.json) << records.dump(2) << "\n";
  // The answers: the weight hangs where the pitch line says (polygon and slip: a tenth of a pitch).
  const double apart = std::abs(runs[0].height - runs[1].height), twice = std::abs(runs[1].height - runs[2].height);
  fmt::print(
      "height of the weight: {:.6f} m on the guide, {:.6f} m on the sprocket, which differ by {:.2e}; with full "
      "analyses {:.2e}\n",
      runs[0].height, runs[1].height, apart, twice);
  if (apart > 1.3e-3 || twice > 1e-6) {
    fmt::print(stderr, "the answers do not agree\n");
    return 1;
  }
  return 0;
}
