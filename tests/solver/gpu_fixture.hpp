/// \file
/// Tests that need a GPU: skipped, with the reason, where none answers.
#pragma once

#include <gtest/gtest.h>

#include "device/cuda/executor/cuda_executor.hpp"
#include "espalier/espalier.hpp"

namespace espalier::test {

class OnGpu : public testing::Test {
 protected:
  void SetUp() override {
    const auto found = device::cuda::available_devices();
    if (found.devices.empty()) GTEST_SKIP() << found.reason;
  }
};

/// A solver that has factorized `a` on the first GPU and does not refine; a failure is one of the test.
inline Solver unrefined_on_gpu(const SparseMatrix& a) {
  Options o;
  o.device = "gpu:0";
  o.refinement_steps = 0;
  Solver s(o);
  EXPECT_TRUE(s.analyze(a).status.ok());
  const Status status = s.factorize(a).status;
  EXPECT_TRUE(status.ok()) << status.message;
  return s;
}

}  // namespace espalier::test
