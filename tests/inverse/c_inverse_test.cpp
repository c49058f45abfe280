// The C interface. Truth: dense inverses of small systems by hand.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "espalier/espalier.h"

namespace {

// [2 1 0; 0 4 0; 3 0 5], determinant 40, by rows from 1.
template <class Matrix, class Int>
struct Small {
  std::array<Int, 4> pointers{1, 3, 4, 6};
  std::array<Int, 5> indices{1, 2, 2, 1, 3};
  std::array<double, 5> values{2, 1, 4, 3, 5};
  Matrix matrix() const {
    Matrix a{};
    a.size = sizeof a;
    a.rows = a.cols = 3;
    a.nonzeros = 5;
    a.pointers = pointers.data();
    a.indices = indices.data();
    a.values = values.data();
    a.layout = ESPALIER_CSR;
    a.index_base = 1;
    return a;
  }
};
// Its inverse, by rows.
constexpr double kInverse[3][3] = {{0.5, -0.125, 0}, {0, 0.25, 0}, {-0.3, 0.075, 0.2}};

int analyze(espalier_solver* s, const espalier_matrix_i32& a) { return espalier_analyze_i32(s, &a, nullptr); }
int analyze(espalier_solver* s, const espalier_matrix_i64& a) { return espalier_analyze_i64(s, &a, nullptr); }
int factorize(espalier_solver* s, const espalier_matrix_i32& a) { return espalier_factorize_i32(s, &a, nullptr); }
int factorize(espalier_solver* s, const espalier_matrix_i64& a) { return espalier_factorize_i64(s, &a, nullptr); }
int selected(espalier_solver* s, const espalier_matrix_i32& a, double* x, int t, espalier_inverse_info* info) {
  return espalier_selected_inverse_i32(s, &a, x, a.nonzeros, t, info);
}
int selected(espalier_solver* s, const espalier_matrix_i64& a, double* x, int t, espalier_inverse_info* info) {
  return espalier_selected_inverse_i64(s, &a, x, a.nonzeros, t, info);
}
int trace_of(espalier_solver* s, const espalier_matrix_i32& a, double* t, espalier_inverse_info* info) {
  return espalier_trace_of_inverse_i32(s, &a, t, info);
}
int trace_of(espalier_solver* s, const espalier_matrix_i64& a, double* t, espalier_inverse_info* info) {
  return espalier_trace_of_inverse_i64(s, &a, t, info);
}

template <class Matrix, class Int>
void check_entries() {
  const Small<Matrix, Int> small;
  const Matrix a = small.matrix();
  // The same matrix by columns, from 0.
  const std::array<Int, 4> pointers{0, 2, 4, 5};
  const std::array<Int, 5> indices{0, 2, 0, 1, 2};
  const std::array<double, 5> values{2, 3, 1, 4, 5};
  Matrix by_columns = a;
  by_columns.pointers = pointers.data();
  by_columns.indices = indices.data();
  by_columns.values = values.data();
  by_columns.layout = ESPALIER_CSC;
  by_columns.index_base = 0;
  for (const Matrix& given : {a, by_columns}) {
    espalier_solver* s = nullptr;
    ASSERT_EQ(espalier_create(&s), ESPALIER_OK);
    ASSERT_EQ(analyze(s, given), ESPALIER_OK) << espalier_last_error(s);
    std::array<double, 5> x{};
    EXPECT_EQ(selected(s, a, x.data(), 0, nullptr), ESPALIER_MISUSE);
    ASSERT_EQ(factorize(s, given), ESPALIER_OK);
    for (const bool transpose : {false, true})
      for (const bool columns : {false, true}) {
        espalier_inverse_info info{};
        info.size = sizeof info;
        ASSERT_EQ(selected(s, columns ? by_columns : a, x.data(), transpose ? 1 : 0, &info), ESPALIER_OK)
            << espalier_last_error(s);
        const int rows[2][5] = {{0, 0, 1, 2, 2}, {0, 2, 0, 1, 2}}, cols[2][5] = {{0, 1, 1, 0, 2}, {0, 0, 1, 1, 2}};
        for (int q = 0; q < 5; ++q) {
          const int r = rows[columns ? 1 : 0][q], c = cols[columns ? 1 : 0][q];
          EXPECT_NEAR(x[static_cast<std::size_t>(q)], transpose ? kInverse[c][r] : kInverse[r][c], 1e-15);
        }
        EXPECT_LE(info.error, 1e-15);
        EXPECT_EQ(info.checked, 3);
        EXPECT_GT(info.seconds, 0);
      }
    std::array<double, 9> block{};
    EXPECT_EQ(espalier_inverse_blocks(s, 3, block.data(), 9, nullptr), ESPALIER_OK);
    for (int c = 0; c < 3; ++c)
      for (int r = 0; r < 3; ++r) EXPECT_NEAR(block[static_cast<std::size_t>(3 * c + r)], kInverse[r][c], 1e-15);
    EXPECT_EQ(espalier_inverse_blocks(s, 1, block.data(), 3, nullptr), ESPALIER_OK);
    EXPECT_NEAR(block[1], 0.25, 1e-15);
    EXPECT_EQ(espalier_inverse_blocks(s, 2, block.data(), 6, nullptr), ESPALIER_MISUSE);
    EXPECT_EQ(espalier_inverse_blocks(s, 1, block.data(), 4, nullptr), ESPALIER_MISUSE);
    double trace = 0;
    espalier_inverse_info info{};
    info.size = sizeof info;
    for (const Matrix& b : {a, by_columns}) {
      ASSERT_EQ(trace_of(s, b, &trace, &info), ESPALIER_OK) << espalier_last_error(s);
      EXPECT_NEAR(trace, 3, 1e-14);
      EXPECT_GT(info.trace_error, 0);
    }
    Matrix shifted = a;  // a pattern alone
    shifted.values = nullptr;
    EXPECT_EQ(selected(s, shifted, x.data(), 0, nullptr), ESPALIER_OK);
    EXPECT_NE(trace_of(s, shifted, &trace, nullptr), ESPALIER_OK);
    EXPECT_EQ(selected(s, a, nullptr, 0, nullptr), ESPALIER_MISUSE);
    EXPECT_EQ(selected(s, a, x.data(), 3, nullptr), ESPALIER_MISUSE);
    Matrix complex = a;
    complex.numbers = ESPALIER_COMPLEX;
    EXPECT_EQ(trace_of(s, complex, &trace, nullptr), ESPALIER_MISUSE);
    espalier_destroy(s);
  }
}

}  // namespace

