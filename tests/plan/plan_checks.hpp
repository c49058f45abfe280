/// \file
/// What every plan has to keep: checks against the permuted dense matrix and a slow replay of the task list.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "analysis/graphs.hpp"
#include "analysis/ordering.hpp"
#include "plan/plan.hpp"

namespace espalier::plan::testing {

using analysis::AssemblyTree;
using analysis::build_tree;
using analysis::Graph;

inline Index pick(std::mt19937& random, std::initializer_list<Index> list) {
  return *(list.begin() + random() % list.size());
}

/// Tiles of small systems, whole fronts and such of many tiles, of every kind.
inline PlanOptions random_tiles(std::mt19937& random) {
  PlanOptions o;
  o.tiles.whole_rows = pick(random, {8, 24, 128});
  o.tiles.whole_pivots = std::min(pick(random, {8, 24, 96}), o.tiles.whole_rows);
  o.tiles.max_block_size = pick(random, {0, 8, 16});
  const unsigned kind = random() % 3;
  o.unsymmetric = kind == 2;
  o.ldlt = kind == 1;
  o.range_flops = static_cast<double>(pick(random, {0, 100, 10000}));
  return o;
}

inline SparseMatrix matrix_of(const Graph& g, Storage storage, bool duplicates, std::mt19937& random) {
  SparseMatrix a{g.n, g.n, {0}, {}, {}, storage};
  const auto keep = [&](Index r, Index c) {
    return storage == Storage::symmetric_lower ? r >= c : storage == Storage::symmetric_upper ? r <= c : true;
  };
  for (Index c = 0; c < g.n; ++c) {
    const auto add = [&](Index r) {
      if (!keep(r, c)) return;
      for (int k = 0; k < (duplicates && random() % 4 == 0 ? 2 : 1); ++k) {
        a.row_ind.push_back(r);
        a.values.push_back(static_cast<double>(random() % 1000 + 1));
      }
    };
    for (Offset q = g.ptr[c]; q < g.ptr[c + 1]; ++q) add(g.adj[q]);
    add(c);
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  if (storage == Storage::symmetric_both) {  // both triangles must agree: give every entry a value of its position
    for (Index c = 0; c < g.n; ++c)
      for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q)
        a.values[q] = 1 + std::min(a.row_ind[q], c) * 7 + std::max(a.row_ind[q], c) * 3;
  }
  return a;
}

using Dense = std::map<std::pair<Index, Index>, double>;

// P A P^T (lower triangle), or the whole row-permuted matrix for lu.
inline Dense permuted(const Plan& p, const MatrixView& a, const std::vector<Index>& row_of_col) {
  std::vector<Index> col(p.tree.order.size()), row(col.size());
  for (Index k = 0; k < p.tree.n; ++k) col[p.tree.order[k]] = k;
  for (Index c = 0; c < p.tree.n; ++c) row[row_of_col.empty() ? c : row_of_col[c]] = col[c];
  Dense d;
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q) {
      Index r = row[a.row_ind[q]], k = col[c];
      if (!p.options.unsymmetric) {
        if (a.storage == Storage::symmetric_both && a.row_ind[q] < c) continue;
        if (r < k) std::swap(r, k);
      }
      d[{r, k}] += a.values[q];
    }
  return d;
}

