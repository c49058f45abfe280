/// \file
/// Many systems of patterns of their own, on the cores and on a device.
#pragma once

#include <string>

#include "espalier/types.hpp"

namespace espalier::bench {

struct ManyPatterns {
  Index count = 10000;
  Index least = 100, most = 2000;  ///< unknowns
  int threads = 0;
  std::string device = "gpu:0";
};

/// Times solve_systems(), checks all answers, prints both. @returns 0 where all are right
int run_many_patterns(const ManyPatterns& wish);

}  // namespace espalier::bench
