#include "dynamics/elements/gather.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "base/at.hpp"

namespace espalier::dynamics {

ForceList make_force_list(const Connectivity& c, Index vertices, std::span<const char> failed) {
  ForceList list;
  list.ptr.assign(at(vertices) + 1, 0);
  const auto for_places = [&](const auto& use) {
    for (std::size_t k = 0; k < c.vertex.size(); ++k)
      if (failed.empty() || failed[k / at(c.vertices)] == 0) use(k);
  };
  for_places([&](std::size_t k) { ++list.ptr[at(c.vertex[k]) + 1]; });
  for (std::size_t v = 0; v < at(vertices); ++v) list.ptr[v + 1] += list.ptr[v];
  list.from.resize(at(list.ptr.back()));
  std::vector<std::int32_t> next(list.ptr.begin(), list.ptr.end() - 1);
  for_places([&](std::size_t k) { list.from[at(next[at(c.vertex[k])]++)] = static_cast<std::int32_t>(k); });
  return list;
}

Offset VertexPattern::entry(Index row, Index column) const {
  const auto begin = ind.begin() + ptr[at(column)];
  const auto end = ind.begin() + ptr[at(column) + 1];
  const auto found = std::lower_bound(begin, end, row);
  if (found == end || *found != row)
    throw std::logic_error(fmt::format("vertices {} and {} share no element", row, column));
  return found - ind.begin();
}

PairList make_pair_list(const Connectivity& c, const VertexPattern& pattern, Index first, Index last,
                        std::span<const char> failed) {
  struct Source {
    std::uint64_t place;  // column, row: the order of the pairs
    std::int32_t from;
  };
  std::vector<Source> sources;
  const int n = c.vertices;
  for (Index e = first; e < last; ++e) {
    if (!failed.empty() && failed[at(e)] != 0) continue;
    const Index* vertex = c.vertex.data() + at(e) * at(n);
    for (int b = 0; b < n; ++b)
      for (int a = 0; a < n; ++a)
        if (vertex[a] <= vertex[b])
          sources.push_back({static_cast<std::uint64_t>(vertex[b]) << 32 | static_cast<std::uint64_t>(vertex[a]),
                             (e - first) << 10 | a << 5 | b});
  }
  // Elements in their order at each place: a code grows with its element.
  std::sort(sources.begin(), sources.end(),
            [](const Source& x, const Source& y) { return x.place != y.place ? x.place < y.place : x.from < y.from; });
  PairList list{first, last, {}, {}, {}};
  for (std::size_t k = 0; k < sources.size(); ++k) {
    if (k == 0 || sources[k].place != sources[k - 1].place) {
      const auto column = static_cast<Index>(sources[k].place >> 32);
      const auto row = static_cast<Index>(sources[k].place & 0xffffffff);
      list.pair.push_back({row, column, static_cast<std::int32_t>(pattern.entry(row, column)),
                           static_cast<std::int32_t>(pattern.entry(column, row))});
      list.ptr.push_back(static_cast<std::int32_t>(k));
    }
    list.from.push_back(sources[k].from);
  }
  list.ptr.push_back(static_cast<std::int32_t>(sources.size()));
  return list;
}

}  // namespace espalier::dynamics
