/// \file
/// First steps of every plan, from its tree and options on.
#pragma once

#include "base/thread_pool.hpp"
#include "plan/plan.hpp"

namespace espalier::plan {

/// Children and tiers.
void link_children(Plan& plan);
/// Tiles, flops, entries of the factor.
void cut_fronts(Plan& plan);
/// Places of every front's rows in its parent's front. @pre layout
void relate_rows(Plan& plan, base::ThreadPool& pool);

}  // namespace espalier::plan
