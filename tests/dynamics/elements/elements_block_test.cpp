// Hexahedra side by side, in all formulations. Truth: oracle::evaluate_hex8(), a second implementation, element by
// element.
#include <fmt/format.h>

#include "dynamics/elements/elements_common.hpp"
#include "dynamics/elements/lanes/hex8_block.hpp"
#include "dynamics/elements/oracles.hpp"

namespace espalier::dynamics::test {
namespace elements_block_test {

struct Setting {
  bool moving;
  double damping, position_weight, velocity_weight;
};

/// `width` elements in lanes: all different, distorted, turned, strained.
struct Block {
  int width;
  std::vector<Vector> reference, position, velocity;
  explicit Block(int lanes) : width(lanes) {
    for (int l = 0; l < width; ++l) {
      const Vector x = regular_element(ElementType::hex8);
      reference.push_back(x + noise(x.size(), 0.1, 7 + static_cast<unsigned>(l)));
      position.push_back(rotated(rotation(0.4, 0.2, -0.9 + l), reference.back()) +
                         noise(x.size(), 0.05, 30 + static_cast<unsigned>(l)));
      velocity.push_back(noise(x.size(), 1.5, 60 + static_cast<unsigned>(l)));
    }
  }
  [[nodiscard]] std::vector<double> side_by_side(const std::vector<Vector>& fields) const {
    std::vector<double> out;
    for (Eigen::Index k = 0; k < 24; ++k)
      for (const Vector& field : fields) out.push_back(field[k]);
    return out;
  }
};

struct BlockResult {
  unsigned whole = 0;
  std::vector<double> force, tangent, energy;
};

/// In a symmetric tangent only the blocks a <= b are given.
void fill_lower_half(std::vector<double>& tangent, std::size_t width) {
  for (std::size_t column = 0; column < 24; ++column)
    for (std::size_t row = column / 3 * 3 + 3; row < 24; ++row)
      for (std::size_t l = 0; l < width; ++l)
        tangent[(24 * column + row) * width + l] = tangent[(24 * row + column) * width + l];
}

BlockResult evaluate(const Hex8Kernel& kernel, Hex8Formulation form, const Material& m, const Block& b,
                     const Setting& s) {
  const auto w = static_cast<std::size_t>(b.width);
  BlockResult r{0, std::vector<double>(24 * w), std::vector<double>(576 * w), std::vector<double>(w)};
  const auto x0 = b.side_by_side(b.reference), x = b.side_by_side(b.position), v = b.side_by_side(b.velocity);
  r.whole = kernel.evaluate(
      {form, m.lambda(), m.mu(), m.law == SolidLaw::neo_hookean},
      {x0.data(), x.data(), s.moving ? v.data() : nullptr, s.damping, s.position_weight, s.velocity_weight},
      {r.force.data(), r.tangent.data(), r.energy.data()});
  if (!s.moving || s.damping == 0) fill_lower_half(r.tangent, w);
  return r;
}

double lane_difference(const std::vector<double>& values, std::size_t lane, std::size_t width, const double* truth) {
  double worst = 0, largest = 0;
  for (std::size_t k = 0; k * width < values.size(); ++k) {
    const double difference = std::abs(values[k * width + lane] - truth[k]);
    if (!(difference <= worst)) worst = difference;
    largest = std::max(largest, std::abs(truth[k]));
  }
  return worst / largest;
}

const Hex8Formulation kForms[] = {Hex8Formulation::full, Hex8Formulation::mean_dilatation, Hex8Formulation::enhanced,
                                  Hex8Formulation::shell};

class Hex8Block : public testing::TestWithParam<std::tuple<bool, SolidLaw>> {
 protected:
  [[nodiscard]] static Hex8Kernel kernel() {
    return std::get<0>(GetParam()) ? vector_hex8_kernel() : scalar_hex8_kernel();
  }
  [[nodiscard]] static Material material() { return {std::get<1>(GetParam()), 200, 0.3, 7}; }
};

TEST_P(Hex8Block, EqualsOneElementAtATime) {
  const Block b(kernel().width);
  for (const Hex8Formulation form : kForms)
    for (const Setting& s : {Setting{false, 0, 1, 0}, Setting{true, 0.2, 0.7, 0.3}, Setting{false, 0.2, 0.7, 0.3},
                             Setting{true, 0, 1.5, 0.3}, Setting{true, 0.2, 0, 1}}) {
      const BlockResult r = evaluate(kernel(), form, material(), b, s);
      EXPECT_EQ(r.whole, (1U << b.width) - 1);
      for (int l = 0; l < b.width; ++l) {
        const auto lane = static_cast<std::size_t>(l);
        double force[24], tangent[576];
        ElementOutput out{force, tangent, 0};
        ASSERT_TRUE(oracle::evaluate_hex8(
            form, material(),
            {b.reference[lane].data(), b.position[lane].data(), s.moving ? b.velocity[lane].data() : nullptr, s.damping,
             s.position_weight, s.velocity_weight},
            out));
        EXPECT_LT(lane_difference(r.force, lane, static_cast<std::size_t>(b.width), force), 1e-13);
        EXPECT_LT(lane_difference(r.tangent, lane, static_cast<std::size_t>(b.width), tangent), 1e-13);
        EXPECT_NEAR(r.energy[lane], out.energy, 1e-13 * out.energy);
      }
    }
}

// Truth: an element inside out, now or in its reference, is told, and its neighbours keep every bit.
TEST_P(Hex8Block, OneElementInsideOutLeavesTheOthers) {
  for (const Hex8Formulation form : kForms)
    for (const bool now : {false, true}) {
      Block b(kernel().width);
      const Setting s{true, 0.2, 0.7, 0.3};
      const BlockResult good = evaluate(kernel(), form, material(), b, s);
      const auto bad = static_cast<std::size_t>(b.width - 1);
      Vector& x = now ? b.position[bad] : b.reference[bad];
      x = rotated(Eigen::Vector3d(1, 1, -1).asDiagonal(), x);
      const BlockResult r = evaluate(kernel(), form, material(), b, s);
      EXPECT_EQ(r.whole, good.whole & ~(1U << bad));
      for (std::size_t k = 0; k < r.tangent.size(); ++k)
        if (k % static_cast<std::size_t>(b.width) != bad) {
          ASSERT_EQ(r.tangent[k], good.tangent[k]);
        }
    }
}

// Truth: oracle::sample_hex8(), which makes the strains with rows of its own.
TEST_P(Hex8Block, SamplesAreTheStrainsOfTheSecondImplementation) {
  const Block b(1);
  for (const Hex8Formulation form : kForms) {
    ElementSamples strains, truth;
    ASSERT_TRUE(sample_hex8(form, material(), b.reference[0].data(), b.position[0].data(), strains));
    ASSERT_TRUE(oracle::sample_hex8(form, material(), b.reference[0].data(), b.position[0].data(), truth));
    for (int q = 0; q < 8; ++q)
      for (int m = 0; m < 6; ++m) EXPECT_NEAR(strains.value[q][m], truth.value[q][m], 1e-13);
  }
}

TEST_P(Hex8Block, NotANumberIsNotWhole) {
  Block b(kernel().width);
  b.position[0][5] = std::nan("");
  for (const Hex8Formulation form : kForms)
    EXPECT_EQ(evaluate(kernel(), form, material(), b, {false, 0, 1, 0}).whole & 1U, 0U);
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
