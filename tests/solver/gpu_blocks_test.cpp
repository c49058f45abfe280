// Fronts with chains of pivot blocks on the GPU, whose inverses are joined, where they are badly conditioned. Truth:
// A x = b by an independent residual, without refinement, and a transposed solve likewise.
#include <gtest/gtest.h>

#include <limits>

#include "espalier/espalier.hpp"
#include "matrix/residual.hpp"
#include "reference/reference.hpp"
#include "solver/gpu_fixture.hpp"

namespace espalier {
namespace {

using reference::Triple;
using reference::Values;

class GpuBlocks : public test::OnGpu {};

/// The system with springs of stiffness `penalty` between pairs of its unknowns: as constraints by penalties make them.
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

TEST_F(GpuBlocks, BadlyConditionedChains) {
  const SparseMatrix systems[] = {reference::random_system(2500, 6, Values::positive, 5),
                                  reference::saddle_point(1500, 300, 6),
                                  reference::random_system(2000, 6, Values::general, 7)};
  for (const SparseMatrix& plain : systems)
    for (const double penalty : {1.0, 1e6, 1e12}) {
      const SparseMatrix a = with_penalties(plain, penalty);
      Options o;
      o.device = "gpu:0";
      o.refinement_steps = 0;
      Solver s(o);
      ASSERT_TRUE(s.analyze(a).status.ok());
      ASSERT_TRUE(s.factorize(a).status.ok());
      for (const Index columns : {1, 8, 20})
        for (const Transpose transpose : {Transpose::no, Transpose::yes}) {
          SCOPED_TRACE(testing::Message() << a.rows << " unknowns, penalty " << penalty << ", " << columns
                                          << " right-hand sides, " << static_cast<int>(transpose));
          const std::vector<double> b = reference::random_vector(static_cast<std::int64_t>(a.rows) * columns, 8);
          std::vector<double> x(b.size());
          ASSERT_TRUE(s.solve(b, x, columns, transpose).status.ok());
          EXPECT_LE(matrix::backward_errors(a, x, b, columns, transpose, nullptr).normwise,
                    10 * std::numeric_limits<double>::epsilon() * static_cast<double>(a.rows));
        }
    }
}

}  // namespace
}  // namespace espalier
