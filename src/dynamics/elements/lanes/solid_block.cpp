#include "dynamics/elements/lanes/solid_block.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "base/vector_targets.hpp"
#include "dynamics/elements/anywhere.hpp"
#include "dynamics/elements/lanes/lane_kernel.hpp"
#include "dynamics/elements/lanes/lane_scalar.hpp"
#include "dynamics/elements/solid.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "dynamics/elements/lanes/solid_block.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "hwy/contrib/math/math-inl.h"
#include "hwy/highway.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace espalier::dynamics::HWY_NAMESPACE {
namespace {

#include "dynamics/elements/lanes/lane_vector-inl.hpp"
//
#include "dynamics/elements/lanes/lane_algebra-inl.hpp"
//
#include "dynamics/elements/lanes/solid_block-inl.hpp"

}  // namespace

SolidKernels make_solid_kernels() { return solid_kernels<Lanes>(); }

}  // namespace espalier::dynamics::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace espalier::dynamics {
namespace scalar {
namespace {

#include "dynamics/elements/lanes/lane_algebra-inl.hpp"
//
#include "dynamics/elements/lanes/solid_block-inl.hpp"

}  // namespace
}  // namespace scalar

SolidKernels scalar_solid_kernels() { return scalar::solid_kernels<ScalarLane>(); }

HWY_EXPORT(make_solid_kernels);

SolidKernels vector_solid_kernels() {
  static const SolidKernels kernels = HWY_DYNAMIC_DISPATCH(make_solid_kernels)();
  return kernels;
}

unsigned evaluate_solid_block(const SolidKernels& kernels, ElementType type, Rule rule, const Material& material,
                              const BlockInput& in, const BlockOutput& out) {
  const SolidConstants law{material.law == SolidLaw::neo_hookean, material.lambda(), material.mu()};
  switch (type) {
#define ESPALIER_CASE(kind, nodes, points) \
  case ElementType::kind:                  \
    return kernels.kind(law, solid_table<nodes, points>(type, rule), in, out);
    ESPALIER_FOR_SOLIDS(ESPALIER_CASE)
#undef ESPALIER_CASE
    default:
      throw std::invalid_argument(fmt::format("evaluate_solid_block: {} is no simulated solid", shape_of(type).name));
  }
}

bool evaluate_solid(ElementType type, Rule rule, const Material& material, const ElementInput& in, ElementOutput& out) {
  return evaluate_one(shape_of(type).nodes, in, out, [&](const BlockInput& state, const BlockOutput& result) {
    return evaluate_solid_block(scalar_solid_kernels(), type, rule, material, state, result);
  });
}

}  // namespace espalier::dynamics
#endif
