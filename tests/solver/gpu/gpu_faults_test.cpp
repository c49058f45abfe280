// Faults on the GPU: every CUDA call of a run refused in turn, and a GPU whose memory others use. Truth: the name of
// the refused call in the message, and an independent residual of the answer that the same solver gives afterwards.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "device/cuda/executor/cuda_executor.hpp"
#include "espalier/espalier.hpp"
#include "reference/reference.hpp"
#include "solver/gpu/gpu_fixture.hpp"

#if ESPALIER_WITH_CUDA
#include <cuda_runtime_api.h>

#include "device/cuda/runtime/cuda_faults.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/residual.hpp"

namespace espalier {
namespace gpu_faults_test {

using reference::Values;

class GpuFaults : public test::OnGpu {
 protected:
  void TearDown() override { device::cuda::call_faults().arm(0); }
};

// Analysis aside, all that a user does. The first status that is not ok; x is the last answer.
Status run(Solver& s, const SparseMatrix& a, std::vector<double>& x) {
  const std::vector<double> b(x.size(), 1.0);
  if (const FactorResult f = s.factorize(a); !f.status.ok()) return f.status;
  if (const FactorResult f = s.refactorize(a.values); !f.status.ok()) return f.status;
  if (const SolveResult r = s.solve(b, x); !r.status.ok()) return r.status;
  return s.solve(b, x).status;
}

double error_of(const SparseMatrix& a, const std::vector<double>& x) {
  base::ThreadPool pool(1);
  return matrix::backward_errors(a, x, std::vector<double>(x.size(), 1.0), 1, Transpose::no, &pool).normwise;
}

// Calls whose refusal need not end a run: it goes on with less memory, or through the staging ring. The thread that
// pins memory begins with the choice of a device.
bool can_do_without(const std::string& call, bool pins) {
  return call.find("lloc") != std::string::npos || call == "cudaHostRegister" || (pins && call == "cudaSetDevice");
}

// Refuses every `step`-th call of a run, then lets the same solver run again. @returns the number of runs that ended in
// an error
int refuse_in_turn(const Options& options, const SparseMatrix& a, int step, std::int64_t& calls) {
  auto& faults = device::cuda::call_faults();
  const double bound = 100 * 2.3e-16 * a.rows;
  std::vector<double> x(static_cast<std::size_t>(a.rows));
  for (int k = 0; k < 2; ++k) {  // some calls are made once in a process
    Solver s(options);
    EXPECT_TRUE(s.analyze(a).status.ok());
    faults.arm(0);
    EXPECT_TRUE(run(s, a, x).ok());
    calls = faults.made;
  }
  int refusals = 0;
  for (std::int64_t k = 1; k <= calls; k += step) {
    SCOPED_TRACE(::testing::Message() << "call " << k << " of " << calls);
    Solver s(options);
    EXPECT_TRUE(s.analyze(a).status.ok());
    faults.arm(k);
    const Status status = run(s, a, x);
    const char* const refused = faults.refused;
    faults.arm(0);
    if (refused == nullptr) {
      EXPECT_NE(options.pinned_memory_bytes, 0) << "a run makes the same calls every time";
      break;
    }
    if (status.ok()) {
      EXPECT_TRUE(can_do_without(refused, options.pinned_memory_bytes > 0)) << refused << " was refused in silence";
      EXPECT_LE(error_of(a, x), bound) << refused;
    } else {
      ++refusals;
      const bool memory = status.code == StatusCode::out_of_memory;
      EXPECT_TRUE(memory || status.code == StatusCode::device_error) << refused << ": " << status.message;
      EXPECT_TRUE(memory || status.message.find(refused) != std::string::npos) << refused << ": " << status.message;
    }
    const Status again = run(s, a, x);
    EXPECT_TRUE(again.ok()) << "after " << refused << ": " << again.message;
    EXPECT_LE(error_of(a, x), bound) << "after " << refused;
    if (!again.ok()) break;
  }
  return refusals;
}

TEST_F(GpuFaults, EveryCallRefusedInTurnIsNamedAndLeavesTheSolverUsable) {
  const struct {
    const char* name;
    SparseMatrix a;
    int step;  // the calls of the other kinds are nearly the same: every fourth of them (a run takes 60 ms)
  } systems[] = {{"llt", reference::random_system(300, 6, Values::positive, 1), 1},
                 {"ldlt", reference::saddle_point(200, 40, 2), 4},
                 {"lu", reference::random_system(250, 6, Values::general, 3), 4}};
  for (const auto& [name, a, step] : systems) {
    SCOPED_TRACE(name);
    Options o;
    o.device = "gpu:0";
    o.threads = 2;
    o.pinned_memory_bytes = 0;
    std::int64_t calls = 0;
    const int refusals = refuse_in_turn(o, a, step, calls);
    EXPECT_GT(calls, 50) << "the calls are counted";
    EXPECT_GT(refusals, calls / step / 2) << "most calls cannot be done without";
  }
}

// Three threads make the calls of a run out of core, so their order differs from run to run, not their number.
TEST_F(GpuFaults, CallsRefusedToARunOutOfCoreAreNamedAndLeaveTheSolverUsable) {
  const SparseMatrix a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "10"}));
  for (const Offset pinned : {Offset{0}, Offset{1} << 30}) {
    SCOPED_TRACE(::testing::Message() << "pinned " << pinned);
    Options o;
    o.device = "gpu:0";
    o.device_memory_bytes = Offset{4} << 20;
    o.pinned_memory_bytes = pinned;
    o.threads = 2;
    {
      Solver s(o);
      std::vector<double> x(static_cast<std::size_t>(a.rows));
      ASSERT_TRUE(s.analyze(a).status.ok());
      ASSERT_TRUE(run(s, a, x).ok());
      const FactorResult f = s.refactorize(a.values);
      ASSERT_FALSE(f.devices.empty());
      EXPECT_GT(f.devices.front().streamed_out_bytes, 0) << "the system fits into the budget";
      EXPECT_LE(f.devices.front().peak_bytes, o.device_memory_bytes);
    }
    std::int64_t calls = 0;
    constexpr int kStep = 23;
    const int refusals = refuse_in_turn(o, a, kStep, calls);
    EXPECT_GT(calls, 10 * kStep);
    EXPECT_GT(refusals, calls / kStep / 2) << "most calls cannot be done without";
  }
}

