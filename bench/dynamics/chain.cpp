// The chain of rigid bars that Exudyn is measured with (exudyn_chain.py): N bars, N revolute joints, generalized-alpha
// with constant step. Prints the wall time, how it splits, and writes the end positions for the comparison.
#include "dynamics/reference/chain.hpp"

#include <fmt/format.h>

#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "alpha_arguments.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/initial.hpp"

namespace {

using namespace espalier;
using namespace espalier::dynamics;

struct Arguments : bench::AlphaArguments {
  Arguments() { tolerance = 1e-9; }
  int bars = 400;
  std::optional<double> refactor_rate;
  double constraints = 1e-12;  // of Phi, m
  double bdf = 0;              // > 0: BDF with this tolerance instead
};

Arguments parse(int argc, char** argv) {
  Arguments a;
  CLI::App app{"Chain of rigid bars by generalized-alpha"};
  app.add_option("--bars", a.bars, "number of bars and of revolute joints");
  app.add_option("--refactor-rate", a.refactor_rate,
                 "a slower convergence rate asks for a new factor (without: by cost)");
  app.add_option("--constraints", a.constraints, "tolerance of the position constraints");
  app.add_option("--bdf", a.bdf, "take BDF of variable step and order with this tolerance");
  a.add_to(app);
  bench::parse_or_exit(app, argc, argv);
  return a;
}

std::unique_ptr<Integrator> make_integrator(Equations& equations, const Arguments& a) {
  if (a.bdf > 0) {
    BdfOptions o;
    o.relative = o.absolute = a.bdf;
    return std::make_unique<BdfIntegrator>(equations, o);
  }
  AlphaOptions o = a.options();
  o.constraint_tolerance = a.constraints;
  o.refactor_rate = a.refactor_rate;
  return std::make_unique<GeneralizedAlpha>(equations, o);
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments a = parse(argc, argv);
  const auto chain = make_chain(a.bars);
  const auto begin = std::chrono::steady_clock::now();
  Equations equations(chain->system);
  State start(chain->system.sizes());
  chain->system.initial(start.q, start.v);
  make_consistent(equations, start);
  const auto integrator = make_integrator(equations, a);
  integrator->start(start);
  const double energy = chain->system.energy(start.view()).total();
  integrator->integrate(a.until);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const State& end = integrator->state();
  const Levels levels = equations.levels(end.view());
  const EquationCounts& e = equations.counts();
  const IntegratorCounts& c = integrator->counts();
  fmt::print("{} bars, {} steps: {:.3f} s, {} iterations, {} factorizations\n", a.bars, c.steps, seconds,
             c.newton_iterations, e.factorizations);
  fmt::print("assembly {:.3f} s, analysis {:.3f} s, factorization {:.3f} s, solve {:.3f} s\n", e.assembly_seconds,
             e.analysis_seconds, e.factor_seconds, e.solve_seconds);
  fmt::print("constraints: position {:.1e}, velocity {:.1e}, acceleration {:.1e}; energy defect {:.3e} J\n",
             levels.position, levels.velocity, levels.acceleration, chain->system.energy(end.view()).total() - energy);
  if (a.json.empty()) return 0;
  nlohmann::json out = {{"seconds", seconds},
                        {"steps", c.steps},
                        {"iterations", c.newton_iterations},
                        {"factorizations", e.factorizations},
                        {"assembly_seconds", e.assembly_seconds},
                        {"analysis_seconds", e.analysis_seconds},
                        {"factor_seconds", e.factor_seconds},
                        {"solve_seconds", e.solve_seconds}};
  for (const RigidBody* bar : chain->bars) {
    const Vec3 p = bar->position(end.q);
    out["positions"].push_back({p.x(), p.y(), p.z()});
  }
  std::ofstream(a.json) << out.dump() << "\n";
  return 0;
}
