// Factorizations and inverses of the host kernels: the factors multiplied out in extended precision give back the
// matrix that went in. Bounds are those of Higham, Accuracy and Stability: |A - L L^T| <= (n + 1) eps |L| |L^T|
// (theorem 10.3), |A - L U| <= n eps |L| |U| (theorem 9.3), for L D L^T a small multiple of n eps (|A| + |L| |D| |L^T|)
// (theorem 11.3). Factors of two and three in front allow for the reciprocals of pivots.
#include <algorithm>
#include <cmath>
#include <string>

#include "device/dense_reference.hpp"
#include "device/host/kernels/kernels.hpp"

namespace espalier::device::host {
namespace factor_kernels_test {

using namespace testing;

template <class T>
class FactorKernelsTest : public ::testing::Test {};
using Types = ::testing::Types<double, float>;
TYPED_TEST_SUITE(FactorKernelsTest, Types);

struct Front {
  std::int64_t m, k;
};

/// Whole tiles and small fronts.
std::vector<Front> fronts() {
  std::vector<Front> list;
  for (const std::int64_t n : {0, 1, 2, 7, 8, 9, 15, 16, 17, 23, 24, 25, 40, 64, 100, 128, 130, 200})
    list.push_back({n, n});
  for (const Front& f : {Front{6, 1},
                         {9, 3},
                         {12, 8},
                         {16, 5},
                         {24, 0},
                         {25, 9},
                         {30, 10},
                         {33, 16},
                         {48, 20},
                         {60, 20},
                         {64, 32},
                         {100, 37},
                         {128, 64},
                         {131, 100}})
    list.push_back(f);
  return list;
}

std::string describe(const char* target, const Front& f) {
  return std::string(target) + " m=" + std::to_string(f.m) + " k=" + std::to_string(f.k);
}

/// Symmetric with entries in [-1, 1] and `shift` added to the diagonal.
template <class T>
Dense random_symmetric(std::int64_t n, double shift, unsigned seed) {
  Dense x = random_dense<T>(n, n, seed);
  for (std::int64_t j = 0; j < n; ++j) {
    for (std::int64_t i = 0; i < j; ++i) x(i, j) = x(j, i);
    x(j, j) = static_cast<T>(x(j, j) + shift);
  }
  return x;
}

/// [L11 0; L21 I]: unit lower when `unit`.
Dense left_factor(const Dense& c, std::int64_t k, bool unit) {
  Dense l(c.rows, c.rows);
  for (std::int64_t j = 0; j < c.rows; ++j) {
    l(j, j) = j < k && !unit ? c(j, j) : 1;
    for (std::int64_t i = j + 1; j < k && i < c.rows; ++i) l(i, j) = c(i, j);
  }
  return l;
}

/// diag(I or D, S) with the symmetric trailing part S taken from the lower triangle of c.
Dense middle_factor(const Dense& c, std::int64_t k) {
  Dense s(c.rows, c.rows);
  for (std::int64_t j = 0; j < c.rows; ++j) {
    if (j < k) s(j, j) = 1;
    for (std::int64_t i = j; j >= k && i < c.rows; ++i) s(i, j) = s(j, i) = c(i, j);
  }
  return s;
}

TYPED_TEST(FactorKernelsTest, CholeskyMultipliesBack) {
  using T = TypeParam;
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const Front& f : fronts()) {
      SCOPED_TRACE(describe(t.target, f));
      const Dense a = random_symmetric<T>(f.m, static_cast<double>(f.m) / 2 + 2, 5);
      const std::int64_t ld = padded<T>(f.m);
      Array<T> x = to_scratch<T>(a, ld, true);
      const std::int64_t done = f.k == f.m ? t.potrf(f.m, x.data(), ld) : t.partial_potrf(f.m, f.k, x.data(), ld);
      ASSERT_EQ(done, f.k);
      const Dense c = from_scratch(x, ld, f.m, f.m), l = left_factor(c, f.k, false), s = middle_factor(c, f.k);
      const Dense magnitude = product(product(absolute(l), absolute(s)), transposed(absolute(l)));
      EXPECT_TRUE(close<T>(product(product(l, s), transposed(l)), a, sum(absolute(a), 1, magnitude),
                           2 * (static_cast<long double>(f.k) + 2), true));
      EXPECT_TRUE(x.intact());
    }
  }
}

