// Plans of which each rank has a part. The truth is the plan of one process with the same tiles: the parts together
// have its entries, rows and tasks, each where it belongs.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "analysis/ordering.hpp"
#include "matrix/generators/generate.hpp"
#include "plan/plan_bytes.hpp"
#include "plan/rank_parts.hpp"

namespace espalier::plan {
namespace plan_parts_test {

struct System {
  SparseMatrix a;
  analysis::AssemblyTree tree;
  PlanOptions options;
};

System system_of(std::vector<std::string> words, Index widest = 16) {
  base::ThreadPool pool{2};
  System s;
  s.a = matrix::generate(matrix::parse_generator(words));
  s.tree = analysis::build_tree(analysis::graph_of(s.a, pool), {}, pool);
  s.options.tiles.max_block_size = widest;
  s.options.tiles.whole_rows = 40;
  s.options.unsymmetric = s.a.storage == Storage::general;
  s.options.stealing = false;
  s.options.balance_columns = true;
  s.options.additional_subtrees = 0;
  return s;
}

Plan plan_of(const System& s, Index ranks, Index rank) {
  base::ThreadPool pool{2};
  PlanOptions o = s.options;
  o.devices = o.ranks = ranks;
  o.rank = rank;
  return make_plan(s.tree, s.a, {}, o, pool);
}

using Entry = std::tuple<Offset, Index, Index, bool>;

// The entries of tiles [first, end).
std::vector<Entry> entries_of(const Plan& p, Offset first, Offset end) {
  std::vector<Entry> list;
  for (auto q = static_cast<std::size_t>(p.entry_ptr[static_cast<std::size_t>(first)]);
       q < static_cast<std::size_t>(p.entry_ptr[static_cast<std::size_t>(end)]); ++q) {
    const EntryPlace& e = p.entries[q];
    const Offset source = p.sources.empty() ? e.source() : p.sources[static_cast<std::size_t>(e.source())];
    list.emplace_back(source, e.row(), e.col(), e.transposed());
  }
  return list;
}

// Tiles of column j of front f among the plan's; of a front that is taken whole, all.
std::pair<Offset, Offset> tiles_of(const Plan& p, Index f, Index j) {
  const auto& l = p.layout[static_cast<std::size_t>(f)];
  const Offset first = p.first_tile[static_cast<std::size_t>(f)];
  if (p.whole[static_cast<std::size_t>(f)] != 0) return {first, first + l.tile_count()};
  return {first + l.tile_index(j, j), first + l.tile_index(j, j) + l.tiles - j};
}

void expect_entries_and_tasks_of_one(const System& s, Index ranks) {
  const Plan one = plan_of(s, 1, 0);
  std::map<std::tuple<Index, Index, Index>, int> made;  // by front, and tile
  Offset entries = 0;
  std::set<Offset> assembled;
  for (Index r = 0; r < ranks; ++r) {
    const Plan p = plan_of(s, ranks, r);
    ASSERT_EQ(p.fronts(), one.fronts());
    entries += static_cast<Offset>(p.entries.size());
    ASSERT_EQ(p.sources.size(), p.entries.size());
    assembled.insert(p.sources.begin(), p.sources.end());
    for (Index f = 0; f < p.fronts(); ++f)
      for (Index j = 0; j < p.layout[static_cast<std::size_t>(f)].tiles; ++j) {
        if (!is_made_here(p, f, j)) continue;
        ASSERT_TRUE(knows(p, f, r));
        const auto [first, end] = tiles_of(p, f, j);
        const auto [first_of_one, end_of_one] = tiles_of(one, f, j);
        ASSERT_EQ(entries_of(p, first, end), entries_of(one, first_of_one, end_of_one)) << f << ' ' << j;
        if (p.whole[static_cast<std::size_t>(f)] != 0) break;
      }
    for (const Task& t : p.tasks) {
      ASSERT_EQ(maker(p, t.front, t.j), r);
      for (Index f = t.is_range() ? t.begin : t.front; f <= t.front; ++f) ++made[{f, t.i, t.j}];
    }
  }
  EXPECT_EQ(entries, static_cast<Offset>(one.entries.size()));
  EXPECT_EQ(assembled.size(), one.entries.size());  // each by one rank
  // Every tile is made once, by one of them.
  std::size_t wanted = 0;
  for (Index f = 0; f < one.fronts(); ++f)
    wanted += one.whole[static_cast<std::size_t>(f)] != 0
                  ? 1
                  : static_cast<std::size_t>(one.layout[static_cast<std::size_t>(f)].tile_count());
  EXPECT_EQ(made.size(), wanted);
  for (const auto& [tile, times] : made) EXPECT_EQ(times, 1) << std::get<0>(tile);
}

void expect_rows_of_one(const System& s, Index ranks) {
  const Plan one = plan_of(s, 1, 0);
  for (Index r = 0; r < ranks; ++r) {
    const Plan p = plan_of(s, ranks, r);
    std::set<Index> known;
    for (Index f = 0; f < p.fronts(); ++f) {
      const Index below = p.layout[static_cast<std::size_t>(f)].below();
      EXPECT_EQ(p.tree.rows_below(f), below);  // sizes are known to all
      if (!knows(p, f, r)) continue;
      known.insert(f);
      EXPECT_TRUE(std::equal(one.rows_below(f), one.rows_below(f) + below, p.rows_below(f)));
      if (p.tree.parent[static_cast<std::size_t>(f)] < 0) continue;
      EXPECT_TRUE(std::equal(one.places_in_parent(f), one.places_in_parent(f) + below, p.places_in_parent(f)));
    }
    for (const Index f : known) {  // what a task of this rank gathers from
      bool here = false;
      for (Index j = 0; j < p.layout[static_cast<std::size_t>(f)].tiles; ++j) here = here || is_made_here(p, f, j);
      for (Offset c = p.child_ptr[static_cast<std::size_t>(f)];
           here && c < p.child_ptr[static_cast<std::size_t>(f) + 1]; ++c)
        EXPECT_TRUE(known.count(p.children[static_cast<std::size_t>(c)]) > 0);
    }
  }
}

TEST(PlanParts, HaveTheEntriesAndTasksOfOne) {
  for (const Index ranks : {2, 3, 5}) {
    expect_entries_and_tasks_of_one(system_of({"elasticity", "6", "5", "4"}), ranks);
    expect_entries_and_tasks_of_one(system_of({"gyroscopic", "5", "4", "4"}), ranks);
  }
  expect_entries_and_tasks_of_one(system_of({"poisson", "6"}), 70);  // more than have a table of members
}

TEST(PlanParts, HaveTheRowsThatTheyNeed) {
  for (const Index ranks : {2, 4, 7}) expect_rows_of_one(system_of({"elasticity", "6", "5", "4"}), ranks);
  expect_rows_of_one(system_of({"gyroscopic", "5", "4", "4"}), 3);
}

// A part is about as large as a rank's share of the work; the tree is known to all.
TEST(PlanParts, AreSmaller) {
  const System s = system_of({"elasticity", "10"}, 0);
  const PlanBytes one = bytes_of(plan_of(s, 1, 0));
  for (const Index ranks : {2, 4, 8}) {
    for (Index r = 0; r < ranks; ++r) {
      const PlanBytes part = bytes_of(plan_of(s, ranks, r));
      EXPECT_LE(part.entries, 2 * 1.5 * static_cast<double>(one.entries) / ranks) << ranks << ' ' << r;
      EXPECT_LE(part.tasks, 1.6 * static_cast<double>(one.tasks) / ranks + 1024) << ranks << ' ' << r;
      EXPECT_LT(part.rows, one.rows) << ranks << ' ' << r;
    }
  }
}

// Whether rank r makes or reads a part of what front f leaves for the top.
bool works_with_rows_of(const Plan& p, Index f, Index r) {
  const Index parent = p.tree.parent[static_cast<std::size_t>(f)];
  const FrontLayout& l = p.layout[static_cast<std::size_t>(f)];
  if (parent < 0 || p.ownership.subtree(parent) >= 0 || l.below() == 0 || !knows(p, f, r)) return false;
  for (Index j = l.pivot_tiles; j < l.tiles; ++j)
    if (is_made_here(p, f, j)) return true;
  for (Index k = 0; k < l.below(); ++k)
    if (is_made_here(p, parent, p.layout[static_cast<std::size_t>(parent)].tile_of(p.places_in_parent(f)[k])))
      return true;
  return false;
}

// A rank has places for the factors that it keeps and for what goes to the top, none of them over another.
TEST(PlanParts, HavePlacesForWhatTheyKeep) {
  System ldlt = system_of({"elasticity", "6", "5", "4"});
  ldlt.options.ldlt = true;
  for (const System& s : {system_of({"elasticity", "6", "5", "4"}), ldlt, system_of({"gyroscopic", "5", "4", "4"})})
    for (const Index ranks : {2, 5})
      for (Index r = 0; r < ranks; ++r) {
        const Plan p = plan_of(s, ranks, r);
        const bool two = s.options.unsymmetric;
        std::vector<std::pair<Offset, Offset>> places;
        const auto take = [&](Offset begin, Offset size) {
          if (size > 0) places.emplace_back(begin, begin + size);
        };
        Offset factors = 0;
        for (Index f = 0; f < p.fronts(); ++f) {
          const auto k = static_cast<std::size_t>(f);
          if (keeps_factor(p, f, r)) {
            const Offset size = p.layout[k].factor_size();
            factors += size * (two ? 2 : 1);
            take(p.memory.factor[k], size);
            if (two) take(p.memory.factor2[k], size);
          }
          if (!works_with_rows_of(p, f, r)) continue;
          take(p.memory.contribution[k], p.layout[k].contribution_size());
          if (two) take(p.memory.contribution2[k], p.layout[k].contribution_size());
        }
        EXPECT_GE(p.memory.factor_size, factors);
        EXPECT_LE(p.memory.factor_size, factors + 2 * p.options.tiles.panel * p.fronts());
        std::sort(places.begin(), places.end());
        for (std::size_t k = 1; k < places.size(); ++k) EXPECT_LE(places[k - 1].second, places[k].first);
        EXPECT_LE(places.back().second, p.memory.size);
      }
}

}  // namespace plan_parts_test
}  // namespace espalier::plan
