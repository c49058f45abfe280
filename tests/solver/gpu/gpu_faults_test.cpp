// Faults on the GPU: every CUDA call of a run refused in turn, and a GPU whose memory others use. Truth: the name of
// the refused call in the message, and an independent residual of the answer that the same solver gives afterwards.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "device/cuda/executor/cuda_executor.hpp"
#include "espalier/espalier.hpp"
#include "reference/reference.hpp"
#include "solver/gpu/refused_calls.hpp"

#if ESPALIER_WITH_CUDA
#include <cuda_runtime_api.h>

#include "matrix/generators/generate.hpp"
#include "matrix/residual.hpp"

namespace espalier {
namespace gpu_faults_test {

using reference::Values;

using GpuFaults = test::RefusedCalls;

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

// An analyzed solver. Nothing but memory may be refused to it in silence.
test::Attempt attempt_of(const Options& options, const SparseMatrix& a) {
  struct Case {
    explicit Case(const Options& o) : s(o) {}
    Solver s;
    std::vector<double> x;
  };
  auto c = std::make_shared<Case>(options);
  c->x.resize(static_cast<std::size_t>(a.rows));
  EXPECT_TRUE(c->s.analyze(a).status.ok());
  const bool pins = options.pinned_memory_bytes > 0;
  return {[c, &a] { return run(c->s, a, c->x); }, [c, &a] { EXPECT_LE(error_of(a, c->x), 100 * 2.3e-16 * a.rows); },
          [pins](const std::string& call) { return can_do_without(call, pins); }};
}

TEST_F(GpuFaults, EveryCallRefusedInTurnIsNamedAndLeavesTheSolverUsable) {
  const struct {
    const char* name;
    SparseMatrix a;
    int step;  // the calls of the other kinds are nearly the same: every fourth of them (a run takes 60 ms)
  } systems[] = {{"llt", reference::random_system(300, 6, Values::positive, 1), 1},
                 {"ldlt", reference::saddle_point(200, 40, 2), 4},
                 {"lu", reference::random_system(250, 6, Values::general, 3), 4}};
  for (const auto& system : systems) {
    SCOPED_TRACE(system.name);
    Options o;
    o.device = "gpu:0";
    o.threads = 2;
    o.pinned_memory_bytes = 0;
    const test::Refusals told = test::refuse_every([&] { return attempt_of(o, system.a); }, system.step);
    EXPECT_TRUE(told.steady) << "a run makes the same calls every time";
    EXPECT_GT(told.calls, 50) << "the calls are counted";
    EXPECT_GT(told.errors, told.calls / system.step / 2) << "most calls cannot be done without";
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
    constexpr int kStep = 23;
    const test::Refusals told = test::refuse_every([&] { return attempt_of(o, a); }, kStep);
    EXPECT_TRUE(told.steady || pinned > 0) << "a run makes the same calls every time";
    EXPECT_GT(told.calls, 10 * kStep);
    EXPECT_GT(told.errors, told.calls / kStep / 2) << "most calls cannot be done without";
  }
}

// A clone of a solver that others use, columns of both orders, a few rows, factors in two precisions. Truth: residuals.
TEST_F(GpuFaults, CallsRefusedToCopiesColumnsAndRowsAreNamed) {
  const SparseMatrix a = reference::random_system(300, 5, Values::general, 7);
  constexpr Index kColumns = 19;
  const std::vector<double> b = reference::random_vector(Offset{a.rows} * kColumns, 3);
  const std::vector<Offset> first = {0, 1};
  const std::vector<Index> row = {4}, wanted = {4, 9};
  const std::vector<double> load = {1};
  for (const Precision precision : {Precision::fp64, Precision::mixed}) {
    SCOPED_TRACE(static_cast<int>(precision));
    Options o;
    o.device = "gpu:0";
    o.threads = 2;
    o.pinned_memory_bytes = 0;
    o.precision = precision;
    Solver original(o);
    ASSERT_TRUE(original.analyze(a).status.ok());
    ASSERT_TRUE(original.factorize(a).status.ok());
    struct Case {
      Solver s;
      std::vector<double> x, y, rows, whole;
    };
    const test::Refusals told = test::refuse_some(
        [&]() -> test::Attempt {
          auto c = std::make_shared<Case>(
              Case{original.clone(), b, b, {0, 0}, std::vector<double>(static_cast<std::size_t>(a.rows))});
          return {[&, c] {
                    if (const FactorResult f = c->s.factorize(a); !f.status.ok()) return f.status;
                    if (const SolveResult r = c->s.solve(b, c->x, kColumns); !r.status.ok()) return r.status;
                    if (const SolveResult r = c->s.solve(b, c->y, kColumns, Transpose::yes); !r.status.ok())
                      return r.status;
                    std::vector<double> unit(c->whole.size());
                    unit[4] = 1;
                    if (const SolveResult r = c->s.solve(unit, c->whole); !r.status.ok()) return r.status;
                    return solve_rows(c->s, {first, row, load}, wanted, c->rows).status;
                  },
                  [&, c] {
                    EXPECT_LE(reference::backward_error(a, b, c->x, kColumns), 1e-14);
                    EXPECT_LE(reference::backward_error(a, b, c->y, kColumns, true), 1e-14);
                    double largest = 0;
                    for (const double v : c->whole) largest = std::max(largest, std::abs(v));
                    for (std::size_t k = 0; k < wanted.size(); ++k)
                      EXPECT_NEAR(c->rows[k], c->whole[static_cast<std::size_t>(wanted[k])], 1e-2 * largest);
                  }};
        },
        60);
    EXPECT_GT(told.errors, told.tried / 3);
    std::vector<double> x(b.size());
    ASSERT_TRUE(original.solve(b, x, kColumns).status.ok());
    EXPECT_LE(reference::backward_error(a, b, x, kColumns), 1e-14) << "the factor that others use";
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
