/// \file
/// An ordering that one rank makes for all.
#pragma once

#include <functional>

#include "analysis/assembly_tree.hpp"
#include "solver/session/context.hpp"

namespace espalier::solver {

/// The tree that `build` makes with a pool, on all ranks. The first rank makes it, with the threads of all ranks that
/// share its cores, since those wait; the tree does not depend on their number. Collective; without ranks, build()
/// alone.
/// @throws Error on all ranks: what build() throws
analysis::AssemblyTree ordered_once(const Context& context,
                                    const std::function<analysis::AssemblyTree(base::ThreadPool& pool)>& build);

}  // namespace espalier::solver
