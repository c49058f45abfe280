/// \file
/// The equations beside their factor on one GPU: factorization and solve without arrays on the host.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "device/cuda/executor/device_equations.hpp"
#include "plan/plan.hpp"
#include "solve/residual.hpp"
#include "solver/equations.hpp"

namespace espalier::solver {

/// Pointers are memory of the GPU unless said otherwise; values are in the order of Equations::a. Calls enqueue what
/// they do on one stream of the GPU and return at once, unless they say that they wait.
class DeviceSystem : public solve::ResidualSpace {
 public:
  /// Takes new values; or the part [first, first + count) of those of the Equations, of which all must be sent.
  virtual void take_values(const double* values) = 0;
  virtual void send_values(Offset first, Offset count) = 0;
  /// Factors the values that were taken or sent last. Waits. smallest_pivot: as for Numeric.
  /// @returns nothing when an entry is not finite
  virtual std::optional<device::FactorOutcome> factorize(double smallest_pivot) = 0;
  /// The values of the last factorize(), to host memory. Waits.
  virtual void read_values(std::span<double> to) const = 0;
  /// x = op(A)^-1 b; x may equal b.
  virtual void substitute(const double* b, double* x, Index columns, bool transpose) = 0;
  /// Seconds of the first substitution since the last call, if compute() came after it; else -1.
  virtual double take_substitution_seconds() = 0;
  /// Waits until vectors are as the calls left them; an Error when a substitution was given up.
  virtual void finish() = 0;
  /// The same after a failure whose error is known.
  virtual void settle() noexcept = 0;
  /// Two more slots of vectors, for right-hand sides and solutions.
  virtual double* right_hand_sides(Index columns) = 0;
  virtual double* solutions(Index columns) = 0;
  /// @throws std::invalid_argument naming `what` when the array is in host memory that the GPU cannot reach
  virtual void expect_reachable(const double* array, const char* what) const = 0;
  /// Waits for what is enqueued on a CUDA stream (cudaStream_t); null: the default stream.
  virtual void wait_for(void* stream) = 0;
  virtual void copy_vectors(const double* from, double* to, Offset count) = 0;
  /// From host memory, which may change on return, and to host memory (waits).
  virtual void send(double* to, const double* from, Offset count) = 0;
  virtual void fetch(double* to, const double* from, Offset count) = 0;
};

/// @param executor  must outlive the system, like `plan` and `equations`
/// @param device    the GPU on which its values and right-hand sides lie
/// @param pool      copies between arrays of the host; must outlive the system
/// @param memory_bytes  budget for what is taken besides the executor's memory; 0: what is free
/// @throws Error(out_of_memory), Error(device_error)
template <class T>
std::unique_ptr<DeviceSystem> make_device_system(const plan::Plan& plan, const Equations& equations,
                                                 const solve::ResidualOperator& residual, Kind kind,
                                                 device::cuda::CudaExecutor<T>& executor, int device,
                                                 Offset memory_bytes, base::ThreadPool& pool);

}  // namespace espalier::solver
