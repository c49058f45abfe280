/// \file
/// Predicted time of one front, by which a tree is cut and dealt to devices.
#pragma once

#include "espalier/types.hpp"

namespace espalier::analysis {

enum class CostModel {
  host,  ///< one thread with AVX-512
  gpu,   ///< one H200
  count  ///< every unknown of the matrix costs the same: what plain bisection balances
};

/// Predicted seconds of a front when the device has enough else to do. count: pivots.
double front_seconds(Index pivots, Index rows, bool unsymmetric, CostModel model = CostModel::host);

}  // namespace espalier::analysis
