// The N-four-bar mechanism through its singular positions: time per step against N, and the error against the exact
// motion.
#include "dynamics/reference/four_bar.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>

#include "dynamics/constraints/redundancy.hpp"
#include "dynamics/integrators/bdf.hpp"

namespace {

using namespace espalier;
using namespace espalier::dynamics;

// theta'' = k sin theta, theta(0) = 0, theta'(0) = 1, by Runge-Kutta with steps of 1e-5 s.
double exact_angle(int loops, double until) {
  const double k = 3 * 9.81 * (3.0 * loops + 1) / (2 * (4.0 * loops + 1));
  const int steps = static_cast<int>(std::ceil(until / 1e-5));
  const double h = until / steps;
  double angle = 0, rate = 1;
  for (int i = 0; i < steps; ++i) {
    const double a1 = rate, r1 = k * std::sin(angle), a2 = rate + h / 2 * r1, r2 = k * std::sin(angle + h / 2 * a1);
    const double a3 = rate + h / 2 * r2, r3 = k * std::sin(angle + h / 2 * a2);
    const double a4 = rate + h * r3, r4 = k * std::sin(angle + h * a3);
    angle += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    rate += h / 6 * (r1 + 2 * r2 + 2 * r3 + r4);
  }
  return angle;
}

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

void run(int loops, double tolerance, double until) {
  const auto model = four_bar(loops);
  Equations equations(model->system);
  State s(model->system.sizes());
  model->system.initial(s.q, s.v);
  const double begin = now();
  RedundancyGuard guard(equations);
  guard.prepare(s);
  const double prepared = now();
  BdfOptions options;
  options.relative = options.absolute = tolerance;
  BdfIntegrator bdf(equations, options);
  bdf.start(s);
  bdf.integrate(until);
  const double seconds = now() - prepared, angle = exact_angle(loops, until);
  const Vec3 tip = four_bar_tip(*model, bdf.state().q);
  const IntegratorCounts& c = bdf.counts();
  const EquationCounts& e = equations.counts();
  fmt::print("N = {}: {} unknowns, {} redundant constraints, prepared in {:.2f} s\n", loops,
             equations.sizes().velocity + equations.sizes().constraints, guard.redundant().size(), prepared - begin);
  fmt::print(
      "  {} steps, {:.2f} s, {:.3f} ms a step ({:.2f} us per loop), {} iterations, {} factorizations, {} next to "
      "singular positions\n",
      c.steps, seconds, 1e3 * seconds / static_cast<double>(c.steps),
      1e6 * seconds / static_cast<double>(c.steps) / loops, c.newton_iterations, e.factorizations, c.crossings);
  fmt::print(
      "  assembly {:.2f} s, analysis {:.2f} s, factorization {:.2f} s, solve {:.2f} s; error of the tip {:.2e} m, "
      "|Phi| {:.1e}\n",
      e.assembly_seconds, e.analysis_seconds, e.factor_seconds, e.solve_seconds,
      std::hypot(tip.x() - std::sin(angle), tip.y() - std::cos(angle)), c.largest_position);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<int> loops = {40, 400};
  double tolerance = 1e-6, until = 1;
  CLI::App app{"N-four-bar mechanism"};
  app.add_option("--loops", loops, "numbers of loops");
  app.add_option("--tolerance", tolerance, "relative and absolute, of q and v");
  app.add_option("--until", until, "end time, s; the links are horizontal at 0.72 s for the first time");
  CLI11_PARSE(app, argc, argv);
  for (const int n : loops) run(n, tolerance, until);
  return 0;
}
