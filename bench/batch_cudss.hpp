/// \file
/// cuDSS's uniform batch: many systems of one pattern on the GPU, for bench/batch_bench.cpp.
#pragma once

#include <memory>
#include <span>

#include "espalier/matrix.hpp"

namespace espalier::bench {

/// How the batch is set up. cuDSS 1.0 may refuse a matching in batches; what it refuses is a Failure.
struct CudssBatchSettings {
  bool definite = false;
  bool matching = false;     ///< by diagonal product
  int refinement_steps = 0;  ///< its own, for each solution
};

/// Seconds of one call.
struct CudssBatchTimes {
  double whole = 0;   ///< values and right-hand sides to the GPU, both phases, solutions back
  double phases = 0;  ///< refactorization and solve alone
};

/// `count` symmetric systems of the pattern of `a` (lower triangle, rows rising, the whole diagonal stored), analyzed
/// and factorized once when this is made. Throws Failure: missing without the library or a GPU, else what cuDSS
/// reports.
class CudssBatch {
 public:
  /// `values`: count * nonzeros of one system after another.
  CudssBatch(const SparseMatrix& a, std::span<const double> values, Index count, const CudssBatchSettings& settings);
  ~CudssBatch();

  /// New values; b and x hold count * n numbers of one system after another.
  CudssBatchTimes solve(std::span<const double> values, std::span<const double> b, std::span<double> x);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace espalier::bench
