/// \file
/// Places in a memory of fixed size, and who last touched them.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::out_of_core {

/// Hands out places. What passes through goes round from the low end on, so that a place rests before it is taken
/// again; what lasts stands at the high end.
class Arena {
 public:
  static constexpr Offset kAlignment = 256;  ///< bytes
  /// @param around  false: what passes through takes the next hole's beginning, which splits memory less where it is
  ///                tight, but takes places again sooner
  explicit Arena(Offset size, bool around = true) : size_(size / kAlignment * kAlignment), around_(around) {
    holes_[0] = size_;
  }
  /// @returns the place, -1 when there is none
  Offset take_passing(Offset bytes);
  Offset take_lasting(Offset bytes);
  Offset take_lowest(Offset bytes);
  /// The lowest hole that is large enough, for what stays; what passes through goes on where it was.
  Offset take_first(Offset bytes);
  void give_back(Offset at, Offset bytes);
  [[nodiscard]] Offset peak() const { return peak_; }  ///< highest byte in use so far
  [[nodiscard]] Offset size() const { return size_; }

  static Offset round(Offset bytes) { return (bytes + kAlignment - 1) / kAlignment * kAlignment; }

 private:
  Offset cut(std::map<Offset, Offset>::iterator hole, Offset at, Offset bytes);
  std::map<Offset, Offset> holes_;  // start -> size
  Offset size_;
  bool around_;
  Offset cursor_ = 0;
  Offset peak_ = 0;
};

/// For every place the last operations that read and wrote it, by queue; numbers count from 1, 0: none.
class Touches {
 public:
  explicit Touches(int queues) : queues_(static_cast<std::size_t>(queues)) {}
  /// Operation `number` of `queue` touches the place. Raises `waits`, a number for each queue, to what it must wait
  /// for.
  void touch(Offset at, Offset size, int queue, std::int64_t number, bool write, std::span<std::int64_t> waits);

 private:
  using Numbers = std::vector<std::int64_t>;
  struct Region {
    Offset end;
    Numbers read, written;
  };
  void split(Offset at);
  std::size_t queues_;
  std::map<Offset, Region> regions_;
};

}  // namespace espalier::out_of_core
