/// \file
/// An independent check of assembly trees, for tests and for trees that come from a file.
#pragma once

#include <string>

#include "analysis/assembly_tree.hpp"
#include "analysis/ordering/graph.hpp"

namespace espalier::analysis {

/// Checks everything that assembly_tree.hpp promises, and that every edge of `graph` and every contribution has its
/// place. The tree may be anything: no size or index in it is trusted. O((rows of all fronts + edges) log n) time.
/// @return an empty text, or what is wrong first
std::string verify_tree(const Graph& graph, const AssemblyTree& tree);

}  // namespace espalier::analysis
