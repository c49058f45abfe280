/// \file
/// A symmetric matrix times a block of vectors.
#pragma once

#include <vector>

#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::modes {

/// Both triangles of a symmetric matrix, row by row: a row is summed by one thread, for several vectors at a time.
class Product {
 public:
  Product() = default;
  /// @param lower  symmetric_lower, rows rising, no duplicates; entries that are zero are left out
  explicit Product(const SparseMatrix& lower);
  /// y = A x for `columns` vectors, one after another; they must not overlap.
  void apply(base::ThreadPool& pool, const double* x, double* y, Index columns) const;
  [[nodiscard]] Index n() const { return n_; }

 private:
  Index n_ = 0;
  std::vector<Offset> first_;
  std::vector<Index> column_;
  std::vector<double> value_;
};

}  // namespace espalier::modes
