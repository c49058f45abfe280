// What a GPU keeps where the pattern changes (Solver::analyze_change()). Truth: the bits of a solver on the same GPU
// that follows the same patterns and makes everything each time.
#include <gtest/gtest.h>

#include <string>

#include "solver/gpu/gpu_variants.hpp"

#if ESPALIER_WITH_CUDA
#include <cuda_runtime_api.h>

namespace espalier {
namespace gpu_kept_numbers_test {

using namespace changed_values;
using namespace gpu_variants;

class GpuKeptNumbers : public FaultsOnGpu {};

TEST_F(GpuKeptNumbers, HaveTheBitsOfAWholeFactorization) {
  for (const Variant& v : kVariants) {
    int kept = 0;
    for (unsigned seed = 1; seed <= 2; ++seed)
      for (const SparseMatrix& a : matrices(v.kind, seed)) {
        SCOPED_TRACE(std::string(v.name) + ", n = " + std::to_string(a.rows) + ", seed " + std::to_string(seed));
        Options partial = on_gpu(true), whole = on_gpu(false);
        for (Options* o : {&partial, &whole}) {
          o->kind = v.kind;
          o->precision = v.precision;
          o->max_block_size = v.block;
          o->rescale = v.rescale;
        }
        expect_bits_in_changing_patterns(partial, whole, a, seed, kept);
        if (testing::Test::HasFailure()) return;
      }
    RecordProperty(std::string(v.name) + ", patterns", kept);
    EXPECT_GT(kept, 5) << v.name << ": hardly ever less than everything is made";
  }
}

// An entry between two nodes of a face. What all pivots are measured by, the largest entry, stays.
SparseMatrix with_entry(const SparseMatrix& a) {
  std::vector<reference::Triple> t;
  double least = 1;
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q) {
      const double v = a.values[static_cast<std::size_t>(q)];
      if (a.row_ind[static_cast<std::size_t>(q)] == c) least = std::min(least, v);
      t.push_back({a.row_ind[static_cast<std::size_t>(q)], c, v});
    }
  t.push_back({a.cols - 3, a.cols - 9, -0.1 * least});
  return reference::from_triples(a.cols, t, a.storage);
}

TEST_F(GpuKeptNumbers, AreThoseThatTheChangeDoesNotReach) {
  const SparseMatrix a = natural_elasticity(14), b = with_entry(a);
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    SCOPED_TRACE(static_cast<int>(kind));
    Options o = on_gpu(true);
    o.kind = kind;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    EXPECT_EQ(s.factorize(a).work_share, 1);
    for (int k = 0; k < 3; ++k)
      for (const SparseMatrix* now : {&b, &a}) {
        ASSERT_FALSE(s.analyze_change(*now).full);
        const FactorResult f = s.factorize(*now);
        ASSERT_TRUE(f.status.ok()) << f.status.message;
        EXPECT_GT(f.work_share, 0);
        EXPECT_LT(f.work_share, 0.8);
        EXPECT_EQ(f.whole_reason, "");
      }
    ASSERT_FALSE(s.analyze_change(a).full);
    EXPECT_EQ(s.factorize(a).work_share, 0) << "nothing has changed";
    double* there = nullptr;  // values of the caller's on the device are compared there
    ASSERT_EQ(cudaMalloc(reinterpret_cast<void**>(&there), b.values.size() * sizeof(double)), cudaSuccess);
    ASSERT_EQ(cudaMemcpy(there, b.values.data(), b.values.size() * sizeof(double), cudaMemcpyHostToDevice),
              cudaSuccess);
    ASSERT_FALSE(s.analyze_change(b).full);
    FactorResult f = s.refactorize_device(there, b.nonzeros());
    EXPECT_LT(f.work_share, 0.8) << f.status.message;
    EXPECT_GT(f.work_share, 0);
    ASSERT_FALSE(s.analyze_change(a).full);  // the values before are on the device alone
    f = s.factorize(a);
    EXPECT_LT(f.work_share, 0.8) << f.status.message;
    EXPECT_EQ(cudaFree(there), cudaSuccess);
  }
}

// What is refused between a pattern and its factor leaves nothing that is wrong.
TEST_F(GpuKeptNumbers, AfterARefusedCallAreRight) {
  const SparseMatrix a = natural_elasticity(6), b = in_contact(a);
  Solver whole(on_gpu(false));
  ASSERT_TRUE(whole.analyze(a).status.ok());
  ASSERT_TRUE(whole.analyze_change(b).analysis.status.ok());
  auto& faults = device::cuda::call_faults();
  int refused = 0, whole_ones = 0;
  std::vector<double> values = b.values;
  for (int call = 1;; ++call) {
    SCOPED_TRACE(call);
    ASSERT_LT(call, 600);
    Solver s(on_gpu(true));
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_TRUE(s.factorize(a).status.ok());
    ASSERT_TRUE(s.analyze_change(b).analysis.status.ok());
    faults.arm(call);
    const FactorResult f = s.refactorize(values);
    const bool done = faults.refused == nullptr;
    faults.arm(0);
    if (f.status.ok() && f.work_share == 1) {
      ++whole_ones;
      EXPECT_NE(f.whole_reason, "");
    }
    if (f.status.ok()) {
      (void)expect_same_factors(s, whole, values, some_right_hand_side<double>(a.rows, 4));
    }
    if (done) {
      EXPECT_TRUE(f.status.ok());
      EXPECT_LT(f.work_share, 1);
      break;
    }
    ++refused;
    values[9] *= 1.01;
    (void)expect_same_factors(s, whole, values, some_right_hand_side<double>(a.rows, 4));
    if (testing::Test::HasFailure()) return;
  }
  EXPECT_GT(refused, 20);
  EXPECT_GT(whole_ones, 5) << "what cannot be kept is made, and said";
}

}  // namespace gpu_kept_numbers_test
}  // namespace espalier

#endif
