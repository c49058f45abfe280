#include "analysis/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <future>
#include <numeric>
#include <system_error>
#include <utility>

#include "analysis/lazy_vector.hpp"
#include "analysis/task_list.hpp"

namespace espalier::analysis {

namespace {

constexpr Index kMostTileWidth = 2047;
constexpr std::int64_t kFrontsPerPiece = 256;

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
  plan.relative.resize(t.rows.size());
  pool.for_each_piece(plan.fronts(), kFrontsPerPiece, [&](std::int64_t b, std::int64_t e) {
    for (auto f = static_cast<Index>(b); f < e; ++f) {
      const Index p = t.parent[f];
      if (p < 0) continue;
      const Index pivots = t.pivots(p);
      Offset at = t.row_ptr[p];
      for (Offset r = t.row_ptr[f]; r < t.row_ptr[f + 1]; ++r) {
        const Index row = t.rows[r];
        if (row < t.first[p + 1]) {
          plan.relative[r] = row - t.first[p];
        } else {
          while (at < t.row_ptr[p + 1] && t.rows[at] < row) ++at;
          plan.relative[r] = pivots + static_cast<Index>(at - t.row_ptr[p]);
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

// An entry of A in permuted form: it belongs to the column list of the lower of its two positions.
struct Raw {
  Offset source;
  Index row;        // the higher position
  bool transposed;  // the entry lies above the diagonal of the permuted matrix (lu)
};

// Entries of the permuted lower triangle, by columns.
struct Columns {
  std::vector<Offset> ptr;  // n + 1
  LazyVector<Raw> list;
};

Columns columns_by_position(const MatrixView& a, const std::vector<Index>& column_position,
                            const std::vector<Index>& row_position, bool unsymmetric, base::ThreadPool& pool) {
  constexpr std::int64_t kColumnsPerPiece = 4096;
  const bool both = a.storage == Storage::symmetric_both;
  std::vector<std::atomic<Offset>> next(static_cast<std::size_t>(a.cols) + 1);
  const auto visit = [&](auto&& use) {
    pool.for_each_piece(a.cols, kColumnsPerPiece, [&](std::int64_t b, std::int64_t e) {
      for (auto c = static_cast<Index>(b); c < e; ++c)
        for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q) {
          const Index r = a.row_ind[q];
          if (both && r < c) continue;  // the lower triangle stands for both
          const Index pr = row_position[r];
          const Index pc = column_position[c];
          use(q, std::min(pr, pc), std::max(pr, pc), unsymmetric && pr < pc);
        }
    });
  };
  visit([&](Offset, Index col, Index, bool) { next[col + 1].fetch_add(1, std::memory_order_relaxed); });
  Columns out;
  out.ptr.resize(next.size());
  Offset sum = 0;
  for (std::size_t k = 0; k < next.size(); ++k) {
    sum += next[k].load(std::memory_order_relaxed);
    out.ptr[k] = sum;
    next[k].store(sum, std::memory_order_relaxed);
  }
  out.list.resize(static_cast<std::size_t>(sum));
  visit([&](Offset q, Index col, Index row, bool transposed) {
    out.list[next[col].fetch_add(1, std::memory_order_relaxed)] = {q, row, transposed};
  });
  return out;
}

// Sorts the entries of one front's columns by tile and appends them at `out` (entry_ptr holds the counts' prefix sums).
class FrontEntries {
 public:
  FrontEntries(const Plan& plan, Columns& columns)
      : plan_(plan), columns_(columns), local_(static_cast<std::size_t>(plan.tree.n), -1) {}

  // Brings the columns of front f in order: rows ascending, duplicates by source.
  void sort(Index f) {
    const auto& first = plan_.tree.first;
    for (Index c = first[f]; c < first[f + 1]; ++c)
      std::sort(columns_.list.begin() + columns_.ptr[c], columns_.list.begin() + columns_.ptr[c + 1],
                [](const Raw& x, const Raw& y) { return x.row != y.row ? x.row < y.row : x.source < y.source; });
  }

  // Calls use(tile, entry) for every entry of front f, columns ascending, rows ascending, duplicates by source.
  template <class Use>
  void visit(Index f, Use&& use) {
    const auto& t = plan_.tree;
    const FrontLayout& layout = plan_.layout[f];
    const Index k = layout.pivots;
    for (Offset r = t.row_ptr[f]; r < t.row_ptr[f + 1]; ++r)
      local_[t.rows[r]] = k + static_cast<Index>(r - t.row_ptr[f]);
    for (Index c = t.first[f]; c < t.first[f + 1]; ++c) {
      const Index col = c - t.first[f];
      const Index j = layout.tile_of(col);
      for (Offset q = columns_.ptr[c]; q < columns_.ptr[c + 1]; ++q) {
        const Raw& e = columns_.list[q];
        const Index row = e.row < t.first[f + 1] ? e.row - t.first[f] : local_[e.row];
        const Index i = plan_.whole[f] ? 0 : layout.tile_of(row);
        const Index jj = plan_.whole[f] ? 0 : j;
        const Index rb = plan_.whole[f] ? 0 : layout.begin(i);
        const Index cb = plan_.whole[f] ? 0 : layout.begin(jj);
        use(layout.tile_index(i, jj), Entry(e.source, row - rb, col - cb, e.transposed));
      }
    }
  }

 private:
  const Plan& plan_;
  Columns& columns_;
  std::vector<Index> local_;  // position -> row of the current front, valid for its rows below
};

void place_entries(Plan& plan, const MatrixView& a, const std::vector<Index>& row_of_col, base::ThreadPool& pool) {
  const Index n = plan.tree.n;
  std::vector<Index> column_position(static_cast<std::size_t>(n));
  for (Index k = 0; k < n; ++k) column_position[plan.tree.order[k]] = k;
  std::vector<Index> row_position(column_position);
  if (!row_of_col.empty())
    for (Index c = 0; c < n; ++c) row_position[row_of_col[c]] = column_position[c];
  Columns columns = columns_by_position(a, column_position, row_position, plan.options.unsymmetric, pool);

  plan.entry_ptr.assign(static_cast<std::size_t>(plan.tiles()) + 1, 0);
  plan.entries.resize(columns.list.size());
  std::atomic<Index> next_front{0};
  pool.run([&](int) {
    FrontEntries front(plan, columns);
    std::vector<Offset> at;
    for (;;) {
      const Index b = next_front.fetch_add(kFrontsPerPiece, std::memory_order_relaxed);
      if (b >= plan.fronts()) return;
      for (Index f = b; f < std::min<Index>(plan.fronts(), b + kFrontsPerPiece); ++f) {
        // All entries of a front stand together, from the start of its first column's list on.
        const Offset start = columns.ptr[plan.tree.first[f]];
        const Offset tile0 = plan.first_tile[f];
        at.assign(static_cast<std::size_t>(plan.layout[f].tile_count()) + 1, 0);
        front.sort(f);
        front.visit(f, [&](Offset tile, const Entry&) { ++at[tile + 1]; });
        at[0] = start;
        for (std::size_t k = 1; k < at.size(); ++k) at[k] += at[k - 1];
        for (std::size_t k = 0; k + 1 < at.size(); ++k) plan.entry_ptr[tile0 + static_cast<Offset>(k)] = at[k];
        front.visit(f, [&](Offset tile, const Entry& e) { plan.entries[at[tile]++] = e; });
      }
    }
  });
  plan.entry_ptr.back() = static_cast<Offset>(plan.entries.size());
}

// Starts `work` on a thread of its own; where there is none to be had, get() does the work.
template <class Work>
std::future<void> start_beside(const Work& work, const base::ThreadPool& pool) {
  if (pool.size() > 1) {
    try {
      return std::async(std::launch::async, work);
    } catch (const std::system_error&) {  // the machine has no more threads
    }
  }
  return std::async(std::launch::deferred, work);
}

}  // namespace

double front_flops(Index pivots, Index rows, bool unsymmetric) {
  // sum over the pivots c of (rows - c)^2
  const double k = pivots;
  const double m = rows;
  const double symmetric = k * m * m - m * k * (k - 1) + k * (k - 1) * (2 * k - 1) / 6;
  return unsymmetric ? 2 * symmetric : symmetric;
}

Plan make_plan(AssemblyTree tree, const MatrixView& a, const std::vector<Index>& row_of_col, const PlanOptions& options,
               base::ThreadPool& pool) {
  if (options.tiles.max_block_size > kMostTileWidth || options.tiles.whole_rows > kMostTileWidth)
    throw Error(StatusCode::invalid_input, fmt::format("max_block_size {} is above the limit of {}",
                                                       options.tiles.max_block_size, kMostTileWidth));
  Plan plan;
  plan.tree = std::move(tree);
  plan.options = options;
  link_children(plan);
  cut_fronts(plan);
  // Tasks and memory are one chain of small steps that needs no entries: it goes beside them.
  const auto list_and_place = [&plan] {
    plan.assignment = assign_devices(plan);
    list_tasks(plan);
    if (!plan.options.plan_memory) return;
    if (plan.options.array_sizes == nullptr) return plan_memory(plan);
    const ArraySizes sizes = plan.options.array_sizes(plan);
    plan_memory(plan, &sizes);
  };
  std::future<void> beside = start_beside(list_and_place, pool);
  relate_rows(plan, pool);
  place_entries(plan, a, row_of_col, pool);
  beside.get();
  return plan;
}

}  // namespace espalier::analysis
