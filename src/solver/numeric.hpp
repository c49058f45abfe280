/// \file
/// The numeric factor of one system in one precision, with scaling and permutation around the executor.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "device/executor.hpp"
#include "solver/analysis.hpp"
#include "solver/context.hpp"

namespace espalier::solver {

/// Hides the precision of the factor from the solver.
class Numeric {
 public:
  virtual ~Numeric() = default;
  /// Factors the solver's values, which must have been sent to device_system() where there are some. Pivots below
  /// the smallest pivot times the largest scaled entry are replaced.
  virtual device::FactorOutcome factorize() = 0;
  /// See Executor::halt_at_failures().
  virtual void halt_at_failures(bool halt) = 0;
  /// After a halted factorization; null: the last one was not.
  [[nodiscard]] virtual const device::LeftContributions* left_contributions() const = 0;
  /// Goes on with an analysis in which pivots have moved, which takes the place of the one before. @returns false where
  /// that cannot be; nothing has changed then
  /// @throws Error(out_of_memory); likewise
  virtual bool change_analysis(const ChangedAnalysis& changed) = 0;
  /// Of the values of the last factorization, after change_analysis(): see Executor::with_changed_plan().
  virtual device::FactorOutcome factorize_rest() = 0;
  /// As they were scaled for the last factorization; empty: they are not there in FP64.
  [[nodiscard]] virtual std::span<const double> scaled_values() const = 0;
  /// The rule of the last factorization. Without meaning where scaled_values() is empty.
  [[nodiscard]] virtual const device::PivotRule& pivot_rule() const = 0;
  /// The linear system on the device of the factor; null: it is on the host alone.
  virtual device::DeviceLinearSystem* device_system() = 0;
  /// factorize() with values in that device's memory, in the order of PreparedMatrix::a. Nothing when one is not
  /// finite.
  virtual std::optional<device::FactorOutcome> factorize_device(const double* values) = 0;
  virtual void set_smallest_pivot(double smallest_pivot) = 0;
  /// Whether scalings of the values' own are those of matchings, from the next factorization on.
  virtual void scale_by_matching(bool matching) = 0;
  /// Solves op(A) x = b for `columns` right-hand sides, column-major, n values each; x may alias b.
  virtual void solve(const double* b, double* x, Index columns, bool transpose) = 0;
  /// Of the last factorization.
  [[nodiscard]] virtual const Scales& scales() const = 0;
  [[nodiscard]] virtual std::string device_name() const = 0;
  /// Most bytes of factor and work arrays that the device held.
  [[nodiscard]] virtual Offset device_peak_bytes() const = 0;
  [[nodiscard]] virtual device::OutOfCoreReport out_of_core() const = 0;
  /// The last factorization by devices; empty where there is one.
  [[nodiscard]] virtual std::vector<device::DeviceWork> device_work() const = 0;
};

/// In the precision of the options. All arguments outlive the factor.
/// @param values  of the factorizations to come, where the caller keeps them
std::unique_ptr<Numeric> make_numeric(const Analysis& analysis, std::span<const double> values, const Context& context);

}  // namespace espalier::solver
