// Sums by rows over a pattern by columns. Truth: a loop over the columns.
#include "dynamics/dae/row_ranges.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <random>

#include "base/at.hpp"

namespace espalier::dynamics {
namespace row_ranges_test {

/// Columns of up to `most` entries, every seventh empty, some rows in none.
SparsePattern made_up(Index rows, Index cols, Index most) {
  std::mt19937 generator(5);
  SparsePattern p{rows, cols, {0}, {}};
  for (Index c = 0; c < cols; ++c) {
    if (c % 7 != 0 && rows > 0) {
      const Index step = 1 + rows / most;
      for (auto r = static_cast<Index>(generator() % at(step)); r < rows;
           r += 1 + static_cast<Index>(generator() % at(2 * step)))
        p.ind.push_back(r);
    }
    p.ptr.push_back(static_cast<Offset>(p.ind.size()));
  }
  return p;
}

TEST(RowRanges, SumsAreThoseOfALoop) {
  for (const auto& [rows, cols, most] :
       {std::array<Index, 3>{2000, 3000, 60}, {3000, 2000, 200}, {3, 5, 2}, {0, 4, 1}, {4, 0, 1}}) {
    const SparsePattern p = made_up(rows, cols, most);
    EXPECT_TRUE(cols < 2000 || p.nonzeros() > 1 << 16);  // several ranges
    const auto value = [&](Index column, Offset k) { return std::sin(static_cast<double>(k) + 0.1 * column); };
    std::vector<double> truth(at(rows), 0.0);
    for (Index c = 0; c < cols; ++c)
      for (Offset k = p.ptr[at(c)]; k < p.ptr[at(c) + 1]; ++k) truth[at(p.ind[at(k)])] += value(c, k);
    for (const int threads : {0, 1, 2, 3}) {
      const auto pool = threads == 0 ? nullptr : std::make_unique<base::ThreadPool>(threads);
      std::vector<double> sums(at(rows), 0.0);
      for_each_row_range(p, pool.get(), [&](Index column, Offset begin, Offset end) {
        EXPECT_LT(begin, end);
        for (Offset k = begin; k < end; ++k) sums[at(p.ind[at(k)])] += value(column, k);
      });
      EXPECT_EQ(sums, truth) << rows << " x " << cols << ", threads: " << threads;
    }
  }
}

}  // namespace row_ranges_test
}  // namespace espalier::dynamics
