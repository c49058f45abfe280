/// \file
/// The equations themselves on a GPU, beside their factor: values scaled there, right-hand sides permuted, residuals in
/// twice the precision. What a factorization and a solve with arrays in device memory need. No CUDA header is needed.
#pragma once

#include <memory>
#include <span>

#include "device/cuda/cuda_executor.hpp"
#include "espalier/matrix.hpp"

namespace espalier::device::cuda {

/// What the GPU gets a copy of; the views need not outlive the construction. Empty spans: identity, ones.
struct EquationArrays {
  MatrixView pattern;  ///< any storage, no duplicates; values are not looked at
  /// Index of the entries by rows: of all (general storage), of those off the diagonal (a triangle), empty (both).
  std::span<const Offset> row_ptr;
  std::span<const Index> row_col;
  std::span<const Offset> row_source;            ///< where the entry stands in the pattern
  std::span<const Index> order;                  ///< n; unknown by position of the elimination
  std::span<const Index> row_of_col;             ///< n; equation matched to each unknown
  std::span<const double> row_scale, col_scale;  ///< n
  std::span<const Offset> diagonal;              ///< n, by position: where the diagonal entry stands; empty: not wanted
};

/// Largest of a right-hand side's residuals and of what they are measured against; see solve/residual.hpp.
struct DeviceResidual {
  double residual = 0;       ///< |b - A x|_inf; infinity when anything is not finite
  double componentwise = 0;  ///< max over rows of |b - A x| / (|A| |x| + |b|), 0/0 counting as 0
  double x = 0, b = 0;       ///< |x|_inf, |b|_inf
};

/// All pointers that the calls take are memory of the executor's GPU; vectors have n values, several stand one after
/// another. Every call returns when the GPU is done. T: precision of the factor.
template <class T>
class DeviceEquations {
 public:
  virtual ~DeviceEquations() = default;

  struct Values {
    double largest = 0;   ///< magnitude of the largest scaled entry
    bool finite = true;   ///< all of them
    double norm_inf = 0;  ///< |A|_inf
    double norm_one = 0;  ///< |A|_1
  };
  /// Takes a copy of the values (pattern's order; FP64) and scales them for the executor.
  virtual Values take_values(const double* values) = 0;
  [[nodiscard]] virtual const T* scaled_values() const = 0;
  /// The values as they were given, and (n, host memory) the scaled diagonal by position.
  virtual void read_values(std::span<double> to) const = 0;
  virtual void read_diagonal(std::span<double> to) = 0;

  /// x = op(A)^-1 b with the executor's factor, for `columns` right-hand sides; x may equal b.
  virtual void substitute(const double* b, double* x, Index columns, bool transpose) = 0;
  /// r[k] = b[k] - op(A) x[k]; r[k] may be null.
  struct Column {
    const double* b;
    const double* x;
    double* r;
  };
  virtual void residuals(std::span<const Column> columns, bool transpose, std::span<DeviceResidual> found) = 0;
  virtual void copy(const double* from, double* to) = 0;
  /// to += from. @returns whether all of `to` was finite before
  virtual bool add(const double* from, double* to) = 0;
  /// Memory for vectors; grows and moves when more are asked for than ever before.
  virtual double* vectors(Index slot, Index columns) = 0;
  static constexpr Index kSlots = 4;  ///< slots of vectors()
  /// Copies from anywhere to anywhere.
  virtual void transfer(double* to, const double* from, Offset count) = 0;
  /// Host memory from which values will come: pinned while the object lives, so that they travel at the link's rate.
  virtual void pin(std::span<const double> values) = 0;
  /// Waits for what is enqueued on a CUDA stream (cudaStream_t).
  virtual void wait_for(void* stream) = 0;
  [[nodiscard]] virtual Offset bytes() const = 0;
};

/// @param executor  must outlive the object
/// @param memory_bytes  budget for everything taken here; 0: what is free
/// @throws Error(out_of_memory), Error(device_error)
template <class T>
std::unique_ptr<DeviceEquations<T>> make_device_equations(const EquationArrays& arrays, CudaExecutor<T>& executor,
                                                          int device, Offset memory_bytes);

}  // namespace espalier::device::cuda
