// What a changed complex system reports of its errors. Truth: dense matrices changed as said, and their residuals.
#include <gtest/gtest.h>

#include <span>
#include <vector>

#include "changes/complex_changes.hpp"
#include "changes/dense_changes.hpp"

namespace espalier::test {

namespace complex_changed_accuracy_test {

using namespace complex_changes;

// Factors in single precision without refinement, of complex matrices of every sort, with the transpose and the
// conjugate transpose.
TEST(ComplexChangedAccuracy, ErrorsAreReportedAsTheyAre) {
  const Index n = 40;
  for (const Given& given : kGiven)
    for (const bool mirrored : {true, false}) {
      SCOPED_TRACE(testing::Message() << "given " << &given - kGiven << ", mirrored " << mirrored);
      Dense m = random_dense(n, given.sort, 5);
      Options o = changed::rough();
      o.kind = given.kind;
      ComplexSolver solver(o);
      const ComplexSparseMatrix a = sparse(m, given.storage);
      ASSERT_TRUE(solver.analyze(a).status.ok());
      ASSERT_TRUE(solver.factorize(a).status.ok());
      ComplexChangedSystem changed(solver);
      changed.set_folding(false);
      const bool hermitian = changed.hermitian();
      const Dense column = 30 * random_columns(n, 1, 7);
      const Dense row = !mirrored ? Dense(random_columns(n, 1, 8)) : hermitian ? Dense(column.conjugate()) : column;
      const std::vector<Value> corner{1.5};
      ASSERT_TRUE(changed.add(numbers(column), 1, mirrored ? std::span<const Value>{} : numbers(row), corner).ok());
      ASSERT_TRUE(changed.remove(std::vector<Index>{6}).ok());
      m.conservativeResize(n + 1, n + 1);
      m.col(n).head(n) = column;
      m.row(n).head(n) = row.transpose();
      m(n, n) = corner[0];
      std::vector<Index> kept;
      for (Index v = 0; v <= n; ++v)
        if (v != 6) kept.push_back(v);
      for (const Transpose how : {Transpose::no, Transpose::yes, Transpose::conjugate}) {
        const Dense left = op(Dense(m(kept, kept)), how), b = random_columns(n + 1, 1, 2);
        Dense x(n + 1, 1);
        const ChangedSolveResult r = changed.solve(numbers(b), {x.data(), at(n + 1)}, 1, how);
        ASSERT_TRUE(r.status.ok()) << r.status.message;
        const Dense found = x(kept, Eigen::all), of_b = b(kept, Eigen::all);
        const double error =
            (of_b - left * found).cwiseAbs().maxCoeff() /
            (left.cwiseAbs().rowwise().sum().maxCoeff() * found.cwiseAbs().maxCoeff() + of_b.cwiseAbs().maxCoeff());
        EXPECT_GT(error, 1e-13);
        EXPECT_LT(error, 1e-2);
        EXPECT_NEAR(r.backward_error, error, 1e-2 * error) << "transpose " << static_cast<int>(how);
      }
    }
}

}  // namespace complex_changed_accuracy_test

}  // namespace espalier::test
