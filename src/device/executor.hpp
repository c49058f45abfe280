/// \file
/// The device seam: an executor carries out a plan on one backend and keeps the numeric factor.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/memory.hpp"
#include "base/scalar.hpp"
#include "device/device_linear_system.hpp"
#include "espalier/types.hpp"
#include "plan/changed_plan.hpp"
#include "plan/plan.hpp"

namespace espalier::device {

using base::RealOf;
using base::WideOf;

/// Seconds in which a device computed, by what it did.
struct OperationTimes {
  double steps = 0;       ///< sets of fronts eliminated in core
  double assembly = 0;    ///< groups of block columns: entries of A and children's contributions
  double updates = 0;     ///< ... products with the columns of earlier groups
  double own_pivots = 0;  ///< ... their own
  [[nodiscard]] double sum() const { return steps + assembly + updates + own_pivots; }
};

/// What a factorization in less device memory than the factor needs moves; budget_bytes 0: it fits, and nothing moves.
struct OutOfCoreReport {
  Offset budget_bytes = 0;
  Offset predicted_bytes = 0;     ///< peak of device memory by the plan
  Offset bytes_in = 0;            ///< from the host to the device, each factorization
  Offset bytes_out = 0;           ///< back
  double link_seconds = 0;        ///< what the busier direction of the link needs alone: no run is faster
  double predicted_seconds = 0;   ///< by the plan
  double copy_in_seconds = 0;     ///< last factorization: time in which the host copied for the device
  double copy_out_seconds = 0;    ///< likewise from it
  Index steps = 0;                ///< sets of fronts eliminated in core
  Index groups = 0;               ///< groups of block columns of fronts too large for that
  OperationTimes times = {};      ///< last factorization
  Offset store_bytes = 0;         ///< of the host's store, which all devices share
  Offset pinned_bytes = 0;        ///< of it, reached without the staging ring so far
  Offset direct_bytes = 0;        ///< last factorization: moved without the ring, both directions
  Offset disk_written_bytes = 0;  ///< since the last factorization began: of the store, to the disk
  Offset disk_read_bytes = 0;     ///< likewise from it
};

/// One device's part in a factorization that several share.
struct DeviceWork {
  std::string name;
  double busy_seconds = 0;           ///< mean over its workers of the time inside tasks, waits left out
  double waiting_seconds = 0;        ///< likewise of the time inside tasks that wait for others
  Index stolen_subtrees = 0;         ///< sub-trees of other devices that it did
  Offset peak_bytes = 0;             ///< its part of factor and work arrays, and what its workers hold
  Offset transferred_bytes = 0;      ///< stored into and fetched from other devices
  OutOfCoreReport out_of_core = {};  ///< where the factor does not fit in the device's memory
};

/// Contributions of fronts that a factorization has left in memory. Value: double or complex<double>.
template <class Value>
class LeftContributions {
 public:
  virtual ~LeftContributions() = default;
  /// Whether the front's contribution is still there, and of use.
  [[nodiscard]] virtual bool has(Index front) const = 0;
  /// Column-major, as many rows and columns as the front has rows below; of ldlt the lower triangle alone is written.
  /// @pre has(front)
  virtual void copy(Index front, Value* to) const = 0;
};

/// The fronts that a substitution passes where few entries of right-hand sides are not zero and few unknowns are
/// wanted. With a front those above it.
struct FrontPaths {
  std::span<const char> up;    ///< fronts; not 0: entries that are not zero reach it
  std::span<const char> down;  ///< fronts; not 0: it leads from a root to a wanted unknown
};

/// Such a substitution. Rows are places in the order of elimination, ascending, each once.
template <class T>
struct PathSolve {
  FrontPaths paths;
  std::span<const Index> given;   ///< rows of the right-hand sides that may be other than zero
  const T* b = nullptr;           ///< given x columns, row-major
  std::span<const Index> wanted;  ///< rows of the solutions
  T* x = nullptr;                 ///< wanted x columns, row-major; written
  Index columns = 1;
  bool transpose = false;
};

/// Entries of an inverse that are asked of a factor, in any order.
template <class T>
struct InverseEntries {
  std::span<const Index> row, col;  ///< places in the order of elimination
  std::span<T> value;               ///< written where the entry is known
  std::span<char> known;            ///< written; 0: the entry is not on the pattern of the factor (L + L^T, L + U)
};

/// Gets or fills some bytes of a factor.
using ArrayVisit = std::function<void(std::span<std::byte> bytes)>;

/// One backend's numeric factor of a matrix with the pattern of a plan. All memory is taken in the constructor;
/// factorize() and solve() allocate nothing on the device. T: see ESPALIER_FOR_SCALARS. Of a Hermitian matrix (Job) the
/// values are those of the entries of the lower triangle in the order of elimination.
template <class T>
class Executor {
 public:
  virtual ~Executor() = default;
  /// For the factorizations to come; `tiny` depends on the values.
  virtual void set_pivot_rule(const PivotRule& rule) = 0;
  /// @param values  the caller's value array (plan.entries index it), scaled so that entries are about 1 at most
  /// @throws Error(device_error) with the failing call; the executor stays usable
  virtual FactorOutcome factorize(std::span<const T> values) = 0;
  /// The same numbers, where the last factorization was one of the values `before`, as many: backends that can make
  /// only those fronts that the values which differ reach, to the last bit as factorize() would (FactorOutcome::share).
  virtual FactorOutcome factorize_changed(std::span<const T> values, std::span<const T> /*before*/) {
    return factorize(values);
  }
  /// Solves in place: x holds the right-hand sides on entry and the solutions on return, n rows in elimination order,
  /// row-major with `columns` values per row. transpose: solves with the transposed matrix (lu; a symmetric or
  /// Hermitian one is solved with itself).
  virtual void solve(T* x, Index columns, bool transpose) = 0;
  /// The same through some fronts alone, to the bits of solve().
  /// @returns false where the backend does not do that, or has no memory for it; nothing is written then
  virtual bool solve_on_paths(const PathSolve<T>& /*solve*/) { return false; }
  /// ldlt: the inverse of D of the last factorization, n each in elimination order: its diagonal, and what stands below
  /// it, which is not zero at the first column of a 2 x 2 pivot. @returns false where the backend does not tell
  virtual bool copy_inverse_pivots(std::span<T> /*d*/, std::span<T> /*e*/) const { return false; }
  /// Entries of the inverse of the matrix of the last factorization, by its factor alone.
  /// @returns false where the backend does not do that; nothing is written then
  /// @throws Error(out_of_memory)
  virtual bool invert_at(const InverseEntries<T>& /*entries*/) { return false; }
  /// A number that differs where arrays have another layout; 0: they cannot be visited.
  [[nodiscard]] virtual std::uint64_t arrays_layout() const { return 0; }
  /// Hands out the arrays of the last factorization one after another: whoever keeps them can restore() it.
  /// @pre arrays_layout() != 0
  virtual void visit_arrays(const ArrayVisit& /*visit*/) {}
  /// In place of factorize(), of the same values: visit() fills arrays as visit_arrays() hands them out.
  /// @throws Error(invalid_input) for what no factorization leaves, and what visit() throws; there is no factor then
  virtual FactorOutcome restore(std::span<const T> values, const ArrayVisit& /*visit*/) { return factorize(values); }
  [[nodiscard]] virtual std::string name() const = 0;
  [[nodiscard]] virtual Offset peak_bytes() const = 0;
  [[nodiscard]] virtual OutOfCoreReport out_of_core() const { return {}; }
  /// The last factorization by devices; empty where there is one, for which the outcome tells all.
  [[nodiscard]] virtual std::vector<DeviceWork> device_work() const { return {}; }
  /// Whether factorizations of ldlt and lu end where pivots fail: what is above them waits until they have moved. At
  /// first they do not; backends that cannot go on never do.
  virtual void halt_at_failures(bool /*halt*/) {}
  /// @returns null where the last factorization was not halted
  [[nodiscard]] virtual const LeftContributions<WideOf<T>>* left_contributions() const { return nullptr; }
  /// What the fronts have left for a border of the plan (AssemblyTree::border): the contribution of the last root that
  /// has rows below its pivots is there after each factorization. @returns null where the backend does not keep it
  /// (Limits::keeps_border); no plan with a border comes there
  [[nodiscard]] virtual const LeftContributions<WideOf<T>>* border_contribution() const { return nullptr; }
  /// An executor for a plan that change_plan() has made of this one's, with the memory of this one, which is to be
  /// destroyed then. Its next factorize() must get the same values: after a halted factorization it makes only what was
  /// not made, or is not the same any more, with the same bits as if it had made all. Of a changed pattern
  /// (FrontsBefore::of_pattern) the next call is factorize_changed(), where `before` are the values of the last
  /// factorization in the places of now; or factorize(), which makes all. So it is of a linear system in the device's
  /// memory (DeviceLinearSystem::factorize_changed()), which has to be made anew.
  /// @returns null where the backend cannot do that
  /// @throws Error(out_of_memory); this executor stays as it is, but is of no use where the pattern has changed
  virtual std::unique_ptr<Executor> with_changed_plan(const plan::Plan& /*plan*/,
                                                      const plan::FrontsBefore& /*before*/) {
    return nullptr;
  }
  /// The linear system in the memory of the (first) device, beside the factor, which it must not outlive. Null: this
  /// executor works on arrays of the host alone.
  /// @param memory_bytes  budget for what is taken besides the factor; 0: what is free
  /// @throws Error(out_of_memory), Error(device_error)
  virtual std::unique_ptr<DeviceLinearSystem> make_linear_system(const LinearSystemArrays& /*arrays*/,
                                                                 Offset /*memory_bytes*/) {
    return nullptr;
  }
};

}  // namespace espalier::device
