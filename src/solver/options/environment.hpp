/// \file
/// Options from the environment, for programs that have no place for them.
#pragma once

#include "espalier/solver.hpp"

namespace espalier::solver {

/// What ESPALIER_OPTIONS says: "device=gpu:0;threads=8;log=stderr", names and values as in set_option(), and where log
/// lines go (nowhere, or stderr).
struct Environment {
  Options options;
  bool log_to_stderr = false;
  Status status;  ///< invalid_input, naming the variable, when it is not understood; options are `defaults` then
};
/// @param defaults  the options that it does not name
Environment read_environment(const Options& defaults = {});

}  // namespace espalier::solver
