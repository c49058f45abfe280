/// \file
/// The equations themselves on a GPU, beside their factor: values scaled there, right-hand sides permuted, residuals in
/// twice the precision. What a factorization and a solve with arrays in device memory need. No CUDA header is needed.
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "device/cuda/executor/cuda_executor.hpp"
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
  double residual = 0;       ///< |b - op(A) x|_inf; infinity when anything is not finite
  double componentwise = 0;  ///< max over rows of |b - op(A) x| / (|op(A)| |x| + |b|), 0/0 counting as 0
  double x = 0, b = 0;       ///< |x|_inf, |b|_inf
  double matrix = 0;         ///< |op(A)|_inf
};

/// Copies on the host, by as many threads as it likes.
using HostCopy = std::function<void(double* to, const double* from, Offset count)>;

/// All pointers that the calls take are memory of the executor's GPU unless said otherwise; vectors have n values,
/// several stand one after another. Calls are enqueued on the executor's stream and do not wait, unless they say so.
template <class T>
class DeviceEquations {
 public:
  virtual ~DeviceEquations() = default;

  /// Takes a copy of the values (pattern's order; FP64) and scales them to where the executor factorizes them.
  virtual void take_values(const double* values) = 0;
  /// The same in pieces from host memory, which may change when it returns unless it was given to pin(): values[first,
  /// first + count), then, after the last one, take_sent_values().
  virtual void send_values(const double* values, Offset first, Offset count, const HostCopy& copy) = 0;
  virtual void take_sent_values() = 0;
  /// What CudaExecutor::factorize_filled() is told of them; tiny and rounding are the caller's.
  [[nodiscard]] virtual FilledValues filled() const = 0;
  /// The values as they were given, to host memory. Waits.
  virtual void read_values(std::span<double> to) const = 0;

  /// x = op(A)^-1 b with the executor's factor, for `columns` right-hand sides; x may equal b.
  virtual void substitute(const double* b, double* x, Index columns, bool transpose) = 0;
  /// r[k] = b[k] - op(A) x[k]; r[k] may be null. Waits, and says (by an Error) when a substitution was given up.
  struct Column {
    const double* b;
    const double* x;
    double* r;
  };
  virtual void residuals(std::span<const Column> columns, bool transpose, std::span<DeviceResidual> found) = 0;
  /// Seconds from the last substitute() before the last residuals() to these, on the GPU.
  [[nodiscard]] virtual double substitution_seconds() const = 0;
  virtual void copy(const double* from, double* to, Offset count) = 0;
  /// to += from.
  virtual void add(const double* from, double* to) = 0;
  /// Waits for all of these; an Error when a substitution was given up since the last residuals().
  virtual void finish() = 0;
  /// The same after a failure on the way, whose error is already known.
  virtual void settle() noexcept = 0;
  /// Memory for vectors; grows and moves when more are asked for than ever before.
  virtual double* vectors(Index slot, Index columns) = 0;
  static constexpr Index kSlots = 4;  ///< slots of vectors()
  /// From host memory, which may change when it returns, and to host memory (waits).
  virtual void send(double* to, const double* from, Offset count, const HostCopy& copy) = 0;
  virtual void fetch(double* to, const double* from, Offset count, const HostCopy& copy) = 0;
  /// Host memory from which values will come: pinned while the object lives, so that they travel at the link's rate.
  virtual void pin(std::span<const double> values) = 0;
  /// @throws std::invalid_argument naming `what` when kernels cannot reach the array: they would end the whole context
  virtual void expect_reachable(const double* array, const char* what) const = 0;
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