TEST_F(GpuFaults, MemoryThatOthersUseSendsTheFactorizationOutOfCore) {
  const SparseMatrix a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "24"}));
  std::size_t free = 0, total = 0;
  ASSERT_EQ(cudaMemGetInfo(&free, &total), cudaSuccess);
  constexpr std::size_t kLeft = std::size_t{192} << 20;
  ASSERT_GT(free, 4 * kLeft);
  void* others = nullptr;
  ASSERT_EQ(cudaMalloc(&others, free - kLeft), cudaSuccess);
  Options o;
  o.device = "gpu:0";
  Solver s(o);
  EXPECT_TRUE(s.analyze(a).status.ok());
  std::vector<double> x(static_cast<std::size_t>(a.rows));
  const Status crowded = run(s, a, x);
  EXPECT_TRUE(crowded.ok()) << crowded.message;
  EXPECT_LE(error_of(a, x), 1e-13);
  const FactorResult f = s.refactorize(a.values);
  EXPECT_TRUE(f.status.ok()) << f.status.message;
  if (!f.devices.empty()) {
    EXPECT_LE(f.devices.front().peak_bytes, static_cast<Offset>(kLeft));
  }
  EXPECT_EQ(cudaFree(others), cudaSuccess);
  Solver alone(o);
  EXPECT_TRUE(alone.analyze(a).status.ok());
  const FactorResult g = alone.factorize(a);
  ASSERT_TRUE(g.status.ok()) << g.status.message;
  EXPECT_GT(g.devices.front().peak_bytes, static_cast<Offset>(kLeft)) << "the system does not fit into what was left";
}

}  // namespace gpu_faults_test
}  // namespace espalier

#endif
