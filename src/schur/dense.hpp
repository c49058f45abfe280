/// \file
/// A factor of the dense matrix that a condensation leaves.
#pragma once

#include <span>

#include "espalier/solver.hpp"

namespace espalier::schur {

/// S as a sparse matrix in which every entry is stored: it becomes one front, with the pivoting, the verdict on
/// singularity and the devices of all others.
class DenseFactor {
 public:
  /// @param s  size * size, column-major
  DenseFactor(std::span<const double> s, Index size, bool symmetric, Options options);

  [[nodiscard]] const Status& status() const { return factor_.status; }
  [[nodiscard]] const FactorResult& result() const { return factor_; }
  /// In place, `columns` right-hand sides of `size` values.
  Status solve(std::span<double> x, Index columns, Transpose transpose);

 private:
  Solver solver_;
  FactorResult factor_;
};

}  // namespace espalier::schur
