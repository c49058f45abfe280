/// \file
/// Free places in memory that is planned.
#pragma once

#include <algorithm>
#include <iterator>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::plan {

/// Free places of a heap that may grow without limit. The smallest hole that is large enough is taken.
class Heap {
 public:
  Offset take(Offset size) {
    const auto fit = by_size_.lower_bound({size, 0});
    if (fit != by_size_.end()) {
      const auto [hole, at] = *fit;
      erase(at, hole);
      if (hole > size) insert(at + size, hole - size);
      return at;
    }
    const Offset at = extent_;
    extent_ += size;
    high_ = std::max(high_, extent_);
    return at;
  }
  void give_back(Offset at, Offset size) {
    auto next = holes_.lower_bound(at);
    if (next != holes_.begin()) {
      const auto before = std::prev(next);
      if (before->first + before->second == at) {
        at = before->first;
        size += before->second;
        erase(before->first, before->second);
      }
    }
    next = holes_.lower_bound(at);
    if (next != holes_.end() && at + size == next->first) {
      const Offset more = next->second;
      erase(next->first, more);
      size += more;
    }
    if (at + size == extent_)
      extent_ = at;
    else
      insert(at, size);
  }
  [[nodiscard]] Offset extent() const { return extent_; }
  /// The largest extent so far.
  [[nodiscard]] Offset high() const { return high_; }
  /// Keeps all that is free from being taken before restore(): places are taken beyond high() from now on.
  void set_aside() {
    aside_.insert(aside_.end(), holes_.begin(), holes_.end());
    holes_.clear();
    by_size_.clear();
    if (extent_ < high_) aside_.emplace_back(extent_, high_ - extent_);
    extent_ = high_;
  }
  void restore() {
    for (const auto& [at, size] : aside_) give_back(at, size);
    aside_.clear();
  }

 private:
  void insert(Offset at, Offset size) {
    holes_.emplace(at, size);
    by_size_.emplace(size, at);
  }
  void erase(Offset at, Offset size) {
    holes_.erase(at);
    by_size_.erase({size, at});
  }
  std::map<Offset, Offset> holes_;                // start -> size
  std::set<std::pair<Offset, Offset>> by_size_;   // (size, start)
  std::vector<std::pair<Offset, Offset>> aside_;  // (start, size)
  Offset extent_ = 0;
  Offset high_ = 0;
};

}  // namespace espalier::plan
