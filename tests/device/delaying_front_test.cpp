// The truth: Schur complements by Eigen, and multipliers computed from it.
#include "device/host/delaying_front.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

namespace espalier::device::host {
namespace delaying_front_test {

using Dense = Eigen::MatrixXd;

/// A random front whose every `share`-th pivot has tiny entries in all rows and columns of the pivots: it must leave.
Dense front_with_bad_pivots(Index rows, Index pivots, Index share, bool symmetric, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1, 1);
  Dense a(rows, rows);
  for (Index j = 0; j < rows; ++j)
    for (Index i = 0; i < rows; ++i) a(i, j) = unit(random) + (i == j ? 3 : 0);
  for (Index b = share - 1; b < pivots; b += share) {
    a.block(0, b, pivots, 1) *= 1e-9;
    a.block(b, 0, 1, pivots) *= 1e-9;
  }
  if (symmetric) a = (a + a.transpose()).eval();
  return a;
}

Dense part(const Dense& a, std::span<const Index> rows, std::span<const Index> cols) {
  Dense out(rows.size(), cols.size());
  for (std::size_t j = 0; j < cols.size(); ++j)
    for (std::size_t i = 0; i < rows.size(); ++i)
      out(static_cast<Index>(i), static_cast<Index>(j)) = a(rows[i], cols[j]);
  return out;
}

TEST(DelayingFront, EliminatesWhatIsStableAndLeavesTheSchurComplement) {
  int left = 0;
  for (const Kind kind : {Kind::ldlt, Kind::lu})
    for (const Index width : {8, 32, 96})
      for (const auto& [rows, pivots] : {std::pair{1, 1}, {7, 3}, {40, 40}, {60, 33}, {150, 90}, {200, 130}})
        for (const Index share : {1000, 7, 3}) {
          SCOPED_TRACE(::testing::Message() << (kind == Kind::lu ? "lu " : "ldlt ") << rows << " rows, " << pivots
                                            << " pivots, tiles of " << width << ", one in " << share << " bad");
          std::mt19937 random(7);
          const Dense a = front_with_bad_pivots(rows, pivots, share, kind == Kind::ldlt, random);
          plan::TileRule tiles;
          tiles.whole_rows = tiles.whole_pivots = 0;
          tiles.max_block_size = width;
          DelayingFront<double> front({kind}, {0.01, 1e-15}, tiles, nullptr);
          front.start(pivots, rows);
          for (Index j = 0; j < rows; ++j)
            for (Index i = kind == Kind::lu ? 0 : j; i < rows; ++i) front.add(i, j, a(i, j));
          ASSERT_TRUE(front.eliminate());
          const Index done = front.eliminated();
          const auto order = front.order();
          ASSERT_EQ(done + front.leaving(), pivots);
          const Index bad = pivots / share;
          EXPECT_LE(front.leaving(), 2 * bad + (pivots == rows ? 1 : 0)) << "too many leave";
          if (rows >= pivots + 20) {
            EXPECT_GE(front.leaving(), bad) << "an unstable pivot was taken";
          }
          left += front.leaving();
          const auto in = order.first(static_cast<std::size_t>(done)),
                     out = order.subspan(static_cast<std::size_t>(done));
          const Dense multipliers = part(a, out, in) * part(a, in, in).partialPivLu().inverse();
          const Dense schur = part(a, out, out) - multipliers * part(a, in, out);
          double worst = 0, most = 1;
          for (Index c = 0; c < rows - done; ++c)
            for (Index r = kind == Kind::lu ? 0 : c; r < rows - done; ++r) {
              worst = std::max(worst, std::abs(schur(r, c) - front.rest(r, c)));
              most = std::max(most, std::abs(schur(r, c)));
            }
          EXPECT_LE(worst, 1e-15 * 100 * rows * most) << "not what elimination leaves";
        }
  EXPECT_GT(left, 100);
}

TEST(DelayingFront, EndsWhereTheEffortIsSpent) {
  std::mt19937 random(3);
  const Index rows = 200, pivots = 130;
  const Dense a = front_with_bad_pivots(rows, pivots, 3, true, random);
  for (const double most : {1e3, 1e5, 1e9}) {
    Effort effort(most);
    DelayingFront<double> front({Kind::ldlt}, {0.01, 1e-15}, plan::TileRule{}, nullptr, nullptr, &effort);
    front.start(pivots, rows);
    for (Index j = 0; j < rows; ++j)
      for (Index i = j; i < rows; ++i) front.add(i, j, a(i, j));
    EXPECT_EQ(front.eliminate(), most == 1e9);
    EXPECT_EQ(effort.spent(), most != 1e9);
  }
}

}  // namespace delaying_front_test
}  // namespace espalier::device::host