// The matrix put together again from the entries, tile by tile.
inline Dense gathered(const Plan& p, const MatrixView& a) {
  Dense d;
  for (Index f = 0; f < p.fronts(); ++f) {
    const FrontLayout& l = p.layout[f];
    const auto position = [&](Index r) {
      return r < l.pivots ? p.tree.first[f] + r : p.tree.rows[p.tree.row_ptr[f] + r - l.pivots];
    };
    for (Index j = 0; j < l.tiles; ++j)
      for (Index i = j; i < l.tiles; ++i) {
        const Offset tile = p.first_tile[f] + l.tile_index(i, j);
        if (p.whole[f] && (i != 0 || j != 0)) {
          EXPECT_EQ(p.entry_ptr[tile], p.entry_ptr[tile + 1]) << "a whole front has all entries at its first tile";
        }
        for (Offset q = p.entry_ptr[tile]; q < p.entry_ptr[tile + 1]; ++q) {
          const EntryPlace& e = p.entries[q];
          EXPECT_LT(e.row(), p.whole[f] ? l.rows : l.width(i));
          EXPECT_LT(e.col(), p.whole[f] ? l.pivots : l.width(j));
          if (!p.whole[f]) {
            EXPECT_LT(j, l.pivot_tiles);
          }
          const Index r = position((p.whole[f] ? 0 : l.begin(i)) + e.row());
          const Index c = position((p.whole[f] ? 0 : l.begin(j)) + e.col());
          d[e.transposed() ? std::pair(c, r) : std::pair(r, c)] += a.values[static_cast<std::size_t>(e.source())];
        }
      }
  }
  return d;
}

inline void check_layout(const Plan& p) {
  for (Index f = 0; f < p.fronts(); ++f) {
    const FrontLayout& l = p.layout[f];
    ASSERT_EQ(l.pivots, p.tree.pivots(f));
    ASSERT_EQ(l.rows, l.pivots + p.tree.rows_below(f));
    Index at = 0;
    std::set<std::pair<Offset, Offset>> places;  // factor tiles: start, end
    for (Index i = 0; i < l.tiles; ++i) {
      ASSERT_EQ(l.begin(i), at);
      ASSERT_GT(l.width(i), 0);
      for (Index r = 0; r < l.width(i); ++r) ASSERT_EQ(l.tile_of(at + r), i);
      at += l.width(i);
      if (i + 1 == l.pivot_tiles) {
        ASSERT_EQ(at, l.pivots);
      }
      if (!p.whole[f] && p.options.tiles.max_block_size > 0) {
        ASSERT_LE(l.width(i), std::max(p.options.tiles.max_block_size + l.panel, l.panel));
      }
    }
    ASSERT_EQ(at, l.rows);
    ASSERT_EQ(l.begin(l.tiles), l.rows);
    for (Index j = 0; j < l.pivot_tiles; ++j)
      for (Index i = j; i < l.tiles; ++i)
        places.emplace(l.tile_offset(i, j), l.tile_offset(i, j) + l.padded(l.width(i)) * l.width(j));
    Offset end = 0;
    for (const auto& [b, e] : places) {
      ASSERT_EQ(b, end) << "factor tiles follow one another";
      end = e;
    }
    ASSERT_EQ(end, l.factor_size());
    places.clear();
    for (Index j = 0; j < l.tiles_below(); ++j)
      for (Index i = j; i < l.tiles_below(); ++i)
        places.emplace(l.contribution_offset(i, j), l.contribution_offset(i, j) +
                                                        l.contribution_ld(i) * (l.padded(l.below_rows(j)) - 1) +
                                                        l.padded(l.below_rows(i)));
    end = 0;
    for (const auto& [b, e] : places) {
      ASSERT_GE(b, end) << "contribution tiles do not overlap";
      end = e;
    }
    ASSERT_LE(end, l.contribution_size());
    ASSERT_EQ(p.first_tile[f + 1] - p.first_tile[f], l.tile_count());
  }
  // Places in the parent's front, through positions.
  for (Index f = 0; f < p.fronts(); ++f) {
    const Index up = p.tree.parent[f];
    if (up < 0) continue;
    for (Offset q = p.tree.row_ptr[f]; q < p.tree.row_ptr[f + 1]; ++q) {
      const Index r = p.relative[q];
      const Index position =
          r < p.layout[up].pivots ? p.tree.first[up] + r : p.tree.rows[p.tree.row_ptr[up] + r - p.layout[up].pivots];
      ASSERT_EQ(position, p.tree.rows[q]);
    }
  }
}

