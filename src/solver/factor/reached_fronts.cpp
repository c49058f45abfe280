#include "solver/factor/reached_fronts.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>

#include "base/at.hpp"

namespace espalier::solver {

ReachedFronts::ReachedFronts(const PreparedMatrix& prepared, const plan::Plan& plan, Index parts,
                             base::ThreadPool& pool)
    : prepared_(prepared),
      plan_(plan),
      parts_(parts),
      pool_(pool),
      front_of_column_(at(plan.tree.n)),
      column_of_row_(at(prepared.n())) {
  const analysis::AssemblyTree& t = plan.tree;
  for (Index f = 0; f < t.fronts(); ++f)
    for (Index k = t.first[at(f)]; k < t.first[at(f) + 1]; ++k) front_of_column_[at(t.order[at(k)])] = f;
  for (Index c = 0; c < prepared.n(); ++c) column_of_row_[at(prepared.row_of(c))] = c;
}

// By any thread.
void ReachedFronts::mark_column(Index column, std::vector<char>& fronts) const {
  for (Index part = 0; part < parts_; ++part) {
    const std::atomic_ref<char> mark(fronts[at(front_of_column_[at(parts_ * column + part)])]);
    if (mark.load(std::memory_order_relaxed) == 0) mark.store(1, std::memory_order_relaxed);
  }
}

void ReachedFronts::mark_parents(std::vector<char>& fronts) const {
  for (Index f = 0; f < plan_.fronts(); ++f)  // children stand before their parents
    if (const Index parent = plan_.tree.parent[at(f)]; parent >= 0 && fronts[at(f)] != 0) fronts[at(parent)] = 1;
}

std::vector<char> ReachedFronts::of_places(std::span<const Offset> places, Offset doubles) const {
  constexpr std::int64_t kPlaces = 1 << 14;
  std::vector<char> fronts(at(plan_.fronts()), 0);
  const auto& col_ptr = prepared_.a.col_ptr;
  pool_.for_each_range(static_cast<std::int64_t>(places.size()), kPlaces, [&](std::int64_t begin, std::int64_t end) {
    const Offset first = places[at(begin)] / doubles;
    auto next = std::upper_bound(col_ptr.begin(), col_ptr.end(), first);
    mark_column(static_cast<Index>(next - col_ptr.begin()) - 1, fronts);
    for (auto k = begin; k < end; ++k) {
      const Offset entry = places[at(k)] / doubles;
      if (entry >= *next) {
        while (entry >= *next) ++next;
        mark_column(static_cast<Index>(next - col_ptr.begin()) - 1, fronts);
      }
      mark_column(column_of_row_[at(prepared_.a.row_ind[at(entry)])], fronts);
    }
  });
  mark_parents(fronts);
  return fronts;
}

std::vector<char> ReachedFronts::of_rows_and_columns(std::span<const unsigned char> rows,
                                                     std::span<const unsigned char> columns) const {
  constexpr std::int64_t kRows = 1 << 14;
  std::vector<char> fronts(at(plan_.fronts()), 0);
  pool_.for_each_range(prepared_.n(), kRows, [&](std::int64_t begin, std::int64_t end) {
    for (auto i = static_cast<Index>(begin); i < end; ++i) {
      if (columns[at(i)] != 0) mark_column(i, fronts);
      if (rows[at(i)] != 0) mark_column(column_of_row_[at(i)], fronts);
    }
  });
  mark_parents(fronts);
  return fronts;
}

}  // namespace espalier::solver
