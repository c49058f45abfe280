/// \file
/// What devices make for others that do not reach their memory: which tiles go to whom, and where they lie. All of it
/// follows from the plan, so that sender and receiver count alike and nobody asks.
#pragma once

#include <cstdint>
#include <vector>

#include "device/cuda/tables/device_plan.hpp"

namespace espalier::device::cuda {

/// A rectangle in one of a device's arrays: `height` stretches of `width` elements each, `pitch` elements apart.
struct Piece {
  enum class Array : std::int8_t {
    top,     ///< region 0, laid out alike on all devices
    places,  ///< Place::offset, of the device that makes the tile
    pivots   ///< pivots, then inverse_d and inverse_e (ldlt), n elements each
  };
  Array array = Array::top;
  std::int64_t offset = 0, pitch = 0, width = 0, height = 0;

  [[nodiscard]] std::int64_t elements() const { return width * height; }
};

/// What a task makes for others. A whole front's factor and contribution are two, as they go to different devices.
struct SentTile {
  FactorTask task;
  bool contribution = false;
  std::uint16_t receivers = 0;  ///< bit d: device d; never the maker's
};

/// Rows of a front's vector of updates in a solve, for devices that gather them without making them.
struct SentUpdates {
  std::int64_t rows = 0;  ///< Front::rows
  std::int32_t below = 0;
  std::uint16_t receivers = 0;
};

class TileMessages {
 public:
  /// @param plan, tables  outlive this object; nothing in them may be stolen
  TileMessages(const plan::Plan& plan, Kind kind, const DevicePlan& tables);

  /// In the order in which the device makes them.
  [[nodiscard]] const std::vector<SentTile>& tiles(int device) const { return tiles_[at(device)]; }
  [[nodiscard]] const std::vector<SentUpdates>& updates(int device) const { return updates_[at(device)]; }
  /// The flag that the maker sets, counted over both parts.
  [[nodiscard]] std::int64_t flag(const SentTile& tile) const;
  /// Whether tile `next` lies right below `tile`, so that both are one rectangle and their flags neighbours.
  [[nodiscard]] bool joined(const SentTile& tile, const SentTile& next) const;
  /// The tile that lies right below tile `k` of a device, in the device's list; -1: none.
  [[nodiscard]] std::int64_t below(int device, std::size_t k) const { return below_[at(device)][k]; }
  /// use(piece) for what tiles `first` to `last`, each below the one before, are made of. Alike on sender and receiver.
  template <class Use>
  void for_pieces(const SentTile& first, const SentTile& last, Use&& use) const {
    for (const Piece& p : pieces(first, last)) use(p);
  }
  /// use(first flag, count) for the flags that a receiver sets once it has them.
  template <class Use>
  void for_flags(const SentTile& first, const SentTile& last, Use&& use) const {
    if (first.task.work == Work::whole && !first.contribution) return;  // nobody waits for it
    const std::int64_t begin = flag(first), count = flag(last) - begin + 1;
    use(begin, count);
    if (first.task.work == Work::whole && kind_ == Kind::lu) use(begin + tables_.flags, count);
  }
  [[nodiscard]] std::int64_t elements(const SentTile& first, const SentTile& last) const;
  /// Elements of the largest tile.
  [[nodiscard]] std::int64_t largest() const { return largest_; }

 private:
  /// Up to three pieces.
  struct Pieces {
    Piece list[3];
    int count = 0;
    void add(const Piece& p) { list[count++] = p; }
    [[nodiscard]] const Piece* begin() const { return list; }
    [[nodiscard]] const Piece* end() const { return list + count; }
  };
  /// Padded rows.
  struct Rows {
    int begin, end;
  };

  [[nodiscard]] const Front& front_of(const SentTile& tile) const { return tables_.fronts[at(tile.task.front)]; }
  [[nodiscard]] Rows rows_of(const SentTile& tile) const;
  [[nodiscard]] Pieces pieces(const SentTile& first, const SentTile& last) const;
  void add_whole(const SentTile& tile, Pieces& to) const;
  void add_diagonal(const SentTile& tile, Pieces& to) const;
  void add_blocks(const SentTile& first, const SentTile& last, Pieces& to) const;
  void list_tiles(int device);
  void join_tiles(int device);
  void list_updates();
  [[nodiscard]] std::uint16_t readers_of(const FactorTask& task) const;

  const plan::Plan& plan_;
  Kind kind_;
  const DevicePlan& tables_;
  std::vector<std::vector<SentTile>> tiles_;
  std::vector<std::vector<std::int32_t>> below_;
  std::vector<std::vector<SentUpdates>> updates_;
  std::int64_t largest_ = 0;
};

}  // namespace espalier::device::cuda
