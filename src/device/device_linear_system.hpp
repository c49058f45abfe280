/// \file
/// The optional part of an executor: the linear system itself in the memory of its device, beside its factor. Values
/// are scaled there, right-hand sides permuted, residuals computed in twice the precision; a factorization and a solve
/// then need no array of the host.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "device/factor_outcome.hpp"
#include "device/residual_space.hpp"
#include "espalier/matrix.hpp"

namespace espalier::device {

/// Copies on the host, by as many threads as it likes.
using HostCopy = std::function<void(double* to, const double* from, Offset count)>;

/// What the device gets a copy of; but for `values`, the views need not outlive the construction. Empty spans:
/// identity, ones.
struct LinearSystemArrays {
  MatrixView pattern;  ///< any storage, no duplicates; values are not looked at
  /// Index of the entries by rows: of all (general storage), of those off the diagonal (a triangle), empty (both).
  std::span<const Offset> row_ptr;
  std::span<const Index> row_col;
  std::span<const Offset> row_source;            ///< where the entry stands in the pattern
  std::span<const Index> order;                  ///< n; unknown by position of the elimination
  std::span<const Index> row_of_col;             ///< n; equation matched to each unknown
  std::span<const double> row_scale, col_scale;  ///< n
  std::span<const Offset> diagonal;              ///< n, by position: where the diagonal entry stands; empty: not wanted
  double rounding = 0;  ///< a pivot of at most so many times its diagonal entry counts as zero (llt)
  /// Not empty: the matrix and the vectors are complex, two doubles a number; `order`, `diagonal` and the factor are
  /// those of the real form (solver/analysis/real_form.hpp), the columns of whose pattern begin here (2n + 1).
  std::span<const Offset> real_columns;
  bool hermitian = false;          ///< of a complex matrix: see the blocks of its real form
  std::span<const double> values;  ///< of the host, in the pattern's order: where send_values() finds them
  HostCopy copy;                   ///< copies on the host
};

/// Pointers are memory of the device unless said otherwise; values are in the order of the pattern, vectors have n
/// numbers, several stand one after another. Calls enqueue what they do in one order and return at once, unless they
/// say that they wait.
class DeviceLinearSystem : public PartSpace {
 public:
  /// The number of the device, as its runtime counts.
  [[nodiscard]] virtual int number() const = 0;
  /// Takes a copy of new values and scales it for the factorization.
  virtual void take_values(const double* values) = 0;
  /// The same for the part [first, first + count) of LinearSystemArrays::values; all of them must be sent.
  virtual void send_values(Offset first, Offset count) = 0;
  /// Whether ranks share the factor. Each has a copy of the system on its device then, and all calls are collective.
  [[nodiscard]] virtual bool on_ranks() const { return false; }
  /// Whether all values have come, so that some of them can be replaced.
  [[nodiscard]] virtual bool has_values() const { return false; }
  /// New values at some places of LinearSystemArrays::values. @pre has_values()
  virtual void replace_values(std::span<const Offset> /*places*/, std::span<const double> /*values*/) {}
  /// Marks (1) the rows and columns, n each, of entries whose values differ, bit by bit, from those that came last.
  /// Waits.
  /// @pre has_values() @returns false where the device cannot tell
  virtual bool mark_differing(const double* /*values*/, std::span<unsigned char> /*rows*/,
                              std::span<unsigned char> /*columns*/) const {
    return false;
  }
  /// On ranks: the same as send_values(), from an array of the device.
  virtual void copy_values(const double* /*from*/, Offset /*first*/, Offset /*count*/) {}
  /// On ranks: this one has sent the values [first, first + count); all get what all have sent, which are the whole.
  virtual void share_values(Offset /*first*/, Offset /*count*/) {}
  /// Factors the values that were taken or sent last. Waits.
  /// @param smallest_pivot  smaller ones are replaced; relative to the largest scaled entry
  /// @returns nothing when an entry is not finite
  virtual std::optional<FactorOutcome> factorize(double smallest_pivot) = 0;
  /// The same, where only entries of some fronts are new since the last factorization: see
  /// Executor::factorize_changed(). @param reached  fronts of the plan; not 0: one of them, closed under parents
  virtual std::optional<FactorOutcome> factorize_changed(double smallest_pivot, std::span<const char> /*reached*/) {
    return factorize(smallest_pivot);
  }
  /// The values as they were given, to host memory. Waits.
  virtual void read_values(std::span<double> to) const = 0;

  /// x = op(A)^-1 b with the factor, for `columns` right-hand sides; x may equal b.
  virtual void substitute(const double* b, double* x, Index columns, bool transpose) = 0;
  /// Seconds of the first substitution since the last call, if compute() came after it; else -1.
  virtual double take_substitution_seconds() = 0;
  /// Waits until vectors are as the calls left them; an Error when a substitution was given up.
  virtual void finish() = 0;
  /// The same after a failure whose error is known.
  virtual void settle() noexcept = 0;
  /// Memory for right-hand sides and solutions; grows, and moves, when more are asked for than ever before.
  virtual double* right_hand_sides(Index columns) = 0;
  virtual double* solutions(Index columns) = 0;
  /// @throws std::invalid_argument naming `what` when the array is in host memory that the device cannot reach
  virtual void expect_reachable(const double* array, const char* what) const = 0;
  /// Waits for what is enqueued on a queue of the device that is the caller's (a cudaStream_t); null: the default one.
  virtual void wait_for(void* queue) = 0;
  /// Also from and to memory of the host that is the device's (host_memory()).
  virtual void copy_vectors(const double* from, double* to, Offset count) = 0;
  /// Memory of the host that copies reach straight, for as long as somebody owns it.
  virtual std::shared_ptr<double[]> host_memory(Offset count) = 0;
  /// From host memory, which may change on return, and to host memory (waits).
  virtual void send(double* to, const double* from, Offset count) = 0;
  virtual void fetch(double* to, const double* from, Offset count) = 0;
};

/// Waits for a device that a failure has left at work on the caller's arrays.
class Settled {
 public:
  explicit Settled(DeviceLinearSystem& device) : device_(device) {}
  Settled(const Settled&) = delete;
  Settled& operator=(const Settled&) = delete;
  ~Settled() { device_.settle(); }

 private:
  DeviceLinearSystem& device_;
};

}  // namespace espalier::device