// Number of the task that makes each tile; of a whole front, at its first tile.
inline void check_tasks(const Plan& p) {
  const Index none = -1;
  std::vector<Index> maker(static_cast<std::size_t>(p.tiles()), none);
  std::vector<Index> first(static_cast<std::size_t>(p.fronts()), none), last(first);
  const auto book = [&](Index f, Index at) {
    if (first[f] == none) first[f] = at;
    last[f] = at;
  };
  for (Index at = 0; at < static_cast<Index>(p.tasks.size()); ++at) {
    const Task& t = p.tasks[at];
    if (t.is_range()) {
      ASSERT_LE(t.begin, t.front);
      for (Index f = t.begin; f <= t.front; ++f) {
        ASSERT_TRUE(p.whole[f]);
        ASSERT_EQ(maker[p.first_tile[f]], none) << "front " << f << " twice";
        for (Offset q = p.first_tile[f]; q < p.first_tile[f + 1]; ++q) maker[q] = at;
        book(f, at);
        // a child lies in the range before its parent, or is finished by an earlier task
        for (Offset c = p.child_ptr[f]; c < p.child_ptr[f + 1]; ++c)
          ASSERT_TRUE(p.children[c] >= t.begin || (last[p.children[c]] != none && last[p.children[c]] < at));
      }
      continue;
    }
    const FrontLayout& l = p.layout[t.front];
    ASSERT_FALSE(p.whole[t.front]);
    ASSERT_TRUE(0 <= t.j && t.j <= t.i && t.i < l.tiles);
    Index& mine = maker[p.first_tile[t.front] + l.tile_index(t.i, t.j)];
    ASSERT_EQ(mine, none) << "tile twice";
    mine = at;
    book(t.front, at);
    const auto made = [&](Index i, Index j) { return maker[p.first_tile[t.front] + l.tile_index(i, j)] != none; };
    for (Index k = 0; k < std::min(t.j, l.pivot_tiles); ++k) ASSERT_TRUE(made(t.i, k) && made(t.j, k));
    if (t.j < l.pivot_tiles && t.i != t.j) {
      ASSERT_TRUE(made(t.j, t.j));
    }
    for (Offset c = p.child_ptr[t.front]; c < p.child_ptr[t.front + 1]; ++c)
      for (Offset q = p.first_tile[p.children[c]]; q < p.first_tile[p.children[c] + 1]; ++q) ASSERT_NE(maker[q], none);
  }
  EXPECT_EQ(std::count(maker.begin(), maker.end(), none), 0) << "tiles that nobody makes";
  EXPECT_EQ(first, p.first_task);
  EXPECT_EQ(last, p.last_task);
}

struct Span {
  Offset begin, end;
  Index front;
  Index dies_with;  // the front whose end frees it; -1: never
};

