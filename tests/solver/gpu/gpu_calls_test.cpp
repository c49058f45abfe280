// What the host does for one refactorization and one solve with arrays in device memory: every call of the CUDA runtime
// is written down. One launch of the captured graph and one wait each, no memory taken, nothing copied.
#include <gtest/gtest.h>

#include "device/cuda/executor/cuda_executor.hpp"
#include "espalier/espalier.hpp"
#include "reference/reference.hpp"
#include "solver/gpu/gpu_fixture.hpp"

#if ESPALIER_WITH_CUDA
#include <cuda_runtime_api.h>

#include <algorithm>
#include <limits>

#include "device/cuda/runtime/cuda_faults.hpp"

namespace espalier {
namespace gpu_calls_test {

using reference::Values;

class GpuCalls : public test::OnGpu {
 protected:
  void TearDown() override { device::cuda::call_faults().record = nullptr; }

  template <class Work>
  static std::vector<std::string> calls_of(Work&& work) {
    std::vector<const char*> names;
    device::cuda::call_faults().record = &names;
    work();
    device::cuda::call_faults().record = nullptr;
    return {names.begin(), names.end()};
  }
  static long count(const std::vector<std::string>& calls, const std::string& word) {
    return std::count_if(calls.begin(), calls.end(),
                         [&](const std::string& call) { return call.find(word) != std::string::npos; });
  }
};

TEST_F(GpuCalls, OneLaunchAndOneWaitEach) {
  const struct {
    const char* name;
    SparseMatrix a;
  } systems[] = {{"llt", reference::random_system(3000, 6, Values::positive, 1)},
                 {"ldlt", reference::saddle_point(1200, 300, 2)},
                 {"lu", reference::random_system(2500, 6, Values::general, 3)}};
  for (const auto& [name, a] : systems) {
    SCOPED_TRACE(name);
    const auto n = static_cast<std::size_t>(a.rows);
    double *values = nullptr, *vectors = nullptr;
    ASSERT_EQ(cudaMalloc(reinterpret_cast<void**>(&values), a.values.size() * sizeof(double)), cudaSuccess);
    ASSERT_EQ(cudaMalloc(reinterpret_cast<void**>(&vectors), 2 * n * sizeof(double)), cudaSuccess);
    ASSERT_EQ(cudaMemcpy(values, a.values.data(), a.values.size() * sizeof(double), cudaMemcpyHostToDevice),
              cudaSuccess);
    const std::vector<double> b = reference::random_vector(a.rows, 4);
    ASSERT_EQ(cudaMemcpy(vectors, b.data(), n * sizeof(double), cudaMemcpyHostToDevice), cudaSuccess);
    Options o;
    o.device = "gpu:0";
    o.refinement_steps = 0;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    for (int k = 0; k < 2; ++k) {
      SCOPED_TRACE(k);
      FactorResult f;
      SolveResult x;
      const auto factor = calls_of([&] { f = s.refactorize_device(values, a.nonzeros()); });
      const auto solve = calls_of([&] { x = s.solve_device(vectors, vectors + n); });
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      ASSERT_TRUE(x.status.ok()) << x.status.message;
      EXPECT_LE(x.backward_error, 10 * n * std::numeric_limits<double>::epsilon());
      EXPECT_GT(x.solve_seconds, 0);
      EXPECT_LE(x.solve_seconds, x.seconds + 2e-6) << "the GPU's clock ticks in microseconds";
      if (k == 0) continue;  // the first ones take memory and capture
      for (const auto& [calls, kernels] : {std::pair{factor, 1}, std::pair{solve, 3}}) {
        const std::string all = testing::PrintToString(calls);
        EXPECT_EQ(count(calls, "cudaGraphLaunch"), 1) << all;
        EXPECT_EQ(count(calls, "launch of"), kernels) << all;
        EXPECT_EQ(count(calls, "Synchronize"), 1) << all;
        EXPECT_EQ(count(calls, "lloc"), 0) << all;
        EXPECT_EQ(count(calls, "Memcpy") + count(calls, "Memset"), 0) << all;
        EXPECT_LE(calls.size(), 14U) << all;
      }
    }
    EXPECT_EQ(cudaFree(values), cudaSuccess);
    EXPECT_EQ(cudaFree(vectors), cudaSuccess);
  }
}

}  // namespace gpu_calls_test
}  // namespace espalier

#endif
