#include "dynamics/elements/hex8_block.hpp"

#include <algorithm>

#include "dynamics/elements/anywhere.hpp"
#include "dynamics/elements/hex8_kinematics.hpp"
#include "dynamics/elements/lane_scalar.hpp"
#include "dynamics/elements/lane_targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "dynamics/elements/hex8_block.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "hwy/contrib/math/math-inl.h"
#include "hwy/highway.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace espalier::dynamics::HWY_NAMESPACE {
namespace {

inline const hex8::BlockTables& tables() { return kHex8BlockTables; }

#include "dynamics/elements/lane_vector-inl.hpp"
//
#include "dynamics/elements/lane_algebra-inl.hpp"
//
#include "dynamics/elements/hex8_block-inl.hpp"
//
#include "dynamics/elements/hex8_strain_block-inl.hpp"

}  // namespace

Hex8Kernel make_hex8_kernel() { return {Lanes::kWidth, &evaluate_hexahedra<Lanes>}; }

}  // namespace espalier::dynamics::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace espalier::dynamics {
namespace scalar {
namespace {

inline const hex8::BlockTables& tables() { return kHex8BlockTables; }

#include "dynamics/elements/lane_algebra-inl.hpp"
//
#include "dynamics/elements/hex8_block-inl.hpp"
//
#include "dynamics/elements/hex8_strain_block-inl.hpp"

}  // namespace
}  // namespace scalar

const hex8::BlockTables kHex8BlockTables = [] {
  const hex8::Tables& all = hex8::tables();
  hex8::BlockTables block;
  for (int q = 0; q < hex8::kPoints; ++q) {
    std::copy_n(&all.points.gradient[q][0][0], 3 * hex8::kNodes, &block.gradient[q][0][0]);
    block.weight[q] = all.points.weight[q];
    for (int k = 0; k < hex8::kEnhancedModes; ++k)
      block.mode[q][k] = hex8::polynomial(hex8::enhanced_mode(k).polynomial, all.xi[q]);
  }
  std::copy_n(&all.centre[0][0], 3 * hex8::kNodes, &block.centre[0][0]);
  return block;
}();

Hex8Kernel scalar_hex8_kernel() { return {1, &scalar::evaluate_hexahedra<ScalarLane>}; }

HWY_EXPORT(make_hex8_kernel);

Hex8Kernel vector_hex8_kernel() {
  static const Hex8Kernel kernel = HWY_DYNAMIC_DISPATCH(make_hex8_kernel)();
  return kernel;
}

}  // namespace espalier::dynamics
#endif
