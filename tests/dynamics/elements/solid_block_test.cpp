// Displacement-based solids side by side. Truth: oracle::evaluate_solid(), a second implementation, element by element.
#include "dynamics/elements/lanes/solid_block.hpp"

#include <fmt/format.h>

#include "dynamics/elements/block_common.hpp"
#include "dynamics/elements/oracles.hpp"

namespace espalier::dynamics::test {
namespace solid_block_test {

constexpr ElementType kTypes[] = {ElementType::tet4,  ElementType::tet10,  ElementType::hex8,
                                  ElementType::hex20, ElementType::wedge6, ElementType::wedge15};

class SolidBlock : public testing::TestWithParam<std::tuple<bool, SolidLaw>> {
 protected:
  [[nodiscard]] static SolidKernels kernels() {
    return std::get<0>(GetParam()) ? vector_solid_kernels() : scalar_solid_kernels();
  }
  [[nodiscard]] static Material material() { return {std::get<1>(GetParam()), 200, 0.3, 7}; }
  [[nodiscard]] static BlockKernel kernel(ElementType type, Rule rule) {
    return [type, rule](const BlockInput& in, const BlockOutput& out) {
      return evaluate_solid_block(kernels(), type, rule, material(), in, out);
    };
  }
  [[nodiscard]] static Block block(ElementType type) { return {regular_element(type), kernels().width, 0.03, 0.02}; }
};

TEST_P(SolidBlock, EqualsOneElementAtATime) {
  for (const ElementType type : kTypes)
    for (const Rule rule : {Rule::stiffness, Rule::reduced})
      expect_one_at_a_time(
          kernel(type, rule),
          [&](const ElementInput& in, ElementOutput& out) {
            return oracle::evaluate_solid(type, rule, material(), in, out);
          },
          block(type), 1e-13, 1e-12);  // tr E - ln J cancels
}

TEST_P(SolidBlock, OneElementInsideOutLeavesTheOthers) {
  for (const ElementType type : kTypes) expect_inside_out_is_told(kernel(type, Rule::stiffness), block(type));
}

TEST_P(SolidBlock, NotANumberIsNotWhole) {
  for (const ElementType type : kTypes) {
    Block b = block(type);
    b.position[0][5] = std::nan("");
    EXPECT_EQ(evaluate(kernel(type, Rule::stiffness), b, kSettings[0]).whole & 1U, 0U);
  }
}

INSTANTIATE_TEST_SUITE_P(Lanes, SolidBlock,
                         testing::Combine(testing::Bool(),
                                          testing::Values(SolidLaw::st_venant_kirchhoff, SolidLaw::neo_hookean)),
                         [](const auto& p) {
                           return fmt::format("{}_{}", std::get<0>(p.param) ? "vector" : "scalar",
                                              std::get<1>(p.param) == SolidLaw::neo_hookean ? "neo_hookean" : "svk");
                         });

}  // namespace solid_block_test
}  // namespace espalier::dynamics::test
