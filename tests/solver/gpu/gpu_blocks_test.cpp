// Fronts with chains of pivot blocks on the GPU, whose inverses are joined (L L^T), where they are badly conditioned.
// Truth: A x = b by an independent residual, without refinement, and a transposed solve likewise.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/residual.hpp"
#include "reference/reference.hpp"
#include "solver/gpu/gpu_fixture.hpp"

namespace espalier {
namespace gpu_blocks_test {

using reference::Triple;
using reference::Values;

class GpuBlocks : public test::OnGpu {};

/// The system with springs of stiffness `penalty` between pairs of its unknowns, as constraints by penalties have them.
SparseMatrix with_penalties(const SparseMatrix& a, double penalty) {
  std::vector<Triple> entries;
  for (Index col = 0; col < a.cols; ++col)
    for (Offset k = a.col_ptr[col]; k < a.col_ptr[col + 1]; ++k) entries.push_back({a.row_ind[k], col, a.values[k]});
  const bool both = a.storage == Storage::general;
  for (Index p = 0; p + 1 < a.rows; p += 7) {
    const Index q = p + 1 + (p * 31) % (a.rows - p - 1);
    entries.push_back({p, p, penalty});
    entries.push_back({q, q, penalty});
    entries.push_back({q, p, -penalty});
    if (both) entries.push_back({p, q, -penalty});
  }
  return reference::from_triples(a.rows, entries, a.storage);
}

void solves(const SparseMatrix& a) {
  Solver s = test::unrefined_on_gpu(a);
  for (const Index columns : {1, 8, 20})
    for (const Transpose transpose : {Transpose::no, Transpose::yes}) {
      SCOPED_TRACE(testing::Message() << columns << " right-hand sides, " << static_cast<int>(transpose));
      const std::vector<double> b = reference::random_vector(static_cast<std::int64_t>(a.rows) * columns, 8);
      std::vector<double> x(b.size());
      ASSERT_TRUE(s.solve(b, x, columns, transpose).status.ok());
      EXPECT_LE(matrix::backward_errors(a, x, b, columns, transpose, nullptr).normwise,
                std::numeric_limits<double>::epsilon() * std::sqrt(static_cast<double>(a.rows)));
    }
}

TEST_F(GpuBlocks, BadlyConditionedChains) {
  base::ThreadPool pool(2);
  const SparseMatrix systems[] = {
      reference::random_system(2500, 6, Values::positive, 5), reference::saddle_point(1500, 300, 6),
      matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "16"}), &pool)};
  for (const SparseMatrix& plain : systems)
    for (const double penalty : {1.0, 1e6, 1e12}) {
      SCOPED_TRACE(testing::Message() << plain.rows << " unknowns, penalty " << penalty);
      solves(with_penalties(plain, penalty));
    }
}

}  // namespace gpu_blocks_test
}  // namespace espalier
