// A pendulum from a text, run step by step; the hinge pulls three times the weight when it passes the bottom.
#include <cmath>
#include <cstdio>

#include "espalier/dynamics.hpp"

int main() {
  const char* model = R"(
gravity = [0, -10, 0]
[bodies.bob]
type = "rigid"
mass = 2
inertia = [1e-9, 1e-9, 1e-9]
position = [1, 0, 0]
[joints.hinge]
type = "revolute"
bodies = ["ground", "bob"]
at = [0, 0, 0]
[integrator]
relative = 1e-8
end = 1
)";
  espalier::Simulation simulation;
  espalier::Status status = simulation.load_text(model, "pendulum");
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
