// Products, layout and substitution of the host kernels against their definitions in extended precision, for every
// instruction set that this processor runs. Bounds: the error of a sum of k products is at most (k + 2) eps times the
// sum of magnitudes (Higham, Accuracy and Stability, 3.1).
#include "device/host/kernels/kernels.hpp"

#include <algorithm>

#include "device/dense_reference.hpp"
#include "gemm.hpp"

namespace espalier::device::host {
namespace kernels_test {

using namespace testing;

template <class T>
class KernelsTest : public ::testing::Test {};
using Types = ::testing::Types<double, float>;
TYPED_TEST_SUITE(KernelsTest, Types);

struct Size {
  std::int64_t m, n, k;
};

template <class T>
std::vector<Size> sizes() {
  constexpr std::int64_t p = kPanel<T>;
  std::vector<Size> list;
  for (const std::int64_t m : {std::int64_t{0}, std::int64_t{1}, p - 1, p, p + 1, 3 * p - 1, 3 * p, 3 * p + 1}) {
    for (const std::int64_t n : {std::int64_t{0}, std::int64_t{1}, std::int64_t{6}, p - 1, p, p + 1, 3 * p + 3})
      list.push_back({m, n, (3 * m + n) % 11});
  }
  for (const Size& s : {Size{40, 64, 100},
                        {64, 40, 23},
                        {100, 100, 1},
                        {128, 128, 128},
                        {130, 24, 200},
                        {200, 130, 25},
                        {26, 24, 161},
                        {40, 9, 333}})
    list.push_back(s);  // the last: sums in passes of unequal length
  return list;
}

std::string describe(const Size& s) {
  return "m=" + std::to_string(s.m) + " n=" + std::to_string(s.n) + " k=" + std::to_string(s.k);
}

TYPED_TEST(KernelsTest, TablesNameTheirTargets) {
  const auto tables = all_kernels<TypeParam>();
  ASSERT_FALSE(tables.empty());
  EXPECT_STREQ(tables.front().target, kernels<TypeParam>().target);
  for (const auto& t : tables) EXPECT_NE(std::string(t.target), "");
}

TYPED_TEST(KernelsTest, GemmIsTheProduct) {
  using T = TypeParam;
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const Size& s : sizes<T>()) {
      SCOPED_TRACE(std::string(t.target) + " " + describe(s));
      const Dense a = random_dense<T>(s.m, s.k, 1), b = random_dense<T>(s.n, s.k, 2), c = random_dense<T>(s.m, s.n, 3);
      const std::int64_t ld = padded<T>(s.m) + kPanel<T>;
      Array<T> x = to_scratch<T>(c, ld);
      t.gemm_nt(s.m, s.n, s.k, to_panels<T>(a).data(), to_panels<T>(b).data(), x.data(), ld);
      const Dense expected = sum(c, -1, product(a, transposed(b)));
      const Dense magnitude = sum(absolute(c), 1, product(absolute(a), transposed(absolute(b))));
      EXPECT_TRUE(close<T>(from_scratch(x, ld, s.m, s.n), expected, magnitude, static_cast<long double>(s.k) + 2));
      EXPECT_TRUE(x.intact());
    }
  }
}

TYPED_TEST(KernelsTest, SyrkIsTheLowerTrapezoidOfTheProduct) {
  using T = TypeParam;
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const Size& s : sizes<T>()) {
      if (s.m < s.n) continue;
      SCOPED_TRACE(std::string(t.target) + " " + describe(s));
      const Dense a = random_dense<T>(s.m, s.k, 1), b = random_dense<T>(s.n, s.k, 2), c = random_dense<T>(s.m, s.n, 3);
      const std::int64_t ld = padded<T>(s.m);
      Array<T> x = to_scratch<T>(c, ld, true);
      t.syrk_nt(s.m, s.n, s.k, to_panels<T>(a).data(), to_panels<T>(b).data(), x.data(), ld);
      const Dense expected = sum(c, -1, product(a, transposed(b)));
      const Dense magnitude = sum(absolute(c), 1, product(absolute(a), transposed(absolute(b))));
      EXPECT_TRUE(
          close<T>(from_scratch(x, ld, s.m, s.n), expected, magnitude, static_cast<long double>(s.k) + 2, true));
      EXPECT_TRUE(x.intact());
    }
  }
}

