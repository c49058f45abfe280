// Displacement-based solids side by side. Truth: oracle::evaluate_solid(), a second implementation, element by element.
#include "dynamics/elements/lanes/solid_block.hpp"

#include <fmt/format.h>

#include "dynamics/elements/elements_common.hpp"
#include "dynamics/elements/oracles.hpp"

namespace espalier::dynamics::test {
namespace solid_block_test {

struct Setting {
  bool moving;
  double damping, position_weight, velocity_weight;
};
const Setting kSettings[] = {
    {false, 0, 1, 0}, {true, 0.2, 0.7, 0.3}, {false, 0.2, 0.7, 0.3}, {true, 0, 1.5, 0.3}, {true, 0.2, 0, 1}};

/// `width` elements in lanes: all different, distorted, turned, strained.
struct Block {
  std::size_t width, numbers;
  std::vector<Vector> reference, position, velocity;
  Block(ElementType type, int lanes) : width(static_cast<std::size_t>(lanes)) {
    const Vector x = regular_element(type);
    numbers = static_cast<std::size_t>(x.size());
    for (unsigned l = 0; l < width; ++l) {
      reference.push_back(x + noise(x.size(), 0.03, 7 + l));
      position.push_back(rotated(rotation(0.4, 0.2, -0.9 + l), reference.back()) + noise(x.size(), 0.02, 30 + l));
      velocity.push_back(noise(x.size(), 1.5, 60 + l));
    }
  }
  [[nodiscard]] std::vector<double> side_by_side(const std::vector<Vector>& fields) const {
    std::vector<double> out;
    for (std::size_t k = 0; k < numbers; ++k)
      for (const Vector& field : fields) out.push_back(field[static_cast<Eigen::Index>(k)]);
    return out;
  }
};

struct BlockResult {
  unsigned whole = 0;
  std::vector<double> force, tangent, energy;
};

BlockResult evaluate(const SolidKernels& kernels, ElementType type, Rule rule, const Material& m, const Block& b,
                     const Setting& s) {
  const std::size_t n = b.numbers, w = b.width;
  BlockResult r{0, std::vector<double>(n * w), std::vector<double>(n * n * w), std::vector<double>(w)};
  const auto x0 = b.side_by_side(b.reference), x = b.side_by_side(b.position), v = b.side_by_side(b.velocity);
  const BlockInput in{x0.data(), x.data(),          s.moving ? v.data() : nullptr,
                      s.damping, s.position_weight, s.velocity_weight};
  r.whole = evaluate_solid_block(kernels, type, rule, m, in, {r.force.data(), r.tangent.data(), r.energy.data()});
  for (std::size_t column = 0; column < n && (!s.moving || s.damping == 0); ++column)  // the half that is not given
    for (std::size_t row = column / 3 * 3 + 3; row < n; ++row)
      for (std::size_t l = 0; l < w; ++l) r.tangent[(n * column + row) * w + l] = r.tangent[(n * row + column) * w + l];
  return r;
}

double lane_difference(const std::vector<double>& values, std::size_t lane, std::size_t width, const Vector& truth) {
  double worst = 0;
  for (std::size_t k = 0; k * width < values.size(); ++k) {
    const double difference = std::abs(values[k * width + lane] - truth[static_cast<Eigen::Index>(k)]);
    if (!(difference <= worst)) worst = difference;
  }
  return worst / truth.cwiseAbs().maxCoeff();
}

constexpr ElementType kTypes[] = {ElementType::tet4,  ElementType::tet10,  ElementType::hex8,
                                  ElementType::hex20, ElementType::wedge6, ElementType::wedge15};

class SolidBlock : public testing::TestWithParam<std::tuple<bool, SolidLaw>> {
 protected:
  [[nodiscard]] static SolidKernels kernels() {
    return std::get<0>(GetParam()) ? vector_solid_kernels() : scalar_solid_kernels();
  }
  [[nodiscard]] static Material material() { return {std::get<1>(GetParam()), 200, 0.3, 7}; }
};

TEST_P(SolidBlock, EqualsOneElementAtATime) {
  for (const ElementType type : kTypes)
    for (const Rule rule : {Rule::stiffness, Rule::reduced})
      for (const Setting& s : kSettings) {
        const Block b(type, kernels().width);
        const BlockResult r = evaluate(kernels(), type, rule, material(), b, s);
        EXPECT_EQ(r.whole, (1U << b.width) - 1);
        for (std::size_t l = 0; l < b.width; ++l) {
          const Result truth =
              run([&](const ElementInput& in,
                      ElementOutput& out) { return oracle::evaluate_solid(type, rule, material(), in, out); },
                  b.reference[l], b.position[l], s.moving ? b.velocity[l] : Vector(), s.damping, s.position_weight,
                  s.velocity_weight);
          ASSERT_TRUE(truth.ok);
          EXPECT_LT(lane_difference(r.force, l, b.width, truth.force), 1e-13);
          EXPECT_LT(lane_difference(r.tangent, l, b.width, truth.tangent.reshaped()), 1e-13);
          EXPECT_NEAR(r.energy[l], truth.energy, 1e-12 * truth.energy);  // tr E - ln J cancels
        }
      }
}

// Truth: an element inside out, now or in its reference, is told, and its neighbours keep every bit.
TEST_P(SolidBlock, OneElementInsideOutLeavesTheOthers) {
  for (const ElementType type : kTypes)
    for (const bool now : {false, true}) {
      Block b(type, kernels().width);
      const BlockResult good = evaluate(kernels(), type, Rule::stiffness, material(), b, kSettings[1]);
      const std::size_t bad = b.width - 1;
      Vector& x = now ? b.position[bad] : b.reference[bad];
      x = rotated(Eigen::Vector3d(1, 1, -1).asDiagonal(), x);
      const BlockResult r = evaluate(kernels(), type, Rule::stiffness, material(), b, kSettings[1]);
      EXPECT_EQ(r.whole, good.whole & ~(1U << bad));
      for (std::size_t k = 0; k < r.tangent.size(); ++k)
        if (k % b.width != bad) {
          ASSERT_EQ(r.tangent[k], good.tangent[k]);
        }
    }
}

TEST_P(SolidBlock, NotANumberIsNotWhole) {
  for (const ElementType type : kTypes) {
    Block b(type, kernels().width);
    b.position[0][5] = std::nan("");
    EXPECT_EQ(evaluate(kernels(), type, Rule::stiffness, material(), b, kSettings[0]).whole & 1U, 0U);
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
