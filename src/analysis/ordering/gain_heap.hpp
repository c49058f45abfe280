/// \file
/// A priority queue for local improvement.
#pragma once

#include <cstddef>
#include <vector>

#include "base/at.hpp"
#include "espalier/types.hpp"

namespace espalier::analysis {

/// A binary max-heap of vertices by gain that finds its members.
class GainHeap {
 public:
  explicit GainHeap(std::size_t n) : place_(n, -1) {}

  [[nodiscard]] bool empty() const { return heap_.empty(); }
  [[nodiscard]] Index top() const { return heap_.front().vertex; }
  [[nodiscard]] Index top_gain() const { return heap_.front().gain; }
  [[nodiscard]] bool contains(Index v) const { return place_[at(v)] >= 0; }

  void clear() {
    for (const Item& e : heap_) place_[at(e.vertex)] = -1;
    heap_.clear();
  }
  void insert(Index v, Index gain) {
    heap_.push_back({gain, v});
    up(heap_.size() - 1);
  }
  void change(Index v, Index difference) {
    const std::size_t k = static_cast<std::size_t>(place_[at(v)]);
    heap_[k].gain += difference;
    difference > 0 ? up(k) : down(k);
  }
  void remove(Index v) {
    const std::size_t k = static_cast<std::size_t>(place_[at(v)]);
    place_[at(v)] = -1;
    const Item last = heap_.back();
    heap_.pop_back();
    if (k == heap_.size()) return;
    heap_[k] = last;
    place_[at(last.vertex)] = static_cast<Index>(k);
    up(k);
    down(static_cast<std::size_t>(place_[at(last.vertex)]));
  }

 private:
  struct Item {
    Index gain, vertex;
    bool operator<(const Item& o) const { return gain != o.gain ? gain < o.gain : vertex > o.vertex; }
  };
  void set_item(std::size_t k, Item e) {
    heap_[k] = e;
    place_[at(e.vertex)] = static_cast<Index>(k);
  }
  void up(std::size_t k) {
    const Item e = heap_[k];
    for (; k > 0 && heap_[(k - 1) / 2] < e; k = (k - 1) / 2) set_item(k, heap_[(k - 1) / 2]);
    set_item(k, e);
  }
  void down(std::size_t k) {
    const Item e = heap_[k];
    for (;;) {
      std::size_t child = 2 * k + 1;
      if (child >= heap_.size()) break;
      if (child + 1 < heap_.size() && heap_[child] < heap_[child + 1]) ++child;
      if (!(e < heap_[child])) break;
      set_item(k, heap_[child]);
      k = child;
    }
    set_item(k, e);
  }

  std::vector<Item> heap_;
  std::vector<Index> place_;
};

}  // namespace espalier::analysis
