/// \file
/// The arrays of one unit of an out-of-core plan while they are put together.
#pragma once

#include <cstdint>
#include <vector>

#include "device/cuda/out_of_core/unit_tables.hpp"

namespace espalier::device::cuda {

/// What TablePlaces says the places of.
struct UnitArrays {
  std::vector<Front> fronts;
  std::vector<FactorTask> tasks;
  std::vector<ChildRows> links;
  std::vector<std::int32_t> bounds, waits, relative;
  std::vector<std::int64_t> entry_ptr;
  std::vector<plan::EntryPlace> entries;

  void add_task(std::int32_t front, Work work, int part = 0, Index block = 0, Index column = 0);
  /// The tasks of tile column j of front number `front` of the unit, whose shape is `x`.
  void add_column(const TileTasks& tasks, const Front& x, std::int32_t front, Index j);
  /// Rows below of front f of the plan, as `x`'s.
  void add_relative(const plan::Plan& plan, Index f, Front& x);
  /// A link to front `child` of the unit, with the bounds of the plan's link `from` to a parent of `tiles` tiles.
  void add_link(const DevicePlan& plan, const ChildRows& from, std::int32_t child, int tiles);
  /// Entries [first, end) of the plan, which fill its tiles [tile, tile + tiles); their values come in this order.
  void add_entries(const plan::Plan& plan, Offset tile, Offset tiles, Offset first, Offset end);
  /// Bytes of the tables, at the places that they have.
  void write(UnitTables& u) const;
};

/// A front of the whole plan, for tables whose arrays all count from the arena's start.
Front in_arena(Front x);

}  // namespace espalier::device::cuda