TEST(CInverse, EntriesBlocksAndTraces) {
  check_entries<espalier_matrix_i32, int32_t>();
  check_entries<espalier_matrix_i64, int64_t>();
}

// [2 i; -i 2], Hermitian: its inverse is [2 -i; i 2] / 3.
TEST(CInverse, Hermitian) {
  for (const int layout : {ESPALIER_CSC, ESPALIER_CSR}) {
    // Lower triangle: by columns (0,0) (1,0) (1,1), by rows (0,0) (1,0) (1,1).
    const std::array<int32_t, 3> by_columns{0, 2, 3}, by_rows{0, 1, 3};
    const std::array<int32_t, 3> rows{0, 1, 1}, cols{0, 0, 1};
    const std::array<double, 6> values{2, 0, 0, -1, 2, 0};
    espalier_matrix_i32 a{};
    a.size = sizeof a;
    a.rows = a.cols = 2;
    a.nonzeros = 3;
    a.pointers = layout == ESPALIER_CSC ? by_columns.data() : by_rows.data();
    a.indices = layout == ESPALIER_CSC ? rows.data() : cols.data();
    a.values = values.data();
    a.layout = layout;
    a.storage = ESPALIER_HERMITIAN_LOWER;
    a.numbers = ESPALIER_COMPLEX;
    espalier_solver* s = nullptr;
    ASSERT_EQ(espalier_create(&s), ESPALIER_OK);
    ASSERT_EQ(espalier_analyze_i32(s, &a, nullptr), ESPALIER_OK) << espalier_last_error(s);
    ASSERT_EQ(espalier_factorize_i32(s, &a, nullptr), ESPALIER_OK);
    std::array<double, 6> x{};
    for (const int transpose : {0, 1, 2}) {
      ASSERT_EQ(espalier_selected_inverse_i32(s, &a, x.data(), 3, transpose, nullptr), ESPALIER_OK);
      EXPECT_NEAR(x[0], 2.0 / 3, 1e-15);
      EXPECT_NEAR(x[3], transpose == 1 ? -1.0 / 3 : 1.0 / 3, 1e-15) << layout << transpose;  // entry (1, 0)
    }
    std::array<double, 8> block{};
    ASSERT_EQ(espalier_inverse_blocks(s, 2, block.data(), 4, nullptr), ESPALIER_OK);
    EXPECT_NEAR(block[3], 1.0 / 3, 1e-15);   // row 1, column 0
    EXPECT_NEAR(block[5], -1.0 / 3, 1e-15);  // row 0, column 1
    std::array<double, 2> trace{};
    ASSERT_EQ(espalier_trace_of_inverse_i32(s, &a, trace.data(), nullptr), ESPALIER_OK);
    EXPECT_NEAR(trace[0], 2, 1e-14);
    EXPECT_NEAR(trace[1], 0, 1e-14);
    espalier_destroy(s);
  }
}
