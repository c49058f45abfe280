// Numbers and enumerations that no option can be, one field at a time: each must be refused before there is a solver.
#include <stdexcept>

#include "solver/solver_common.hpp"

namespace espalier {
namespace option_check_test {

using namespace test;

TEST(OptionCheck, WhatCannotBeIsMisuse) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<void (*)(Options&, double)> wrong = {
      [](Options& o, double) { o.kind = static_cast<Kind>(7); },
      [](Options& o, double) { o.precision = static_cast<Precision>(-1); },
      [](Options& o, double) { o.threads = -1; },
      [](Options& o, double) { o.threads = 1'000'000; },
      [](Options& o, double) { o.max_block_size = -3; },
      [](Options& o, double) { o.pivot_threshold = 1.5; },
      [](Options& o, double x) { o.pivot_threshold = x; },
      [](Options& o, double x) { o.perturbation = x; },
      [](Options& o, double) { o.refinement_steps = -1; },
      [](Options& o, double x) { o.required_backward_error = x; },
      [](Options& o, double x) { o.sharing.additional_subtrees = x; },
      [](Options& o, double) { o.host_memory_bytes = -5; },
      [](Options& o, double) { o.device_memory_bytes = -5; },
      [](Options& o, double) {
        o.device_memory_each_bytes = {1 << 20, -5};
      },
      [](Options& o, double) { o.pinned_memory_bytes = -2; },
      [](Options& o, double) { o.machine = "gpu.flops=nan"; },
      [](Options& o, double) { o.machine = "gpu.speed=1"; },
  };
  for (std::size_t k = 0; k < wrong.size(); ++k) {
    Options o = two_threads();
    wrong[k](o, nan);
    EXPECT_THROW(Solver{o}, std::invalid_argument) << k;
  }
}

// The ends of what may be given.
TEST(OptionCheck, LimitsMayBeGiven) {
  const std::vector<void (*)(Options&)> right = {
      [](Options& o) { o.pivot_threshold = 0; },
      [](Options& o) { o.pivot_threshold = 0.5; },
      [](Options& o) { o.refinement_steps = 0; },
      [](Options& o) { o.required_backward_error = 0; },
      [](Options& o) { o.sharing.additional_subtrees = 0; },
      [](Options& o) { o.refinement_target = 0; },
      [](Options& o) { o.interrupted_every = 0; },
  };
  for (std::size_t k = 0; k < right.size(); ++k) {
    Options o = two_threads();
    right[k](o);
    EXPECT_NO_THROW(Solver{o}) << k;
  }
}

}  // namespace option_check_test
}  // namespace espalier
