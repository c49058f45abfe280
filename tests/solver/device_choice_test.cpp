// Which devices a text asks for, and how many GPUs the model takes. Truth: the grammar of Options::device, and limits
// of the model: nothing to share, or nothing but work to share.
#include "solver/device_choice.hpp"

#include <gtest/gtest.h>

#include "device/cuda/cuda_executor.hpp"

namespace espalier::solver {
namespace {

StatusCode refusal(const std::string& device) {
  Options options;
  options.device = device;
  try {
    (void)choose_device(options, {});
  } catch (const Error& e) {
    return e.status().code;
  }
  return StatusCode::ok;
}

TEST(DeviceChoice, TextsThatAreNoDeviceAreRefused) {
  for (const char* text : {"gpu:", "gpu:0,", "gpu:0,0", "gpu:x", "gpu:0;1",
                           "gpu:0,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16", "host:0", "gpus", ""})
    EXPECT_EQ(refusal(text), StatusCode::invalid_input) << text;
  EXPECT_EQ(refusal("cpu"), StatusCode::ok);
  EXPECT_EQ(refusal("host:3"), StatusCode::ok);
}

TEST(DeviceChoice, GpusThatAreNotThereAreNamed) {
  EXPECT_EQ(refusal("gpu:0,15"), StatusCode::device_error);
  if (device::cuda::available_devices().devices.empty()) {
    EXPECT_EQ(refusal("gpu:all"), StatusCode::device_error);
  }
}

TEST(DeviceChoice, ModelTakesAsManyGpusAsHelp) {
  EXPECT_EQ(fastest_count({1.0, 0.0}, 4), 4) << "work alone is shared by all";
  EXPECT_EQ(fastest_count({0.0, 1e-3}, 4), 1) << "a chain is not shared";
  EXPECT_EQ(fastest_count({1e-4, 1e-3}, 4), 1) << "a gain of less than a tenth is none";
  EXPECT_EQ(fastest_count({1.0, 0.0}, 1), 1);
}

TEST(DeviceChoice, ModelOfAChainOfTwoFronts) {
  // Front 0: 10 pivots, 20 rows; its parent, front 1: 20 pivots. The chain has 30 pivots, twice as much work is no
  // chain.
  analysis::AssemblyTree tree;
  tree.n = 30;
  tree.first = {0, 10, 30};
  tree.parent = {1, -1};
  tree.row_ptr = {0, 20, 20};
  const analysis::GpuTime t = analysis::gpu_time(tree, false, false);
  const double work = analysis::front_seconds(10, 30, false, analysis::CostModel::gpu) +
                      analysis::front_seconds(20, 20, false, analysis::CostModel::gpu);
  EXPECT_DOUBLE_EQ(t.work_seconds, work);
  analysis::AssemblyTree half = tree;
  half.parent = {-1, -1};
  EXPECT_NEAR(analysis::gpu_time(half, false, false).chain_seconds / t.chain_seconds, 20.0 / 30, 1e-12);
  EXPECT_GT(t.on(1), t.chain_seconds + t.work_seconds);
}

}  // namespace
}  // namespace espalier::solver
