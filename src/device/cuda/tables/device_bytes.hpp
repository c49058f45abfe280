/// \file
/// What the memory of a GPU goes to, by the plan alone: no GPU is needed.
#pragma once

#include "device/cuda/tables/device_plan.hpp"
#include "plan/plan.hpp"

namespace espalier::device::cuda {

/// Bytes that one device holds for a factorization and solves with one right-hand side. The linear system of
/// refinement, which is the caller's matrix once more, is not among them.
struct DeviceBytes {
  Offset factor = 0;          ///< arrays of the factors of its fronts, padding included
  Offset contributions = 0;   ///< what its arena has beyond that
  Offset values = 0;          ///< of the matrix
  Offset entries = 0;         ///< where each value goes, and where those of a tile begin
  Offset rows = 0;            ///< of the fronts, and their places in the parents
  Offset fronts = 0;          ///< fronts, links between them, whom they wait for
  Offset tasks = 0;           ///< lists of the factorization and of a solve
  Offset flags = 0;           ///< flags of tasks, marks of pivots
  Offset vectors = 0;         ///< pivots; of a solve where the arena has no room for them (DevicePlan::kept)
  Offset spare = 0;           ///< for a sub-tree that is stolen
  Offset factor_entries = 0;  ///< of `factor`, what is no padding: columns of L and U^T from the diagonal on

  [[nodiscard]] Offset all() const {
    return factor + contributions + values + entries + rows + fronts + tasks + flags + vectors + spare;
  }
};

/// @param self     number of the device among those of the plan
/// @param values   length of the caller's value array
/// @param scalar   bytes of a number: 8 or 4
/// @param spare    elements that it takes for a sub-tree stolen from another
DeviceBytes bytes_of(const plan::Plan& plan, Kind kind, const DevicePlan& tables, int self, Offset values,
                     Offset scalar, Offset spare = 0);

}  // namespace espalier::device::cuda
