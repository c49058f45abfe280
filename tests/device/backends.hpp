/// \file
/// All backends of this build whose devices answer here, for tests that run over each of them.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "analysis/ordering.hpp"
#include "device/registry.hpp"

namespace espalier::test {

inline std::vector<const device::Backend*> backends_here() {
  std::vector<const device::Backend*> list;
  for (const device::Backend* b : device::registry().backends)
    if (!b->find().names.empty()) list.push_back(b);
  return list;
}

/// "host", "reference", "gpu": suffixes of parametrised tests.
inline std::string name_of(const device::Backend* backend) { return std::string(backend->name()); }

/// A plan of the backend's for one device, with tiles of at most `width` columns (0: as it likes).
template <class T>
plan::Plan plan_for(const device::Backend& backend, const SparseMatrix& a, Kind kind, Index width = 0) {
  base::ThreadPool one(1);
  device::PlanWish wish;
  wish.kind = kind;
  wish.precision = sizeof(T) == sizeof(float) ? Precision::fp32 : Precision::fp64;
  wish.max_block_size = width;
  plan::PlanOptions o = backend.plan_options(wish);
  const bool any_width = backend.limits().widest_tile == 0;
  if (width > 0 && any_width) o.tiles.whole_rows = o.tiles.whole_pivots = width;  // small tiles mean tiled fronts
  return plan::make_plan(analysis::build_tree(analysis::graph_of(a, one, {}), {}, one), a, {}, o, one);
}

}  // namespace espalier::test
