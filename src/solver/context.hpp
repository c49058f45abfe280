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

  void log(const std::string& line) const {
    if (options.log) options.log(line);
  }
  [[nodiscard]] bool single() const { return options.precision != Precision::fp64; }
};

}  // namespace espalier::solver
