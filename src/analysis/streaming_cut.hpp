/// \file
/// Cutting a tree into the units of a streaming plan.
#pragma once

#include <vector>

#include "analysis/streaming_plan.hpp"

namespace espalier::analysis {

/// An in-core step, or a large front (`fronts` empty).
struct StreamUnit {
  std::vector<Index> fronts;  ///< ascending
  Index large = -1;
};

/// Units in topological order, each in-core step of about `limit_bytes` at most, as far as fronts allow.
std::vector<StreamUnit> cut_for_streaming(const StreamLayout& layout, Offset limit_bytes);

/// The in-core steps of these units (empty for large fronts): tasks, externals, places of their arrays.
std::vector<InCoreStep> make_in_core_steps(const StreamLayout& layout, const std::vector<StreamUnit>& units);

}  // namespace espalier::analysis