TYPED_TEST(KernelsTest, TrmmIsTheProductWithATriangle) {
  using T = TypeParam;
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const Size& s : sizes<T>()) {
      SCOPED_TRACE(std::string(t.target) + " " + describe(s));
      const Dense b = random_dense<T>(s.m, s.n, 1);
      Dense w = random_dense<T>(s.n, s.n, 2);
      for (std::int64_t j = 0; j < s.n; ++j) {
        for (std::int64_t i = 0; i < j; ++i) w(i, j) = 0;
      }
      Array<T> x(padded<T>(s.m) * s.n);
      t.trmm_nt(s.m, s.n, to_panels<T>(b).data(), to_panels<T>(w).data(), x.data());
      const Dense magnitude = product(absolute(b), transposed(absolute(w)));
      EXPECT_TRUE(
          close<T>(from_panels(x, s.m, s.n), product(b, transposed(w)), magnitude, static_cast<long double>(s.n) + 2));
      EXPECT_TRUE(padding_is_zero(x, s.m, s.n));
      EXPECT_TRUE(x.intact());
    }
  }
}

TYPED_TEST(KernelsTest, PackingFollowsTheLayout) {
  using T = TypeParam;
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const Size& s : sizes<T>()) {
      SCOPED_TRACE(std::string(t.target) + " " + describe(s));
      const Dense c = random_dense<T>(s.m, s.n, 1);
      const std::int64_t ld = padded<T>(s.m) + kPanel<T>;
      const Array<T> x = to_scratch<T>(c, ld);
      Array<T> p(padded<T>(s.m) * s.n), q(padded<T>(s.n) * s.m), back(ld * padded<T>(s.n));
      t.pack(s.m, s.n, x.data(), ld, p.data());
      t.pack_transposed(s.m, s.n, x.data(), ld, q.data());
      t.unpack(s.m, s.n, p.data(), back.data(), ld);
      const Dense zero(s.m, s.n), zero_transposed(s.n, s.m);
      EXPECT_TRUE(close<T>(from_panels(p, s.m, s.n), c, zero, 0));
      EXPECT_TRUE(close<T>(from_panels(q, s.n, s.m), transposed(c), zero_transposed, 0));
      EXPECT_TRUE(close<T>(from_scratch(back, ld, s.m, s.n), c, zero, 0));
      EXPECT_TRUE(padding_is_zero(p, s.m, s.n) && padding_is_zero(q, s.n, s.m));
      EXPECT_TRUE(p.intact() && q.intact() && back.intact());
    }
  }
}

TYPED_TEST(KernelsTest, ColumnsAreScaledByOneAndTwoColumnPivots) {
  using T = TypeParam;
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const Size& s : sizes<T>()) {
      SCOPED_TRACE(std::string(t.target) + " " + describe(s));
      const Dense b = random_dense<T>(s.m, s.n, 1), d = random_dense<T>(s.n, 2, 2);
      Dense scale(s.n, s.n);
      Array<T> d1(s.n), e(s.n, T(0));
      for (std::int64_t j = 0; j < s.n; ++j) {
        scale(j, j) = d(j, 0);
        d1[j] = static_cast<T>(d(j, 0));
      }
      for (std::int64_t j = 1; j + 1 < s.n; j += j % 3 + 2) {
        scale(j, j + 1) = scale(j + 1, j) = d(j, 1);
        e[j] = static_cast<T>(d(j, 1));
      }
      Array<T> x = to_panels<T>(b), y(x.size());
      t.scale_columns(s.m, s.n, x.data(), d1.data(), e.data(), y.data());
      t.scale_columns(s.m, s.n, x.data(), d1.data(), e.data(), x.data());
      const Dense expected = product(b, scale), magnitude = product(absolute(b), absolute(scale));
      EXPECT_TRUE(close<T>(from_panels(y, s.m, s.n), expected, magnitude, 2));
      EXPECT_TRUE(close<T>(from_panels(x, s.m, s.n), expected, magnitude, 2));
      EXPECT_TRUE(x.intact() && y.intact());
    }
  }
}

