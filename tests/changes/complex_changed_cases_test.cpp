// Named cases of changes around complex factors. Truth: dense matrices that are changed as said.
#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <vector>

#include "changes/complex_changes.hpp"
#include "espalier/espalier.h"

namespace espalier::test {

namespace complex_changed_cases_test {

using namespace complex_changes;

// 64 unknowns of 500 go and come, beside dense algebra.
TEST(ComplexChangedCases, ManyChangesOfLargerSystems) {
  for (const int which : {0, 2, 7, 12}) {
    const Given& given = kGiven[which];
    const Index n = 500;
    const Dense a = random_dense(n, given.sort, 5);
    ComplexSolver solver = factorized(sparse(a, given.storage), given.kind);
    ComplexChangedSystem changed(solver);
    changed.set_folding(false);
    std::vector<Index> gone, kept;
    for (Index v = 0; v < n; ++v) (v % 7 == 3 && gone.size() < 64 ? gone : kept).push_back(v);
    ASSERT_TRUE(changed.remove(gone).ok());
    EXPECT_EQ(changed.changes(), 64);
    for (const Transpose how : {Transpose::no, Transpose::yes, Transpose::conjugate}) {
      const Dense m = op(a(kept, kept), how), b = random_columns(n, 1, 2);
      Dense x(n, 1);
      const ChangedSolveResult r = changed.solve(numbers(b), {x.data(), at(n)}, 1, how);
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      const Dense found = x(kept, Eigen::all), given_b = b(kept, Eigen::all);
      const double scale =
          m.cwiseAbs().rowwise().sum().maxCoeff() * found.cwiseAbs().maxCoeff() + given_b.cwiseAbs().maxCoeff();
      EXPECT_LE((given_b - m * found).cwiseAbs().maxCoeff() / scale, 100 * kEps) << which;
    }
  }
}

// A replaced row of a Hermitian matrix is the conjugate column; of a symmetric one the column.
TEST(ComplexChangedCases, RowsThatAreLeftOut) {
  for (const bool hermitian : {false, true}) {
    const Dense a = random_dense(9, hermitian ? Sort::definite : Sort::symmetric, 3);
    ComplexSolver solver =
        factorized(sparse(a, hermitian ? Storage::hermitian_lower : Storage::symmetric_lower), Kind::automatic);
    ComplexChangedSystem changed(solver);
    Dense u = Dense::Zero(9, 1), m = a;
    u(2, 0) = Value(1, 2);
    u(4, 0) = 50;
    ASSERT_TRUE(changed.replace(std::vector<Index>{4}, Entries(u).view()).ok());
    m.row(4) = hermitian ? Dense(u.adjoint()) : Dense(u.transpose());
    m.col(4) = u;
    const Dense b = random_columns(9, 1, 1);
    Dense x(9, 1);
    ASSERT_TRUE(changed.solve(numbers(b), {x.data(), 9}).status.ok());
    EXPECT_LE((m * x - b).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_EQ(changed.inertia().positive, hermitian ? 9 : -1);
  }
}

// Complex symmetric cores of any rank keep a matrix symmetric: their singular vectors.
TEST(ComplexChangedCases, SymmetricCoresStaySymmetric) {
  const Index n = 20;
  const Dense a = random_dense(n, Sort::symmetric, 8);
  ComplexSolver solver = factorized(sparse(a, Storage::symmetric_lower), Kind::ldlt);
  Dense defective(2, 2), nilpotent(2, 2), equal(2, 2);
  defective << Value(1, 1), Value(0, 1), Value(0, 1), Value(1, -1);  // one eigenvalue, one eigenvector
  nilpotent << Value(1), Value(0, 1), Value(0, 1), Value(-1);
  equal << Value(0), Value(1), Value(1), Value(0);
  for (const Dense& c : {defective, nilpotent, equal}) {
    ComplexChangedSystem changed(solver);
    const Dense u = random_columns(n, 2, 4), b = random_columns(n, 1, 1), m = a + u * c * u.transpose();
    ASSERT_TRUE(changed.add_low_rank(numbers(u), 2, numbers(c)).ok());
    ASSERT_TRUE(changed.fold().ok());  // as a symmetric matrix, or the kind would not do
    Dense x(n, 1), y(n, 1);
    ASSERT_TRUE(changed.solve(numbers(b), {x.data(), at(n)}).status.ok());
    EXPECT_LE((m * x - b).cwiseAbs().maxCoeff(), 1e-11 * x.cwiseAbs().maxCoeff());
    ASSERT_TRUE(changed.solve(numbers(b), {y.data(), at(n)}, 1, Transpose::yes).status.ok());
    EXPECT_EQ(x, y) << "the transpose of a symmetric matrix is another one";
  }
}

TEST(ComplexChangedCases, BitsDoNotDependOnThreads) {
  const Index n = 900;
  for (const int which : {0, 2, 7}) {
    const ComplexSparseMatrix a = sparse(random_dense(n, kGiven[which].sort, 7), kGiven[which].storage);
    Dense first;
    for (const int threads : {1, 2, 3}) {
      ComplexSolver solver = factorized(a, kGiven[which].kind, threads);
      ComplexChangedSystem changed(solver);
      std::vector<Index> list;
      for (Index v = 0; v < 40; ++v) list.push_back(13 * v);
      ASSERT_TRUE(changed.flip(list).ok());
      const Dense b = random_columns(n, 3, 1);
      Dense x(n, 3);
      ASSERT_TRUE(changed.solve(numbers(b), {x.data(), at(3 * n)}, 3, Transpose::yes).status.ok());
      if (threads == 1) first = x;
      EXPECT_EQ(first, x) << threads;
    }
  }
}

TEST(ComplexChangedCases, SingularChangesLeaveEverythingUsable) {
  const Dense a = random_dense(30, Sort::definite, 1);
  ComplexSolver solver = factorized(sparse(a, Storage::hermitian_lower), Kind::llt);
  for (const bool folds : {false, true}) {
    ComplexChangedSystem changed(solver);
    ASSERT_TRUE(changed.remove(std::vector<Index>{4}).ok());
    ASSERT_TRUE(changed.add(numbers(Dense::Zero(30, 1)), 1).ok());  // an equation that says nothing
    const Dense b = random_columns(31, 1, 1);
    Dense x(31, 1);
    const std::span<Value> to(x.data(), 31);
    EXPECT_EQ((folds ? changed.fold() : changed.prepare()).code, StatusCode::singular);
    EXPECT_EQ(changed.solve(numbers(b), to).status.code, StatusCode::singular);
    ASSERT_TRUE(changed.remove(std::vector<Index>{30}).ok());
    ASSERT_TRUE(changed.restore(std::vector<Index>{4}).ok());
    ASSERT_TRUE(changed.solve(numbers(b), to).status.ok());
    EXPECT_LE((a * x.topRows(30) - b.topRows(30)).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(ComplexChangedCases, MisuseAndBadNumbersAreErrors) {
  ComplexSolver empty;
  EXPECT_THROW(ComplexChangedSystem{empty}, std::logic_error);
  const ComplexSparseMatrix a = sparse(random_dense(10, Sort::definite, 1), Storage::hermitian_lower);
  ComplexSolver solver = factorized(a, Kind::llt);
  ComplexChangedSystem changed(solver);
  Dense u = Dense::Ones(10, 1), x(10, 1);
  const std::span<Value> to(x.data(), 10);
  EXPECT_THROW((void)changed.add(numbers(u), 2), std::invalid_argument);
  EXPECT_THROW((void)changed.add_low_rank(numbers(u), 1, numbers(u)), std::invalid_argument);
  EXPECT_THROW((void)changed.solve(numbers(u), to.first(9)), std::invalid_argument);
  for (const Value bad :
       {Value(std::numeric_limits<double>::quiet_NaN(), 0), Value(0, std::numeric_limits<double>::infinity())}) {
    u(4, 0) = bad;
    EXPECT_EQ(changed.add(numbers(u), 1).code, StatusCode::invalid_input);
    EXPECT_EQ(changed.add_low_rank(numbers(u), 1).row, 4);
    EXPECT_EQ(changed.replace(std::vector<Index>{3}, Entries(u).view()).row, 4);
    const SolveResult r = changed.solve(numbers(u), to);
    EXPECT_EQ(r.status.code, StatusCode::invalid_input);
    EXPECT_EQ(r.status.row, 4);
    EXPECT_EQ(changed.add(numbers(Dense::Ones(10, 1)), 1, {}, std::vector<Value>{bad}).code, StatusCode::invalid_input);
  }
  EXPECT_EQ(changed.remove(std::vector<Index>{10}).row, 10);
  EXPECT_EQ(changed.flip(std::vector<Index>{2, 2}).row, 2);
  EXPECT_EQ(changed.restore(std::vector<Index>{2}).code, StatusCode::invalid_input);
  Entries out_of_range(Dense::Ones(10, 1));
  out_of_range.rows.back() = 10;
  EXPECT_EQ(changed.add(out_of_range.view()).row, 10);
  EXPECT_EQ(changed.size(), 10);
  EXPECT_EQ(changed.changes(), 0);
  ASSERT_TRUE(solver.factorize(a).status.ok());
  EXPECT_THROW((void)changed.solve(numbers(Dense::Ones(10, 1)), to), std::logic_error);
  changed.reset();
  EXPECT_TRUE(changed.solve(numbers(Dense::Ones(10, 1)), to).status.ok());
}

// From C, in either layout: numbers are pairs, a row that is left out is the conjugate column, whatever is held.
TEST(ComplexChangedCases, FromC) {
  const Index n = 12;
  const Dense a = random_dense(n, Sort::definite, 6);
  const ComplexSparseMatrix lower = sparse(a, Storage::hermitian_lower);
  const std::vector<std::int64_t> pointers(lower.col_ptr.begin(), lower.col_ptr.end());
  const std::vector<std::int64_t> indices(lower.row_ind.begin(), lower.row_ind.end());
  for (const bool by_rows : {false, true}) {
    // By rows the arrays are those of the upper triangle of the transpose, which is another matrix.
    const Dense given = by_rows ? Dense(a.transpose()) : a;
    espalier_solver* solver = nullptr;
    ASSERT_EQ(espalier_create(&solver), ESPALIER_OK);
    espalier_matrix_i64 m{};
    m.size = sizeof m;
    m.rows = m.cols = n;
    m.nonzeros = lower.nonzeros();
    m.pointers = pointers.data();
    m.indices = indices.data();
    m.values = reinterpret_cast<const double*>(lower.values.data());
    m.layout = by_rows ? ESPALIER_CSR : ESPALIER_CSC;
    m.storage = by_rows ? ESPALIER_HERMITIAN_UPPER : ESPALIER_HERMITIAN_LOWER;
    m.numbers = ESPALIER_COMPLEX;
    ASSERT_EQ(espalier_analyze_i64(solver, &m, nullptr), ESPALIER_OK) << espalier_last_error(solver);
    std::int32_t anew = 1;
    ASSERT_EQ(espalier_analyze_change_i64(solver, &m, &anew, nullptr), ESPALIER_OK) << espalier_last_error(solver);
    EXPECT_EQ(anew, 0);
    ASSERT_EQ(espalier_factorize_i64(solver, &m, nullptr), ESPALIER_OK);
    espalier_changed* changed = nullptr;
    ASSERT_EQ(espalier_changed_create(solver, &changed), ESPALIER_OK) << espalier_last_error(solver);
    const Dense u = random_columns(n, 1, 3), core = Dense::Constant(1, 1, -2);
    const std::int64_t begin[2] = {0, n}, gone[1] = {5};
    std::vector<std::int64_t> rows(at(n));
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<std::int64_t>(i);
    const espalier_columns column{1, begin, rows.data(), reinterpret_cast<const double*>(u.data())};
    const auto* corner = reinterpret_cast<const double*>(core.data());
    ASSERT_EQ(espalier_changed_add(changed, &column, nullptr, corner), ESPALIER_OK) << espalier_last_error(solver);
    ASSERT_EQ(espalier_changed_add_low_rank(changed, &column, nullptr, nullptr), ESPALIER_OK);
    ASSERT_EQ(espalier_changed_remove(changed, gone, 1), ESPALIER_OK);
    Dense truth = Dense::Zero(n + 1, n + 1);
    truth.topLeftCorner(n, n) = given + u * u.adjoint();
    truth.topRightCorner(n, 1) = u;
    truth.bottomLeftCorner(1, n) = u.adjoint();
    truth(n, n) = -2;
    truth.row(5).setZero();
    truth.col(5).setZero();
    truth(5, 5) = 1;
    Dense b = random_columns(n + 1, 1, 1), x(n + 1, 1);
    for (const Transpose how : {Transpose::no, Transpose::yes, Transpose::conjugate}) {
      ASSERT_EQ(espalier_changed_solve(changed, reinterpret_cast<const double*>(b.data()),
                                       reinterpret_cast<double*>(x.data()), n + 1, 1, static_cast<int>(how), nullptr),
                ESPALIER_OK)
          << espalier_last_error(solver);
      Dense right = b;
      right(5, 0) = 0;
      EXPECT_LE((op(truth, how) * x - right).cwiseAbs().maxCoeff(), 1e-11) << by_rows << static_cast<int>(how);
    }
    std::int64_t inertia[3];
    ASSERT_EQ(espalier_changed_inertia(changed, inertia), ESPALIER_OK);
    EXPECT_EQ(inertia[0], n - 1);
    EXPECT_EQ(inertia[1], 1);
    espalier_changed_destroy(changed);
    espalier_destroy(solver);
  }
}

}  // namespace complex_changed_cases_test

}  // namespace espalier::test
