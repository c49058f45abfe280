/// \file
/// Predicted time of one front, by which a tree is cut and dealt to devices.
#pragma once

#include "analysis/assembly_tree.hpp"
#include "espalier/types.hpp"

namespace espalier::plan {

enum class CostModel {
  host,  ///< one thread with AVX-512
  gpu,   ///< one H200
  count  ///< every unknown of the matrix costs the same: what plain bisection balances
};

/// Predicted seconds of a front when the device has enough else to do. count: pivots.
double front_seconds(Index pivots, Index rows, bool unsymmetric, CostModel model = CostModel::host);

/// Predicted time of a factorization on one H200 or several, by two figures: the work of all fronts, which devices
/// share, and the longest chain of pivots from a leaf to the root, which nothing shortens.
struct GpuTime {
  double work_seconds = 0;
  double chain_seconds = 0;
  [[nodiscard]] double on(int devices) const;
};
GpuTime gpu_time(const analysis::AssemblyTree& tree, bool unsymmetric, bool symmetric_indefinite);

}  // namespace espalier::plan
