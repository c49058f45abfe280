// Partial refactorization on a GPU. Truth: the bits of a solver on the same GPU that makes everything each time.
#include <gtest/gtest.h>

#include <string>

#include "solver/gpu/gpu_variants.hpp"

#if ESPALIER_WITH_CUDA
#include <cuda_runtime_api.h>

namespace espalier {
namespace gpu_partial_test {

using namespace changed_values;
using namespace gpu_variants;

class GpuPartial : public FaultsOnGpu {};

TEST_F(GpuPartial, HasTheBitsOfAWholeOne) {
  for (const Variant& v : kVariants) {
    Shares shares;
    for (unsigned seed = 1; seed <= 2; ++seed)
      for (const SparseMatrix& a : matrices(v.kind, seed)) {
        SCOPED_TRACE(std::string(v.name) + ", n = " + std::to_string(a.rows) + ", seed " + std::to_string(seed));
        Options partial = on_gpu(true), full = on_gpu(false);
        for (Options* o : {&partial, &full}) {
          o->kind = v.kind;
          o->precision = v.precision;
          o->max_block_size = v.block;
          o->rescale = v.rescale;
        }
        expect_bits_of_all<Solver>(partial, full, a, seed, 20, &shares);
        if (testing::Test::HasFailure()) return;
      }
    RecordProperty(v.name, shares.some);
    EXPECT_GT(shares.some, 5) << v.name << ": hardly ever less than everything is made";
    EXPECT_GT(shares.none, 0) << v.name;
  }
}

// Each GPU has a part of the fronts that they share; all are made again where they have to be.
TEST_F(GpuPartial, OnTwoGpusHasTheBitsOfAWholeOne) {
  if (!test::has_gpus(2)) GTEST_SKIP() << "there is one GPU";
  device::PlanWish wish;
  wish.devices = 2;
  wish.keep_contributions = true;
  const bool keep = device::registry().find("gpu")->plan_options(wish).keep_contributions;
  for (const Variant& v : kVariants) {
    Shares shares;
    for (unsigned seed = 1; seed <= 2; ++seed)
      for (const SparseMatrix& a : matrices(v.kind, seed)) {
        SCOPED_TRACE(std::string(v.name) + ", n = " + std::to_string(a.rows) + ", seed " + std::to_string(seed));
        Options partial = on_gpu(true), full = on_gpu(false);
        for (Options* o : {&partial, &full}) {
          o->device = "gpu:0,1";
          o->kind = v.kind;
          o->precision = v.precision;
          o->max_block_size = v.block;
          o->rescale = v.rescale;
        }
        expect_bits_of_all<Solver>(partial, full, a, seed, 20, &shares);
        if (testing::Test::HasFailure()) return;
      }
    EXPECT_EQ(shares.some + shares.none > 0, keep) << v.name;
  }
}

TEST_F(GpuPartial, OfComplexSystemsToo) {
  for (const auto sort : {test::Sort::symmetric, test::Sort::hermitian, test::Sort::definite, test::Sort::general}) {
    SCOPED_TRACE("sort " + std::to_string(static_cast<int>(sort)));
    const bool hermitian = sort == test::Sort::hermitian || sort == test::Sort::definite;
    const Storage storage = sort == test::Sort::general ? Storage::general
                            : hermitian                 ? Storage::hermitian_lower
                                                        : Storage::symmetric_lower;
    Shares shares;
    for (unsigned seed = 1; seed <= 2; ++seed) {
      const ComplexSparseMatrix a = test::sparse(test::random_dense(90, sort, seed), storage);
      expect_bits_of_all<ComplexSolver>(on_gpu(true), on_gpu(false), a, seed, 16, &shares);
    }
    EXPECT_GT(shares.none + shares.some, 0);
  }
}

TEST_F(GpuPartial, MakesWhatValuesReach) {
  const SparseMatrix a = elasticity(12);
  Solver s(on_gpu(true));
  ASSERT_TRUE(s.analyze(a).status.ok());
  EXPECT_EQ(s.factorize(a).work_share, 1);
  EXPECT_EQ(s.factorize(a).work_share, 0) << "nothing has changed";
  std::vector<double> values = a.values;
  values.front() *= 1.25;
  const FactorResult one = s.refactorize(values);
  EXPECT_GT(one.work_share, 0);
  EXPECT_LT(one.work_share, 0.7) << "the fronts from one entry to the root";
  const FactorResult entries = s.refactorize_entries(std::vector<Offset>{0}, std::vector<double>{a.values.front()});
  EXPECT_EQ(entries.work_share, one.work_share);
  for (double& v : values) v *= 3;
  EXPECT_GT(s.refactorize(values).work_share, 0.99);
}

// Values that the device compares with those it has.
TEST_F(GpuPartial, TakesValuesFromTheMemoryOfTheDevice) {
  const SparseMatrix a = elasticity(9);
  std::vector<double> now = a.values;
  double* there = nullptr;
  ASSERT_EQ(cudaMalloc(reinterpret_cast<void**>(&there), now.size() * sizeof(double)), cudaSuccess);
  Solver partial(on_gpu(true)), full(on_gpu(false));
  ASSERT_TRUE(partial.analyze(a).status.ok());
  ASSERT_TRUE(full.analyze(a).status.ok());
  const std::vector<double> b = reference::random_vector(a.rows, 4);
  std::mt19937 random(3);
  Shares shares;
  for (int round = 0; round < 24; ++round) {
    SCOPED_TRACE(round);
    FactorResult p;
    if (round % 5 == 3) {
      p = partial.refactorize(now);  // from the host in between
    } else {
      ASSERT_EQ(cudaMemcpy(there, now.data(), now.size() * sizeof(double), cudaMemcpyHostToDevice), cudaSuccess);
      p = partial.refactorize_device(there, a.nonzeros());
    }
    ++(p.work_share == 0 ? shares.none : p.work_share < 1 ? shares.some : shares.all);
    const FactorResult f = full.refactorize(now);
    ASSERT_EQ(p.status.code, f.status.code) << p.status.message << " / " << f.status.message;
    if (p.status.ok()) {
      std::vector<double> x(b.size()), y(b.size());
      (void)partial.solve(b, x);
      (void)full.solve(b, y);
      ASSERT_TRUE(same_bits(x, y)) << "share " << p.work_share;
    }
    now[static_cast<std::size_t>(random() % now.size())] *= 1.01;
  }
  EXPECT_GT(shares.some, 5);
  EXPECT_EQ(cudaFree(there), cudaSuccess);
}

// Its kernels are those of other solvers, too, whose fronts may need less of what the kernels share.
TEST_F(GpuPartial, GoesOnAfterASolverOfSmallerFronts) {
  const SparseMatrix a = elasticity(11), small = reference::random_system(12, 2, Values::positive, 1);
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    Options o = on_gpu(true);
    o.kind = kind;
    Solver s(o), other(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_TRUE(s.factorize(a).status.ok());
    ASSERT_TRUE(other.analyze(small).status.ok());
    ASSERT_TRUE(other.factorize(small).status.ok());
    std::vector<double> values = a.values;
    values.front() *= 0.75;
    const FactorResult f = s.refactorize(values);
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_LT(f.work_share, 1);
  }
}

// A device that fails in the middle leaves no factor, and the next one is whole and right.
TEST_F(GpuPartial, AfterARefusedCallEverythingIsMade) {
  const SparseMatrix a = elasticity(6);
  std::vector<double> values = a.values;
  values[5] *= 1.5;
  Solver whole(on_gpu(false));
  ASSERT_TRUE(whole.analyze(a).status.ok());
  const std::vector<double> b = reference::random_vector(a.rows, 4);
  std::vector<double> x(b.size()), y(b.size());
  auto& faults = device::cuda::call_faults();
  int refused = 0;
  for (int call = 1;; ++call) {
    SCOPED_TRACE(call);
    ASSERT_LT(call, 400);
    Solver s(on_gpu(true));
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_TRUE(s.factorize(a).status.ok());
    faults.arm(call);
    const FactorResult f = s.refactorize(values);
    const bool done = faults.refused == nullptr;
    faults.arm(0);
    if (done) {
      EXPECT_TRUE(f.status.ok());
      EXPECT_LT(f.work_share, 1);
      break;
    }
    ++refused;
    EXPECT_FALSE(f.status.ok());
    EXPECT_NE(s.state(), Solver::State::factorized) << "the old factor is not called valid";
    values[9] *= 1.01;
    const FactorResult again = s.refactorize(values);
    ASSERT_TRUE(again.status.ok()) << again.status.message;
    EXPECT_EQ(again.work_share, 1);
    ASSERT_TRUE(whole.refactorize(values).status.ok());
    (void)s.solve(b, x);
    (void)whole.solve(b, y);
    ASSERT_TRUE(same_bits(x, y));
  }
  EXPECT_GT(refused, 5);
}

// Such options with a part of the memory that a factor takes in core, from `part` on, with which it goes out of core.
template <class AnySolver, class Matrix>
Options in_budget(Options o, const Matrix& a, double part) {
  o.partial_refactorization = false;
  AnySolver probe(o);
  EXPECT_TRUE(probe.analyze(a).status.ok());
  const Offset whole = probe.factorize(a).devices.front().peak_bytes;
  o.partial_refactorization = true;
  for (; part < 1; part *= 1.2) {
    o.device_memory_bytes = static_cast<Offset>(part * static_cast<double>(whole));
    AnySolver s(o);
    if (!s.analyze(a).status.ok()) continue;
    const auto f = s.factorize(a);
    if (f.status.ok()) {
      EXPECT_GT(f.devices.front().streamed_out_bytes, 0) << "in core with " << part << " of what it takes";
      return o;
    }
    EXPECT_EQ(f.status.code, StatusCode::out_of_memory) << f.status.message;
  }
  ADD_FAILURE() << "no budget does";
  return o;
}

TEST_F(GpuPartial, OutOfCoreHasTheBitsOfAWholeOne) {
  for (const Variant& v : kVariants) {
    if (v.precision == Precision::mixed) continue;  // a factor may stay in FP64, for which there is no room
    BudgetTally tally;
    for (const double part : {0.15, 0.5}) {
      const unsigned seed = part < 0.3 ? 1 : 2;
      for (const SparseMatrix& a : matrices(v.kind, seed)) {
        SCOPED_TRACE(std::string(v.name) + ", n = " + std::to_string(a.rows) + ", seed " + std::to_string(seed));
        Options o = on_gpu(true);
        o.kind = v.kind;
        o.precision = v.precision;
        o.max_block_size = v.block;
        o.rescale = v.rescale;
        follow_beside_new<Solver>(in_budget<Solver>(o, a, part), a, seed, 4, tally);
        if (HasFailure()) return;
      }
    }
    RecordProperty(v.name, tally.some);
    EXPECT_GT(tally.some, 3) << v.name << ": hardly ever less than everything is made";
    EXPECT_GT(tally.out_of_core, 10) << v.name;
  }
}

TEST_F(GpuPartial, OutOfCoreOfComplexSystemsToo) {
  BudgetTally tally;
  const SparseMatrix gyroscopic =
      matrix::generate(matrix::parse_generator(std::vector<std::string>{"gyroscopic", "6"}));
  for (const Storage storage : {Storage::symmetric_lower, Storage::hermitian_lower, Storage::general}) {
    SCOPED_TRACE("storage " + std::to_string(static_cast<int>(storage)));
    const ComplexSparseMatrix a = turned(storage == Storage::general ? gyroscopic : elasticity(7), storage);
    follow_beside_new<ComplexSolver>(in_budget<ComplexSolver>(on_gpu(true), a, 0.3), a, 3, 8, tally);
  }
  EXPECT_GT(tally.some, 3);
  EXPECT_GT(tally.out_of_core, 10);
}

// The store is larger than a page-locked block, so what is brought may lie in two of them.
TEST_F(GpuPartial, OutOfCoreMakesWhatValuesReach) {
  const SparseMatrix a = elasticity(22);
  const Options o = in_budget<Solver>(on_gpu(true), a, 0.3);
  Solver s(o), fresh(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  const double all = s.factorize(a).seconds;
  EXPECT_EQ(s.factorize(a).work_share, 0) << "nothing has changed";
  std::vector<double> values = a.values;
  values.front() *= 1.25;
  const FactorResult one = s.refactorize(values);
  ASSERT_TRUE(one.status.ok()) << one.status.message;
  EXPECT_GT(one.work_share, 0);
  EXPECT_LT(one.work_share, 0.8) << "the units from one entry to the root";
  for (std::size_t k = 1; k <= 12; ++k) {
    values[k * (values.size() / 13)] *= 1.01;
    const FactorResult f = s.refactorize(values);
    ASSERT_TRUE(f.status.ok()) << f.status.message;
  }
  ASSERT_TRUE(fresh.analyze(a).status.ok());
  ASSERT_TRUE(fresh.refactorize(values).status.ok());
  const std::vector<double> b = reference::random_vector(a.rows, 4);
  std::vector<double> x(b.size()), y(b.size());
  ASSERT_TRUE(s.solve(b, x).status.ok());
  ASSERT_TRUE(fresh.solve(b, y).status.ok());
  EXPECT_TRUE(same_bits(x, y));
  RecordProperty("seconds", std::to_string(all) + ", " + std::to_string(one.seconds));
}

// A call that is refused in the middle of a run that makes a part.
TEST_F(GpuPartial, OutOfCoreAfterARefusedCallEverythingIsMade) {
  const SparseMatrix a = elasticity(8);
  const Options o = in_budget<Solver>(on_gpu(true), a, 0.4);
  const std::vector<double> b = reference::random_vector(a.rows, 4);
  std::vector<double> x(b.size()), y(b.size()), values = a.values;
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  auto& faults = device::cuda::call_faults();
  int refused = 0;
  for (int call = 1;; call += call < 40 ? 3 : 23) {
    SCOPED_TRACE(call);
    ASSERT_LT(call, 4000);
    values[static_cast<std::size_t>(5 * call) % values.size()] *= 1.01;
    faults.arm(call);
    const FactorResult f = s.refactorize(values);
    const bool done = faults.refused == nullptr;
    faults.arm(0);
    if (!done) {
      ++refused;
      if (!f.status.ok()) {
        EXPECT_NE(s.state(), Solver::State::factorized) << "the old factor is not called valid";
        const FactorResult again = s.refactorize(values);
        ASSERT_TRUE(again.status.ok()) << again.status.message;
        EXPECT_EQ(again.work_share, 1);
      }
    }
    Solver whole(o);
    ASSERT_TRUE(whole.analyze(a).status.ok());
    ASSERT_TRUE(whole.refactorize(values).status.ok());
    ASSERT_TRUE(s.solve(b, x).status.ok());
    ASSERT_TRUE(whole.solve(b, y).status.ok());
    ASSERT_TRUE(same_bits(x, y));
    if (done) break;
  }
  EXPECT_GT(refused, 5);
}

TEST_F(GpuPartial, WithoutMemoryToKeepFrontsEverythingIsMade) {
  const SparseMatrix a = elasticity(14);
  Solver probe(on_gpu(false));
  ASSERT_TRUE(probe.analyze(a).status.ok());
  ASSERT_TRUE(probe.factorize(a).status.ok());
  Options o = on_gpu(true);
  o.device_memory_bytes = probe.factorize(a).devices.front().peak_bytes * 5 / 4;
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  for (int k = 0; k < 2; ++k) {
    const FactorResult f = s.factorize(a);
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_EQ(f.work_share, 1);
    EXPECT_LE(f.devices.front().peak_bytes, o.device_memory_bytes);
    EXPECT_EQ(f.devices.front().streamed_out_bytes, 0) << "in core as without the wish";
  }
}

}  // namespace gpu_partial_test
}  // namespace espalier

#endif
