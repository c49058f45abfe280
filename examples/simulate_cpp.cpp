// A pendulum (examples/pendulum.toml, or the model that is named) run step by step; the hinge pulls three times the
// weight when it passes the bottom.
#include <cmath>
#include <cstdio>

#include "espalier/dynamics.hpp"

int main(int argc, char** argv) {
  espalier::Simulation simulation;
  espalier::Status status = simulation.load(argc > 1 ? argv[1] : "pendulum.toml");
  double pull = 0;
  if (status.ok()) {
    status = simulation.run([&](const espalier::SimulationStep&) {
      pull = std::fmax(pull, simulation.value("hinge.force.norm"));
      return true;  // false would stop here
    });
  }
  if (!status.ok()) {
    std::fprintf(stderr, "%s\n", status.message.c_str());
    return 1;
  }
  std::printf("%ld steps, bob at (%.6f, %.6f), largest force in the hinge %.4f N\n", simulation.summary().steps,
              simulation.value("bob.position.x"), simulation.value("bob.position.y"), pull);
  return std::fabs(pull - 60) < 0.5 ? 0 : 1;
}
