/// \file
/// Tests that need a GPU: skipped, with the reason, where none answers.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "device/registry.hpp"
#include "espalier/espalier.hpp"

namespace espalier::test {

/// Empty: a GPU answers.
inline std::string why_no_gpu() {
  const device::Backend* gpus = device::registry().find("gpu");
  if (gpus == nullptr) return std::string(device::registry().find_left_out("gpu")->reason);
  const device::FoundDevices found = gpus->find();
  return found.names.empty() ? found.reason : std::string();
}

inline bool has_gpus(int count) {
  const device::Backend* gpus = device::registry().find("gpu");
  return gpus != nullptr && static_cast<int>(gpus->find().names.size()) >= count;
}

class OnGpu : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string why = why_no_gpu(); !why.empty()) GTEST_SKIP() << why;
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
