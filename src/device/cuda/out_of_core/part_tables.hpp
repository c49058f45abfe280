/// \file
/// Tables of the solve kernel for a part of the fronts: those whose factors stay on a GPU that works out of core, and
/// sub-trees below them whose factors it reads from the host's store. Needs no CUDA.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "device/cuda/out_of_core/unit_tables.hpp"
#include "out_of_core/plan.hpp"

namespace espalier::device::cuda {

/// Bytes from the start of the memory of a solve. What stands before `vectors` is sent to the device; the vectors hold
/// a row for each right-hand side of a pass; those from `forward` on are filled with ones bits.
struct PartPlaces {
  Offset fronts = 0, up = 0, down = 0, links = 0, bounds = 0, relative = 0, rows = 0, base = 0;
  Offset inverse_d = 0, inverse_e = 0;  ///< ldlt
  Offset vectors = 0, rhs = 0, forward = 0, solution = 0, updates = 0;
  Offset control = 0;  ///< behind the vectors; kControlBytes
  Offset bytes = 0;
  static constexpr Offset kControlBytes = 64;
};

/// A part has with each front all above it. Its pivots are numbered anew, front by front: the positions and rows of the
/// tables count so. Region 0 is the arena, region 1 the host's store.
struct PartTables {
  /// Tasks of the resident fronts, or of the streamed ones: places in the lists of all.
  struct Tasks {
    int up = 0, ups = 0, small_up = 0;        ///< first, how many, how many of them for sub-trees of small fronts first
    int down = 0, downs = 0, small_down = 0;  ///< likewise; those of small fronts last
  };
  std::vector<Index> part;      ///< the plan's numbers of the part's fronts, ascending
  std::vector<Index> children;  ///< of fronts that are not in the part, but their parents are, ascending
  std::vector<Front> fronts;    ///< of `part`, then of `children`
  Tasks resident, streamed;
  std::vector<SolveTask> up, down;
  std::vector<ChildRows> links;
  std::vector<std::int32_t> bounds, relative, rows;
  Index pivots = 0;          ///< of the part
  Offset updates = 0;        ///< rows below of all `fronts`
  Offset child_updates = 0;  ///< the first row of the children's, which come last

  /// @param streamed  whether the plan's streamed fronts are in the part, beside the resident ones
  PartTables(const plan::Plan& plan, const OutOfCoreTables& tables, const out_of_core::OutOfCorePlan& places,
             bool with_streamed);
  /// @param columns  right-hand sides of a pass
  [[nodiscard]] PartPlaces places(Kind kind, Offset element_bytes, Index columns) const;
  /// The most bytes that places() takes for these fronts, whatever their places.
  static Offset most_bytes(const plan::Plan& plan, const OutOfCoreTables& tables, const std::vector<Index>& part,
                           Offset element_bytes, Index columns);
};

}  // namespace espalier::device::cuda
