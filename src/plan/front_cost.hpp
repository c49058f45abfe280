/// \file
/// Times predicted by a machine model: of one front, by which a tree is cut and dealt to devices, and of a whole
/// factorization, by which the device is chosen.
#pragma once

#include "analysis/assembly_tree.hpp"
#include "espalier/types.hpp"
#include "plan/machine_model.hpp"

namespace espalier::plan {

/// Work of one front: L L^T or L D L^T; twice that for L U. Multiply and add count as two.
double front_flops(Index pivots, Index rows, bool unsymmetric);

/// Predicted seconds of a front on one device (a host's thread, a GPU) that has enough else to do.
double front_seconds(Index pivots, Index rows, bool unsymmetric, const MachineModel& machine);

/// Predicted seconds of a factorization by threads of the host: all fronts by all threads, but no less than the longest
/// path from a leaf to the root, on which a front is worked on by one thread for every `thread_rows` of its rows.
/// @param single  FP32
double host_seconds(const analysis::AssemblyTree& tree, Kind kind, bool single, int threads,
                    const MachineModel& machine);

/// Predicted time of a factorization on one GPU or several, by two figures: the work of all fronts, which devices
/// share, and the longest chain of pivots from a leaf to the root, which nothing shortens.
struct GpuTime {
  double work_seconds = 0;
  double chain_seconds = 0;
  MachineModel machine = h200();
  [[nodiscard]] double on(int devices) const;
};
GpuTime gpu_time(const analysis::AssemblyTree& tree, Kind kind, bool single, const MachineModel& machine);

}  // namespace espalier::plan
