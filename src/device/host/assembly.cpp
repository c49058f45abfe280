#include "device/host/assembly.hpp"

#include <algorithm>

#include "device/host/kernels/scatter.hpp"

namespace espalier::device::host {

namespace {

// The runs of the child's rows [begin, end).
void find_runs(const Index* relative, Index begin, Index end, Index row_begin, std::vector<Run>& runs) {
  runs.clear();
  for (Index r = begin; r < end;) {
    Index e = r + 1;
    while (e < end && relative[e] == relative[e - 1] + 1) ++e;
    runs.push_back({r, e, relative[r] - row_begin});
    r = e;
  }
}

}  // namespace

template <class T>
void add_contribution(const plan::Plan& plan, Index child, const T* source, const FrontBlock<T>& part, bool mirror,
                      std::vector<Run>& runs, ColumnRange columns) {
  const plan::FrontLayout& layout = plan.layout[child];
  const Index below = layout.below();
  const Index* relative = plan.places_in_parent(child);
  const auto place = [&](Index row) {
    return static_cast<Index>(std::lower_bound(relative, relative + below, row) - relative);
  };
  const Index col_begin = std::max(place(part.col_begin), columns.begin);
  const Index col_end = std::min(place(part.col_end), columns.end);
  if (col_begin >= col_end) return;
  const Index row_begin = place(part.row_begin);
  const Index row_end = place(part.row_end);
  const Index w = layout.below_width;
  // Tile by tile of the child.
  for (Index i = row_begin / w; i * w < row_end; ++i) {
    const Index rows_from = std::max(row_begin, i * w);
    const Index rows_to = std::min(row_end, (i + 1) * w);
    find_runs(relative, rows_from, rows_to, part.row_begin, runs);
    for (Index j = col_begin / w; j <= i && j * w < col_end; ++j) {
      const Scatter<T> task{source + layout.contribution_offset(i, j),
                            layout.contribution_ld(i),
                            i * w,
                            j * w,
                            std::max(col_begin, j * w),
                            std::min(col_end, (j + 1) * w),
                            relative,
                            part.col_begin,
                            part.data,
                            part.ld};
      if (mirror)
        scatter_mirrored(runs.data(), static_cast<Index>(runs.size()), task);
      else
        scatter(runs.data(), static_cast<Index>(runs.size()), task);
    }
  }
}

template <class T>
void add_entries(std::span<const plan::EntryPlace> entries, std::span<const T> values, T* c, Offset ld,
                 EntryPart part) {
  // The values of a tile lie scattered over the caller's array: their cache lines are asked for ahead of their use.
  constexpr std::size_t kAhead = 24;
  const auto prefetch = [&](std::size_t k) {
    if (k + kAhead < entries.size()) __builtin_prefetch(&values[at(entries[k + kAhead].source())]);
  };
  const bool square = part == EntryPart::square;
  const bool transposed = part == EntryPart::transposed;
  for (std::size_t k = 0; k < entries.size(); ++k) {
    prefetch(k);
    const plan::EntryPlace& e = entries[k];
    const T value = values[at(e.source())];
    if (square)
      c[e.transposed() ? e.row() * ld + e.col() : e.col() * ld + e.row()] += value;
    else if (e.transposed() == transposed)
      c[e.col() * ld + e.row()] += value;
  }
}

#define ESPALIER_INSTANTIATE(T)                                                                                     \
  template void add_contribution(const plan::Plan&, Index, const T*, const FrontBlock<T>&, bool, std::vector<Run>&, \
                                 ColumnRange);                                                                      \
  template void add_entries(std::span<const plan::EntryPlace>, std::span<const T>, T*, Offset, EntryPart);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host