TYPED_TEST(FactorKernelsTest, CholeskyNamesTheFirstBadColumn) {
  using T = TypeParam;
  const T nan = std::numeric_limits<T>::quiet_NaN();
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const std::int64_t n : {1, 8, 9, 30, 64, 130}) {
      for (const std::int64_t bad : {std::int64_t{0}, n / 2, n - 1}) {
        for (const T value : {T(-1), T(0), nan}) {
          SCOPED_TRACE(describe(t.target, {n, bad}));
          Dense a = random_symmetric<T>(n, static_cast<double>(n) + 2, 6);
          for (std::int64_t i = 0; i < n; ++i) a(i, bad) = a(bad, i) = 0;
          a(bad, bad) = value;
          Array<T> x = to_scratch<T>(a, padded<T>(n), true);
          EXPECT_EQ(t.potrf(n, x.data(), padded<T>(n)), bad);
        }
      }
    }
  }
}

/// The state that partial_ldlt leaves, as matrices.
template <class T>
struct Ldlt {
  Ldlt(const Kernels<T>& t, const Dense& a, std::int64_t k, T tiny)
      : ld(padded<T>(a.rows)),
        x(to_scratch<T>(a, ld, true)),
        d(k),
        e(k),
        perm(static_cast<std::size_t>(k)),
        replaced(static_cast<std::size_t>(k)),
        l(0, 0),
        middle(0, 0),
        permuted(a) {
    const std::int64_t m = a.rows;
    counts = k == m
                 ? t.ldlt(m, x.data(), ld, {tiny, tiny}, perm.data(), d.data(), e.data(), replaced.data())
                 : t.partial_ldlt(m, k, x.data(), ld, {tiny, tiny}, perm.data(), d.data(), e.data(), replaced.data());
    const Dense c = from_scratch(x, ld, m, m);
    l = left_factor(c, k, true);
    middle = middle_factor(c, k);
    for (std::int64_t j = 0; j < k; ++j) {
      middle(j, j) = d[j];
      if (e[j] != T(0) && j + 1 < k) middle(j + 1, j) = middle(j, j + 1) = e[j];
    }
    const auto row = [&](std::int64_t i) {
      return i < k ? static_cast<std::int64_t>(perm[static_cast<std::size_t>(i)]) : i;
    };
    for (std::int64_t j = 0; j < m; ++j) {
      for (std::int64_t i = 0; i < m; ++i) permuted(i, j) = a(row(i), row(j));
    }
  }
  [[nodiscard]] ::testing::AssertionResult multiplies_back(std::int64_t k) const {
    const Dense magnitude = product(product(absolute(l), absolute(middle)), transposed(absolute(l)));
    return close<T>(product(product(l, middle), transposed(l)), permuted, sum(absolute(permuted), 1, magnitude),
                    3 * (static_cast<long double>(k) + 4), true);
  }
  std::int64_t ld;
  Array<T> x, d, e;
  std::vector<std::int32_t> perm;
  std::vector<char> replaced;
  PivotCounts counts;
  Dense l, middle, permuted;
};

