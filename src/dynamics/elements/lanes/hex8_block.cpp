#include "dynamics/elements/lanes/hex8_block.hpp"

#include <algorithm>

#include "base/vector_targets.hpp"
#include "dynamics/elements/anywhere.hpp"
#include "dynamics/elements/hex8_kinematics.hpp"
#include "dynamics/elements/lanes/ancf_shell_block.hpp"
#include "dynamics/elements/lanes/lane_scalar.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "dynamics/elements/lanes/hex8_block.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "hwy/contrib/math/math-inl.h"
#include "hwy/highway.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace espalier::dynamics::HWY_NAMESPACE {
namespace {

inline const hex8::BlockTables& tables() { return kHex8BlockTables; }
inline const hex8::BlockTables& shell_tables() { return kShellBlockTables; }

#include "dynamics/elements/lanes/lane_vector-inl.hpp"
//
#include "dynamics/elements/lanes/lane_algebra-inl.hpp"
//
#include "dynamics/elements/lanes/hex8_block-inl.hpp"
//
#include "dynamics/elements/lanes/hex8_strain_points-inl.hpp"
//
#include "dynamics/elements/lanes/hex8_strain_block-inl.hpp"
//
#include "dynamics/elements/lanes/ancf_shell_block-inl.hpp"

}  // namespace

Hex8Kernel make_hex8_kernel() { return {Lanes::kWidth, &evaluate_hexahedra<Lanes>}; }
ShellKernel make_shell_kernel() { return {Lanes::kWidth, &evaluate_shell_block<Lanes>}; }

}  // namespace espalier::dynamics::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace espalier::dynamics {
namespace scalar {
namespace {

inline const hex8::BlockTables& tables() { return kHex8BlockTables; }
inline const hex8::BlockTables& shell_tables() { return kShellBlockTables; }

#include "dynamics/elements/lanes/lane_algebra-inl.hpp"
//
#include "dynamics/elements/lanes/hex8_block-inl.hpp"
//
#include "dynamics/elements/lanes/hex8_strain_points-inl.hpp"
//
#include "dynamics/elements/lanes/hex8_strain_block-inl.hpp"
//
#include "dynamics/elements/lanes/ancf_shell_block-inl.hpp"

}  // namespace
}  // namespace scalar

namespace {

/// @param order  node number order[k] stands at k
hex8::BlockTables make_tables(const int (&order)[hex8::kNodes]) {
  const hex8::Tables& all = hex8::tables();
  const auto arrange = [&](const hex8::Gradients& from, hex8::Gradients& to) {
    for (int d = 0; d < 3; ++d)
      for (int k = 0; k < hex8::kNodes; ++k) to[d][k] = from[d][order[k]];
  };
  hex8::BlockTables block;
  for (int q = 0; q < hex8::kPoints; ++q) {
    arrange(all.points.gradient[q], block.gradient[q]);
    block.weight[q] = all.points.weight[q];
    for (int k = 0; k < hex8::kEnhancedModes; ++k)
      block.mode[q][k] = hex8::polynomial(hex8::enhanced_mode(k).polynomial, all.xi[q]);
    for (int k = 0; k < hex8::kShellModes; ++k)
      block.shell_mode[q][k] = hex8::polynomial(hex8::shell_mode(k).polynomial, all.xi[q]);
    std::copy_n(all.weight[q], hex8::kTyingPoints, block.tying_weight[q]);
  }
  for (int t = 0; t < hex8::kTyingPoints; ++t) arrange(all.tying[t], block.tying[t]);
  arrange(all.centre, block.centre);
  return block;
}

}  // namespace

const hex8::BlockTables kHex8BlockTables = make_tables({0, 1, 2, 3, 4, 5, 6, 7});
const hex8::BlockTables kShellBlockTables = make_tables({0, 4, 1, 5, 2, 6, 3, 7});

Hex8Kernel scalar_hex8_kernel() { return {1, &scalar::evaluate_hexahedra<ScalarLane>}; }

ShellKernel scalar_shell_kernel() { return {1, &scalar::evaluate_shell_block<ScalarLane>}; }

bool evaluate_hex8(Hex8Formulation formulation, const Material& material, const ElementInput& in, ElementOutput& out) {
  return evaluate_one(hex8::kNodes, in, out, [&](const BlockInput& state, const BlockOutput& result) {
    return scalar::evaluate_hexahedra<ScalarLane>(law_of(formulation, material), state, result);
  });
}

bool sample_hex8(Hex8Formulation formulation, const Material& material, const double* reference, const double* position,
                 ElementSamples& out) {
  ScalarLane strain[hex8::kPoints][6];
  if (!scalar::sample_strains(law_of(formulation, material), {reference, position, nullptr}, strain)) return false;
  for (int q = 0; q < hex8::kPoints; ++q)
    for (int m = 0; m < 6; ++m) strain[q][m].store(&out.value[q][m]);
  return true;
}

HWY_EXPORT(make_hex8_kernel);
HWY_EXPORT(make_shell_kernel);

Hex8Kernel vector_hex8_kernel() {
  static const Hex8Kernel kernel = HWY_DYNAMIC_DISPATCH(make_hex8_kernel)();
  return kernel;
}
ShellKernel vector_shell_kernel() {
  static const ShellKernel kernel = HWY_DYNAMIC_DISPATCH(make_shell_kernel)();
  return kernel;
}

}  // namespace espalier::dynamics
#endif
