/// \file
/// A symmetric matrix times a block of vectors.
#pragma once

#include <span>
#include <vector>

#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::modes {

/// Both triangles of a symmetric matrix, row by row: a row is summed by one thread, for several vectors at a time.
class Product {
 public:
  Product() = default;
  /// @param lower  symmetric_lower, rows rising, no duplicates; entries that are zero are left out
  Product(const SparseMatrix& lower, base::ThreadPool& pool);
  /// y = A x for `columns` vectors, one after another; they must not overlap.
  void apply(base::ThreadPool& pool, const double* x, double* y, Index columns) const;
  [[nodiscard]] Index n() const { return n_; }
  /// By full rows.
  [[nodiscard]] std::span<const Offset> first() const { return first_; }
  [[nodiscard]] std::span<const Index> column() const {
    return {column_.data(), static_cast<std::size_t>(column_.size())};
  }
  [[nodiscard]] std::span<const double> value() const {
    return {value_.data(), static_cast<std::size_t>(value_.size())};
  }

 private:
  Index n_ = 0;
  std::vector<Offset> first_;
  base::Buffer<Index> column_;
  base::Buffer<double> value_;
  mutable base::Buffer<double> packed_;  // kWidth vectors, row by row
};

}  // namespace espalier::modes
