/// \file
/// What a search for modes works with: threads, memory, interruption; and how its failures become a status.
#pragma once

#include <chrono>
#include <functional>

#include "base/interruption.hpp"
#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "espalier/modes.hpp"
#include "modes/tall.hpp"

namespace espalier::modes {

struct Resources {
  explicit Resources(const Options& options);
  const Options& options;
  base::Interruption interruption;
  base::ThreadPool pool;
  base::MemoryBudget budget;  ///< of vectors; what the factor holds is counted in, see reserve()

  /// A basis of `wanted` columns, or, where the memory does not allow for so many, of fewer, but at least `least`.
  /// @param factor_bytes  what the factor holds beside it
  /// @throws Error(out_of_memory) naming what is needed
  Tall basis(Index n, Index wanted, Index least, Offset factor_bytes);
  void log(const std::string& line) const {
    if (options.log) options.log(line);
  }
};

/// Runs body() as a call that may be interrupted; what it throws becomes a status.
Status guarded(Resources& shop, const std::function<void()>& body);

/// @throws Error(invalid_input) naming the first option that cannot be
void check_options(const ModesOptions& options);

}  // namespace espalier::modes
