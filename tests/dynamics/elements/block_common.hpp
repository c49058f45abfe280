// Shared by the tests of elements side by side: blocks of elements, what kernels give of them, and comparisons with one
// element at a time.
#pragma once

#include "dynamics/elements/elements_common.hpp"

namespace espalier::dynamics::test {

struct Setting {
  bool moving;
  double damping, position_weight, velocity_weight;
};
inline constexpr Setting kSettings[] = {
    {false, 0, 1, 0}, {true, 0.2, 0.7, 0.3}, {false, 0.2, 0.7, 0.3}, {true, 0, 1.5, 0.3}, {true, 0.2, 0, 1}};

/// Elements in lanes: all different, distorted, turned, strained.
struct Block {
  std::size_t width, numbers;
  std::vector<Vector> reference, position, velocity;
  /// @param x  what all of them are near to @param distortion, strain  the largest differences of coordinates
  Block(const Vector& x, int lanes, double distortion, double strain)
      : width(static_cast<std::size_t>(lanes)), numbers(static_cast<std::size_t>(x.size())) {
    for (unsigned l = 0; l < width; ++l) {
      reference.push_back(x + noise(x.size(), distortion, 7 + l));
      position.push_back(rotated(rotation(0.4, 0.2, -0.9 + l), reference.back()) + noise(x.size(), strain, 30 + l));
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

using BlockKernel = std::function<unsigned(const BlockInput&, const BlockOutput&)>;

/// What a kernel gives, with the half of a symmetric tangent that it leaves out.
inline BlockResult evaluate(const BlockKernel& kernel, const Block& b, const Setting& s) {
  const std::size_t n = b.numbers, w = b.width;
  BlockResult r{0, std::vector<double>(n * w), std::vector<double>(n * n * w), std::vector<double>(w)};
  const auto x0 = b.side_by_side(b.reference), x = b.side_by_side(b.position), v = b.side_by_side(b.velocity);
  const BlockInput in{x0.data(), x.data(),          s.moving ? v.data() : nullptr,
                      s.damping, s.position_weight, s.velocity_weight};
  r.whole = kernel(in, {r.force.data(), r.tangent.data(), r.energy.data()});
  for (std::size_t column = 0; column < n && (!s.moving || s.damping == 0); ++column)
    for (std::size_t row = column / 3 * 3 + 3; row < n; ++row)
      for (std::size_t l = 0; l < w; ++l) r.tangent[(n * column + row) * w + l] = r.tangent[(n * row + column) * w + l];
  return r;
}

/// The largest difference of a lane from the truth, relative to the largest number.
inline double lane_difference(const std::vector<double>& values, std::size_t lane, std::size_t width,
                              const Vector& truth) {
  double worst = 0;
  for (std::size_t k = 0; k * width < values.size(); ++k) {
    const double difference = std::abs(values[k * width + lane] - truth[static_cast<Eigen::Index>(k)]);
    if (!(difference <= worst)) worst = difference;
  }
  return worst / truth.cwiseAbs().maxCoeff();
}

/// Every lane gives what `one` gives of its element: forces and tangents to `rounding`, energies to `of_energy`.
inline void expect_one_at_a_time(const BlockKernel& kernel, const Evaluate& one, const Block& b, double rounding,
                                 double of_energy) {
  for (const Setting& s : kSettings) {
    const BlockResult r = evaluate(kernel, b, s);
    EXPECT_EQ(r.whole, (1U << b.width) - 1);
    for (std::size_t l = 0; l < b.width; ++l) {
      const Result truth = run(one, b.reference[l], b.position[l], s.moving ? b.velocity[l] : Vector(), s.damping,
                               s.position_weight, s.velocity_weight);
      ASSERT_TRUE(truth.ok);
      EXPECT_LT(lane_difference(r.force, l, b.width, truth.force), rounding);
      EXPECT_LT(lane_difference(r.tangent, l, b.width, truth.tangent.reshaped()), rounding);
      EXPECT_NEAR(r.energy[l], truth.energy, of_energy * truth.energy);
    }
  }
}

/// The last element of a block is spoilt: that is told, and its neighbours keep every bit.
inline void expect_others_keep_their_bits(const BlockKernel& kernel, Block b,
                                          const std::function<void(Block&, std::size_t)>& spoil) {
  const BlockResult good = evaluate(kernel, b, kSettings[1]);
  const std::size_t bad = b.width - 1;
  spoil(b, bad);
  const BlockResult r = evaluate(kernel, b, kSettings[1]);
  EXPECT_EQ(r.whole, good.whole & ~(1U << bad));
  for (std::size_t k = 0; k < r.tangent.size(); ++k)
    if (k % b.width != bad) {
      ASSERT_EQ(r.tangent[k], good.tangent[k]);
    }
}

/// An element inside out, now or in its reference.
inline void expect_inside_out_is_told(const BlockKernel& kernel, const Block& b) {
  for (const bool now : {false, true})
    expect_others_keep_their_bits(kernel, b, [now](Block& block, std::size_t bad) {
      Vector& x = now ? block.position[bad] : block.reference[bad];
      x = rotated(Eigen::Vector3d(1, 1, -1).asDiagonal(), x);
    });
}

}  // namespace espalier::dynamics::test
