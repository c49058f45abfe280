/// \file
/// Delayed pivoting ahead of the factorization: where each pivot is stable.
#pragma once

#include <optional>
#include <vector>

#include "device/backend.hpp"

namespace espalier::device::host {

/// See Backend::place_pivots(). A multifrontal elimination of its own, front by front, that keeps no factor: pivots
/// that fail in a front join those of its parent, however far up that takes them (Duff and Reid 1983). Sub-trees are
/// taken in parallel, the top of the tree by one thread.
/// Value: double or complex<double>.
template <class Value>
std::optional<std::vector<analysis::PivotMove>> place_pivots(const PlacementJobOf<Value>& job);

}  // namespace espalier::device::host
