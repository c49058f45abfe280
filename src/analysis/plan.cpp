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

// The matrix by positions of the elimination.
struct Permuted {
  const MatrixView& a;
  const matrix::RowIndex& rows;
  const std::vector<Index>& order;       // column by position
  const std::vector<Index>& row_of_col;  // empty: identity
  bool unsymmetric;
  std::vector<Index> column_position, row_position;

  // Calls use(source, row position, transposed) for the entries that belong to position k. An entry is found in its
  // column when that is the lower of its positions, else in its row.
  template <class Use>
  void visit(Index k, Use&& use) const {
    const Index c = order[k];
    const bool both = a.storage == Storage::symmetric_both;
    for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q) {
      const Index r = a.row_ind[q];
      if (both && r < c) continue;  // the lower triangle stands for both
      if (const Index p = row_position[r]; p >= k) use(q, p, false);
    }
    const Index r = row_of_col.empty() ? c : row_of_col[c];
    for (Offset q = rows.ptr[r]; q < rows.ptr[r + 1]; ++q)
      if (const Index p = column_position[rows.col[q]]; p > k) use(rows.source[q], p, unsymmetric);
  }
};

// The entries of one front at a time, sorted.
class FrontEntries {
 public:
  FrontEntries(const Plan& plan, const Permuted& permuted)
      : plan_(plan), permuted_(permuted), local_(static_cast<std::size_t>(plan.tree.n), -1) {}

  // Collects the columns of front f: in each, rows ascending, duplicates by source.
  void collect(Index f) {
    list_.clear();
    ptr_.assign(1, 0);
    for (Index k = plan_.tree.first[f]; k < plan_.tree.first[f + 1]; ++k) {
      permuted_.visit(k, [&](Offset q, Index row, bool transposed) { list_.push_back({q, row, transposed}); });
      std::sort(list_.begin() + static_cast<std::ptrdiff_t>(ptr_.back()), list_.end(),
                [](const Raw& x, const Raw& y) { return x.row != y.row ? x.row < y.row : x.source < y.source; });
      ptr_.push_back(list_.size());
    }
  }

  // Calls use(tile, entry) for every entry collected, columns ascending.
  template <class Use>
  void visit(Index f, Use&& use) {
    const auto& t = plan_.tree;
    const FrontLayout& layout = plan_.layout[f];
    const Index k = layout.pivots;
    for (Offset r = t.row_ptr[f]; r < t.row_ptr[f + 1]; ++r)
      local_[t.rows[r]] = k + static_cast<Index>(r - t.row_ptr[f]);
    for (Index col = 0; col < k; ++col) {
      const Index j = layout.tile_of(col);
      for (std::size_t q = ptr_[static_cast<std::size_t>(col)]; q < ptr_[static_cast<std::size_t>(col) + 1]; ++q) {
        const Raw& e = list_[q];
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
  const Permuted& permuted_;
  std::vector<Raw> list_;
  std::vector<std::size_t> ptr_;  // pivots + 1: each column's part of the list
  std::vector<Index> local_;      // position -> row of the current front, valid for its rows below
};

// Where each front's entries begin (fronts + 1): all entries of a front stand together.
std::vector<Offset> count_entries(const Plan& plan, const Permuted& permuted, base::ThreadPool& pool) {
  std::vector<Offset> begin(static_cast<std::size_t>(plan.fronts()) + 1, 0);
  pool.for_each_piece(plan.fronts(), kFrontsPerPiece, [&](std::int64_t b, std::int64_t e) {
    for (auto f = static_cast<Index>(b); f < e; ++f) {
      Offset count = 0;
      for (Index k = plan.tree.first[f]; k < plan.tree.first[f + 1]; ++k)
        permuted.visit(k, [&](Offset, Index, bool) { ++count; });
      begin[f + 1] = count;
    }
  });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  return begin;
}

Permuted permute(const Plan& plan, const MatrixView& a, const matrix::RowIndex& rows,
                 const std::vector<Index>& row_of_col) {
  const auto n = static_cast<std::size_t>(plan.tree.n);
  Permuted p{a, rows, plan.tree.order, row_of_col, plan.options.unsymmetric, std::vector<Index>(n), {}};
  for (std::size_t k = 0; k < n; ++k) p.column_position[plan.tree.order[k]] = static_cast<Index>(k);
  p.row_position = p.column_position;
  if (!row_of_col.empty())
    for (std::size_t c = 0; c < n; ++c) p.row_position[row_of_col[c]] = p.column_position[c];
  return p;
}

void place_entries(Plan& plan, const Permuted& permuted, base::ThreadPool& pool) {
  const std::vector<Offset> begin = count_entries(plan, permuted, pool);
  plan.entry_ptr.assign(static_cast<std::size_t>(plan.tiles()) + 1, 0);
  plan.entries.resize(static_cast<std::size_t>(begin.back()));
  std::atomic<Index> next_front{0};
  pool.run([&](int) {
    FrontEntries front(plan, permuted);
    std::vector<Offset> at;
    for (;;) {
      const Index b = next_front.fetch_add(kFrontsPerPiece, std::memory_order_relaxed);
      if (b >= plan.fronts()) return;
      for (Index f = b; f < std::min<Index>(plan.fronts(), b + kFrontsPerPiece); ++f) {
        const Offset tile0 = plan.first_tile[f];
        at.assign(static_cast<std::size_t>(plan.layout[f].tile_count()) + 1, 0);
        front.collect(f);
        front.visit(f, [&](Offset tile, const Entry&) { ++at[tile + 1]; });
        at[0] = begin[f];
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
               base::ThreadPool& pool, const matrix::RowIndex* rows) {
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
  matrix::RowIndex own;
  if (rows == nullptr || rows->ptr.empty()) rows = &(own = matrix::index_rows(a, pool));
  place_entries(plan, permute(plan, a, *rows, row_of_col), pool);
  beside.get();
  return plan;
}

}  // namespace espalier::analysis
