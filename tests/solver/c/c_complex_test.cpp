// Complex systems through the C interface. Truth: Eigen's dense solutions of A, A^T and A^H, for every layout, storage
// and index base.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <complex>
#include <cstring>
#include <vector>

#include "solver/c/c_handle.hpp"
#include "solver/c/c_matrices.hpp"
#include "solver/complex_common.hpp"

namespace c_complex_test {

using Value = std::complex<double>;
using Dense = Eigen::MatrixXcd;
using espalier::test::analyze;
using espalier::test::factorize;
using espalier::test::Handle;
using espalier::test::make;
using espalier::test::matrix_for;
using Arrays = espalier::test::Arrays<std::int32_t>;

void solve_with_every_storage_layout_and_transpose(bool real_form) {
  const int n = 30;
  for (int storage = ESPALIER_GENERAL; storage <= ESPALIER_HERMITIAN_BOTH; ++storage)
    for (const int layout : {ESPALIER_CSC, ESPALIER_CSR})
      for (const int base : {0, 1}) {
        SCOPED_TRACE(testing::Message() << "storage " << storage << ", layout " << layout << ", base " << base);
        const Dense a = matrix_for(storage, n), b = Dense::Random(n, 2);
        const Arrays arrays(a, layout, storage, base);
        const Handle s = make();
        ASSERT_EQ(analyze(s.get(), arrays.c), ESPALIER_OK) << espalier_last_error(s.get());
        espalier_factor_info info{};
        info.size = sizeof info;
        ASSERT_EQ(factorize(s.get(), arrays.c, &info), ESPALIER_OK) << espalier_last_error(s.get());
        const Value determinant = a.determinant(), phase(info.determinant_phase[0], info.determinant_phase[1]);
        if (real_form && storage < ESPALIER_HERMITIAN_LOWER) {
          EXPECT_TRUE(std::isnan(phase.real()));
          EXPECT_EQ(info.determinant_sign, 1);
        } else {
          EXPECT_LE(std::abs(phase - determinant / std::abs(determinant)), 1e-9);
        }
        EXPECT_EQ(info.negative >= 0, storage >= ESPALIER_HERMITIAN_LOWER);
        for (const int t : {ESPALIER_NO_TRANSPOSE, ESPALIER_TRANSPOSE, ESPALIER_CONJUGATE_TRANSPOSE}) {
          const Dense m = t == ESPALIER_NO_TRANSPOSE ? a
                          : t == ESPALIER_TRANSPOSE  ? Dense(a.transpose())
                                                     : Dense(a.adjoint());
          Dense x(n, 2);
          ASSERT_EQ(espalier_solve(s.get(), reinterpret_cast<const double*>(b.data()),
                                   reinterpret_cast<double*>(x.data()), 2, t, nullptr),
                    ESPALIER_OK);
          EXPECT_LE((m * x - b).norm(), 1e-12 * m.norm() * x.norm()) << t;
        }
        double estimate = 0;
        EXPECT_EQ(espalier_condition_estimate(s.get(), &estimate), ESPALIER_OK);
        EXPECT_GT(estimate, 1);
        ASSERT_EQ(espalier_refactorize(s.get(), arrays.c.values, arrays.c.nonzeros, nullptr), ESPALIER_OK);
        espalier_solver* clone = nullptr;
        ASSERT_EQ(espalier_clone(s.get(), 1, &clone), ESPALIER_OK);
        const Handle other(clone);
        Dense x(n, 1);
        ASSERT_EQ(factorize(other.get(), arrays.c), ESPALIER_OK);
        ASSERT_EQ(espalier_solve(other.get(), reinterpret_cast<const double*>(b.data()),
                                 reinterpret_cast<double*>(x.data()), 1, ESPALIER_NO_TRANSPOSE, nullptr),
                  ESPALIER_OK);
        EXPECT_LE((a * x - b.col(0)).norm(), 1e-12 * a.norm() * x.norm());
      }
}

TEST(CComplex, SolvesWithEveryStorageLayoutAndTranspose) { solve_with_every_storage_layout_and_transpose(false); }

TEST(CComplex, SolvesRealFormsWithEveryStorageLayoutAndTranspose) {
  const espalier::test::AsRealForm form;
  solve_with_every_storage_layout_and_transpose(true);
}

// The matrix as stored, and in general storage, where the values say what it is. Row 7 depends on row 4 alone.
TEST(CComplex, NullVectorsAreThoseOfTheCallersMatrix) {
  const auto expect_null_space = [](espalier_solver* s, const Dense& a) {
    std::int64_t row = -1, found = 0;
    Eigen::VectorXcd v(20);
    ASSERT_EQ(espalier_null_space(s, 1, &row, reinterpret_cast<double*>(v.data()), &found), ESPALIER_OK);
    ASSERT_EQ(found, 1);
    EXPECT_TRUE(row == 4 || row == 7) << row;
    EXPECT_NEAR(v.cwiseAbs().maxCoeff(), 1, 1e-14);
    EXPECT_LE((a * v).norm(), 1e-13 * a.norm());
  };
  for (int values = ESPALIER_GENERAL; values <= ESPALIER_HERMITIAN_BOTH; ++values)
    for (const int storage : {values, static_cast<int>(ESPALIER_GENERAL)})
      for (const int layout : {ESPALIER_CSC, ESPALIER_CSR}) {
        SCOPED_TRACE(testing::Message() << "values " << values << ", storage " << storage << ", layout " << layout);
        Dense a = matrix_for(values, 20);
        const Value factor(1, 2), other = values >= ESPALIER_HERMITIAN_LOWER ? std::conj(factor) : factor;
        a.col(7) = factor * a.col(4);  // ... and the row likewise
        a.row(7) = other * a.row(4);
        a(7, 7) = other * factor * a(4, 4);
        const Arrays arrays(a, layout, storage, 0);
        const Handle s = make();
        ASSERT_EQ(espalier_set_option(s.get(), "singular", "report"), ESPALIER_OK);
        ASSERT_EQ(analyze(s.get(), arrays.c), ESPALIER_OK);
        ASSERT_EQ(factorize(s.get(), arrays.c), ESPALIER_OK) << espalier_last_error(s.get());
        expect_null_space(s.get(), a);
        espalier_solver* clone = nullptr;
        ASSERT_EQ(espalier_clone(s.get(), 1, &clone), ESPALIER_OK);
        const Handle second(clone);
        ASSERT_EQ(espalier_refactorize(clone, arrays.c.values, arrays.c.nonzeros, nullptr), ESPALIER_OK);
        expect_null_space(clone, a);
      }
}

TEST(CComplex, MisuseIsTold) {
  const Dense a = matrix_for(ESPALIER_HERMITIAN_LOWER, 9);
  Arrays arrays(a, ESPALIER_CSC, ESPALIER_HERMITIAN_LOWER, 0);
  const Handle s = make();
  espalier_matrix_i32 wrong = arrays.c;
  wrong.numbers = ESPALIER_REAL;
  EXPECT_EQ(analyze(s.get(), wrong), ESPALIER_MISUSE);
  wrong.numbers = 2;
  EXPECT_EQ(analyze(s.get(), wrong), ESPALIER_MISUSE);
  wrong.numbers = ESPALIER_COMPLEX;
  wrong.storage = 7;
  EXPECT_EQ(analyze(s.get(), wrong), ESPALIER_MISUSE);
  ASSERT_EQ(analyze(s.get(), arrays.c), ESPALIER_OK);
  wrong = arrays.c;
  wrong.numbers = ESPALIER_REAL;
  wrong.storage = ESPALIER_SYMMETRIC_LOWER;
  EXPECT_EQ(factorize(s.get(), wrong), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_refactorize_device(s.get(), arrays.c.values, arrays.c.nonzeros, nullptr, nullptr),
            ESPALIER_DEVICE_ERROR);
  arrays.values[1] += 1;  // an imaginary part
  EXPECT_EQ(factorize(s.get(), arrays.c), ESPALIER_INVALID_INPUT);
  EXPECT_EQ(espalier_last_error_row(s.get()), 0);
}

// A program that was compiled before complex numbers came has a shorter struct, and rubbish behind it.
TEST(CComplex, ShorterStructsAreReal) {
  const std::int32_t pointers[] = {0, 1}, indices[] = {0};
  const double values[] = {4};
  espalier_matrix_i32 a;
  std::memset(static_cast<void*>(&a), 0x55, sizeof a);
  a.size = offsetof(espalier_matrix_i32, numbers);
  a.rows = a.cols = a.nonzeros = 1;
  a.pointers = pointers;
  a.indices = indices;
  a.values = values;
  a.layout = ESPALIER_CSC;
  a.storage = ESPALIER_GENERAL;
  a.index_base = 0;
  const Handle s = make();
  ASSERT_EQ(analyze(s.get(), a), ESPALIER_OK);
  ASSERT_EQ(factorize(s.get(), a), ESPALIER_OK);
  double x = 1;
  ASSERT_EQ(espalier_solve(s.get(), &x, &x, 1, ESPALIER_CONJUGATE_TRANSPOSE, nullptr), ESPALIER_OK);
  EXPECT_EQ(x, 0.25);
}

}  // namespace c_complex_test
