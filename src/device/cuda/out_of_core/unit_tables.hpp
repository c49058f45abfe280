/// \file
/// The tables of one unit of an out-of-core plan: what the kernels read of an in-core step or of a group of block
/// columns, as one block of bytes with all places in it.
#pragma once

#include <cstddef>
#include <vector>

#include "device/cuda/tables/device_plan.hpp"
#include "out_of_core/plan.hpp"

namespace espalier::device::cuda {

/// Bytes from the start of a unit's tables.
struct TablePlaces {
  Offset fronts = 0, tasks = 0, links = 0, bounds = 0, waits = 0, relative = 0, entry_ptr = 0, entries = 0;
  Offset bytes = 0;
};

/// Bytes from the start of a unit's scratch. What stands before `flags` goes to the host; from `replaced` on, zeroes
/// are expected, but for the flags of fronts that were eliminated before.
struct ScratchPlaces {
  Offset pivot = 0, inverse_d = 0, inverse_e = 0, replaced = 0, failed = 0, control = 0, flags = 0, finished = 0;
  Offset bytes = 0;
  Index pivots = 0;       ///< unknowns that the unit eliminates
  Offset part_flags = 0;  ///< flags of one part
  Offset set_flags = 0;   ///< the last so many flags of each part are set
};

struct UnitTables {
  TablePlaces at;
  ScratchPlaces scratch;
  std::vector<std::byte> bytes;
  int narrow_end = 0;  ///< tasks [0, narrow_end) for the narrow kernel
  int end = 0;         ///< tasks [narrow_end, end) for the wide one
  int group_end = 0;   ///< group: tasks [end, group_end) in terms of the large front
  int width = 0;       ///< group: of its tile columns
};

struct UnitArrays;

/// Makes the tables of a plan's units. Front 0 of a group's tables is the group seen as a front of its own, front 1 the
/// large front, then its children, link k of the large front belonging to its k-th child with rows below.
class OutOfCoreTables {
 public:
  OutOfCoreTables(const plan::Plan& plan, Kind kind, Offset element_bytes);

  [[nodiscard]] const DevicePlan& device_plan() const { return device_; }
  [[nodiscard]] Offset element_bytes() const { return element_; }
  /// Narrow fronts first: the plan lists them so.
  [[nodiscard]] const plan::TaskList& order() const { return plan_.tasks; }
  [[nodiscard]] Offset share_bytes(Index f) const;
  [[nodiscard]] TablePlaces tables(const out_of_core::InCoreStep& step) const;
  [[nodiscard]] ScratchPlaces scratch(const out_of_core::InCoreStep& step) const;
  [[nodiscard]] TablePlaces tables(Index f, Index begin, Index end) const;
  [[nodiscard]] ScratchPlaces scratch(Index f, Index begin, Index end) const;
  [[nodiscard]] UnitTables build(const out_of_core::InCoreStep& step) const;
  [[nodiscard]] UnitTables build(const out_of_core::ColumnGroup& group) const;
  /// Number of the link of `child` among its parent's links.
  [[nodiscard]] int link_of(Index child) const { return link_of_[static_cast<std::size_t>(child)]; }

 private:
  struct Counts {
    Offset fronts = 0, tasks = 0, links = 0, bounds = 0, waits = 0, relative = 0, tiles = 0, entries = 0;
    Offset flags = 0, set_flags = 0;
    Index pivots = 0;
  };
  [[nodiscard]] Offset pivot_tile_count(Index f) const;
  [[nodiscard]] Counts count(const out_of_core::InCoreStep& step) const;
  [[nodiscard]] Counts count(Index f, Index begin, Index end) const;
  [[nodiscard]] static TablePlaces places(const Counts& c);
  [[nodiscard]] ScratchPlaces scratch_places(const Counts& c) const;
  [[nodiscard]] Front group_front(Index f, Index begin, Index end) const;
  struct Position {  // of the next front of a step, in the step's pivots and flags
    std::int32_t pivot = 0;
    std::int64_t flag = 0;
  };
  [[nodiscard]] static std::int32_t place_in(const out_of_core::InCoreStep& step, Index f);
  void add_front(const out_of_core::InCoreStep& step, Index k, UnitArrays& arrays, Position& next) const;
  void place_group(const out_of_core::ColumnGroup& g, Front& whole, Front& own) const;

  const plan::Plan& plan_;
  Kind kind_;
  Offset element_;
  DevicePlan device_;
  TileTasks ahead_, in_turn_;  // of steps and of groups seen as fronts; of groups in terms of the large front
  std::vector<char> wide_;     // fronts; 1: the front, or one below it, has wide tiles
  std::vector<int> link_of_;   // fronts
};

}  // namespace espalier::device::cuda
