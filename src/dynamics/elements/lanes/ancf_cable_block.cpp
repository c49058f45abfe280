#include "dynamics/elements/lanes/ancf_cable_block.hpp"

#include "base/vector_targets.hpp"
#include "dynamics/elements/anywhere.hpp"
#include "dynamics/elements/lanes/lane_scalar.hpp"
#include "dynamics/elements/line_point.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "dynamics/elements/lanes/ancf_cable_block.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "hwy/contrib/math/math-inl.h"
#include "hwy/highway.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace espalier::dynamics::HWY_NAMESPACE {
namespace {

inline const CableTables& cable_tables() { return kCableTables; }

#include "dynamics/elements/lanes/lane_vector-inl.hpp"
//
#include "dynamics/elements/lanes/lane_algebra-inl.hpp"
//
#include "dynamics/elements/lanes/ancf_cable_block-inl.hpp"

}  // namespace

CableKernel make_cable_kernel() { return {Lanes::kWidth, &evaluate_cable_block<Lanes>}; }

}  // namespace espalier::dynamics::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace espalier::dynamics {
namespace scalar {
namespace {

inline const CableTables& cable_tables() { return kCableTables; }

#include "dynamics/elements/lanes/lane_algebra-inl.hpp"
//
#include "dynamics/elements/lanes/ancf_cable_block-inl.hpp"

}  // namespace
}  // namespace scalar

namespace {

template <int kPoints>
CableShapeFunctions<kPoints> make_shapes(const LinePoint (&rule)[kPoints]) {
  CableShapeFunctions<kPoints> shapes;
  for (int k = 0; k < kPoints; ++k) {
    const Hermite h(rule[k].xi, 1);
    for (int p = 0; p < kCableParts; ++p) {
      const int a = p == 0 ? 2 : p == 1 ? 1 : 3;  // of r2, r1_x, r2_x
      shapes.d[k][p] = h.d[a];
      shapes.dd[k][p] = h.dd[a];
    }
    shapes.weight[k] = 0.5 * rule[k].weight;
  }
  return shapes;
}

}  // namespace

const CableTables kCableTables = {make_shapes(kGauss5), make_shapes(kGauss3)};

CableKernel scalar_cable_kernel() { return {1, &scalar::evaluate_cable_block<ScalarLane>}; }

HWY_EXPORT(make_cable_kernel);

bool evaluate_cable(const CableSection& section, double length, const ElementInput& in, ElementOutput& out) {
  const CableLaw law{section, length};
  return evaluate_one(kCableVertices, in, out, [&](const BlockInput& state, const BlockOutput& result) {
    return scalar_cable_kernel().evaluate(law, state, result);
  });
}

CableKernel vector_cable_kernel() {
  static const CableKernel kernel = HWY_DYNAMIC_DISPATCH(make_cable_kernel)();
  return kernel;
}

}  // namespace espalier::dynamics
#endif
