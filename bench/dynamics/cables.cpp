// Hanging cables that Exudyn is measured with (exudyn_cables.py): ANCF cables hinged at one end, released from the
// horizontal, generalized-alpha with constant step. Prints the wall time, how it splits, and writes the end positions.
#include <fmt/format.h>

#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>

#include "alpha_arguments.hpp"
#include "dynamics/bodies/flexible_frame.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/joints/joint.hpp"

namespace {

using namespace espalier;
using namespace espalier::dynamics;

struct Arguments : bench::AlphaArguments {
  int cables = 32;
  int elements = 8;
};

Arguments parse(int argc, char** argv) {
  Arguments a;
  CLI::App app{"Hanging ANCF cables by generalized-alpha"};
  app.add_option("--cables", a.cables, "number of cables");
  app.add_option("--elements", a.elements, "elements of each");
  a.add_to(app);
  bench::parse_or_exit(app, argc, argv);
  return a;
}

/// Steel-like rubber: 1 m long, radius 5 mm, E = 1e8 Pa, 1000 kg/m^3; cable k hangs k / 10 m beside the first.
std::vector<FlexibleBody*> add_cables(AssembledSystem& system, const Arguments& a) {
  const double area = 3.14159265358979324 * 0.005 * 0.005;
  std::vector<FlexibleBody*> cables;
  for (int k = 0; k < a.cables; ++k) {
    const double z = 0.1 * k;
    FlexibleBody& cable = system.add(make_cable_body("cable " + std::to_string(k + 1), {0, 0, z}, {1, 0, z}, a.elements,
                                                     {1e8 * area, 1e8 * area * 0.005 * 0.005 / 4, 1000 * area}));
    cable.set_gravity({0, -9.81, 0});
    cables.push_back(&cable);
  }
  for (FlexibleBody* cable : cables)
    system.add(spherical_joint("hinge of " + cable->name(),
                               std::make_unique<GroundFrame>(Eigen::Map<const Vec3>(cable->reference().data())),
                               make_node_frame(*cable, 0)));
  system.finish();
  return cables;
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments a = parse(argc, argv);
  AssembledSystem system;
  const std::vector<FlexibleBody*> cables = add_cables(system, a);
  const auto begin = std::chrono::steady_clock::now();
  Equations equations(system);
  State start(system.sizes());
  system.initial(start.q, start.v);
  make_consistent(equations, start);
  GeneralizedAlpha integrator(equations, a.options());
  integrator.start(start);
  integrator.integrate(a.until);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const EquationCounts& e = equations.counts();
  const IntegratorCounts& c = integrator.counts();
  AssemblyTimes times;
  for (const FlexibleBody* cable : cables) {
    times.force_seconds += cable->times().force_seconds;
    times.tangent_seconds += cable->times().tangent_seconds;
    times.forces += cable->times().forces;
    times.tangents += cable->times().tangents;
  }
  fmt::print("{} cables, {} steps: {:.3f} s, {} iterations, {} factorizations\n", a.cables, c.steps, seconds,
             c.newton_iterations, e.factorizations);
  fmt::print(
      "assembly {:.3f} s (cables: {} forces {:.3f} s, {} tangents {:.3f} s), factorization {:.3f} s, solve {:.3f} s\n",
      e.assembly_seconds, times.forces, times.force_seconds, times.tangents, times.tangent_seconds, e.factor_seconds,
      e.solve_seconds);
  if (a.json.empty()) return 0;
  nlohmann::json out = {{"seconds", seconds},
                        {"iterations", c.newton_iterations},
                        {"factorizations", e.factorizations},
                        {"assembly_seconds", e.assembly_seconds}};
  const State& end = integrator.state();
  for (const FlexibleBody* cable : cables) {
    const double* r = end.q.data() + cable->configuration(2 * a.elements);
    out["positions"].push_back({r[0], r[1], r[2]});
  }
  std::ofstream(a.json) << out.dump() << "\n";
  return 0;
}