/// Negative eigenvalues by plain symmetric elimination with complete pivoting in extended precision (Sylvester's law).
int negative_eigenvalues(Dense a) {
  int negative = 0;
  std::vector<std::int64_t> left;
  for (std::int64_t i = 0; i < a.rows; ++i) left.push_back(i);
  const auto eliminate = [&](std::int64_t p) {
    left.erase(std::find(left.begin(), left.end(), p));
    for (const std::int64_t j : left) {
      const long double f = a(p, j) / a(p, p);
      for (const std::int64_t i : left) a(i, j) -= a(i, p) * f;
    }
  };
  while (!left.empty()) {
    long double diagonal = -1, off = -1;
    std::int64_t p = 0, q = 0, r = 0;
    for (const std::int64_t j : left) {
      for (const std::int64_t i : left) {
        if (i == j && std::abs(a(i, i)) > diagonal) diagonal = std::abs(a(i, i)), p = i;
        if (i != j && std::abs(a(i, j)) > off) off = std::abs(a(i, j)), q = i, r = j;
      }
    }
    if (diagonal < 0.64L * off) {  // (x_q + x_r) / 2 and (x_q - x_r) as new unknowns: a congruence with a large pivot
      for (const std::int64_t i : left) {
        const long double u = a(i, q), v = a(i, r);
        a(i, q) = u + v, a(i, r) = u - v;
      }
      for (const std::int64_t i : left) {
        const long double u = a(q, i), v = a(r, i);
        a(q, i) = u + v, a(r, i) = u - v;
      }
      p = std::abs(a(q, q)) > std::abs(a(r, r)) ? q : r;
    }
    negative += a(p, p) < 0 ? 1 : 0;
    eliminate(p);
  }
  return negative;
}

TYPED_TEST(FactorKernelsTest, LdltMultipliesBackWithBoundedFactor) {
  using T = TypeParam;
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const Front& f : fronts()) {
      for (const double shift : {0.0, 1.0}) {
        SCOPED_TRACE(describe(t.target, f) + " shift " + std::to_string(shift));
        Dense a = random_symmetric<T>(f.m, shift, 7);
        if (shift == 0.0) {
          for (std::int64_t j = 1; j < f.m; j += 2) a(j, j) = 0;  // zero diagonal entries call for 2x2 pivots
        }
        const Ldlt<T> r(t, a, f.k, T(0));
        EXPECT_TRUE(r.multiplies_back(f.k));
        EXPECT_TRUE(r.x.intact() && r.d.intact() && r.e.intact());
        // |L| <= 1 / (1 - alpha) + ... = 2.78 with alpha = 0.6404 (Ashcraft, Grimes, Lewis 1998); single 2x2 entries
        // and 1x1 entries obey it in the pivot block
        for (std::int64_t j = 0; j < f.k; ++j) {
          for (std::int64_t i = j + 1; i < f.k; ++i) ASSERT_LE(std::abs(r.l(i, j)), 2.79L) << i << ", " << j;
        }
        if (f.k == f.m && f.m <= 64) {
          EXPECT_EQ(r.counts.negative, negative_eigenvalues(a));
        }
      }
    }
  }
}

TYPED_TEST(FactorKernelsTest, LdltOfSaddlePointsHasTheRightInertia) {
  using T = TypeParam;
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const std::int64_t n : {3, 12, 30, 64, 130}) {  // [W B^T; B 0] with W positive definite: n / 3 negative
      SCOPED_TRACE(describe(t.target, {n, n}));
      const std::int64_t constraints = n / 3;
      Dense a = random_symmetric<T>(n, static_cast<double>(n), 8);
      for (std::int64_t j = n - constraints; j < n; ++j) {
        for (std::int64_t i = n - constraints; i < n; ++i) a(i, j) = 0;
      }
      const Ldlt<T> r(t, a, n, T(0));
      EXPECT_TRUE(r.multiplies_back(n));
      EXPECT_EQ(r.counts.negative, constraints);
      EXPECT_EQ(r.counts.perturbed, 0);
    }
  }
}

