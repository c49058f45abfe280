// A process that has used a GPU and forks. CUDA does not follow into the child: there the old solver says so, and a new
// one works on the host; the parent goes on with the bits it had.
#include <gtest/gtest.h>

#include "process.hpp"
#include "solver/gpu/gpu_fixture.hpp"
#include "solver/solver_common.hpp"

namespace espalier::test {
namespace gpu_fork_test {

class GpuFork : public OnGpu {};

TEST_F(GpuFork, TheChildIsToldAndTheParentGoesOn) {
  const SparseMatrix a = generated({"elasticity", "8"});
  const std::vector<double> b = reference::random_vector(a.rows, 1);
  std::vector<double> x(b.size()), again(b.size());
  Solver solver = unrefined_on_gpu(a);
  ASSERT_TRUE(solver.solve(b, x).status.ok());
  const auto said = [](const Status& status) {
    return status.code == StatusCode::device_error && status.message.find("fork()") != std::string::npos;
  };
  EXPECT_EQ(in_child([&] {
              std::vector<double> y(b.size());
              return said(solver.solve(b, y).status) && said(solver.refactorize(a.values).status) &&
                     said(solver.analyze(a).status);
            }),
            0);
  EXPECT_EQ(in_child([&] {
              Options o;
              o.device = "cpu";
              Solver anew(o);
              std::vector<double> y(b.size());
              return anew.analyze(a).status.ok() && anew.factorize(a).status.ok() && anew.solve(b, y).status.ok() &&
                     reference::backward_error(a, b, y) <= 8 * kEps;
            }),
            0);
  ASSERT_TRUE(solver.refactorize(a.values).status.ok());
  ASSERT_TRUE(solver.solve(b, again).status.ok());
  EXPECT_EQ(again, x);
}

}  // namespace gpu_fork_test
}  // namespace espalier::test
