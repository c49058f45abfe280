// Calls of CUDA refused in turn to frequency responses on a GPU. Truth: the responses of the host.
#include <memory>

#include "harmonic/harmonic_common.hpp"
#include "solver/gpu/refused_calls.hpp"

namespace espalier::test {

using HarmonicFaults = RefusedCalls;

TEST_F(HarmonicFaults, RefusedCallsAreNamedOrTheResponsesAreRight) {
  const auto generated = [](const char* name) {
    return matrix::generate(matrix::parse_generator(std::vector<std::string>{name, "4"}));
  };
  const SparseMatrix k = generated("elasticity"), m = generated("elasticity-mass");
  std::vector<Complex> f(static_cast<std::size_t>(k.rows));
  f.back() = 1;
  HarmonicOptions o = range(0.01, 0.02, 4);
  o.loss_factor = 0.05;
  o.observed = {0, k.rows - 1};
  o.solver.device = "cpu";
  const HarmonicResult truth = harmonic_response(k, SparseMatrix(), m, f, 1, o);
  ASSERT_TRUE(truth.status.ok()) << truth.status.message;
  double largest = 0;
  for (const Complex& v : truth.responses) largest = std::max(largest, std::abs(v));
  o.solver.device = "gpu:0";
  o.solver.pinned_memory_bytes = 0;
  const Refusals told = refuse_some(
      [&]() -> Attempt {
        auto found = std::make_shared<HarmonicResult>();
        return {[&, found] {
                  *found = harmonic_response(k, SparseMatrix(), m, f, 1, o);
                  return found->status;
                },
                [&, found] {
                  ASSERT_EQ(found->responses.size(), truth.responses.size());
                  for (std::size_t i = 0; i < truth.responses.size(); ++i)
                    EXPECT_LE(std::abs(found->responses[i] - truth.responses[i]), 1e-9 * largest) << i;
                }};
      },
      60);
  EXPECT_GT(told.tried, 30);
}

}  // namespace espalier::test