TYPED_TEST(FactorKernelsTest, LdltReplacesTinyPivots) {
  using T = TypeParam;
  const T tiny = std::numeric_limits<T>::epsilon();
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const std::int64_t n : {1, 5, 24, 40, 100}) {
      SCOPED_TRACE(describe(t.target, {n, n}));
      const Ldlt<T> zero(t, Dense(n, n), n, tiny);
      EXPECT_EQ(zero.counts.perturbed, n);
      EXPECT_EQ(std::count(zero.replaced.begin(), zero.replaced.end(), 1), n);
      for (std::int64_t j = 0; j < n; ++j) EXPECT_EQ(std::abs(zero.d[j]), tiny);
      Dense a = random_symmetric<T>(n, 3, 9);  // one zero row: one replaced pivot, the rest untouched
      for (std::int64_t i = 0; i < n; ++i) a(i, n / 2) = a(n / 2, i) = 0;
      const Ldlt<T> single(t, a, n, tiny);
      EXPECT_EQ(single.counts.perturbed, 1);
      const auto where = std::find(single.replaced.begin(), single.replaced.end(), 1) - single.replaced.begin();
      EXPECT_EQ(single.perm[static_cast<std::size_t>(where)], n / 2);
      const Ldlt<T> without(t, Dense(n, n), n, T(0));  // zero threshold: nothing to divide by, yet finite
      for (std::int64_t j = 0; j < n; ++j) {
        for (std::int64_t i = 0; i < n; ++i) EXPECT_TRUE(std::isfinite(without.l(i, j)));
      }
    }
  }
}

TYPED_TEST(FactorKernelsTest, NanNeitherHangsNorEscapes) {
  using T = TypeParam;
  const T nan = std::numeric_limits<T>::quiet_NaN(), infinity = std::numeric_limits<T>::infinity();
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const std::int64_t n : {1, 9, 30, 70}) {
      for (const T value : {nan, infinity, -infinity}) {
        for (const std::int64_t at : {std::int64_t{0}, n / 2, n - 1}) {
          SCOPED_TRACE(describe(t.target, {n, at}));
          Dense a = random_symmetric<T>(n, 0, 10);
          a(at, n / 3) = a(n / 3, at) = value;
          const Ldlt<T> r(t, a, n, T(1e-6));
          std::vector<std::int32_t> perm = r.perm;
          std::sort(perm.begin(), perm.end());
          for (std::int64_t i = 0; i < n; ++i) ASSERT_EQ(perm[static_cast<std::size_t>(i)], i);
          bool finite = true;
          for (std::int64_t i = 0; i < n; ++i) finite = finite && std::isfinite(r.d[i]) && std::isfinite(r.e[i]);
          for (const long double v : r.l.values) finite = finite && std::isfinite(v);
          EXPECT_FALSE(finite) << "bad input must show in the factor";
          Array<T> x = to_scratch<T>(a, padded<T>(n));
          std::vector<char> replaced(static_cast<std::size_t>(n));
          t.getrf(n, x.data(), padded<T>(n), {T(1e-6), T(1e-6)}, perm.data(), replaced.data());
          std::sort(perm.begin(), perm.end());
          for (std::int64_t i = 0; i < n; ++i) ASSERT_EQ(perm[static_cast<std::size_t>(i)], i);
        }
      }
    }
  }
}

TYPED_TEST(FactorKernelsTest, LuMultipliesBackWithBoundedFactor) {
  using T = TypeParam;
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const Front& f : fronts()) {
      SCOPED_TRACE(describe(t.target, f));
      const Dense a = random_dense<T>(f.m, f.m, 11);
      const std::int64_t ld = padded<T>(f.m);
      Array<T> x = to_scratch<T>(a, ld);
      std::vector<std::int32_t> perm(static_cast<std::size_t>(f.k));
      std::vector<char> replaced(static_cast<std::size_t>(f.k));
      const PivotCounts counts = f.k == f.m ? t.getrf(f.m, x.data(), ld, {}, perm.data(), replaced.data())
                                            : t.partial_getrf(f.m, f.k, x.data(), ld, {}, perm.data(), replaced.data());
      EXPECT_EQ(counts.perturbed, 0);
      const Dense c = from_scratch(x, ld, f.m, f.m), l = left_factor(c, f.k, true);
      Dense u = c, permuted = a;
      for (std::int64_t j = 0; j < f.m; ++j) {
        for (std::int64_t i = 0; i < f.m; ++i) {
          if (j < f.k && i > j) u(i, j) = 0;
          permuted(i, j) = a(i < f.k ? perm[static_cast<std::size_t>(i)] : i, j);
          if (i > j && i < f.k) {
            ASSERT_LE(std::abs(l(i, j)), 1 + 2 * std::numeric_limits<T>::epsilon());
          }
        }
      }
      const Dense magnitude = sum(absolute(a), 1, product(absolute(l), absolute(u)));
      EXPECT_TRUE(close<T>(product(l, u), permuted, magnitude, 2 * (static_cast<long double>(f.k) + 2)));
      EXPECT_TRUE(x.intact());
    }
  }
}

