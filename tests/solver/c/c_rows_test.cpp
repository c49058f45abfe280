// A few unknowns of solutions in the C interface. Truth: inverses of small matrices by hand.
#include <array>
#include <cmath>
#include <complex>
#include <string>
#include <vector>

#include "solver/c/c_handle.hpp"

namespace espalier {
namespace c_rows_test {

using namespace test;
using Complex = std::complex<double>;

template <class Matrix, class Int>
struct Small {
  std::vector<Int> pointers, indices;
  std::vector<double> values;
  int layout, storage, base, numbers;

  [[nodiscard]] Matrix matrix() const {
    Matrix a{};
    a.size = sizeof a;
    a.rows = a.cols = static_cast<std::int64_t>(pointers.size()) - 1;
    a.nonzeros = static_cast<std::int64_t>(indices.size());
    a.pointers = pointers.data();
    a.indices = indices.data();
    a.values = values.data();
    a.layout = layout;
    a.storage = storage;
    a.index_base = base;
    a.numbers = numbers;
    return a;
  }
};

template <class Matrix>
Handle factorized(const Matrix& a) {
  Handle s = make();
  EXPECT_EQ(espalier_set_option(s.get(), "threads", "2"), ESPALIER_OK);
  EXPECT_EQ(analyze(s.get(), a), ESPALIER_OK) << espalier_last_error(s.get());
  EXPECT_EQ(factorize(s.get(), a), ESPALIER_OK) << espalier_last_error(s.get());
  return s;
}

// [2 1 0; 0 4 0; 3 0 5]; its inverse, by rows.
constexpr double kInverse[3][3] = {{0.5, -0.125, 0}, {0, 0.25, 0}, {-0.3, 0.075, 0.2}};

template <class Matrix, class Int>
void check_real() {
  const Small<Matrix, Int> by_rows{{1, 3, 4, 6}, {1, 2, 2, 1, 3}, {2, 1, 4, 3, 5}, ESPALIER_CSR, 0, 1, 0};
  const Small<Matrix, Int> by_columns{{0, 2, 4, 5}, {0, 2, 0, 1, 2}, {2, 3, 1, 4, 5}, ESPALIER_CSC, 0, 0, 0};
  for (const auto& small : {by_rows, by_columns}) {
    const Handle s = factorized(small.matrix());
    // The second column has two entries in one place, the third none.
    const std::array<std::int64_t, 4> begin{0, 2, 4, 4};
    const std::array<std::int64_t, 4> rows{0, 2, 1, 1};
    const std::array<double, 4> values{2, -1, 3, 4};
    const double b[3][3] = {{2, 0, -1}, {0, 7, 0}, {0, 0, 0}};
    const std::array<std::int64_t, 4> wanted{2, 0, 1, 2};
    const espalier_columns columns{3, begin.data(), rows.data(), values.data()};
    for (const int how : {ESPALIER_NO_TRANSPOSE, ESPALIER_TRANSPOSE, ESPALIER_CONJUGATE_TRANSPOSE}) {
      std::vector<double> x(12);
      espalier_rows_info info{};
      info.size = sizeof info;
      ASSERT_EQ(espalier_solve_rows(s.get(), &columns, wanted.data(), 4, x.data(), 12, how, &info), ESPALIER_OK)
          << espalier_last_error(s.get());
      for (int c = 0; c < 3; ++c)
        for (std::size_t k = 0; k < 4; ++k) {
          double truth = 0;
          for (int i = 0; i < 3; ++i)
            truth += (how == ESPALIER_NO_TRANSPOSE ? kInverse[wanted[k]][i] : kInverse[i][wanted[k]]) * b[c][i];
          EXPECT_NEAR(x[static_cast<std::size_t>(c) * 4 + k], truth, 1e-14) << how << ' ' << c << ' ' << k;
        }
      EXPECT_GT(info.share, 0);
      EXPECT_LE(info.share, 1);
      EXPECT_LT(info.componentwise_error, 1e-14);
    }
  }
}

TEST(CRows, AreThoseOfTheInverse) {
  check_real<espalier_matrix_i32, std::int32_t>();
  check_real<espalier_matrix_i64, std::int64_t>();
}

// [p q; r t], general or Hermitian, by rows and by columns.
TEST(CRows, OfComplexMatricesKnowTransposesAndConjugates) {
  const auto check = [](const std::array<Complex, 4>& a, int layout, int storage) {
    const bool rows_first = layout == ESPALIER_CSR;
    Small<espalier_matrix_i32, std::int32_t> small{{}, {}, {}, layout, storage, 0, ESPALIER_COMPLEX};
    small.pointers = {0};
    for (int major = 0; major < 2; ++major) {
      for (int minor = 0; minor < 2; ++minor) {
        const int i = rows_first ? major : minor, j = rows_first ? minor : major;
        if (storage == ESPALIER_HERMITIAN_UPPER && i > j) continue;
        small.indices.push_back(minor);
        const Complex v = a[static_cast<std::size_t>(2 * i + j)];
        small.values.push_back(v.real());
        small.values.push_back(v.imag());
      }
      small.pointers.push_back(static_cast<std::int32_t>(small.indices.size()));
    }
    const Complex det = a[0] * a[3] - a[1] * a[2];
    const Complex inverse[2][2] = {{a[3] / det, -a[1] / det}, {-a[2] / det, a[0] / det}};
    const Handle s = factorized(small.matrix());
    const std::array<std::int64_t, 2> begin{0, 1};
    const std::array<std::int64_t, 1> row{1};
    const std::array<std::int64_t, 2> wanted{1, 0};
    const Complex load(0.5, -2);
    const espalier_columns columns{1, begin.data(), row.data(), reinterpret_cast<const double*>(&load)};
    for (const int how : {ESPALIER_NO_TRANSPOSE, ESPALIER_TRANSPOSE, ESPALIER_CONJUGATE_TRANSPOSE}) {
      std::array<Complex, 2> x;
      ASSERT_EQ(espalier_solve_rows(s.get(), &columns, wanted.data(), 2, reinterpret_cast<double*>(x.data()), 2, how,
                                    nullptr),
                ESPALIER_OK)
          << espalier_last_error(s.get());
      for (std::size_t k = 0; k < 2; ++k) {
        const auto w = static_cast<std::size_t>(wanted[k]);
        const Complex v = how == ESPALIER_NO_TRANSPOSE ? inverse[w][1]
                          : how == ESPALIER_TRANSPOSE  ? inverse[1][w]
                                                       : std::conj(inverse[1][w]);
        EXPECT_LT(std::abs(x[k] - v * load), 1e-14) << layout << ' ' << storage << ' ' << how;
      }
    }
  };
  const std::array<Complex, 4> general{Complex(3, 1), Complex(0, -1), Complex(1, 2), Complex(-2, 4)};
  const std::array<Complex, 4> hermitian{Complex(3, 0), Complex(1, -1), Complex(1, 1), Complex(4, 0)};
  for (const int layout : {ESPALIER_CSR, ESPALIER_CSC}) {
    check(general, layout, ESPALIER_GENERAL);
    check(hermitian, layout, ESPALIER_HERMITIAN_UPPER);
  }
}

TEST(CRows, BadArgumentsAreNamedAndTheFactorStays) {
  const Small<espalier_matrix_i32, std::int32_t> small{
      {1, 3, 4, 6}, {1, 2, 2, 1, 3}, {2, 1, 4, 3, 5}, ESPALIER_CSR, 0, 1, 0};
  const Handle s = make();
  std::array<std::int64_t, 2> begin{0, 1}, wanted{2, 0};
  std::array<std::int64_t, 1> row{0};
  std::array<double, 1> value{2};
  std::array<double, 2> x{};
  espalier_columns b{1, begin.data(), row.data(), value.data()};
  const auto call = [&](std::int64_t count = 2, int how = 0) {
    return espalier_solve_rows(s.get(), &b, wanted.data(), 2, x.data(), count, how, nullptr);
  };
  const auto said = [&](const char* words) {
    const std::string message = espalier_last_error(s.get());
    EXPECT_NE(message.find(words), std::string::npos) << message;
  };
  EXPECT_EQ(call(), ESPALIER_MISUSE);
  said("espalier_factorize");
  const espalier_matrix_i32 a = small.matrix();
  ASSERT_EQ(analyze(s.get(), a), ESPALIER_OK);
  EXPECT_EQ(call(), ESPALIER_MISUSE);
  ASSERT_EQ(factorize(s.get(), a), ESPALIER_OK);
  EXPECT_EQ(call(1), ESPALIER_MISUSE);
  said("unknowns times columns");
  EXPECT_EQ(call(2, 3), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_solve_rows(s.get(), nullptr, wanted.data(), 2, x.data(), 2, 0, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_solve_rows(s.get(), &b, nullptr, 2, x.data(), 2, 0, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_solve_rows(s.get(), &b, wanted.data(), -1, x.data(), -1, 0, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_solve_rows(nullptr, &b, wanted.data(), 2, x.data(), 2, 0, nullptr), ESPALIER_MISUSE);
  for (const std::int64_t columns : {std::int64_t{0}, std::int64_t{-3}, INT64_MAX}) {
    b.columns = columns;
    EXPECT_EQ(call(), ESPALIER_MISUSE);
  }
  b.columns = 1;
  b.values = nullptr;
  EXPECT_EQ(call(), ESPALIER_MISUSE);
  b.values = value.data();
  espalier_rows_info without_size{};
  EXPECT_EQ(espalier_solve_rows(s.get(), &b, wanted.data(), 2, x.data(), 2, 0, &without_size), ESPALIER_MISUSE);
  for (const std::int64_t wrong : {std::int64_t{-1}, std::int64_t{3}, std::int64_t{1} << 32, INT64_MIN}) {
    row[0] = wrong;
    EXPECT_EQ(call(), ESPALIER_INVALID_INPUT);
    said("entry 0");
    row[0] = 0;
    wanted[1] = wrong;
    EXPECT_EQ(call(), ESPALIER_INVALID_INPUT);
    said("unknown 1");
    wanted[1] = 0;
  }
  value[0] = std::nan("");
  EXPECT_EQ(call(), ESPALIER_INVALID_INPUT);
  said("not finite");
  value[0] = 2;
  begin[1] = -1;
  EXPECT_EQ(call(), ESPALIER_MISUSE);
  begin = {1, 1};
  EXPECT_EQ(call(), ESPALIER_INVALID_INPUT);
  said("columns");
  begin = {0, 1};
  ASSERT_EQ(call(), ESPALIER_OK) << espalier_last_error(s.get());
  EXPECT_NEAR(x[0], -0.6, 1e-15);
  EXPECT_NEAR(x[1], 1, 1e-15);
  // Nothing wanted.
  EXPECT_EQ(espalier_solve_rows(s.get(), &b, nullptr, 0, nullptr, 0, 0, nullptr), ESPALIER_OK);
}

}  // namespace c_rows_test
}  // namespace espalier
