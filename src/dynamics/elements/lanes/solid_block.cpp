#include "dynamics/elements/lanes/solid_block.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "base/vector_targets.hpp"
#include "dynamics/elements/anywhere.hpp"
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
    case ElementType::tet4:
      return kernels.tet4(law, solid_table<4, 4>(type, rule), in, out);
    case ElementType::tet10:
      return kernels.tet10(law, solid_table<10, 14>(type, rule), in, out);
    case ElementType::hex8:
      return kernels.hex8(law, solid_table<8, 8>(type, rule), in, out);
    case ElementType::hex20:
      return kernels.hex20(law, solid_table<20, 27>(type, rule), in, out);
    case ElementType::wedge6:
      return kernels.wedge6(law, solid_table<6, 6>(type, rule), in, out);
    case ElementType::wedge15:
      return kernels.wedge15(law, solid_table<15, 21>(type, rule), in, out);
    default:
      throw std::invalid_argument(fmt::format("evaluate_solid_block: {} is no simulated solid", shape_of(type).name));
  }
}

}  // namespace espalier::dynamics
#endif
