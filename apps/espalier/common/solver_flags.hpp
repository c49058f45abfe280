/// \file
/// The options of the solver on the command line, the same for every subcommand that uses it.
#pragma once

#include <map>
#include <string>

#include "espalier/solver.hpp"

namespace CLI {
class App;
}

namespace espalier::cli {

/// Adds --kind, --precision, --device and so on to a command and turns what was given into Options.
class SolverFlags {
 public:
  void add_to(CLI::App& command);
  /// @throws Error(invalid_input) naming the option and what it takes
  [[nodiscard]] Options options() const;
  /// What was given, by name.
  [[nodiscard]] const std::map<std::string, std::string>& values() const { return values_; }

 private:
  std::map<std::string, std::string> values_;  // by key of solver::set_option
};

}  // namespace espalier::cli
