/// \file
/// An order that is made beside the work, for a pattern that has drifted away from the one that was ordered.
#pragma once

#include <atomic>
#include <cstdint>
#include <future>
#include <memory>
#include <optional>

#include "analysis/assembly_tree.hpp"
#include "solver/analysis/analysis.hpp"

namespace espalier::solver {

/// Made on threads of its own. When it is taken is counted in changes, never by a clock, and the order does not depend
/// on the number of threads: the same calls give the same bits, whatever the timing.
class FreshOrder {
 public:
  /// Begins at once. @param analysis  what has drifted; its system is held until the order is taken
  FreshOrder(const Analysis& analysis, int threads);
  /// Stops it.
  ~FreshOrder();
  FreshOrder(const FreshOrder&) = delete;
  FreshOrder& operator=(const FreshOrder&) = delete;

  /// Whether the change of so many entries is the one that takes it; asked once for each.
  [[nodiscard]] bool is_due(Offset entries);
  /// Whether its order is one for `analysis`, whose pattern may have changed since: kind and matching are the same.
  [[nodiscard]] bool fits(const Analysis& analysis) const;
  [[nodiscard]] const System& system() const { return *system_; }
  /// Waits for it, once. In the child of a fork(), whose parent's threads are not there, it is made here and now.
  /// @param pool  of the thread that waits, which may be interrupted. @returns nothing where it could not be made
  [[nodiscard]] std::optional<analysis::AssemblyTree> take(base::ThreadPool& pool);
  /// There is no order to wait for any more.
  [[nodiscard]] bool done() const { return done_; }

 private:
  [[nodiscard]] bool thread_lost() const;

  std::shared_ptr<const System> system_;
  int threads_;
  int changes_ = 0;
  Offset entries_ = 0;  // that have come or gone
  bool done_ = false;
  std::uint64_t forks_;
  std::shared_ptr<std::atomic<bool>> stop_;
  std::future<analysis::AssemblyTree> made_;
};

/// Whether an analysis that has followed its pattern should be ordered anew beside the work: its factor has grown, or
/// much has come and gone, so that a fresh order might be better.
bool has_drifted(const Analysis& analysis);

}  // namespace espalier::solver
