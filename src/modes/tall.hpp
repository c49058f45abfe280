/// \file
/// Dense algebra of tall blocks: n rows, some columns, column-major. The same bits for every number of threads: rows
/// are cut into ranges that do not depend on it, and sums of ranges are added in order.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "espalier/types.hpp"

namespace espalier::modes {

using Dense = Eigen::MatrixXd;

/// Columns of n values each, counted in a budget.
class Tall {
 public:
  Tall() = default;
  Tall(Index rows, Index columns, base::MemoryBudget* budget)
      : rows_(rows), columns_(columns), data_(static_cast<std::int64_t>(rows) * columns, budget) {}
  [[nodiscard]] Index rows() const { return rows_; }
  [[nodiscard]] Index columns() const { return columns_; }
  /// The first ones alone count from now on; the memory stays.
  void keep(Index columns) { columns_ = columns; }
  [[nodiscard]] double* col(Index j) { return data_.data() + static_cast<std::int64_t>(rows_) * j; }
  [[nodiscard]] const double* col(Index j) const { return data_.data() + static_cast<std::int64_t>(rows_) * j; }

 private:
  Index rows_ = 0, columns_ = 0;
  base::Buffer<double> data_;
};

/// V^T W, for `p` columns of v and `b` of w.
Dense gram(base::ThreadPool& pool, Index n, const double* v, Index p, const double* w, Index b);
/// sum_i d_i w_ij^2 of each of `b` columns.
Eigen::VectorXd weighted_squares(base::ThreadPool& pool, Index n, const double* d, const double* w, Index b);
/// W -= V H, for H of p x b.
void subtract(base::ThreadPool& pool, Index n, const double* v, const Dense& h, double* w);
/// out = V S, for S of p x k. `out` may be v itself.
void combine(base::ThreadPool& pool, Index n, const double* v, const Dense& s, double* out);
/// y = B x for so many columns.
using Apply = std::function<void(const double* x, double* y, Index columns)>;
/// Makes columns B-orthonormal, each to those before it: V R^-1 with R^T R = V^T B V.
/// @param work  some columns of n rows  @pre they are nearly orthogonal
void orthonormalize(base::ThreadPool& pool, const Apply& b, Tall& v, Tall& work);
/// Random numbers in [-1, 1) that depend on seed, row and column alone.
void randomize(base::ThreadPool& pool, Index n, double* w, Index b, std::uint64_t seed);

}  // namespace espalier::modes
