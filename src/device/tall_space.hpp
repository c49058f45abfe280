/// \file
/// Dense algebra of tall blocks in the memory of a device, and symmetric matrices times them: what a search for
/// eigenvectors does beside its solves.
#pragma once

#include <span>

#include "espalier/types.hpp"

namespace espalier::device {

/// Blocks have rows() rows and some columns, one column after another; pointers to them are memory of the device. Small
/// matrices are of the host, column-major. Calls take effect in their order; those that fill arrays of the host wait.
/// Sums have the same order in every run.
class TallSpace {
 public:
  virtual ~TallSpace() = default;
  [[nodiscard]] virtual Index rows() const = 0;
  /// A block that lives as long as the space, one for each slot. One that grows loses what stands in it.
  /// @throws Error(out_of_memory)
  virtual double* block(Index slot, Index columns) = 0;
  /// A symmetric matrix by full rows. @returns its number
  virtual Index add_matrix(std::span<const Offset> first, std::span<const Index> column,
                           std::span<const double> value) = 0;
  /// The queue of the device (a cudaStream_t) in which all is done.
  [[nodiscard]] virtual void* queue() const = 0;

  virtual void send(double* to, const double* from, Index columns) = 0;
  virtual void fetch(double* to, const double* from, Index columns) = 0;
  /// Columns from the first to the last, so that a block may go to the left over itself.
  virtual void copy(const double* from, double* to, Index columns) = 0;
  /// y = A x; they must not overlap.
  virtual void multiply(Index matrix, const double* x, double* y, Index columns) = 0;
  /// out = V^T W, `p` x `b`.
  virtual void gram(const double* v, Index p, const double* w, Index b, double* out) = 0;
  /// out_j = sum_i d_i w_ij^2. @param d  one column
  virtual void weighted_squares(const double* d, const double* w, Index b, double* out) = 0;
  /// W -= V H. @param h  `p` x `b`
  virtual void subtract(const double* v, Index p, const double* h, Index b, double* w) = 0;
  /// out = V S; `out` may be v. @param s  `p` x `k`
  virtual void combine(const double* v, Index p, const double* s, Index k, double* out) = 0;
};

}  // namespace espalier::device
