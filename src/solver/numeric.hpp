/// \file
/// The numeric factor of one system in one precision, with scaling and permutation around the executor.
#pragma once

#include <memory>
#include <optional>

#include "base/timeline.hpp"
#include "device/executor.hpp"
#include "plan/plan.hpp"
#include "solver/device_choice.hpp"
#include "solver/device_system.hpp"
#include "solver/equations.hpp"

namespace espalier::solver {

/// Hides the precision of the factor from the solver.
class Numeric {
 public:
  virtual ~Numeric() = default;
  /// Factors the values in `equations`, which must have been sent to device_system() where there is one. Pivots below
  /// `smallest_pivot` times the largest scaled entry are replaced.
  virtual device::FactorOutcome factorize() = 0;
  /// The equations on the GPU of the factor; null: they are on the host alone.
  virtual DeviceSystem* device_system() = 0;
  /// factorize() with values in that GPU's memory, in the order of Equations::a. Nothing when one is not finite.
  virtual std::optional<device::FactorOutcome> factorize_device(const double* values) = 0;
  virtual void set_smallest_pivot(double smallest_pivot) = 0;
  /// Solves op(A) x = b for `columns` right-hand sides, column-major, n values each; x may alias b.
  virtual void solve(const double* b, double* x, Index columns, bool transpose) = 0;
  [[nodiscard]] virtual std::string device_name() const = 0;
  /// Most bytes of factor and work arrays that the device held.
  [[nodiscard]] virtual Offset device_peak_bytes() const = 0;
  [[nodiscard]] virtual device::StreamReport streaming() const = 0;
  /// The last factorization by devices; empty where there is one.
  [[nodiscard]] virtual std::vector<device::DeviceWork> device_work() const = 0;
};

struct NumericOptions {
  Kind kind = Kind::llt;
  DeviceChoice device;
  std::vector<Offset> device_memory_bytes = {};  ///< budget of each device; 0: what is free
  Offset pinned_memory_bytes = 0;                ///< of a factor that streams; -1: half of the machine's memory
  double threshold = 0.01;
  double smallest_pivot = 0;  ///< relative to the largest scaled entry
};

/// @param single  FP32 instead of FP64
/// @param residual  of the same equations; looked at during the call alone
std::unique_ptr<Numeric> make_numeric(const plan::Plan& plan, const Equations& equations,
                                      const solve::ResidualOperator& residual, const NumericOptions& options,
                                      bool single, base::ThreadPool& pool, base::MemoryBudget& budget,
                                      base::Timeline* timeline);

}  // namespace espalier::solver
