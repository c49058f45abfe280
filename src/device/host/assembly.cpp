#include "device/host/assembly.hpp"

#include <algorithm>

namespace espalier::device::host {

namespace {

// Consecutive rows of the child that are consecutive in the parent too: (row of the child, length, row of the part).
void find_runs(const Index* relative, Index begin, Index end, Index row_begin, std::vector<Index>& runs) {
  runs.clear();
  for (Index r = begin; r < end;) {
    Index e = r + 1;
    while (e < end && relative[e] == relative[e - 1] + 1) ++e;
    runs.insert(runs.end(), {r, e - r, relative[r] - row_begin});
    r = e;
  }
}

}  // namespace

template <class T>
void add_contribution(const analysis::Plan& plan, Index child, const T* source, const Part<T>& part, bool mirror,
                      std::vector<Index>& runs) {
  const analysis::FrontLayout& layout = plan.layout[child];
  const Index below = layout.below();
  const Index* relative = plan.relative.data() + plan.tree.row_ptr[child];
  const auto place = [&](Index row) {
    return static_cast<Index>(std::lower_bound(relative, relative + below, row) - relative);
  };
  const Index col_begin = place(part.col_begin);
  const Index col_end = place(part.col_end);
  if (col_begin == col_end) return;
  const Index row_begin = place(part.row_begin);
  const Index row_end = place(part.row_end);
  if (row_begin == row_end) return;
  find_runs(relative, row_begin, row_end, part.row_begin, runs);
  const std::size_t run_count = runs.size();
  std::size_t first_run = 0;
  for (Index c = col_begin; c < col_end; ++c) {
    const Index block = c / layout.below_width;
    const Index block_begin = block * layout.below_width;
    const T* column =
        source + layout.contribution_offset(block) + (c - block_begin) * layout.contribution_ld(block) - block_begin;
    const Index start = mirror ? c + 1 : c;  // rows of the child from there on are stored
    while (first_run < run_count && runs[first_run] + runs[first_run + 1] <= start) first_run += 3;
    for (std::size_t q = first_run; q < run_count; q += 3) {
      const Index skip = std::max<Index>(0, start - runs[q]);
      const Index length = runs[q + 1] - skip;
      const T* from = column + runs[q] + skip;
      if (mirror) {
        T* to = part.data + (runs[q + 2] + skip) * part.ld + (relative[c] - part.col_begin);
        for (Index r = 0; r < length; ++r) to[r * part.ld] += from[r];
      } else {
        T* to = part.data + (relative[c] - part.col_begin) * part.ld + runs[q + 2] + skip;
        for (Index r = 0; r < length; ++r) to[r] += from[r];
      }
    }
  }
}

template <class T>
void add_entries(std::span<const analysis::Entry> entries, std::span<const T> values, T* c, Offset ld, EntryPart part) {
  if (part == EntryPart::square) {
    for (const analysis::Entry& e : entries)
      c[e.transposed() ? e.row() * ld + e.col() : e.col() * ld + e.row()] +=
          values[static_cast<std::size_t>(e.source())];
    return;
  }
  const bool transposed = part == EntryPart::transposed;
  for (const analysis::Entry& e : entries)
    if (e.transposed() == transposed) c[e.col() * ld + e.row()] += values[static_cast<std::size_t>(e.source())];
}

template void add_contribution(const analysis::Plan&, Index, const double*, const Part<double>&, bool,
                               std::vector<Index>&);
template void add_contribution(const analysis::Plan&, Index, const float*, const Part<float>&, bool,
                               std::vector<Index>&);
template void add_entries(std::span<const analysis::Entry>, std::span<const double>, double*, Offset, EntryPart);
template void add_entries(std::span<const analysis::Entry>, std::span<const float>, float*, Offset, EntryPart);

}  // namespace espalier::device::host
