/// \file
/// Which rank knows which rows of a solution.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "plan/plan.hpp"
#include "ranks/communicator.hpp"
#include "ranks/message.hpp"

namespace espalier::device {

/// Rows in elimination order, each known to the rank that speaks for its front, and given to all.
class RankRows {
 public:
  /// @param plan  outlives this object
  RankRows(const plan::Plan& plan, int ranks) : plan_(plan), pieces_(at(ranks)) {}

  /// @param rank_of  the rank that speaks for a front
  template <class RankOf>
  void own(RankOf&& rank_of) {
    for (auto& list : pieces_) list.clear();
    for (Index f = 0; f < plan_.fronts(); ++f) {
      auto& list = pieces_[at(rank_of(f))];
      const Index begin = plan_.tree.first[f], end = plan_.tree.first[f + 1];
      if (!list.empty() && list.back().second == begin)
        list.back().second = end;
      else
        list.emplace_back(begin, end);
    }
  }

  /// Collective: everybody gets all of it. @param x  n x columns, row-major
  template <class T>
  void share(ranks::Communicator& link, T* x, Index columns) const {
    const auto place = [&](const std::pair<Index, Index>& p) {
      return std::pair(x + Offset{p.first} * columns, at(Offset{p.second - p.first} * columns));
    };
    std::vector<T> mine;
    for (const auto& p : pieces_[at(link.rank())]) {
      const auto [from, count] = place(p);
      mine.insert(mine.end(), from, from + count);
    }
    const auto all = link.all_gather(std::as_bytes(std::span<const T>(mine)));
    for (int r = 0; r < link.size(); ++r) {
      if (r == link.rank()) continue;
      const auto& bytes = all[at(r)];
      ranks::Reader reader(bytes.data(), bytes.size());
      for (const auto& p : pieces_[at(r)]) {
        const auto [to, count] = place(p);
        reader.get(to, count);
      }
    }
  }

 private:
  const plan::Plan& plan_;
  std::vector<std::vector<std::pair<Index, Index>>> pieces_;  // by rank; positions [begin, end)
};

}  // namespace espalier::device
