#include "plan/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "analysis/fronts.hpp"
#include "base/beside.hpp"
#include "plan/entry_places.hpp"
#include "plan/fitted_tree.hpp"
#include "plan/kept_entries.hpp"
#include "plan/kept_places.hpp"
#include "plan/layout_steps.hpp"
#include "plan/rank_parts.hpp"
#include "plan/regions.hpp"
#include "plan/task_list.hpp"

namespace espalier::plan {

namespace {

constexpr Index kMostTileWidth = 2047;
constexpr std::int64_t kChildrenRange = 256;

}  // namespace

void link_children(Plan& plan) {
  const Index fronts = plan.fronts();
  const auto& parent = plan.tree.parent;
  plan.child_ptr.assign(static_cast<std::size_t>(fronts) + 1, 0);
  for (Index f = 0; f < fronts; ++f)
    if (parent[f] >= 0) ++plan.child_ptr[parent[f] + 1];
  std::partial_sum(plan.child_ptr.begin(), plan.child_ptr.end(), plan.child_ptr.begin());
  plan.children.resize(static_cast<std::size_t>(plan.child_ptr.back()));
  std::vector<Offset> next(plan.child_ptr.begin(), plan.child_ptr.end() - 1);
  for (Index f = 0; f < fronts; ++f)
    if (parent[f] >= 0) plan.children[next[parent[f]]++] = f;
  plan.tier.assign(static_cast<std::size_t>(fronts), 0);
  for (Index f = fronts - 1; f >= 0; --f)
    if (parent[f] >= 0) plan.tier[f] = plan.tier[parent[f]] + 1;
}

// Places of every front's rows in its parent's front: both lists ascend, so one walk suffices.
void relate_rows(Plan& plan, base::ThreadPool& pool) {
  const auto& t = plan.tree;
  const bool part = !plan.row_begin.empty();
  plan.relative.resize(part ? static_cast<std::size_t>(plan.row_begin.back()) : t.rows.size());
  pool.for_each_range(plan.fronts(), kChildrenRange, [&](std::int64_t b, std::int64_t e) {
    for (auto f = static_cast<Index>(b); f < e; ++f) {
      const Index p = t.parent[f];
      if (part && !knows(plan, f, plan.options.rank)) continue;
      Index* place = plan.relative.data() + plan.row_at(f);
      if (p < 0) {  // rows of the border
        std::fill_n(place, t.rows_below(f), 0);
        continue;
      }
      const Index pivots = t.pivots(p);
      Offset at = t.row_ptr[p];
      for (Offset r = t.row_ptr[f]; r < t.row_ptr[f + 1]; ++r, ++place) {
        const Index row = t.rows[r];
        if (row < t.first[p + 1]) {
          *place = row - t.first[p];
        } else {
          while (at < t.row_ptr[p + 1] && t.rows[at] < row) ++at;
          *place = pivots + static_cast<Index>(at - t.row_ptr[p]);
        }
      }
    }
  });
}

void cut_fronts(Plan& plan) {
  const Index fronts = plan.fronts();
  const auto& rule = plan.options.tiles;
  plan.layout.resize(static_cast<std::size_t>(fronts));
  plan.whole.resize(static_cast<std::size_t>(fronts));
  plan.first_tile.assign(static_cast<std::size_t>(fronts) + 1, 0);
  for (Index f = 0; f < fronts; ++f) {
    const Index k = plan.tree.pivots(f);
    const Index m = k + plan.tree.rows_below(f);
    plan.layout[f] = cut_front(k, m, rule);
    plan.whole[f] = static_cast<char>(m <= rule.whole_rows && k <= rule.whole_pivots);
    plan.first_tile[f + 1] = plan.first_tile[f] + plan.layout[f].tile_count();
    const double md = m;
    const double kd = k;
    plan.flops += front_flops(k, m, plan.options.unsymmetric);
    plan.nonzeros_factor += static_cast<Offset>(kd * md - kd * (kd - 1) / 2) * (plan.options.unsymmetric ? 2 : 1);
  }
}

double front_seconds(const Plan& plan, Index f) {
  const FrontLayout& l = plan.layout[f];
  if (plan.options.balance_unknowns) return l.pivots;
  return front_seconds(l.pivots, l.rows, plan.options.unsymmetric, plan.options.machine);
}

Plan make_plan(analysis::AssemblyTree tree, const MatrixView& a, const std::vector<Index>& row_of_col,
               const PlanOptions& options, base::ThreadPool& pool, const matrix::RowIndex* rows,
               const KeptEntries* kept) {
  if (options.tiles.max_block_size > kMostTileWidth || options.tiles.whole_rows > kMostTileWidth)
    throw Error(StatusCode::invalid_input, fmt::format("max_block_size {} is above the limit of {}",
                                                       options.tiles.max_block_size, kMostTileWidth));
  // A tree that follows another one has been fitted with that. Until nothing fits better: the tree of an analysis that
  // was saved stays as it is when it is read.
  if (options.arrays != nullptr && !options.ldlt && tree.border == 0 && kept == nullptr)
    for (auto moves = moves_that_fit(tree, options); !moves.empty(); moves = moves_that_fit(tree, options))
      analysis::relocate_pivots(tree, moves, &pool);
  Plan plan;
  plan.tree = std::move(tree);
  plan.options = options;
  link_children(plan);
  cut_fronts(plan);
  const bool part = options.ranks > 1;
  plan.ownership = assign_owners(plan);
  if (part) number_known(plan);
  list_tasks(plan, &pool);
  // Places in memory are one chain of small steps that needs no entries: it goes beside them.
  const auto place = [&plan, part, kept, threads = pool.size()] {
    if (part) return;  // memory is planned when rows are related
    if (kept != nullptr && kept->places && place_as_before(plan, kept->before, kept->same)) return;
    if (plan.options.arrays == nullptr) return plan_memory(plan);
    const ArraySizes sizes = array_sizes(plan, name_regions(plan, true));
    plan_memory(plan, &sizes, threads);
  };
  auto beside = base::start_beside(place, pool.size() > 1);
  relate_rows(plan, pool);
  matrix::RowIndex own;
  if (rows == nullptr || rows->ptr.empty()) rows = &(own = matrix::index_rows(a, pool));
  place_entries(plan, {a, *rows, row_of_col}, pool, kept);
  beside.get();
  if (!part) return plan;
  number_sources(plan, pool);
  plan.memory = memory_of_rank(plan);
  drop_unknown_rows(plan);
  return plan;
}

}  // namespace espalier::plan
