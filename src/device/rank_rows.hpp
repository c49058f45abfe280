/// \file
/// Which rank knows which rows of a solution.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "plan/plan.hpp"
#include "ranks/link.hpp"
#include "ranks/message.hpp"

namespace espalier::device {

/// Rows in elimination order, each known to the rank that speaks for its front, and given to all.
class RankRows {
 public:
  /// @param plan  outlives this object
  RankRows(const plan::Plan& plan, int ranks) : plan_(plan), pieces_(static_cast<std::size_t>(ranks)) {}

  /// @param rank_of  the rank that speaks for a front
  template <class RankOf>
  void own(RankOf&& rank_of) {
    for (auto& list : pieces_) list.clear();
    for (Index f = 0; f < plan_.fronts(); ++f) {
      auto& list = pieces_[static_cast<std::size_t>(rank_of(f))];
      const Index begin = plan_.tree.first[f], end = plan_.tree.first[f + 1];
      if (!list.empty() && list.back().second == begin)
        list.back().second = end;
      else
        list.emplace_back(begin, end);
    }
  }

  /// Collective: everybody gets all of it. @param x  n x columns, row-major
  template <class T>
  void share(ranks::Link& link, T* x, Index columns) const {
    const std::vector<T> mine = packed(link.rank(), x, columns);
    unpack(link, link.all_gather(std::as_bytes(std::span<const T>(mine))), x, columns);
  }
  /// Likewise, but rank 0 alone gets it.
  template <class T>
  void gather(ranks::Link& link, T* x, Index columns) const {
    const std::vector<T> mine = packed(link.rank(), x, columns);
    std::vector<std::span<const std::byte>> to(static_cast<std::size_t>(link.size()));
    if (link.rank() != 0) to.front() = std::as_bytes(std::span<const T>(mine));
    const auto all = link.all_to_all(to);
    if (link.rank() == 0) unpack(link, all, x, columns);
  }

 private:
  // use(first element, elements) for the rows of a rank.
  template <class T, class Use>
  void for_pieces(int rank, T* x, Index columns, Use&& use) const {
    for (const auto& [begin, end] : pieces_[static_cast<std::size_t>(rank)])
      use(x + Offset{begin} * columns, static_cast<std::size_t>(Offset{end - begin} * columns));
  }
  template <class T>
  std::vector<T> packed(int rank, const T* x, Index columns) const {
    std::vector<T> list;
    for_pieces(rank, x, columns,
               [&](const T* from, std::size_t count) { list.insert(list.end(), from, from + count); });
    return list;
  }
  template <class T>
  void unpack(const ranks::Link& link, const std::vector<std::vector<std::byte>>& all, T* x, Index columns) const {
    for (int r = 0; r < link.size(); ++r) {
      if (r == link.rank()) continue;
      const auto& bytes = all[static_cast<std::size_t>(r)];
      ranks::Reader reader(bytes.data(), bytes.size());
      for_pieces(r, x, columns, [&](T* to, std::size_t count) { reader.get(to, count); });
    }
  }

  const plan::Plan& plan_;
  std::vector<std::vector<std::pair<Index, Index>>> pieces_;  // by rank; positions [begin, end)
};

}  // namespace espalier::device
