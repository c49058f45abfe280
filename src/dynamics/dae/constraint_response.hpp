/// \file
/// What K's inverse makes of the constraints alone: K^-1 [0; I]. Projections onto the levels of the constraints need no
/// more of K, and a step makes many of them.
#pragma once

#include <functional>
#include <vector>

#include "base/lazy_vector.hpp"
#include "base/thread_pool.hpp"
#include "dynamics/dae/system.hpp"
#include "dynamics/device/device_vectors.hpp"

namespace espalier::dynamics {

/// Answers K x = [0; r] by a product with the columns of K^-1 [0; I], one for each constraint, where that is cheaper
/// than the factor. The columns belong to one factor. They are made at once where the factor before had enough to do
/// that they would have paid, and otherwise when this one has had. What is decided depends on counts alone, so that
/// runs repeat to the bit.
///
/// A GPU that has the factor makes the columns, keeps them, and forms the products.
class ConstraintResponse {
 public:
  /// Solves K X = B in place for the given number of columns, each n + m.
  using Solve = std::function<void(Span, Index)>;
  using Columns = base::LazyVector<double>;

  /// The factor is another one. @param n, m  rows of K: motion, constraints
  /// @param dropped  m marks: constraints whose rows of K are empty; their r is zero
  /// @param entries  numbers that a solve with the factor reads; 0: not known, no columns are made
  /// @param device  where the factor is; outlives the use up to leave_device(); null: the host
  void start(Index n, Index m, const std::vector<char>& dropped, Offset entries, DeviceVectors* device = nullptr);
  /// The factor is there: where columns are still to be made, it makes and keeps them.
  void use_device(DeviceVectors& device) { device_ = &device; }
  /// Columns on a GPU are gone, and none are made there any more.
  void leave_device();
  /// What factors before have had to do counts no more.
  void forget() { solved_ = before_ = 0; }
  /// Whether apply() can be used. `columns` right-hand sides [0; r] are to be solved for; makes the columns where that
  /// pays.
  /// @param solve_on_device  solves with the scaled K there; not used where start() got no device
  /// Without memory for the columns there are none; nor where the GPU fails, which the next solve looks into.
  [[nodiscard]] bool ready(Index columns, const Solve& solve, const DeviceVectors::Solve& solve_on_device,
                           base::ThreadPool* pool);
  /// The columns are known: n + m numbers for each constraint that is not dropped.
  void take(Columns columns);
  /// Gives the columns away; none where there are none. They are not known any more.
  [[nodiscard]] Columns give();
  /// x = K^-1 [0; r], r the last m of x. @pre ready()
  void apply(Span x, base::ThreadPool* pool) const;
  /// The same for an x in the GPU's memory, n + m numbers; r: m numbers of the host. Does not wait.
  /// @pre ready(), on_device()
  void apply_there(ConstSpan r, double* x) const;
  /// Whether the columns lie on the GPU.
  [[nodiscard]] bool on_device() const { return on_device_; }
  /// Columns that were made of this factor.
  [[nodiscard]] Index columns() const { return static_cast<Index>(made_ ? kept_.size() : 0); }

 private:
  void make(const Solve& solve, const DeviceVectors::Solve& solve_on_device, base::ThreadPool* pool);

  Index n_ = 0, m_ = 0;
  std::vector<Index> kept_;  // constraints that have a column
  Offset entries_ = 0;
  Index solved_ = 0, before_ = 0;  // right-hand sides [0; r] of this factor and of the one before
  DeviceVectors* device_ = nullptr;
  bool made_ = false, on_device_ = false;
  Columns columns_;                // (n + m) * kept, column by column; not those on a GPU
  mutable std::vector<double> r_;  // kept
};

}  // namespace espalier::dynamics
