/// \file
/// The numeric factor of one system in one precision, with scaling and permutation around the executor.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "device/executor.hpp"
#include "solver/analysis/analysis.hpp"
#include "solver/session/context.hpp"

namespace espalier::solver {

/// The part of a Schur complement that eliminating the matrix leaves: -A_sr A_rr^-1 A_rs.
struct BorderContribution {
  std::vector<Index> rows;     ///< of the border that are coupled with the matrix, ascending
  std::vector<double> values;  ///< rows x rows, column-major; of a symmetric matrix the lower triangle alone
};

/// op(A) X = B where B has few entries and few unknowns of X are wanted (SparseColumnsOf). Numbers as doubles.
struct RowsJob {
  std::span<const Offset> col_ptr;
  std::span<const Index> row_ind;  ///< of a column, each once
  const double* values = nullptr;
  std::span<const Index> unknowns;
  double* x = nullptr;  ///< unknowns x columns, column-major
  bool transpose = false;
};

/// Hides the numbers and the precision of the factor from the solver. Vectors are doubles (base::Numbers).
class Numeric {
 public:
  virtual ~Numeric() = default;
  /// Factors the solver's values, which must have been sent to device_system() where there are some. Pivots below
  /// the smallest pivot times the largest scaled entry are replaced.
  virtual device::FactorOutcome factorize() = 0;
  /// Whether a factorization can make some fronts again and keep the others.
  [[nodiscard]] virtual bool keeps_fronts() const = 0;
  /// The values of the next factorize(), as doubles, differ from those of the last one at these places alone, which
  /// ascend.
  virtual void expect_changes(std::span<const Offset> places) = 0;
  /// See Executor::arrays_layout() and visit_arrays(); a number of the scalar goes into the layout.
  [[nodiscard]] virtual std::uint64_t arrays_layout() const = 0;
  virtual void visit_arrays(const device::ArrayVisit& visit) = 0;
  /// The next factorize() restores a factor (Executor::restore()).
  virtual void restore_next(device::ArrayVisit visit) = 0;
  /// See Executor::halt_at_failures().
  virtual void halt_at_failures(bool halt) = 0;
  /// Goes on with an analysis in which pivots have moved, which takes the place of the one before. @returns false where
  /// that cannot be; nothing has changed then
  /// @throws Error(out_of_memory); likewise
  virtual bool change_analysis(const ChangedAnalysis& changed) = 0;
  /// For an analysis that has followed a changed pattern: with the memory of this one, which is of no use then, and the
  /// numbers of the fronts that stay. The first factorization of the other makes what these and its values leave.
  /// @param values  of the factorizations to come. Where a device holds the linear system they are those of the last
  ///                one, in the places of now, and are to be sent there
  /// @returns null where that cannot be. This one may be of no use then, or where it throws
  [[nodiscard]] virtual std::unique_ptr<Numeric> follow_pattern(const Analysis& analysis,
                                                                std::span<const double> values,
                                                                const FollowedAnalysis::Numbers& stay,
                                                                const Context& context) = 0;
  /// The outcome of the values of the last factorization, after change_analysis(): see Executor::with_changed_plan().
  virtual device::FactorOutcome factorize_rest() = 0;
  /// Where pivots have to go after a halted factorization, by the values and with the contributions that it has left
  /// (see device::PlacementJob; no list: the search is given up). @pre left_something()
  [[nodiscard]] virtual std::optional<std::vector<analysis::PivotMove>> place_pivots(
      const device::Backend& host, const Analysis& analysis, std::span<const Index> failed) const = 0;
  /// Whether the last factorization was halted and its scaled values are there in FP64.
  [[nodiscard]] virtual bool left_something() const = 0;
  /// The linear system on the device of the factor; null: it is on the host alone.
  virtual device::DeviceLinearSystem* device_system() = 0;
  /// factorize() with values in that device's memory, in the order of PreparedMatrix::a. Nothing when one is not
  /// finite.
  virtual std::optional<device::FactorOutcome> factorize_device(const double* values) = 0;
  virtual void set_smallest_pivot(double smallest_pivot) = 0;
  /// Whether smaller pivots are replaced by the largest scaled entry (PivotRule::in_place_of_zero), from the next
  /// factorization on; else by the smallest pivot itself.
  virtual void part_with_zeros(bool parts) = 0;
  /// Whether scalings of the values' own are those of matchings, from the next factorization on.
  virtual void scale_by_matching(bool matching) = 0;
  /// Solves op(A) x = b for `columns` right-hand sides, column-major, n numbers each; x may alias b.
  virtual void solve(const double* b, double* x, Index columns, bool transpose) = 0;
  /// By substitution on the paths between them. @returns the share of the factor's entries that were read; nothing
  /// where the executor does not do that
  virtual std::optional<double> solve_rows(const RowsJob& job) = 0;
  /// Entries (unknown, row) of the inverse of the matrix of the last factorization, by its factor alone: see
  /// Executor::invert_at(). @param values  as many numbers
  virtual bool invert_at(std::span<const Index> unknowns, std::span<const Index> rows, double* values,
                         std::span<char> known) = 0;
  /// The scales of the last factorization.
  [[nodiscard]] virtual const Scales& scales() const = 0;
  /// ldlt of a real system: by position, whether it brings a negative eigenvalue of D, of the last factorization; a 2 x
  /// 2 pivot has two positions. Empty: not known.
  [[nodiscard]] virtual std::vector<char> negative_pivots() const = 0;
  [[nodiscard]] virtual std::string device_name() const = 0;
  /// What the last factorization has left for the border. @pre the plan has one
  [[nodiscard]] virtual BorderContribution border_contribution() const = 0;
  /// Most bytes of factor and work arrays that the device held.
  [[nodiscard]] virtual Offset device_peak_bytes() const = 0;
  [[nodiscard]] virtual device::OutOfCoreReport out_of_core() const = 0;
  /// The last factorization by devices; empty where there is one.
  [[nodiscard]] virtual std::vector<device::DeviceWork> device_work() const = 0;
};

/// In the precision of the options. All arguments outlive the factor.
/// @param values  of the factorizations to come, where the caller keeps them; likewise of the border
std::unique_ptr<Numeric> make_numeric(const Analysis& analysis, std::span<const double> values,
                                      std::span<const double> border_values, const Context& context);

}  // namespace espalier::solver
