// Several sides of one executor, on as many GPUs as there are, and two on one: a side that dies, calls that are
// refused, peer access that is refused. Truth: an error that names what failed, no hang, and afterwards the bits of a
// run before, whose residual is checked.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "analysis/ordering.hpp"
#include "base/timeline.hpp"
#include "device/cuda/executor/cuda_executor.hpp"
#include "espalier/solver.hpp"
#include "solver/gpu/gpu_fixture.hpp"

#if ESPALIER_WITH_CUDA
#include <cuda_runtime_api.h>

#include "device/cuda/runtime/cuda_faults.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/residual.hpp"

namespace espalier {
namespace gpu_sides_test {

using Executor = device::cuda::CudaExecutor<double>;

constexpr double kPatience = 20;  // seconds after which a wait for another side would end by itself

class GpuSides : public test::OnGpu {
 protected:
  void SetUp() override {
    OnGpu::SetUp();
    if (IsSkipped()) return;
    a_ = matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "9"}), &pool_);
    tree_ = analysis::build_tree(analysis::graph_of(a_, pool_), {}, pool_);
    int gpus = 0;
    ASSERT_EQ(cudaGetDeviceCount(&gpus), cudaSuccess);
    groups_ = {{0, 0}};
    for (int count = 2; count <= gpus; count *= 2) {
      groups_.emplace_back();
      for (int d = 0; d < count; ++d) groups_.back().push_back(d);
    }
  }
  void TearDown() override { device::cuda::call_faults().arm(0); }

  // A plan for so many sides; it outlives the executor.
  void plan_for(const std::vector<int>& devices) {
    plan_ = plan::make_plan(tree_, a_, {},
                            device::cuda::cuda_plan_options(Kind::llt, {}, static_cast<Index>(devices.size())), pool_);
  }
  std::unique_ptr<Executor> make(const std::vector<int>& devices, int fail_device = -1) {
    device::cuda::CudaOptions options;
    options.devices = devices;
    options.fail_device = fail_device;
    options.patience_seconds = kPatience;
    options.pool = &pool_;
    return device::cuda::make_cuda_executor<double>(plan_, Kind::llt, {}, options);
  }
  // The solution for ones, by position.
  std::vector<double> run(Executor& executor) const {
    executor.factorize(a_.values);
    std::vector<double> x(static_cast<std::size_t>(a_.rows), 1.0);
    executor.solve(x.data(), 1, false);
    return x;
  }
  void expect_solution(const std::vector<double>& by_position) {
    std::vector<double> x(by_position.size());
    for (std::size_t k = 0; k < x.size(); ++k) x[static_cast<std::size_t>(plan_.tree.order[k])] = by_position[k];
    const std::vector<double> b(x.size(), 1.0);
    EXPECT_LE(matrix::backward_errors(a_, x, b, 1, Transpose::no, &pool_).normwise, 1e-16 * a_.rows);
  }

  base::ThreadPool pool_{2};
  SparseMatrix a_;
  analysis::AssemblyTree tree_;
  plan::Plan plan_;
  std::vector<std::vector<int>> groups_;  // GPUs of the sides
};

TEST_F(GpuSides, OneThatDiesEndsTheOthersWithItsName) {
  for (const auto& devices : groups_) {
    SCOPED_TRACE(::testing::Message() << devices.size() << " sides, the last on GPU " << devices.back());
    plan_for(devices);
    const auto last = static_cast<int>(devices.size()) - 1;
    const auto dying = make(devices, last);
    for (int attempt = 0; attempt < 2; ++attempt) {
      const double began = base::now_seconds();
      try {
        run(*dying);
        ADD_FAILURE() << "half of the tasks were not done";
      } catch (const Error& e) {
        EXPECT_EQ(e.status().code, StatusCode::device_error);
        EXPECT_NE(std::string(e.what()).find("#" + std::to_string(devices.back())), std::string::npos) << e.what();
      }
      EXPECT_LT(base::now_seconds() - began, kPatience / 2) << "the others did not wait until their patience ended";
    }
    expect_solution(run(*make(devices)));
  }
}

TEST_F(GpuSides, EveryCallRefusedInTurnLeavesTheExecutorUsable) {
  auto& faults = device::cuda::call_faults();
  for (const auto& devices : groups_) {
    plan_for(devices);
    const auto executor = make(devices);
    const std::vector<double> before = run(*executor);  // graphs of the solve are recorded
    expect_solution(before);
    faults.arm(0);
    run(*executor);
    const std::int64_t calls = faults.made;
    EXPECT_GT(calls, 10);
    for (std::int64_t k = 1; k <= calls; ++k) {
      SCOPED_TRACE(::testing::Message() << devices.size() << " sides, call " << k << " of " << calls);
      faults.arm(k);
      std::string message;
      try {
        run(*executor);
      } catch (const Error& e) {
        message = e.what();
      }
      const char* const refused = faults.refused;
      faults.arm(0);
      ASSERT_NE(refused, nullptr) << "a run makes the same calls every time";
      EXPECT_NE(message.find(refused), std::string::npos) << refused << " was refused: '" << message << "'";
      ASSERT_EQ(run(*executor), before) << "after " << refused;
    }
  }
}

