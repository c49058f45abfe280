// Which devices a text asks for, and how many GPUs the model takes. Truth: the grammar of Options::device, and limits
// of the model: nothing to share, or nothing but work to share.
#include "solver/options/device_choice.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "analysis/ordering.hpp"
#include "matrix/generators/generate.hpp"
#include "solver/fake_backend.hpp"
#include "solver/options/device_text.hpp"

namespace espalier::solver {
namespace device_choice_test {

DeviceChoice chosen(const Options& options, const device::Registry& registry = device::registry()) {
  analysis::AssemblyTree tree;
  tree.n = 1;
  tree.first = {0, 1};
  tree.parent = {-1};
  tree.row_ptr = {0, 0};
  device::PlanWish wish;
  wish.threads = 16;
  return choose_device(options, registry, tree, wish);
}

Status refusal(const std::string& device) {
  Options options;
  options.device = device;
  try {
    (void)chosen(options);
  } catch (const Error& e) {
    return e.status();
  }
  return {};
}

TEST(DeviceChoice, TextsThatAreNoDeviceAreRefused) {
  for (const char* text : {"gpu:", "gpu:0,", "gpu:0,0", "gpu:x", "gpu:0;1", "gpu",
                           "gpu:0,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16", "host:0", "host", "gpus", "cpu:0", ""}) {
    EXPECT_EQ(refusal(text).code, StatusCode::invalid_input) << text;
    EXPECT_FALSE(is_device(text)) << text;
  }
  for (const char* text : {"cpu", "host:3"}) EXPECT_TRUE(refusal(text).ok()) << text;
  for (const char* text : {"auto", "cpu", "host:3", "host:3,2", "gpu:0", "gpu:all"})
    EXPECT_TRUE(is_device(text)) << text;
}

TEST(DeviceChoice, DevicesThatAreNotThereAreNamed) {
  EXPECT_EQ(refusal("gpu:0,15").code, StatusCode::device_error);
  const device::Backend* gpus = device::registry().find("gpu");
  if (gpus == nullptr) {
    EXPECT_NE(refusal("gpu:0").message.find("this build of espalier has no CUDA backend"), std::string::npos)
        << refusal("gpu:0").message;
  }
  if (gpus == nullptr || gpus->find().names.empty()) {
    EXPECT_EQ(refusal("gpu:all").code, StatusCode::device_error);
  }
}

TEST(DeviceChoice, NamedDevicesAreThoseOfTheTextOrNone) {
  const device::Registry& registry = device::registry();
  for (const char* text : {"auto", "gpu:x", "gpu:0,15", ""}) EXPECT_FALSE(named_devices(text, registry)) << text;
  const device::Backend* gpus = registry.find("gpu");
  const bool any = gpus != nullptr && !gpus->find().names.empty();
  EXPECT_EQ(named_devices("gpu:0", registry).has_value(), any);
  const auto hosts = named_devices("host:2", registry);
  ASSERT_TRUE(hosts);
  EXPECT_EQ(hosts->numbers, (std::vector<int>{0, 1}));
}

device::PredictedTime shared(double work, double chain) { return {0, true, {work, chain}}; }

TEST(DeviceChoice, ModelTakesAsManyGpusAsHelp) {
  EXPECT_EQ(fastest_count(shared(1.0, 0.0), 4), 4) << "work alone is shared by all";
  EXPECT_EQ(fastest_count(shared(0.0, 1e-3), 4), 1) << "a chain is not shared";
  EXPECT_EQ(fastest_count(shared(1e-4, 1e-3), 4), 1) << "a gain of less than a tenth is none";
  EXPECT_EQ(fastest_count(shared(1.0, 0.0), 1), 1);
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

TEST(DeviceChoice, DevicesOfNoUseAreLeftOut) {
  using device::DeviceRates;
  const test::FakeBackend backend;
  DeviceChoice four;
  four.backend = &backend;
  four.numbers = {4, 5, 6, 7};
  const DeviceRates fast{6e13, 2e12, ""}, half{2.9e13, 2e12, ""}, slow{1e13, 2e12, ""}, gone{0, 0, "out of order"};

  const DeviceChoice equal = leave_out(four, {fast, {5.9e13, 2e12, ""}, fast, fast});
  EXPECT_EQ(equal.numbers, four.numbers);
  EXPECT_TRUE(equal.speed.empty()) << "noise makes no difference";
  EXPECT_FALSE(equal.unequal);
  EXPECT_EQ(equal.notice, "");

  const DeviceChoice some = leave_out(four, {half, slow, gone, fast});
  EXPECT_EQ(some.numbers, (std::vector<int>{4, 7}));
  EXPECT_EQ(some.places, (std::vector<std::size_t>{0, 3}));
  EXPECT_EQ(some.speed, (std::vector<double>{0.5, 1}));
  EXPECT_EQ(some.devices(), 2);
  EXPECT_TRUE(some.unequal);
  EXPECT_NE(some.notice.find("fake 5 is left out: it has 17 %"), std::string::npos) << some.notice;
  EXPECT_NE(some.notice.find("fake 6 is left out: out of order"), std::string::npos) << some.notice;
  EXPECT_THROW((void)leave_out(four, {gone, gone, gone, gone}), Error);

  Options options;
  options.device_memory_each_bytes = {10, 20, 30, 40};
  EXPECT_EQ(budgets_of(some, options), (std::vector<Offset>{10, 40})) << "budgets stay with their devices";
}

// Who takes over: one device of several, then the host; nobody where the caller named the devices.
TEST(DeviceChoice, OneDeviceThenTheHostTakeOver) {
  const test::FakeBackend backend;
  const device::Registry registry{{&device::registry().host(), &backend}, {}};
  Options options;
  options.device_memory_each_bytes = {10, 20};
  DeviceChoice several = chosen(options, registry);
  ASSERT_EQ(several.backend, &backend);
  ASSERT_EQ(several.devices(), 2) << several.reason;

  const auto one = take_over(several, "it burns", registry);
  ASSERT_TRUE(one);
  EXPECT_EQ(one->backend, &backend);
  EXPECT_EQ(one->numbers, std::vector<int>{0});
  EXPECT_EQ(one->reason, "one fake: it burns");
  EXPECT_EQ(budgets_of(*one, options), std::vector<Offset>{10});

  const auto host = take_over(*one, "it burns", registry);
  ASSERT_TRUE(host);
  EXPECT_EQ(host->backend, &registry.host());
  EXPECT_EQ(host->reason, "the host: it burns");
  EXPECT_EQ(budgets_of(*host, options), std::vector<Offset>{0}) << "a budget of device memory is none of the host's";
  EXPECT_FALSE(take_over(*host, "it burns", registry));

  options.device = "fake:0,1";
  EXPECT_FALSE(take_over(chosen(options, registry), "it burns", registry)) << "the caller named the devices";
}

TEST(DeviceChoice, ABackendThatOnlyWorksWhenAskedForIsNotChosen) {
  test::FakeBackend slow;
  slow.seconds = std::numeric_limits<double>::infinity();
  const device::Registry registry{{&device::registry().host(), &slow}, {}};
  EXPECT_EQ(chosen({}, registry).backend, &registry.host());
  Options options;
  options.device = "fake:0";
  EXPECT_EQ(chosen(options, registry).backend, &slow);
}

// Measured on two H200s: the chain of 200 small bodies gains nothing from the second one (0.94), that of 20 larger
// ones does (1.51).
TEST(DeviceChoice, SmallSystemsStayOnOneGpu) {
  base::ThreadPool pool(2);
  const auto count = [&](const std::vector<std::string>& words) {
    const SparseMatrix a = matrix::generate(matrix::parse_generator(words), &pool);
    const auto tree = analysis::build_tree(analysis::graph_of(a, pool), {}, pool);
    return fastest_count(
        {0, true, plan::gpu_time(tree, words[0] == "kkt" ? Kind::ldlt : Kind::llt, false, plan::h200())}, 4);
  };
  EXPECT_EQ(count({"kkt", "200", "3", "2", "2"}), 1);
  EXPECT_EQ(count({"kkt", "1000", "2", "1", "1"}), 1);
  EXPECT_EQ(count({"kkt", "2", "20", "8", "8"}), 1);
  EXPECT_EQ(count({"elasticity", "6"}), 1);
  EXPECT_GE(count({"kkt", "20", "20", "8", "8"}), 2);
}

}  // namespace device_choice_test
}  // namespace espalier::solver