// Replays the list; at every task, the regions of the front that begins must be free: never taken, or freed by a front
// for which the beginner waits (directly or through fronts that it waits for) and which stands earlier.
inline void check_memory(const Plan& p) {
  const MemoryPlan& m = p.memory;
  const bool two = p.options.unsymmetric || p.options.ldlt;
  const Offset copies = p.options.unsymmetric ? 2 : 1;
  Offset factors = 0;
  for (const FrontLayout& l : p.layout) factors += copies * l.factor_size();
  EXPECT_GE(m.factor_size, factors);
  EXPECT_LE(m.factor_size, m.size);
  std::vector<Span> dead, alive;
  // ended[f]: fronts that have surely ended when front f begins to write; closure[f]: when it has ended, which are
  // those, itself, and the same of its children, whose contributions it has read.
  std::vector<std::set<Index>> ended(static_cast<std::size_t>(p.fronts())), closure(ended);
  const auto take = [&](Index f, Index waiter, Offset begin, Offset size, Index dies_with) {
    if (size == 0) return;
    const Span s{begin, begin + size, f, dies_with};
    ASSERT_GE(s.begin, 0);
    ASSERT_LE(s.end, m.size);
    for (const Span& o : alive)
      ASSERT_TRUE(s.end <= o.begin || o.end <= s.begin) << "front " << f << " overwrites front " << o.front;
    for (const Span& o : dead)
      if (s.begin < o.end && o.begin < s.end) {
        ASSERT_TRUE(ended[waiter].contains(o.dies_with))
            << "front " << f << " may overwrite what front " << o.dies_with << " still reads";
      }
    alive.push_back(s);
  };
  const auto begin_front = [&](Index f, Index waiter) {
    const FrontLayout& l = p.layout[f];
    const Index up = p.tree.parent[f];
    take(f, waiter, m.factor[f], l.factor_size(), -1);
    if (p.options.unsymmetric) take(f, waiter, m.factor2[f], l.factor_size(), -1);
    if (two && !p.options.unsymmetric && !p.whole[f]) take(f, waiter, m.factor2[f], l.factor_size(), f);
    if (up < 0 || m.on_stack[f] || l.contribution_size() == 0) return;
    take(f, waiter, m.contribution[f], l.contribution_size(), up);
    if (copies == 2) take(f, waiter, m.contribution2[f], l.contribution_size(), up);
  };
  for (Index at = 0; at < static_cast<Index>(p.tasks.size()); ++at) {
    const Task& t = p.tasks[at];
    const Index f = t.front;
    if (p.first_task[f] == at) {
      for (Offset q = m.wait_ptr[f]; q < m.wait_ptr[f + 1]; ++q) {
        const Index w = m.wait_fronts[q];
        ASSERT_LT(p.last_task[w], at) << "front " << f << " waits for the later front " << w;
        ended[f].insert(closure[w].begin(), closure[w].end());
      }
      for (Index g = t.is_range() ? t.begin : f; g <= f; ++g) begin_front(g, f);
    }
    if (p.last_task[f] != at) continue;
    for (Index g = t.is_range() ? t.begin : f; g <= f; ++g) {
      closure[g] = ended[f];
      closure[g].insert(g);
      for (Offset c = p.child_ptr[g]; c < p.child_ptr[g + 1]; ++c)
        closure[g].insert(closure[p.children[c]].begin(), closure[p.children[c]].end());
    }
    const auto freed =
        std::stable_partition(alive.begin(), alive.end(), [&](const Span& s) { return s.dies_with != f; });
    dead.insert(dead.end(), freed, alive.end());
    alive.erase(freed, alive.end());
  }
  // Stacks of range tasks: a front's contribution may lie over its children's (they are in the scratch by then), but
  // never over one that is still to be read, and children must stand where their parent looks for them.
  for (const Task& t : p.tasks) {
    if (!t.is_range()) continue;
    std::vector<Span> stack;
    for (Index f = t.begin; f < t.front; ++f) {
      ASSERT_TRUE(m.on_stack[f] != 0 || m.added > 0) << "contributions inside a range stay on the stack";
      std::erase_if(stack, [&](const Span& s) { return p.tree.parent[s.front] == f; });
      if (m.on_stack[f] == 0) continue;
      for (int copy = 0; copy < copies; ++copy) {
        const Offset b = copy == 0 ? m.contribution[f] : m.contribution2[f];
        const Span s{b, b + p.layout[f].contribution_size(), f, -1};
        ASSERT_GE(s.begin, 0);
        ASSERT_LE(s.end, m.stack_size);
        for (const Span& o : stack) ASSERT_TRUE(s.end <= o.begin || o.end <= s.begin);
        if (s.end > s.begin) stack.push_back(s);
      }
    }
    ASSERT_FALSE(m.on_stack[t.front]);
  }
}

inline Graph graph_number(int number, std::mt19937& random) {
  switch (number) {
    case 0:
      return analysis::testing::graph_of_edges(1, {});
    case 1:
      return analysis::testing::graph_of_edges(9, {});
    case 2:
      return analysis::testing::chain(300);
    case 3:
      return analysis::testing::star(150);
    case 4:
      return analysis::testing::complete(70);
    case 5:
      return analysis::testing::brick(5, 5, 4, 3);
    case 6:
      return analysis::testing::brick(20, 20, 1, 1);
    default: {
      const Index n = static_cast<Index>(50 + random() % 300);
      return analysis::testing::graph_of_edges(
          n, analysis::testing::random_edges(n, static_cast<Index>(n * (1 + random() % 3)), random));
    }
  }
}

}  // namespace espalier::plan::testing
