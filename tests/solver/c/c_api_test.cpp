// The C interface. Truths: the closed-form solution of the second difference, b made from a known x, the documented
// status of every kind of misuse.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <thread>
#include <tuple>
#include <type_traits>
#include <vector>

#include "solver/c/c_handle.hpp"

namespace c_api_test {

constexpr double kEps = std::numeric_limits<double>::epsilon();

using espalier::test::analyze;
using espalier::test::factorize;
using espalier::test::Handle;
using espalier::test::make;

/// A matrix in the arrays of one layout, with the C struct that points at them.
template <class Int>
struct Arrays {
  using Matrix = std::conditional_t<sizeof(Int) == 4, espalier_matrix_i32, espalier_matrix_i64>;
  std::vector<Int> pointers, indices;
  std::vector<double> values;
  Matrix matrix{};

  /// Takes the entries of the dense n x n matrix (row after row) that lie in `storage` and differ from zero.
  Arrays(const std::vector<double>& dense, int n, int layout, int storage, int base) {
    pointers.push_back(static_cast<Int>(base));
    for (int outer = 0; outer < n; ++outer) {
      for (int inner = 0; inner < n; ++inner) {
        const int row = layout == ESPALIER_CSR ? outer : inner;
        const int col = layout == ESPALIER_CSR ? inner : outer;
        const double value = dense[static_cast<std::size_t>(row * n + col)];
        if (value == 0 || (storage == ESPALIER_SYMMETRIC_LOWER && row < col) ||
            (storage == ESPALIER_SYMMETRIC_UPPER && row > col)) {
          continue;
        }
        indices.push_back(static_cast<Int>(inner + base));
        values.push_back(value);
      }
      pointers.push_back(static_cast<Int>(indices.size()) + static_cast<Int>(base));
    }
    matrix.size = sizeof matrix;
    matrix.rows = matrix.cols = n;
    matrix.nonzeros = static_cast<int64_t>(indices.size());
    matrix.pointers = pointers.data();
    matrix.indices = indices.data();
    matrix.values = values.data();
    matrix.layout = layout;
    matrix.storage = storage;
    matrix.index_base = base;
  }
};

std::vector<double> second_difference(int n) {
  std::vector<double> dense(static_cast<std::size_t>(n * n));
  for (int i = 0; i < n; ++i) {
    dense[static_cast<std::size_t>(i * n + i)] = 2;
    if (i > 0) dense[static_cast<std::size_t>(i * n + i - 1)] = -1;
    if (i + 1 < n) dense[static_cast<std::size_t>(i * n + i + 1)] = -1;
  }
  return dense;
}

/// The second difference of x is -1 and x is 0 at both ends: x_i = (i + 1) (n - i) / 2. The condition number is about
/// (2 n / pi)^2 / 2, so the error may reach n^2 eps times the largest x.
void expect_parabola(const std::vector<double>& x, double scale = 1) {
  const int n = static_cast<int>(x.size());
  for (int i = 0; i < n; ++i) {
    const double exact = scale * 0.5 * (i + 1) * (n - i);
    EXPECT_NEAR(x[static_cast<std::size_t>(i)], exact, n * n * kEps * scale * n * n / 8) << "at " << i;
  }
}

template <class Int>
void solve_parabola(int layout, int storage, int base) {
  constexpr int n = 37;
  const Arrays<Int> a(second_difference(n), n, layout, storage, base);
  const Handle s = make();
  ASSERT_EQ(analyze(s.get(), a.matrix), ESPALIER_OK) << espalier_last_error(s.get());
  ASSERT_EQ(factorize(s.get(), a.matrix), ESPALIER_OK) << espalier_last_error(s.get());
  std::vector<double> x(n, 1.0);
  espalier_solve_info info{};
  info.size = sizeof info;
  ASSERT_EQ(espalier_solve(s.get(), x.data(), x.data(), 1, ESPALIER_NO_TRANSPOSE, &info), ESPALIER_OK);
  EXPECT_LE(info.backward_error, n * kEps);
  expect_parabola(x);

  std::vector<double> doubled = a.values;
  for (double& v : doubled) v *= 2;
  ASSERT_EQ(espalier_refactorize(s.get(), doubled.data(), static_cast<int64_t>(doubled.size()), nullptr), ESPALIER_OK);
  x.assign(n, 1.0);
  ASSERT_EQ(espalier_solve(s.get(), x.data(), x.data(), 1, ESPALIER_NO_TRANSPOSE, nullptr), ESPALIER_OK);
  expect_parabola(x, 0.5);
}

class CApiLayouts : public testing::TestWithParam<std::tuple<int, int, int>> {};

TEST_P(CApiLayouts, Solves32And64Bit) {
  const auto [layout, storage, base] = GetParam();
  solve_parabola<int32_t>(layout, storage, base);
  solve_parabola<int64_t>(layout, storage, base);
}

INSTANTIATE_TEST_SUITE_P(All, CApiLayouts,
                         testing::Combine(testing::Values(ESPALIER_CSC, ESPALIER_CSR),
                                          testing::Values(ESPALIER_GENERAL, ESPALIER_SYMMETRIC_LOWER,
                                                          ESPALIER_SYMMETRIC_UPPER, ESPALIER_SYMMETRIC_BOTH),
                                          testing::Values(0, 1)));

/// Upwind convection-diffusion: unsymmetric, rows diagonally dominant.
std::vector<double> convection(int n) {
  std::vector<double> dense = second_difference(n);
  for (int i = 0; i < n; ++i) {
    dense[static_cast<std::size_t>(i * n + i)] += 1.5;
    if (i > 0) dense[static_cast<std::size_t>(i * n + i - 1)] -= 1.25;
    if (i + 5 < n) dense[static_cast<std::size_t>(i * n + i + 5)] = 0.125;
  }
  return dense;
}

/// b = A x or A^T x for a dense A: all terms are small binary fractions, so b is exact.
std::vector<double> product(const std::vector<double>& dense, const std::vector<double>& x, bool transposed) {
  const std::size_t n = x.size();
  std::vector<double> b(n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      b[transposed ? j : i] += dense[i * n + j] * x[transposed ? i : j];
    }
  }
  return b;
}

