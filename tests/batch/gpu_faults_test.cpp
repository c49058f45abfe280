// Calls of CUDA refused in turn to batches on a GPU. Truth: residuals of all systems. What fails there is solved alone.
#include <algorithm>
#include <memory>

#include "batch/batch_common.hpp"
#include "solver/gpu/refused_calls.hpp"

namespace espalier::test {

namespace {

constexpr Index kSystems = 60;

using BatchFaults = RefusedCalls;

/// The message of the batch, or that of a system.
Status first_failure(const BatchResult& r) {
  for (const SystemResult& s : r.systems)
    if (!s.status.ok()) return s.status;
  return r.status;
}

void expect_solutions(const SparseMatrix& a, const std::vector<double>& values, const std::vector<double>& b,
                      const std::vector<double>& x) {
  const auto n = static_cast<std::ptrdiff_t>(a.cols);
  for (Index k = 0; k < kSystems; ++k) {
    const auto slice = [&](const std::vector<double>& v) {
      return std::vector<double>(v.begin() + n * k, v.begin() + n * (k + 1));
    };
    ASSERT_LE(reference::backward_error(system_of(a, values, k), slice(b), slice(x)), 8 * kEps) << "system " << k;
  }
}

TEST_F(BatchFaults, RefusedCallsOfOnePattern) {
  const struct {
    Kind kind;
    SparseMatrix a;
  } systems[] = {{Kind::llt, reference::random_system(120, 4, reference::Values::positive, 1)},
                 {Kind::ldlt, constrained_chain(150)}};
  for (const auto& system : systems) {
    const SparseMatrix& a = system.a;
    SCOPED_TRACE(static_cast<int>(system.kind));
    const std::vector<double> values = values_of(a, kSystems, 1);
    const std::vector<double> b = reference::random_vector(Offset{a.cols} * kSystems, 2);
    Options o = options_of(system.kind, 2);
    o.device = "gpu:0";
    o.pinned_memory_bytes = 0;
    struct Case {
      Batch batch;
      std::vector<double> x;
    };
    const Refusals told = refuse_some(
        [&]() -> Attempt {
          auto c = std::make_shared<Case>(Case{Batch(o), std::vector<double>(b.size())});
          EXPECT_TRUE(c->batch.analyze(a).status.ok());
          return {[&, c] {
                    std::fill(c->x.begin(), c->x.end(), -1.0);
                    return first_failure(c->batch.solve(values, b, c->x, kSystems));
                  },
                  [&, c] { expect_solutions(a, values, b, c->x); }};
        },
        60);
    EXPECT_GT(told.tried, 30);
  }
}

TEST_F(BatchFaults, RefusedCallsOfManyPatterns) {
  std::vector<SparseMatrix> matrices;
  std::vector<std::vector<double>> b;
  for (Index k = 0; k < kSystems; ++k) {
    matrices.push_back(k % 2 == 0 ? constrained_chain(60 + k)
                                  : reference::random_system(60 + k, 3, reference::Values::general, 10U + k));
    b.push_back(reference::random_vector(matrices.back().cols, 5));
  }
  Options o = options_of(Kind::automatic, 2);
  o.device = "gpu:0";
  o.pinned_memory_bytes = 0;
  const Refusals told = refuse_some(
      [&]() -> Attempt {
        auto x = std::make_shared<std::vector<std::vector<double>>>(b);
        return {[&, x] {
                  std::vector<System> list;
                  for (std::size_t k = 0; k < b.size(); ++k) list.push_back({matrices[k], b[k], (*x)[k]});
                  return first_failure(solve_systems(list, o));
                },
                [&, x] {
                  for (std::size_t k = 0; k < b.size(); ++k)
                    ASSERT_LE(reference::backward_error(matrices[k], b[k], (*x)[k]), 8 * kEps) << "system " << k;
                }};
      },
      60);
  EXPECT_GT(told.tried, 30);
}

}  // namespace

}  // namespace espalier::test
