/// \file
/// What all calls of one solver work with.
#pragma once

#include <string>

#include "base/memory.hpp"
#include "base/spare_memory.hpp"
#include "base/thread_pool.hpp"
#include "base/timeline.hpp"
#include "device/registry.hpp"
#include "espalier/solver.hpp"
#include "ranks/communicator.hpp"

namespace espalier::solver {

struct Context {
  const Options& options;  ///< as the caller gave them
  const device::Registry& registry;
  base::ThreadPool& pool;
  base::MemoryBudget& budget;
  base::Timeline* timeline = nullptr;
  ranks::Communicator* link = nullptr;  ///< to other ranks; null: there are none
  /// The threads of the host, by which plans are made: with ranks the fewest that one of them has, so that all make the
  /// same plan.
  const int* planning_threads = nullptr;
  base::SpareMemory* spare = nullptr;  ///< of analyses that follow each other
  bool raised = false;                 ///< FP32 does not do, or does not pay: a factor goes on in FP64
  bool rescaled = false;  ///< pivots vanished in the analysis's scaling alone: a factor takes one of its own

  void log(const std::string& line) const {
    if (options.log) options.log(line);
  }
  /// The precision of factors; never automatic.
  [[nodiscard]] Precision precision() const {
    if (raised) return Precision::fp64;
    // What two processes measure differs, so that they might go different ways.
    if (link != nullptr && options.precision == Precision::automatic) return Precision::fp64;
    return options.precision == Precision::automatic ? Precision::mixed : options.precision;
  }
  [[nodiscard]] int threads() const { return planning_threads != nullptr ? *planning_threads : pool.size(); }
  [[nodiscard]] bool rescales() const { return rescaled || options.rescale != Rescale::off; }
  /// Whether scalings are those of matchings.
  [[nodiscard]] bool matches() const {
    return options.matching && (rescaled || options.rescale != Rescale::equilibration);
  }
  [[nodiscard]] bool single() const { return precision() != Precision::fp64; }
};

}  // namespace espalier::solver