TEST(CApi, UnsymmetricByRowsAndColumnsBothWays) {
  constexpr int n = 50;
  const auto dense = convection(n);
  std::vector<double> exact(n);
  for (int i = 0; i < n; ++i) exact[static_cast<std::size_t>(i)] = (i * 7 % 11) - 5;
  for (const int layout : {ESPALIER_CSC, ESPALIER_CSR}) {
    const Arrays<int32_t> a(dense, n, layout, ESPALIER_GENERAL, 1);
    const Handle s = make();
    ASSERT_EQ(analyze(s.get(), a.matrix), ESPALIER_OK) << espalier_last_error(s.get());
    ASSERT_EQ(factorize(s.get(), a.matrix), ESPALIER_OK) << espalier_last_error(s.get());
    for (const int transpose : {ESPALIER_NO_TRANSPOSE, ESPALIER_TRANSPOSE}) {
      const auto b = product(dense, exact, transpose == ESPALIER_TRANSPOSE);
      std::vector<double> x(n);
      ASSERT_EQ(espalier_solve(s.get(), b.data(), x.data(), 1, transpose, nullptr), ESPALIER_OK);
      for (int i = 0; i < n; ++i) {
        // The condition number is below 100.
        EXPECT_NEAR(x[static_cast<std::size_t>(i)], exact[static_cast<std::size_t>(i)], 100 * n * kEps)
            << "layout " << layout << " transpose " << transpose;
      }
    }
  }
}

TEST(CApi, InfosCarryTheFigures) {
  const Arrays<int32_t> a({2, 1, 1, -3}, 2, ESPALIER_CSC, ESPALIER_SYMMETRIC_BOTH, 0);
  const Handle s = make();
  espalier_analysis_info analysis{};
  analysis.size = sizeof analysis;
  espalier_factor_info factor{};
  factor.size = sizeof factor;
  ASSERT_EQ(espalier_set_option(s.get(), "kind", "ldlt"), ESPALIER_OK);
  ASSERT_EQ(analyze(s.get(), a.matrix, &analysis), ESPALIER_OK) << espalier_last_error(s.get());
  ASSERT_EQ(factorize(s.get(), a.matrix, &factor), ESPALIER_OK) << espalier_last_error(s.get());
  EXPECT_GE(analysis.nonzeros_factor, 3);
  EXPECT_GE(analysis.fronts, 1);
  EXPECT_GT(analysis.predicted_bytes, 0);
  EXPECT_EQ(factor.positive, 1);  // det = -7: one eigenvalue of each sign
  EXPECT_EQ(factor.negative, 1);
  EXPECT_EQ(factor.zero, 0);
  EXPECT_EQ(factor.determinant_sign, -1);
  EXPECT_NEAR(factor.determinant_log, std::log(7.0), 8 * kEps);
}

