// On a GPU, in core and with a tenth of the memory: S by solves with the factor there.
#include <memory>

#include "device/registry.hpp"
#include "schur_common.hpp"
#include "solver/gpu/refused_calls.hpp"

namespace espalier::test {

namespace {

TEST(GpuSchur, IsThatOfTheHost) {
  const device::Backend* gpu = device::registry().find("gpu");
  if (gpu == nullptr || gpu->find().names.empty()) GTEST_SKIP() << "no GPU here";
  const SparseMatrix a = generated({"elasticity", "10"});
  const std::vector<Index> list = random_list(a.cols, 100, 3);
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    Options o;
    o.kind = kind;
    o.device = "cpu";
    SchurComplement on_host(o);
    ASSERT_TRUE(on_host.analyze(a, list).status.ok());
    ASSERT_TRUE(on_host.factorize(a.values).status.ok());
    for (const Offset budget : {Offset{0}, on_host.analysis().predicted_bytes / 10}) {
      o.device = "gpu:0";
      o.device_memory_bytes = budget;
      SchurComplement on_gpu(o);
      const AnalysisResult analysis = on_gpu.analyze(a, list);
      ASSERT_TRUE(analysis.status.ok()) << analysis.status.message;
      const SchurResult result = on_gpu.factorize(a.values);
      if (budget > 0 && result.status.code == StatusCode::out_of_memory) continue;  // below what a GPU needs at least
      ASSERT_TRUE(result.status.ok()) << result.status.message;
      const double scale = largest({on_host.complement().begin(), on_host.complement().end()});
      for (std::size_t k = 0; k < on_gpu.complement().size(); ++k)
        ASSERT_NEAR(on_gpu.complement()[k], on_host.complement()[k], 1e-11 * scale);
      const std::vector<double> b = reference::random_vector(a.cols, 5);
      std::vector<double> x(b.size());
      ASSERT_TRUE(on_gpu.solve(b, x).status.ok());
      EXPECT_LE(reference::backward_error(a, b, x), 8 * kEps);
    }
  }
}

using SchurFaults = RefusedCalls;

// Calls of CUDA refused in turn while S is formed and a system is solved with it.
TEST_F(SchurFaults, RefusedCallsAreNamedAndTheComplementIsRightAfterwards) {
  const SparseMatrix a = generated({"elasticity", "6"});
  const std::vector<Index> list = random_list(a.cols, 40, 3);
  const std::vector<double> b = reference::random_vector(a.cols, 5);
  for (const Kind kind : {Kind::llt, Kind::lu}) {
    Options o;
    o.kind = kind;
    o.threads = 2;
    o.device = "cpu";
    SchurComplement on_host(o);
    ASSERT_TRUE(on_host.analyze(a, list).status.ok());
    ASSERT_TRUE(on_host.factorize(a.values).status.ok());
    const std::vector<double> truth(on_host.complement().begin(), on_host.complement().end());
    const double scale = largest(truth);
    o.device = "gpu:0";
    o.pinned_memory_bytes = 0;
    struct Case {
      SchurComplement s;
      std::vector<double> x;
    };
    const Refusals told = refuse_some(
        [&]() -> Attempt {
          auto c = std::make_shared<Case>(Case{SchurComplement(o), std::vector<double>(b.size())});
          EXPECT_TRUE(c->s.analyze(a, list).status.ok());
          return {[&, c] {
                    if (const SchurResult f = c->s.factorize(a.values); !f.status.ok()) {
                      EXPECT_FALSE(c->s.factorized());
                      return f.status;
                    }
                    return c->s.solve(b, c->x).status;
                  },
                  [&, c] {
                    for (std::size_t k = 0; k < truth.size(); ++k)
                      ASSERT_NEAR(c->s.complement()[k], truth[k], 1e-11 * scale);
                    EXPECT_LE(reference::backward_error(a, b, c->x), 8 * kEps);
                  }};
        },
        60);
    EXPECT_GT(told.errors, told.tried / 3);
  }
}

}  // namespace

}  // namespace espalier::test