TYPED_TEST(KernelsTest, ColumnMaximumSeesEveryRowAndNaN) {
  using T = TypeParam;
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const Size& s : sizes<T>()) {
      SCOPED_TRACE(std::string(t.target) + " " + describe(s));
      Dense x = random_dense<T>(s.m, s.n, 1);
      std::vector<T> expected(static_cast<std::size_t>(s.n), T(0.25));
      for (std::int64_t j = 0; j < s.n; ++j) {
        for (std::int64_t i = 0; i < s.m; ++i) {
          T& top = expected[static_cast<std::size_t>(j)];
          top = std::max(top, static_cast<T>(std::abs(x(i, j))));
        }
      }
      if (s.m > 1 && s.n > 2) {
        x(s.m / 2, s.n - 1) = -std::numeric_limits<T>::infinity();
        x(s.m - 2, s.n / 2) = std::numeric_limits<T>::quiet_NaN();
        expected.back() = expected[static_cast<std::size_t>(s.n / 2)] = std::numeric_limits<T>::infinity();
      }
      Array<T> out(s.n, T(0.25));
      t.column_max(s.m, s.n, to_panels<T>(x).data(), out.data());
      for (std::int64_t j = 0; j < s.n; ++j) EXPECT_EQ(out[j], expected[static_cast<std::size_t>(j)]) << "column " << j;
      EXPECT_TRUE(out.intact());
    }
  }
}

/// Right-hand sides in row-major order (nr columns), rows padded with `padding`.
template <class T>
Array<T> to_rows(const Dense& x, T padding) {
  Array<T> y(padded<T>(x.rows) * x.columns, padding);
  for (std::int64_t i = 0; i < x.rows; ++i) {
    for (std::int64_t r = 0; r < x.columns; ++r) y[i * x.columns + r] = static_cast<T>(x(i, r));
  }
  return y;
}

template <class T>
Dense from_rows(const Array<T>& y, std::int64_t rows, std::int64_t columns) {
  Dense x(rows, columns);
  for (std::int64_t i = 0; i < rows; ++i) {
    for (std::int64_t r = 0; r < columns; ++r) x(i, r) = y[i * columns + r];
  }
  return x;
}

TYPED_TEST(KernelsTest, ApplyMultipliesByTheTileAndItsTranspose) {
  using T = TypeParam;
  const T nan = std::numeric_limits<T>::quiet_NaN();
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const Size& s : sizes<T>()) {
      for (const std::int64_t nr : {1, kPanel<T>, 2 * kPanel<T>, 3 * kPanel<T>, 4 * kPanel<T>}) {
        SCOPED_TRACE(std::string(t.target) + " " + describe(s) + " nr=" + std::to_string(nr));
        const Dense a = random_dense<T>(s.m, s.n, 1), x = random_dense<T>(s.n, nr, 2), y = random_dense<T>(s.m, nr, 3);
        const Array<T> panels = to_panels<T>(a);
        Array<T> down = to_rows<T>(y, nan), up = to_rows<T>(x, nan);
        t.apply(s.m, s.n, nr, panels.data(), to_rows<T>(x, nan).data(), down.data());
        t.apply_transposed(s.m, s.n, nr, panels.data(), to_rows<T>(y, T(1)).data(), up.data());
        const Dense size_down = sum(absolute(y), 1, product(absolute(a), absolute(x)));
        const Dense size_up = sum(absolute(x), 1, product(transposed(absolute(a)), absolute(y)));
        EXPECT_TRUE(close<T>(from_rows(down, s.m, nr), sum(y, -1, product(a, x)), size_down,
                             static_cast<long double>(s.n) + 2));
        EXPECT_TRUE(close<T>(from_rows(up, s.n, nr), sum(x, -1, product(transposed(a), y)), size_up,
                             static_cast<long double>(s.m) + 2));
        EXPECT_TRUE(down.intact() && up.intact());
      }
    }
  }
}