TEST(CApi, AShorterInfoOfAnOlderProgramIsNotOverrun) {
  const Arrays<int32_t> a({4}, 1, ESPALIER_CSC, ESPALIER_SYMMETRIC_LOWER, 0);
  const Handle s = make();
  struct {
    espalier_factor_info info;
  } place;
  std::memset(&place, 0x5a, sizeof place);
  place.info.size = offsetof(espalier_factor_info, positive);
  ASSERT_EQ(analyze(s.get(), a.matrix), ESPALIER_OK) << espalier_last_error(s.get());
  ASSERT_EQ(factorize(s.get(), a.matrix, &place.info), ESPALIER_OK);
  EXPECT_EQ(place.info.size, offsetof(espalier_factor_info, positive));
  EXPECT_EQ(place.info.positive, 0x5a5a5a5a5a5a5a5a);
  EXPECT_GE(place.info.seconds, 0);
}

TEST(CApi, MisuseIsTurnedAway) {
  EXPECT_EQ(espalier_create(nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_set_option(nullptr, "kind", "llt"), ESPALIER_MISUSE);
  EXPECT_STRNE(espalier_last_error(nullptr), "");
  espalier_destroy(nullptr);

  const Arrays<int32_t> a({4}, 1, ESPALIER_CSC, ESPALIER_SYMMETRIC_LOWER, 0);
  const Handle s = make();
  double x = 1;
  EXPECT_EQ(espalier_solve(s.get(), &x, &x, 1, 0, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(factorize(s.get(), a.matrix), ESPALIER_MISUSE);
  EXPECT_NE(std::string(espalier_last_error(s.get())).find("espalier_analyze"), std::string::npos);
  EXPECT_EQ(espalier_analyze_i32(s.get(), nullptr, nullptr), ESPALIER_MISUSE);
  auto wrong = a.matrix;
  wrong.size = 0;
  EXPECT_EQ(analyze(s.get(), wrong), ESPALIER_MISUSE);
  wrong = a.matrix;
  wrong.index_base = 2;
  EXPECT_EQ(analyze(s.get(), wrong), ESPALIER_MISUSE);
  wrong = a.matrix;
  wrong.storage = 17;
  EXPECT_EQ(analyze(s.get(), wrong), ESPALIER_MISUSE);
  wrong = a.matrix;
  wrong.pointers = nullptr;
  EXPECT_EQ(analyze(s.get(), wrong), ESPALIER_MISUSE);

  ASSERT_EQ(analyze(s.get(), a.matrix), ESPALIER_OK) << espalier_last_error(s.get());
  EXPECT_STREQ(espalier_last_error(s.get()), "");
  wrong = a.matrix;
  wrong.values = nullptr;
  EXPECT_EQ(factorize(s.get(), wrong), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_refactorize(s.get(), a.values.data(), 2, nullptr), ESPALIER_MISUSE);
  ASSERT_EQ(factorize(s.get(), a.matrix), ESPALIER_OK);
  EXPECT_EQ(espalier_solve(s.get(), &x, &x, 1, 5, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_solve(s.get(), nullptr, &x, 1, 0, nullptr), ESPALIER_MISUSE);
  EXPECT_EQ(espalier_solve(s.get(), &x, &x, -1, 0, nullptr), ESPALIER_MISUSE);
  ASSERT_EQ(espalier_solve(s.get(), &x, &x, 1, 0, nullptr), ESPALIER_OK);
  EXPECT_EQ(x, 0.25);
}

template <class Int>
void expect_broken_arrays_refused() {
  const auto dense = second_difference(4);
  const Handle s = make();
  const auto refuse = [&](const char* what, const auto& spoil) {
    Arrays<Int> a(dense, 4, ESPALIER_CSR, ESPALIER_GENERAL, 1);
    spoil(a);
    EXPECT_EQ(analyze(s.get(), a.matrix), ESPALIER_INVALID_INPUT) << what;
    EXPECT_STRNE(espalier_last_error(s.get()), "") << what;
  };
  refuse("pointers begin elsewhere", [](auto& a) { a.pointers[0] = 0; });
  refuse("pointers fall", [](auto& a) { a.pointers[2] = 2; });
  refuse("pointers pass the end", [](auto& a) { a.pointers[3] = 1000; });
  refuse("pointers end early", [](auto& a) { a.pointers[4] -= 1; });
  refuse("index below the base", [](auto& a) { a.indices[3] = 0; });
  refuse("index past the end", [](auto& a) { a.indices[3] = 5; });
  refuse("negative index", [](auto& a) { a.indices[0] = -7; });
  refuse("rectangular", [](auto& a) { a.matrix.cols = 9; });
  refuse("negative size", [](auto& a) { a.matrix.rows = a.matrix.cols = -4; });
  refuse("not a number", [](auto& a) { a.values[2] = std::nan(""); });
  refuse("infinite", [](auto& a) { a.values[2] = INFINITY; });
}

TEST(CApi, BrokenArraysAreRefused) {
  expect_broken_arrays_refused<int32_t>();
  expect_broken_arrays_refused<int64_t>();
  Arrays<int64_t> large(second_difference(4), 4, ESPALIER_CSC, ESPALIER_GENERAL, 0);
  large.indices[1] = int64_t{1} << 32;  // would be 0 if it were cut to 32 bits
  const Handle s = make();
  EXPECT_EQ(analyze(s.get(), large.matrix), ESPALIER_INVALID_INPUT);
}

TEST(CApi, OptionsByName) {
  const Handle s = make();
  EXPECT_EQ(espalier_set_option(s.get(), "host_memory", "2GiB"), ESPALIER_OK);
  EXPECT_EQ(espalier_set_option(s.get(), "host-memory", "512m"), ESPALIER_OK);
  EXPECT_EQ(espalier_set_option(s.get(), "threads", "2"), ESPALIER_OK);
  EXPECT_EQ(espalier_set_option(s.get(), "device", "host:1,1"), ESPALIER_OK);
  for (const auto& [key, value] : std::vector<std::pair<const char*, const char*>>{{"kind", "qr"},
                                                                                   {"threads", "two"},
                                                                                   {"threads", "-1"},
                                                                                   {"threads", "1x"},
                                                                                   {"host_memory", "2 GB!"},
                                                                                   {"host_memory", "-2G"},
                                                                                   {"host_memory", "1e30"},
                                                                                   {"host_memory", ""},
                                                                                   {"device", "host:0"},
                                                                                   {"device", "host:1,"},
                                                                                   {"device", "gpu:"},
                                                                                   {"pivot_threshold", "nan"},
                                                                                   {"colour", "red"}}) {
    EXPECT_EQ(espalier_set_option(s.get(), key, value), ESPALIER_INVALID_INPUT) << key << " = " << value;
    EXPECT_NE(std::string(espalier_last_error(s.get())).find(key), std::string::npos) << espalier_last_error(s.get());
  }
}

TEST(CApi, FailuresHaveTheirNumbers) {
  const Handle s = make();
  const Arrays<int32_t> indefinite({1, 2, 2, 1}, 2, ESPALIER_CSC, ESPALIER_SYMMETRIC_BOTH, 0);
  ASSERT_EQ(espalier_set_option(s.get(), "kind", "llt"), ESPALIER_OK);
  ASSERT_EQ(analyze(s.get(), indefinite.matrix), ESPALIER_OK) << espalier_last_error(s.get());
  EXPECT_EQ(factorize(s.get(), indefinite.matrix), ESPALIER_NOT_POSITIVE_DEFINITE);
  EXPECT_STRNE(espalier_last_error(s.get()), "");

  const Handle t = make();
  Arrays<int32_t> empty_row({1, 0, 0, 0, 0, 0, 0, 0, 1}, 3, ESPALIER_CSC, ESPALIER_GENERAL, 0);
  int code = analyze(t.get(), empty_row.matrix);
  if (code == ESPALIER_OK) code = factorize(t.get(), empty_row.matrix);
  EXPECT_EQ(code, ESPALIER_SINGULAR);
  EXPECT_NE(std::string(espalier_last_error(t.get())).find('1'), std::string::npos) << "names the row";
}

void count_lines(const char* line, void* user) {
  EXPECT_NE(line, nullptr);
  ++*static_cast<int*>(user);
}

struct Reentry {
  espalier_solver* solver;
  int worst = ESPALIER_MISUSE;
};
void call_back(const char*, void* user) {
  auto* reentry = static_cast<Reentry*>(user);
  const int code = espalier_set_option(reentry->solver, "threads", "1");
  if (code != ESPALIER_MISUSE) reentry->worst = code;
}

TEST(CApi, LogLinesReachTheCallback) {
  const Arrays<int32_t> a(second_difference(20), 20, ESPALIER_CSC, ESPALIER_SYMMETRIC_LOWER, 0);
  const Handle s = make();
  int lines = 0;
  ASSERT_EQ(espalier_set_log(s.get(), count_lines, &lines), ESPALIER_OK);
  ASSERT_EQ(analyze(s.get(), a.matrix), ESPALIER_OK) << espalier_last_error(s.get());
  ASSERT_EQ(factorize(s.get(), a.matrix), ESPALIER_OK);
  EXPECT_GT(lines, 0);

  Reentry reentry{s.get()};
  ASSERT_EQ(espalier_set_log(s.get(), call_back, &reentry), ESPALIER_OK);
  EXPECT_EQ(analyze(s.get(), a.matrix), ESPALIER_OK);
  EXPECT_EQ(reentry.worst, ESPALIER_MISUSE);
}

TEST(CApi, ThreadsShareOneSolverAndUseTheirOwn) {
  constexpr int n = 25;
  const Arrays<int64_t> a(second_difference(n), n, ESPALIER_CSC, ESPALIER_SYMMETRIC_LOWER, 0);
  const Handle shared = make();
  ASSERT_EQ(espalier_set_option(shared.get(), "threads", "1"), ESPALIER_OK);
  ASSERT_EQ(analyze(shared.get(), a.matrix), ESPALIER_OK) << espalier_last_error(shared.get());
  ASSERT_EQ(factorize(shared.get(), a.matrix), ESPALIER_OK);
  std::atomic<int> good = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      const Handle own = make();
      espalier_set_option(own.get(), "threads", "1");
      for (int round = 0; round < 5; ++round) {
        std::vector<double> x(n, 1.0), y(n, 1.0);
        const bool ok = espalier_solve(shared.get(), x.data(), x.data(), 1, 0, nullptr) == ESPALIER_OK &&
                        analyze(own.get(), a.matrix) == ESPALIER_OK && factorize(own.get(), a.matrix) == ESPALIER_OK &&
                        espalier_solve(own.get(), y.data(), y.data(), 1, 0, nullptr) == ESPALIER_OK;
        if (ok && x == y) ++good;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(good, 20);
}

// Columns 0 and 1 of [1 2 3; 2 4 7; 0 0 1] are parallel: A v = 0 for v = (1, -1/2, 0) alone, whichever way A is stored,
// while the left null vector is another one. Any two rows are independent with the third.
TEST(CApi, NullSpaceIsThatOfTheCallersMatrix) {
  const std::vector<double> dense = {1, 2, 3, 2, 4, 7, 0, 0, 1};
  for (const int layout : {ESPALIER_CSR, ESPALIER_CSC})
    for (const char* answer : {"report", "error"}) {
      SCOPED_TRACE(testing::Message() << "layout " << layout << ", " << answer);
      const Arrays<int64_t> a(dense, 3, layout, ESPALIER_GENERAL, 1);
      const Handle s = make();
      ASSERT_EQ(espalier_set_option(s.get(), "singular", answer), ESPALIER_OK);
      ASSERT_EQ(analyze(s.get(), a.matrix), ESPALIER_OK);
      int64_t found = -1, row = -1;
      std::vector<double> v(3, -7.0);
      EXPECT_EQ(espalier_null_space(s.get(), 1, &row, v.data(), &found), ESPALIER_OK);
      EXPECT_EQ(found, 0) << "nothing is factorized";
      EXPECT_EQ(factorize(s.get(), a.matrix), std::string(answer) == "error" ? ESPALIER_SINGULAR : ESPALIER_OK);
      ASSERT_EQ(espalier_null_space(s.get(), 1, &row, v.data(), &found), ESPALIER_OK);
      EXPECT_EQ(found, 1);
      EXPECT_TRUE(row >= 0 && row < 3);
      EXPECT_NEAR(v[0] / std::abs(v[0]) * v[1], -0.5, 1e-14);
      EXPECT_NEAR(std::abs(v[0]), 1, 1e-14);
      EXPECT_NEAR(v[2], 0, 1e-14);
      EXPECT_EQ(espalier_null_space(s.get(), 0, nullptr, nullptr, &found), ESPALIER_OK);
      EXPECT_EQ(found, 1);
      EXPECT_EQ(espalier_null_space(s.get(), -1, nullptr, nullptr, &found), ESPALIER_MISUSE);
      EXPECT_EQ(espalier_null_space(s.get(), 1, nullptr, nullptr, nullptr), ESPALIER_MISUSE);
    }
}

// Where the layouts differ, what is said is of the caller's rows and columns.
TEST(CApi, ErrorsNameTheCallersRowsAndColumns) {
  std::vector<double> dense = {4, 1, 0, 0, 4, 1, 2, 0, 4};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const int layout : {ESPALIER_CSR, ESPALIER_CSC})
    for (const int storage : {ESPALIER_GENERAL, ESPALIER_SYMMETRIC_UPPER}) {
      SCOPED_TRACE(testing::Message() << "layout " << layout << ", storage " << storage);
      const bool by_rows = layout == ESPALIER_CSR;
      std::vector<double> bad = dense;
      bad[5] = nan;
      const Arrays<int32_t> a(dense, 3, layout, storage, 0), b(bad, 3, layout, storage, 0);
      const Handle s = make();
      ASSERT_EQ(analyze(s.get(), a.matrix), ESPALIER_OK) << espalier_last_error(s.get());
      EXPECT_EQ(espalier_last_error_column(s.get()), -1);
      EXPECT_EQ(factorize(s.get(), b.matrix), ESPALIER_INVALID_INPUT);
      EXPECT_NE(std::string(espalier_last_error(s.get())).find("entry (1, 2) is nan"), std::string::npos)
          << espalier_last_error(s.get());
      EXPECT_EQ(espalier_last_error_row(s.get()), by_rows ? -1 : 1);
      EXPECT_EQ(espalier_last_error_column(s.get()), by_rows ? 2 : -1);
      EXPECT_EQ(espalier_refactorize(s.get(), b.values.data(), b.matrix.nonzeros, nullptr), ESPALIER_INVALID_INPUT);
      EXPECT_NE(std::string(espalier_last_error(s.get())).find("entry (1, 2) is nan"), std::string::npos);
      ASSERT_EQ(factorize(s.get(), a.matrix), ESPALIER_OK);
      EXPECT_EQ(espalier_last_error_column(s.get()), -1);
    }
  // Row 1 has no entry, columns 0 and 1 have: by rows the solver finds a column without partner.
  const Arrays<int32_t> hollow({1, 1, 0, 0, 0, 0, 0, 1, 1}, 3, ESPALIER_CSR, ESPALIER_GENERAL, 0);
  const Handle s = make();
  EXPECT_EQ(analyze(s.get(), hollow.matrix), ESPALIER_SINGULAR);
  const std::string text = espalier_last_error(s.get());
  EXPECT_NE(text.find("its 3 columns can be matched to rows"), std::string::npos) << text;
  EXPECT_EQ(espalier_last_error_row(s.get()), -1);
  EXPECT_GE(espalier_last_error_column(s.get()), 0);
  EXPECT_EQ(espalier_last_error_column(nullptr), -1);
}

TEST(CApi, NamesAndVersion) {
  EXPECT_STREQ(espalier_status_name(ESPALIER_SINGULAR), "singular");
  EXPECT_STREQ(espalier_status_name(ESPALIER_MISUSE), "misuse");
  EXPECT_STREQ(espalier_status_name(12345), "unknown");
  EXPECT_STRNE(espalier_version(), "");
}

}  // namespace c_api_test
