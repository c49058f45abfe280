/// \file
/// What ranks have of a plan in parts, put together again on each of them.
#pragma once

#include "ranks/communicator.hpp"
#include "solver/analysis/analysis.hpp"

namespace espalier::solver {

/// The tree with the rows of all fronts. Collective where the plan is a part (Plan::row_begin), else a copy.
/// @param link  to the ranks that have the other parts; null where the plan is whole
analysis::AssemblyTree whole_tree(const plan::Plan& plan, ranks::Communicator* link);

/// The plan of one process with the same fronts and tiles, for what looks at all entries. Collective. @pre there are
/// ranks
plan::Plan whole_plan(const Analysis& analysis, const Context& context);

}  // namespace espalier::solver
