/// \file
/// What all calls of one solver work with.
#pragma once

#include <string>

#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "base/timeline.hpp"
#include "device/registry.hpp"
#include "espalier/solver.hpp"

namespace espalier::solver {

struct Context {
  const Options& options;  ///< as the caller gave them
  const device::Registry& registry;
  base::ThreadPool& pool;
  base::MemoryBudget& budget;
  base::Timeline* timeline = nullptr;
  bool raised = false;    ///< FP32 does not do, or does not pay: a factor goes on in FP64
  bool rescaled = false;  ///< pivots vanished in the analysis's scaling alone: a factor takes one of its own

  void log(const std::string& line) const {
    if (options.log) options.log(line);
  }
  /// Of factors; never automatic.
  [[nodiscard]] Precision precision() const {
    if (raised) return Precision::fp64;
    return options.precision == Precision::automatic ? Precision::mixed : options.precision;
  }
  [[nodiscard]] bool rescales() const { return rescaled || options.rescale != Rescale::off; }
  /// Whether scalings are those of matchings.
  [[nodiscard]] bool matches() const {
    return options.matching && (rescaled || options.rescale != Rescale::equilibration);
  }
  [[nodiscard]] bool single() const { return precision() != Precision::fp64; }
};

}  // namespace espalier::solver
