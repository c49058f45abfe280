// Hexahedra side by side, in all formulations. Truth: oracle::evaluate_hex8(), a second implementation, element by
// element.
#include <fmt/format.h>

#include "dynamics/elements/block_common.hpp"
#include "dynamics/elements/lanes/hex8_block.hpp"
#include "dynamics/elements/oracles.hpp"

namespace espalier::dynamics::test {
namespace elements_block_test {

const Hex8Formulation kForms[] = {Hex8Formulation::full, Hex8Formulation::mean_dilatation, Hex8Formulation::enhanced,
                                  Hex8Formulation::shell};

class Hex8Block : public testing::TestWithParam<std::tuple<bool, SolidLaw>> {
 protected:
  [[nodiscard]] static Hex8Kernel kernel() {
    return std::get<0>(GetParam()) ? vector_hex8_kernel() : scalar_hex8_kernel();
  }
  [[nodiscard]] static Material material() { return {std::get<1>(GetParam()), 200, 0.3, 7}; }
  [[nodiscard]] static BlockKernel kernel(Hex8Formulation form) {
    return [form](const BlockInput& in, const BlockOutput& out) {
      return kernel().evaluate(law_of(form, material()), in, out);
    };
  }
  [[nodiscard]] static Block block() { return {regular_element(ElementType::hex8), kernel().width, 0.1, 0.05}; }
};

TEST_P(Hex8Block, EqualsOneElementAtATime) {
  for (const Hex8Formulation form : kForms)
    expect_one_at_a_time(
        kernel(form),
        [&](const ElementInput& in, ElementOutput& out) { return oracle::evaluate_hex8(form, material(), in, out); },
        block(), 1e-13, 1e-13);
}

TEST_P(Hex8Block, OneElementInsideOutLeavesTheOthers) {
  for (const Hex8Formulation form : kForms) expect_inside_out_is_told(kernel(form), block());
}

// Truth: oracle::sample_hex8(), which makes the strains with rows of its own.
TEST_P(Hex8Block, SamplesAreTheStrainsOfTheSecondImplementation) {
  const Block b = block();
  for (const Hex8Formulation form : kForms) {
    ElementSamples strains, truth;
    ASSERT_TRUE(sample_hex8(form, material(), b.reference[0].data(), b.position[0].data(), strains));
    ASSERT_TRUE(oracle::sample_hex8(form, material(), b.reference[0].data(), b.position[0].data(), truth));
    for (int q = 0; q < 8; ++q)
      for (int m = 0; m < 6; ++m) EXPECT_NEAR(strains.value[q][m], truth.value[q][m], 1e-13);
  }
}

TEST_P(Hex8Block, NotANumberIsNotWhole) {
  Block b = block();
  b.position[0][5] = std::nan("");
  for (const Hex8Formulation form : kForms) EXPECT_EQ(evaluate(kernel(form), b, kSettings[0]).whole & 1U, 0U);
}

INSTANTIATE_TEST_SUITE_P(Lanes, Hex8Block,
                         testing::Combine(testing::Bool(),
                                          testing::Values(SolidLaw::st_venant_kirchhoff, SolidLaw::neo_hookean)),
                         [](const auto& p) {
                           return fmt::format("{}_{}", std::get<0>(p.param) ? "vector" : "scalar",
                                              std::get<1>(p.param) == SolidLaw::neo_hookean ? "neo_hookean" : "svk");
                         });

}  // namespace elements_block_test
}  // namespace espalier::dynamics::test
