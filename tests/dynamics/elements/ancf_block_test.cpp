// ANCF elements side by side. Truth: oracle::evaluate_shell() and oracle::evaluate_cable(), second implementations,
// element by element.
#include <fmt/format.h>

#include <limits>

#include "dynamics/elements/elements_common.hpp"
#include "dynamics/elements/lanes/ancf_cable_block.hpp"
#include "dynamics/elements/lanes/ancf_shell_block.hpp"
#include "dynamics/elements/oracles.hpp"

namespace espalier::dynamics::test {
namespace ancf_block_test {

struct Setting {
  bool moving;
  double damping, position_weight, velocity_weight;
};
const Setting kSettings[] = {
    {false, 0, 1, 0}, {true, 0.2, 0.7, 0.3}, {false, 0.2, 0.7, 0.3}, {true, 0, 1.5, 0.3}, {true, 0.2, 0, 1}};

/// One kind of elements, several at a time and one at a time.
struct Kind {
  std::string name;
  int width;
  std::function<unsigned(const BlockInput&, const BlockOutput&)> block;
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

/// Elements in lanes: all different, distorted, turned, strained.
struct Block {
  std::size_t width, numbers;
  std::vector<Vector> reference, position, velocity;
  explicit Block(const Kind& kind)
      : width(static_cast<std::size_t>(kind.width)), numbers(static_cast<std::size_t>(kind.reference.size())) {
    const Vector& x = kind.reference;
    for (unsigned l = 0; l < width; ++l) {
      reference.push_back(x + noise(x.size(), 0.01, 7 + l));
      position.push_back(rotated(rotation(0.4, 0.2, -0.9 + l), reference.back()) + noise(x.size(), kNoise, 30 + l));
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

BlockResult evaluate(const Kind& kind, const Block& b, const Setting& s) {
  const std::size_t n = b.numbers, w = b.width;
  BlockResult r{0, std::vector<double>(n * w), std::vector<double>(n * n * w), std::vector<double>(w)};
  const auto x0 = b.side_by_side(b.reference), x = b.side_by_side(b.position), v = b.side_by_side(b.velocity);
  const BlockInput in{x0.data(), x.data(),          s.moving ? v.data() : nullptr,
                      s.damping, s.position_weight, s.velocity_weight};
  r.whole = kind.block(in, {r.force.data(), r.tangent.data(), r.energy.data()});
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

class AncfBlock : public testing::TestWithParam<Kind> {};

TEST_P(AncfBlock, EqualsOneElementAtATime) {
  const Kind& kind = GetParam();
  const Block b(kind);
  for (const Setting& s : kSettings) {
    const BlockResult r = evaluate(kind, b, s);
    EXPECT_EQ(r.whole, (1U << b.width) - 1);
    for (std::size_t l = 0; l < b.width; ++l) {
      const Result truth = run(kind.one, b.reference[l], b.position[l], s.moving ? b.velocity[l] : Vector(), s.damping,
                               s.position_weight, s.velocity_weight);
      ASSERT_TRUE(truth.ok);
      EXPECT_LT(lane_difference(r.force, l, b.width, truth.force), kRounding);
      EXPECT_LT(lane_difference(r.tangent, l, b.width, truth.tangent.reshaped()), kRounding);
      EXPECT_NEAR(r.energy[l], truth.energy, kind.energy_error * truth.energy);
    }
  }
}

// Truth: what an element gives where the lanes beside it hold itself.
TEST_P(AncfBlock, AnyLaneGivesWhatItGivesAlone) {
  const Kind& kind = GetParam();
  const Block b(kind);
  const BlockResult together = evaluate(kind, b, kSettings[1]);
  for (std::size_t l = 0; l < b.width; ++l) {
    Block alone = b;
    for (auto* field : {&alone.reference, &alone.position, &alone.velocity})
      std::fill(field->begin(), field->end(), Vector((*field)[l]));
    const BlockResult r = evaluate(kind, alone, kSettings[1]);
    for (std::size_t k = l; k < r.force.size(); k += b.width) ASSERT_EQ(r.force[k - l], together.force[k]);
    for (std::size_t k = l; k < r.tangent.size(); k += b.width) ASSERT_EQ(r.tangent[k - l], together.tangent[k]);
    EXPECT_EQ(r.energy[0], together.energy[l]);
  }
}

// Truth: an element that is not whole is told, and its neighbours keep every bit.
TEST_P(AncfBlock, OneBadElementLeavesTheOthers) {
  const Kind& kind = GetParam();
  Block b(kind);
  const BlockResult good = evaluate(kind, b, kSettings[1]);
  const std::size_t bad = b.width - 1;
  b.position[bad].setZero();
  const BlockResult r = evaluate(kind, b, kSettings[1]);
  EXPECT_EQ(r.whole, good.whole & ~(1U << bad));
  for (std::size_t k = 0; k < r.tangent.size(); ++k)
    if (k % b.width != bad) {
      ASSERT_EQ(r.tangent[k], good.tangent[k]);
    }
}

TEST_P(AncfBlock, NotANumberIsNotWhole) {
  Block b(GetParam());
  b.position[0][5] = std::nan("");
  for (const Setting& s : kSettings) EXPECT_EQ(evaluate(GetParam(), b, s).whole & 1U, 0U);
}

INSTANTIATE_TEST_SUITE_P(All, AncfBlock, testing::ValuesIn(kinds()), [](const auto& p) { return p.param.name; });

}  // namespace ancf_block_test
}  // namespace espalier::dynamics::test
