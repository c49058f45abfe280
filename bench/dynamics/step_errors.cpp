// Error against step for generalized-alpha, HHT and BDF of every order on six mechanisms
// (tests/dynamics/integrators/step_cases.hpp), at the end of the motion. Prints one line for each run and writes all as
// JSON for scripts/draw_step_errors.py.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>

#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"
#include "dynamics/integrators/step_cases.hpp"

namespace {

using namespace espalier::dynamics;

struct Arguments {
  std::vector<std::string> cases, methods = {"alpha", "hht", "bdf1", "bdf2", "bdf3", "bdf4", "bdf5"};
  double radius = 0.8, hht = -0.1;
  double largest = 1e-2, smallest = 1e-6;  // steps over the length of the motion
  std::string json;
};

Arguments parse(int argc, char** argv) {
  Arguments a;
  CLI::App app{"Error against step on six mechanisms"};
  app.add_option("--cases", a.cases, "their names; all by default");
  app.add_option("--methods", a.methods, "alpha, hht, bdf1 to bdf5");
  app.add_option("--radius", a.radius, "spectral radius of generalized-alpha");
  app.add_option("--hht", a.hht, "alpha of HHT");
  app.add_option("--largest", a.largest, "longest step, over the length of the motion");
  app.add_option("--smallest", a.smallest, "shortest step, over the length of the motion");
  app.add_option("--json", a.json, "file for the results");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    std::exit(app.exit(e));
  }
  return a;
}

std::unique_ptr<Integrator> begin(const StepCase& c, Equations& equations, const Arguments& a,
                                  const std::string& method, double h) {
  if (method.rfind("bdf", 0) == 0) {
    BdfOptions o;
    o.fixed_step = h;
    o.fixed_order = std::stoi(method.substr(3));
    auto bdf = std::make_unique<BdfIntegrator>(equations, o);
    // Exact points: a start with the formulas of lower order would leave an error of h^2.
    std::vector<State> past = {c.start};
    for (int k = 1; k <= o.fixed_order; ++k)
      past.push_back(index_one_truth(*c.system, past.back(), k * h, std::min(h, c.truth)));
    bdf->start(past);
    return bdf;
  }
  AlphaOptions o;
  o.step = h;
  o.spectral_radius = a.radius;
  if (method == "hht") o.hht_alpha = a.hht;
  auto alpha = std::make_unique<GeneralizedAlpha>(equations, o);
  alpha->start(c.start);
  return alpha;
}

/// Positions, velocities and accelerations of the places that other programs know.
nlohmann::json values_at(const StepCase& c, const State& s) {
  nlohmann::json out = {nlohmann::json::array(), nlohmann::json::array(), nlohmann::json::array()};
  for (const auto& [q, v] : c.points)
    for (std::size_t k = 0; k < 3; ++k) {
      out[0].push_back(s.q[q + k]);
      out[1].push_back(s.v[v + k]);
      out[2].push_back(s.a[v + k]);
    }
  return out;
}

nlohmann::json run(const StepCase& c, const State& truth, const Arguments& a, const std::string& method, long steps) {
  const double h = c.end / static_cast<double>(steps);
  Equations equations(*c.system);
  nlohmann::json out = {{"case", c.name}, {"title", c.title}, {"method", method}, {"h", h}};
  const auto clock = std::chrono::steady_clock::now();
  try {
    const auto integrator = begin(c, equations, a, method, h);
    integrator->integrate(c.end);
    out["seconds"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - clock).count();
    const StepErrors e = step_errors(*c.system, integrator->state(), truth);
    out["values"] = values_at(c, integrator->state());
    out["truth"] = values_at(c, truth);
    out["rounded"] = integrator->counts().rounded, out["rounding"] = integrator->counts().largest_rounding;
    out["q"] = e.q, out["v"] = e.v, out["a"] = e.a, out["lambda"] = e.lambda;
    const IntegratorCounts& n = integrator->counts();
    out["steps"] = n.steps, out["iterations"] = n.newton_iterations, out["failures"] = n.newton_failures;
    out["factorizations"] = equations.counts().factorizations;
    fmt::print(
        "{:9} {:5} h {:8.2e}  q {:8.1e} v {:8.1e} a {:8.1e} l {:8.1e}  {:5.2f} passes {:5.3f} factors {:7.3f} s  "
        "rounding {:.0e}\n",
        c.name, method, h, e.q, e.v, e.a, e.lambda, double(n.newton_iterations) / double(n.steps),
        double(equations.counts().factorizations) / double(n.steps), out["seconds"].get<double>(), n.largest_rounding);
  } catch (const espalier::Error& error) {
    out["failed"] = error.what();
    fmt::print("{:9} {:5} h {:8.2e}  failed: {}\n", c.name, method, h, error.what());
  }
  std::fflush(stdout);
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments a = parse(argc, argv);
  nlohmann::json results = nlohmann::json::array();
  for (const auto make : step_cases()) {
    const StepCase c = make();
    if (!a.cases.empty() && std::find(a.cases.begin(), a.cases.end(), c.name) == a.cases.end()) continue;
    const State truth = index_one_truth(*c.system, c.start, c.end, c.truth);
    for (const std::string& method : a.methods)
      for (double decade = 1; decade < 1e9; decade *= 10)
        for (const double digit : {1.0, 2.0, 5.0}) {
          const double share = 1 / (decade * digit);
          if (share > a.largest * 1.001 || share < a.smallest * 0.999) continue;
          results.push_back(run(c, truth, a, method, std::lround(1 / share)));
        }
  }
  if (!a.json.empty()) std::ofstream(a.json) << results.dump(1) << '\n';
}
