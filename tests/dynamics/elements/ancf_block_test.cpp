// ANCF elements side by side. Truth: oracle::evaluate_shell() and oracle::evaluate_cable(), second implementations,
// element by element.
#include <fmt/format.h>

#include <limits>

#include "dynamics/elements/block_common.hpp"
#include "dynamics/elements/lanes/ancf_cable_block.hpp"
#include "dynamics/elements/lanes/ancf_shell_block.hpp"
#include "dynamics/elements/oracles.hpp"

namespace espalier::dynamics::test {
namespace ancf_block_test {

/// One kind of elements, several at a time and one at a time.
struct Kind {
  std::string name;
  int width;
  BlockKernel block;
  Evaluate one;
  Vector reference;
  double energy_error;  // in units of the energy
};
std::ostream& operator<<(std::ostream& out, const Kind& k) { return out << k.name; }

Vector shell_reference() {
  Vector x(24);
  const double corner[4][3] = {{0, 0, 0}, {1.2, 0.1, 0.05}, {1.1, 0.9, 0.1}, {-0.1, 1.0, 0}};
  for (int a = 0; a < 4; ++a) {
    x.segment<3>(6 * a) = Eigen::Vector3d(corner[a][0], corner[a][1], corner[a][2]);
    x.segment<3>(6 * a + 3) = rotation(0.05 * a + 0.01, -0.1, 0.02) * Eigen::Vector3d::UnitZ();
  }
  return x;
}

Kind shell(const std::string& lanes, const ShellKernel& kernel, SolidLaw law) {
  const Material material{law, 200, 0.3, 7};
  const bool neo_hookean = law == SolidLaw::neo_hookean;
  const ShellLaw block{{Hex8Formulation::shell, material.lambda(), material.mu(), neo_hookean}, 0.1};
  return {fmt::format("shell_{}_{}", neo_hookean ? "neo_hookean" : "svk", lanes),
          kernel.width,
          [=](const BlockInput& in, const BlockOutput& out) { return kernel.evaluate(block, in, out); },
          [=](const ElementInput& in, ElementOutput& out) { return oracle::evaluate_shell(material, 0.1, in, out); },
          shell_reference(),
          1e-12};  // tr E - ln J cancels
}

Kind cable(const std::string& lanes, const CableKernel& kernel) {
  const CableSection section{150, 3, 2};
  const CableLaw block{section, 1.3};
  return {"cable_" + lanes,
          kernel.width,
          [=](const BlockInput& in, const BlockOutput& out) { return kernel.evaluate(block, in, out); },
          [=](const ElementInput& in, ElementOutput& out) { return oracle::evaluate_cable(section, 1.3, in, out); },
          (Vector(12) << 0, 0, 0, 1, 0, 0, 1.3, 0, 0, 1, 0, 0).finished(),
          1e-13};
}

std::vector<Kind> kinds() {
  std::vector<Kind> all;
  for (const SolidLaw law : {SolidLaw::st_venant_kirchhoff, SolidLaw::neo_hookean}) {
    all.push_back(shell("scalar", scalar_shell_kernel(), law));
    all.push_back(shell("vector", vector_shell_kernel(), law));
  }
  all.push_back(cable("scalar", scalar_cable_kernel()));
  all.push_back(cable("vector", vector_cable_kernel()));
  return all;
}

/// What two orders of summation may leave of a force or tangent, relative to its largest entry: a strain is the
/// difference of a metric, sums of 24 products of numbers of size 1, and 1; the strains here are kNoise; rounding of
/// both orders.
constexpr double kNoise = 0.03;
constexpr double kRounding = 2 * 24 * std::numeric_limits<double>::epsilon() / kNoise;

Block block_of(const Kind& kind) { return {kind.reference, kind.width, 0.01, kNoise}; }

class AncfBlock : public testing::TestWithParam<Kind> {};

TEST_P(AncfBlock, EqualsOneElementAtATime) {
  const Kind& kind = GetParam();
  expect_one_at_a_time(kind.block, kind.one, block_of(kind), kRounding, kind.energy_error);
}

// Truth: what an element gives where the lanes beside it hold itself.
TEST_P(AncfBlock, AnyLaneGivesWhatItGivesAlone) {
  const Kind& kind = GetParam();
  const Block b = block_of(kind);
  const BlockResult together = evaluate(kind.block, b, kSettings[1]);
  for (std::size_t l = 0; l < b.width; ++l) {
    Block alone = b;
    for (auto* field : {&alone.reference, &alone.position, &alone.velocity})
      std::fill(field->begin(), field->end(), Vector((*field)[l]));
    const BlockResult r = evaluate(kind.block, alone, kSettings[1]);
    for (std::size_t k = l; k < r.force.size(); k += b.width) ASSERT_EQ(r.force[k - l], together.force[k]);
    for (std::size_t k = l; k < r.tangent.size(); k += b.width) ASSERT_EQ(r.tangent[k - l], together.tangent[k]);
    EXPECT_EQ(r.energy[0], together.energy[l]);
  }
}

TEST_P(AncfBlock, OneBadElementLeavesTheOthers) {
  expect_others_keep_their_bits(GetParam().block, block_of(GetParam()),
                                [](Block& b, std::size_t bad) { b.position[bad].setZero(); });
}

TEST_P(AncfBlock, NotANumberIsNotWhole) {
  Block b = block_of(GetParam());
  b.position[0][5] = std::nan("");
  for (const Setting& s : kSettings) EXPECT_EQ(evaluate(GetParam().block, b, s).whole & 1U, 0U);
}

INSTANTIATE_TEST_SUITE_P(All, AncfBlock, testing::ValuesIn(kinds()), [](const auto& p) { return p.param.name; });

}  // namespace ancf_block_test
}  // namespace espalier::dynamics::test
