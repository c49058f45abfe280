// Many right-hand sides on the GPU, in passes of up to 32. Truth: A x = b by an independent residual of every column,
// and zeros for a column of zeros, whatever stands beside it.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "espalier/espalier.hpp"
#include "matrix/residual.hpp"
#include "reference/reference.hpp"
#include "solver/gpu/gpu_fixture.hpp"

namespace espalier {
namespace gpu_columns_test {

using reference::Values;

class GpuColumns : public test::OnGpu {};

TEST_F(GpuColumns, EveryNumberOfThem) {
  const SparseMatrix systems[] = {reference::random_system(2000, 6, Values::positive, 1),
                                  reference::saddle_point(900, 200, 2),
                                  reference::random_system(1500, 6, Values::general, 3)};
  for (const SparseMatrix& a : systems) {
    Solver s = test::unrefined_on_gpu(a);
    const auto n = static_cast<std::size_t>(a.rows);
    for (const Index columns : {2, 8, 9, 16, 24, 31, 32, 33, 72})
      for (const Transpose transpose : {Transpose::no, Transpose::yes}) {
        SCOPED_TRACE(testing::Message() << a.rows << " unknowns, " << columns << " right-hand sides, "
                                        << static_cast<int>(transpose));
        std::vector<double> b = reference::random_vector(static_cast<std::int64_t>(n) * columns, 4 + columns);
        const auto zero = b.begin() + static_cast<std::ptrdiff_t>(n) * (columns / 2);
        std::fill_n(zero, n, 0.0);
        std::vector<double> x(b.size(), 7), again(b.size());
        ASSERT_TRUE(s.solve(b, x, columns, transpose).status.ok());
        ASSERT_TRUE(s.solve(b, again, columns, transpose).status.ok());
        EXPECT_EQ(x, again) << "the bits of every run";
        for (Index c = 0; c < columns; ++c) {
          const auto first = static_cast<std::size_t>(c) * n;
          const std::vector<double> bc(b.begin() + static_cast<std::ptrdiff_t>(first),
                                       b.begin() + static_cast<std::ptrdiff_t>(first + n));
          const std::vector<double> xc(x.begin() + static_cast<std::ptrdiff_t>(first),
                                       x.begin() + static_cast<std::ptrdiff_t>(first + n));
          if (c == columns / 2)
            EXPECT_EQ(std::count(xc.begin(), xc.end(), 0.0), static_cast<std::ptrdiff_t>(n));
          else
            EXPECT_LE(matrix::backward_errors(a, xc, bc, 1, transpose, nullptr).normwise,
                      10 * std::numeric_limits<double>::epsilon() * static_cast<double>(n));
        }
      }
  }
}

}  // namespace gpu_columns_test
}  // namespace espalier