TEST_F(GpuSides, RefusedPeerAccessGoesThroughTheHost) {
  if (groups_.size() < 2) GTEST_SKIP() << "needs two GPUs";
  auto& faults = device::cuda::call_faults();
  const std::vector<int>& devices = groups_[1];
  plan_for(devices);
  std::vector<const char*> names;
  faults.record = &names;
  const std::vector<double> before = run(*make(devices));
  faults.record = nullptr;
  expect_solution(before);
  int refusals = 0;
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (std::string(names[k]) != "cudaDeviceEnablePeerAccess") continue;
    faults.arm(static_cast<std::int64_t>(k) + 1);
    const auto executor = make(devices);
    EXPECT_EQ(faults.refused.load(), names[k]);
    faults.arm(0);
    expect_solution(run(*executor));
    ++refusals;
  }
  EXPECT_GE(refusals, 2) << "each GPU asks for the other";
}

// The values are then scaled on the first GPU and go to the others through the host, and so do the limits of the
// pivots.
// Bits are those of peer access for L D L^T. For L L^T they are not: the sides share one copy of the top then, in which
// inverses of blocks are not joined (device/cuda/block_inverse.hpp), so that a solve has other products.
TEST_F(GpuSides, RefusedPeerAccessThroughTheSolverGivesTheSameAnswers) {
  if (groups_.size() < 2) GTEST_SKIP() << "needs two GPUs";
  auto& faults = device::cuda::call_faults();
  const std::vector<double> b(static_cast<std::size_t>(a_.rows), 1.0);
  std::vector<const char*> names;
  // call: of the first factorization, refused; 0: none
  const auto solve = [&](Kind kind, std::int64_t call) {
    Options options;
    options.kind = kind;
    options.device = "gpu:0,1";
    options.refinement_steps = 0;
    Solver solver(options);
    EXPECT_TRUE(solver.analyze(a_).status.ok());
    if (call == 0) names.clear();
    if (call == 0) faults.record = &names;
    faults.arm(call);
    EXPECT_TRUE(solver.factorize(a_).status.ok());
    faults.record = nullptr;
    EXPECT_EQ(faults.refused.load(), call == 0 ? nullptr : names[static_cast<std::size_t>(call - 1)]);
    faults.arm(0);
    EXPECT_TRUE(solver.refactorize(a_.values).status.ok());
    std::vector<double> x(b.size());
    EXPECT_TRUE(solver.solve(b, x).status.ok());
    EXPECT_LE(matrix::backward_errors(a_, x, b, 1, Transpose::no, &pool_).normwise, 1e-16 * a_.rows);
    return x;
  };
  for (const Kind kind : {Kind::llt, Kind::ldlt}) {
    const std::vector<double> before = solve(kind, 0);
    int refusals = 0;
    for (std::size_t k = 0; k < names.size(); ++k) {
      if (std::string(names[k]) != "cudaDeviceEnablePeerAccess") continue;
      const std::vector<double> x = solve(kind, static_cast<std::int64_t>(k) + 1);
      if (kind == Kind::ldlt) {
        EXPECT_EQ(x, before) << "call " << k + 1;
      }
      ++refusals;
    }
    EXPECT_GE(refusals, 2) << "each GPU asks for the other";
  }
}

// Neighbouring unknowns are eliminated together, so most have neighbours on their GPU.
TEST_F(GpuSides, PlacesSayWhoEliminatesWhichUnknown) {
  for (const std::vector<int>& devices : groups_) {
    if (devices.size() > 1 && devices[1] == 0) continue;  // one GPU twice: not through the solver
    std::string names = "gpu:";
    for (const int d : devices) names += std::to_string(d) + (d == devices.back() ? "" : ",");
    SCOPED_TRACE(names);
    Options options;
    options.device = names;
    Solver solver(options);
    EXPECT_TRUE(solver.analyze(a_).status.ok());
    EXPECT_TRUE(solver.gpu_places().gpus.empty());
    EXPECT_TRUE(solver.factorize(a_).status.ok());
    const GpuPlaces places = solver.gpu_places();
    EXPECT_EQ(places.gpus, devices);
    EXPECT_EQ(places.gpus.front(), solver.gpu());
    ASSERT_EQ(places.of_unknown.size(), static_cast<std::size_t>(a_.rows));
    std::vector<Index> unknowns(devices.size());
    Index apart = 0;
    for (std::size_t i = 0; i < places.of_unknown.size(); ++i) {
      ++unknowns.at(static_cast<std::size_t>(places.of_unknown[i]));
      if (i > 0 && places.of_unknown[i] != places.of_unknown[i - 1]) ++apart;
    }
    for (const Index count : unknowns) EXPECT_GT(count, a_.rows / static_cast<Index>(4 * devices.size()));
    EXPECT_LT(apart, a_.rows / 3);
  }
}

TEST_F(GpuSides, OneGpuEliminatesAll) {
  Solver solver = test::unrefined_on_gpu(a_);
  const GpuPlaces places = solver.gpu_places();
  EXPECT_EQ(places.gpus, std::vector<int>{0});
  EXPECT_TRUE(places.of_unknown.empty());
}

}  // namespace gpu_sides_test
}  // namespace espalier

#endif
