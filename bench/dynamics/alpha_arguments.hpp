/// \file
/// Arguments of the programs that Exudyn is measured with.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <string>

#include "dynamics/integrators/generalized_alpha.hpp"

namespace espalier::bench {

/// Generalized-alpha with constant step.
struct AlphaArguments {
  int steps = 1000;
  double until = 1;
  double radius = 0.8;
  double tolerance = 1e-8;  ///< of Newton, relative to 1 m and 1 rad
  std::string json;

  void add_to(CLI::App& app) {
    app.add_option("--steps", steps, "number of steps");
    app.add_option("--until", until, "end time, s");
    app.add_option("--radius", radius, "spectral radius at infinity");
    app.add_option("--tolerance", tolerance, "of Newton's iteration, m and rad");
    app.add_option("--json", json, "file for times, counts and end positions");
  }
  [[nodiscard]] dynamics::AlphaOptions options() const {
    dynamics::AlphaOptions o;
    o.step = until / steps;
    o.spectral_radius = radius;
    o.tolerance = tolerance;
    return o;
  }
};

/// Ends the program where the arguments are none of its own.
inline void parse_or_exit(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    std::exit(app.exit(e));
  }
}

}  // namespace espalier::bench
