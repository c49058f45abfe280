/// \file
/// Nested dissection.
#pragma once

#include <vector>

#include "analysis/graph.hpp"

namespace espalier::analysis {

/// A fill-reducing elimination order of the vertices of `graph`: order[k] goes k-th. The same for every pool.
std::vector<Index> nested_dissection(const CompressedGraph& graph, base::ThreadPool& pool);

}  // namespace espalier::analysis