TYPED_TEST(KernelsTest, ApplyLowerMultipliesByTheTriangle) {
  using T = TypeParam;
  const T nan = std::numeric_limits<T>::quiet_NaN();
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const std::int64_t n : {0, 1, kPanel<T> - 1, kPanel<T>, kPanel<T> + 1, 40, 100, 128}) {
      for (const std::int64_t nr : {1, kPanel<T>, 2 * kPanel<T>, 4 * kPanel<T>}) {
        SCOPED_TRACE(std::string(t.target) + " n=" + std::to_string(n) + " nr=" + std::to_string(nr));
        Dense w = random_dense<T>(n, n, 1);
        for (std::int64_t j = 0; j < n; ++j) {
          for (std::int64_t i = 0; i < j; ++i) w(i, j) = 0;
        }
        const Dense x = random_dense<T>(n, nr, 2);
        Array<T> down(padded<T>(n) * nr), up(padded<T>(n) * nr);
        t.apply_lower(n, nr, to_panels<T>(w).data(), to_rows<T>(x, nan).data(), down.data());
        t.apply_lower_transposed(n, nr, to_panels<T>(w).data(), to_rows<T>(x, T(1)).data(), up.data());
        const long double factor = static_cast<long double>(n) + 2;
        EXPECT_TRUE(close<T>(from_rows(down, n, nr), product(w, x), product(absolute(w), absolute(x)), factor));
        EXPECT_TRUE(close<T>(from_rows(up, n, nr), product(transposed(w), x),
                             product(transposed(absolute(w)), absolute(x)), factor));
        EXPECT_TRUE(down.intact() && up.intact());
      }
    }
  }
}

TYPED_TEST(KernelsTest, GeneralProductFollowsBlas) {
  using T = TypeParam;
  for (const Size& s : sizes<T>()) {
    for (int form = 0; form < 4; ++form) {
      const bool ta = form % 2 == 1, tb = form / 2 == 1;
      const T alpha = T(form == 0 ? 1 : -0.75), beta = T(form == 1 ? 0 : form == 2 ? 1 : 0.5);
      SCOPED_TRACE(describe(s) + " form " + std::to_string(form));
      const Dense a = random_dense<T>(s.m, s.k, 1), b = random_dense<T>(s.k, s.n, 2), c = random_dense<T>(s.m, s.n, 3);
      const auto store = [](const Dense& x, std::int64_t ld) {
        Array<T> y(ld * x.columns);
        for (std::int64_t j = 0; j < x.columns; ++j) {
          for (std::int64_t i = 0; i < x.rows; ++i) y[j * ld + i] = static_cast<T>(x(i, j));
        }
        return y;
      };
      const std::int64_t lda = (ta ? s.k : s.m) + 1, ldb = (tb ? s.n : s.k) + 3, ldc = s.m + 1;
      Array<T> x = beta == T(0) ? Array<T>(ldc * s.n) : store(c, ldc);
      gemm<T>(ta, tb, s.m, s.n, s.k, alpha, store(ta ? transposed(a) : a, lda).data(), lda,
              store(tb ? transposed(b) : b, ldb).data(), ldb, beta, x.data(), ldc);
      const Dense zero(s.m, s.n), scaled = sum(zero, beta, c);
      const Dense expected = sum(scaled, alpha, product(a, b));
      const Dense magnitude = sum(absolute(scaled), 1, product(absolute(a), absolute(b)));
      EXPECT_TRUE(close<T>(from_scratch(x, ldc, s.m, s.n), expected, magnitude, static_cast<long double>(s.k) + 4));
      EXPECT_TRUE(x.intact());
      for (std::int64_t j = 0; j < s.n; ++j)
        EXPECT_TRUE(std::isnan(x[j * ldc + s.m])) << "row past the end, column " << j;
    }
  }
}

TYPED_TEST(KernelsTest, SameInputGivesTheSameBits) {
  using T = TypeParam;
  const Dense a = random_dense<T>(100, 70, 1), b = random_dense<T>(60, 70, 2), c = random_dense<T>(100, 60, 3);
  const Array<T> pa = to_panels<T>(a), pb = to_panels<T>(b);
  Array<T> x = to_scratch<T>(c, 112), y = to_scratch<T>(c, 128), moved(128 * 64 + 1);  // other strides, other alignment
  std::copy(y.data(), y.data() + y.size(), moved.data() + 1);
  for (const Kernels<T>& t : all_kernels<T>()) {
    t.gemm_nt(100, 60, 70, pa.data(), pb.data(), x.data(), 112);
    t.gemm_nt(100, 60, 70, pa.data(), pb.data(), moved.data() + 1, 128);
    for (std::int64_t j = 0; j < 60; ++j) {
      for (std::int64_t i = 0; i < 100; ++i) ASSERT_EQ(x[j * 112 + i], moved[1 + j * 128 + i]) << i << ", " << j;
    }
  }
}

TEST(MeasuredRate, IsPositiveAndFinite) {
  const double rate = measure_gemm_rate(0.01);
  EXPECT_GT(rate, 1e7);
  EXPECT_LT(rate, 1e13);
}

}  // namespace kernels_test
}  // namespace espalier::device::host
