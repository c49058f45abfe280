// Which devices a text asks for, and how many GPUs the model takes. Truth: the grammar of Options::device, and limits
// of the model: nothing to share, or nothing but work to share.
#include "solver/device_choice.hpp"

#include <gtest/gtest.h>

#include "analysis/ordering.hpp"
#include "device/cuda/executor/cuda_executor.hpp"
#include "matrix/generators/generate.hpp"

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

TEST(DeviceChoice, NamedGpusAreThoseOfTheTextOrNone) {
  for (const char* text : {"cpu", "host:2", "gpu:x", "gpu:0,15", ""}) EXPECT_TRUE(named_gpus(text).empty()) << text;
  const bool any = !device::cuda::available_devices().devices.empty();
  EXPECT_EQ(named_gpus("gpu:0"), any ? std::vector<int>{0} : std::vector<int>{});
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
  const plan::GpuTime t = plan::gpu_time(tree, Kind::llt, false, plan::h200());
  const double work =
      plan::front_seconds(10, 30, false, plan::h200()) + plan::front_seconds(20, 20, false, plan::h200());
  EXPECT_LT(t.work_seconds, work) << "a front costs less among many than alone on its device";
  EXPECT_GT(t.work_seconds, 0);
  analysis::AssemblyTree half = tree;
  half.parent = {-1, -1};
  EXPECT_NEAR(plan::gpu_time(half, Kind::llt, false, plan::h200()).chain_seconds / t.chain_seconds, 20.0 / 30, 1e-12);
  EXPECT_GT(t.on(1), t.chain_seconds + t.work_seconds);
}

TEST(DeviceChoice, GpusOfNoUseAreLeftOut) {
  using device::cuda::DeviceRates;
  const DeviceChoice four{DeviceChoice::Backend::cuda, {4, 5, 6, 7}, 4, "asked for"};
  const DeviceRates fast{6e13, 2e12, ""}, half{2.9e13, 2e12, ""}, slow{1e13, 2e12, ""}, gone{0, 0, "out of order"};

  const DeviceChoice equal = leave_out(four, {fast, {5.9e13, 2e12, ""}, fast, fast});
  EXPECT_EQ(equal.gpus, four.gpus);
  EXPECT_TRUE(equal.speed.empty()) << "noise makes no difference";
  EXPECT_FALSE(equal.unequal);
  EXPECT_EQ(equal.notice, "");

  const DeviceChoice some = leave_out(four, {half, slow, gone, fast});
  EXPECT_EQ(some.gpus, (std::vector<int>{4, 7}));
  EXPECT_EQ(some.places, (std::vector<std::size_t>{0, 3}));
  EXPECT_EQ(some.speed, (std::vector<double>{0.5, 1}));
  EXPECT_EQ(some.devices, 2);
  EXPECT_TRUE(some.unequal);
  EXPECT_NE(some.notice.find("GPU 5 is left out: it has 17 %"), std::string::npos) << some.notice;
  EXPECT_NE(some.notice.find("GPU 6 is left out: out of order"), std::string::npos) << some.notice;
  EXPECT_THROW((void)leave_out(four, {gone, gone, gone, gone}), Error);
}

// Measured on two H200s: the chain of 200 small bodies gains nothing from the second one (0.94), that of 20 larger
// ones does (1.51).
TEST(DeviceChoice, SmallSystemsStayOnOneGpu) {
  base::ThreadPool pool(2);
  const auto count = [&](const std::vector<std::string>& words) {
    const SparseMatrix a = matrix::generate(matrix::parse_generator(words), &pool);
    const auto tree = analysis::build_tree(analysis::graph_of(a, pool), {}, pool);
    return fastest_count(plan::gpu_time(tree, words[0] == "kkt" ? Kind::ldlt : Kind::llt, false, plan::h200()), 4);
  };
  EXPECT_EQ(count({"kkt", "200", "3", "2", "2"}), 1);
  EXPECT_EQ(count({"kkt", "1000", "2", "1", "1"}), 1);
  EXPECT_EQ(count({"kkt", "2", "20", "8", "8"}), 1);
  EXPECT_EQ(count({"elasticity", "6"}), 1);
  EXPECT_GE(count({"kkt", "20", "20", "8", "8"}), 2);
}

}  // namespace
}  // namespace espalier::solver