TYPED_TEST(FactorKernelsTest, LuReplacesTinyPivots) {
  using T = TypeParam;
  const T tiny = std::numeric_limits<T>::epsilon();
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const std::int64_t n : {1, 8, 30, 100}) {
      SCOPED_TRACE(describe(t.target, {n, n}));
      Dense a = random_dense<T>(n, n, 12);
      for (std::int64_t i = 0; i < n; ++i) a(i, n / 2) = 0;
      Array<T> x = to_scratch<T>(a, padded<T>(n));
      std::vector<std::int32_t> perm(static_cast<std::size_t>(n));
      std::vector<char> replaced(static_cast<std::size_t>(n));
      EXPECT_EQ(t.getrf(n, x.data(), padded<T>(n), {tiny, tiny}, perm.data(), replaced.data()).perturbed, 1);
      EXPECT_EQ(replaced[static_cast<std::size_t>(n / 2)], 1);
      EXPECT_EQ(std::abs(x[n / 2 * padded<T>(n) + n / 2]), tiny);
    }
  }
}

TYPED_TEST(FactorKernelsTest, InversesMultiplyToIdentity) {
  using T = TypeParam;
  for (const Kernels<T>& t : all_kernels<T>()) {
    for (const std::int64_t n : {0, 1, 7, 8, 9, 15, 16, 17, 23, 24, 25, 40, 64, 100, 128, 130, 200}) {
      for (int form = 0; form < 3; ++form) {  // lower, unit lower, upper
        SCOPED_TRACE(describe(t.target, {n, form}));
        Dense l = random_dense<T>(n, n, 13);
        for (std::int64_t j = 0; j < n; ++j) {
          for (std::int64_t i = 0; i < n; ++i) l(i, j) = static_cast<T>(i < j ? 0 : l(i, j) / 4);
          l(j, j) = form == 1 ? 1 : static_cast<T>(l(j, j) + 1.5L);
        }
        const std::int64_t ld = padded<T>(n);
        Array<T> x = to_scratch<T>(form == 2 ? transposed(l) : l, ld, form != 2), w(ld * n);
        for (std::int64_t j = 0; j < n; ++j) {  // the other triangle and a unit diagonal must not be read
          for (std::int64_t i = 0; i < n; ++i) {
            if (form == 2 ? i > j : (i < j || (form == 1 && i == j))) x[j * ld + i] = T(1e9);
          }
        }
        if (form == 2) {
          t.invert_upper_transposed(n, x.data(), ld, w.data());
        } else {
          t.invert_lower(n, x.data(), ld, form == 1, w.data());
        }
        const Dense inverse = from_panels(w, n, n);
        Dense identity(n, n);
        for (std::int64_t j = 0; j < n; ++j) {
          identity(j, j) = 1;
          for (std::int64_t i = 0; i < j; ++i) ASSERT_EQ(inverse(i, j), 0);
        }
        EXPECT_TRUE(close<T>(product(l, inverse), identity, product(absolute(l), absolute(inverse)),
                             2 * (static_cast<long double>(n) + 2)));
        EXPECT_TRUE(padding_is_zero(w, n, n) && w.intact());
      }
    }
  }
}

}  // namespace factor_kernels_test
}  // namespace espalier::device::host
