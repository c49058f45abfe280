/// \file
/// Tests that need a GPU: skipped, with the reason, where none answers.
#pragma once

#include <gtest/gtest.h>

#include "device/cuda/cuda_executor.hpp"

namespace espalier::test {

class OnGpu : public testing::Test {
 protected:
  void SetUp() override {
    const auto found = device::cuda::available_devices();
    if (found.devices.empty()) GTEST_SKIP() << found.reason;
  }
};

}  // namespace espalier::test
