// Kernels of complex numbers against Eigen's dense products and against the factorizations' own identities, for every
// instruction set that this processor runs, in the tables for symmetric and for Hermitian matrices.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "device/dense_reference.hpp"
#include "device/host/kernels/kernels.hpp"

namespace espalier::device::host {
namespace complex_kernels_test {

using testing::Array;
using Wide = Eigen::MatrixXcd;

template <class T>
class ComplexKernels : public ::testing::Test {};
using Types = ::testing::Types<std::complex<double>, std::complex<float>>;
TYPED_TEST_SUITE(ComplexKernels, Types);

template <class T>
double rounding() {
  return base::ScalarTraits<T>::epsilon;
}

Wide random_matrix(Index rows, Index cols, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  // One draw a statement: compilers may take the arguments of a call in any order.
  return Wide::NullaryExpr(rows, cols, [&] {
    const auto real = static_cast<float>(u(random));
    return std::complex<double>(real, static_cast<float>(u(random)));
  });
}
Wide turned(const Wide& a, bool hermitian) { return hermitian ? Wide(a.adjoint()) : Wide(a.transpose()); }

template <class T>
Array<T> scratch_of(const Wide& a, std::int64_t ld) {
  Array<T> c(ld * padded<T>(a.cols()), T(0));
  for (Index j = 0; j < a.cols(); ++j)
    for (Index i = 0; i < a.rows(); ++i) c[j * ld + i] = static_cast<T>(a(i, j));
  return c;
}
template <class T>
Array<T> panels_of(const Wide& a) {
  Array<T> c(padded<T>(a.rows()) * std::max<std::int64_t>(1, a.cols()), T(0));
  constexpr std::int64_t p = kPanel<T>;
  for (Index j = 0; j < a.cols(); ++j)
    for (Index i = 0; i < a.rows(); ++i) c[i / p * p * a.cols() + j * p + i % p] = static_cast<T>(a(i, j));
  return c;
}
template <class T>
Wide from_scratch(const Array<T>& c, Index rows, Index cols, std::int64_t ld) {
  return Wide::NullaryExpr(rows, cols, [&](Index i, Index j) { return std::complex<double>(c[j * ld + i]); });
}
template <class T>
Wide from_panels(const Array<T>& c, Index rows, Index cols) {
  constexpr std::int64_t p = kPanel<T>;
  return Wide::NullaryExpr(rows, cols, [&](Index i, Index j) {
    return std::complex<double>(c[i / p * p * cols + std::int64_t{j} * p + i % p]);
  });
}
Wide lower(const Wide& a) { return a.triangularView<Eigen::Lower>(); }

template <class T, class Check>
void for_tables(const Check& check) {
  for (const bool hermitian : {false, true})
    for (const Kernels<T>& t : all_kernels<T>(hermitian)) {
      SCOPED_TRACE(std::string(t.target) + (hermitian ? ", hermitian" : ", symmetric"));
      check(t, hermitian);
    }
}

TYPED_TEST(ComplexKernels, ProductsAreThoseOfTheDefinition) {
  using T = TypeParam;
  for_tables<T>([](const Kernels<T>& t, bool hermitian) {
    for (const auto& [m, n, k] : {std::array<Index, 3>{1, 1, 1}, {5, 3, 7}, {12, 9, 40}, {37, 22, 200}, {24, 24, 0}}) {
      const Wide a = random_matrix(m, k, 1), b = random_matrix(n, k, 2), c = random_matrix(m, n, 3);
      const std::int64_t ld = padded<T>(m) + kPanel<T>;
      Array<T> x = scratch_of<T>(c, ld);
      t.gemm_nt(m, n, k, panels_of<T>(a).data(), panels_of<T>(b).data(), x.data(), ld);
      const double bound = 8 * rounding<T>() * (k + 2);
      EXPECT_LE((from_scratch(x, m, n, ld) - (c - a * turned(b, hermitian))).cwiseAbs().maxCoeff(), bound);
      if (m >= n) {
        Array<T> y = scratch_of<T>(c, ld);
        t.syrk_nt(m, n, k, panels_of<T>(a).data(), panels_of<T>(b).data(), y.data(), ld);
        EXPECT_LE(lower(from_scratch(y, m, n, ld) - (c - a * turned(b, hermitian))).cwiseAbs().maxCoeff(), bound);
      }
      const Wide w = lower(random_matrix(n, n, 4)), r = random_matrix(m, n, 5);
      Array<T> z = panels_of<T>(Wide::Zero(m, n));
      t.trmm_nt(m, n, panels_of<T>(r).data(), panels_of<T>(w).data(), z.data());
      EXPECT_LE((from_panels(z, m, n) - r * turned(w, hermitian)).cwiseAbs().maxCoeff(), 8 * rounding<T>() * (n + 2));
    }
  });
}

TYPED_TEST(ComplexKernels, SubstitutionIsTheProduct) {
  using T = TypeParam;
  for_tables<T>([](const Kernels<T>& t, bool hermitian) {
    for (const Index m : {1, 7, 30})
      for (const Index n : {1, 10, 25})
        for (const Index nr : {1, kPanel<T>, 3 * kPanel<T>}) {
          const Wide a = random_matrix(m, n, 1), x = random_matrix(n, nr, 2), y = random_matrix(m, nr, 3);
          const auto rows = [&](const Wide& v) { return scratch_of<T>(Wide(v.transpose()), nr); };
          const auto pad = [&](const Wide& v) {
            Wide p = Wide::Zero(padded<T>(v.rows()), v.cols());
            p.topRows(v.rows()) = v;
            return p;
          };
          const double bound = 8 * rounding<T>() * (m + n + 2);
          Array<T> out = rows(pad(y));
          t.apply(m, n, nr, panels_of<T>(a).data(), rows(x).data(), out.data());
          EXPECT_LE((from_scratch(out, nr, m, nr).transpose() - (y - a * x)).cwiseAbs().maxCoeff(), bound);
          Array<T> back = rows(pad(x));
          t.apply_transposed(m, n, nr, panels_of<T>(a).data(), rows(pad(y)).data(), back.data());
          EXPECT_LE((from_scratch(back, nr, n, nr).transpose() - (x - turned(a, hermitian) * y)).cwiseAbs().maxCoeff(),
                    bound);
          const Wide w = lower(random_matrix(n, n, 4));
          Array<T> solved = rows(pad(x));
          t.apply_lower(n, nr, panels_of<T>(w).data(), rows(x).data(), solved.data());
          EXPECT_LE((from_scratch(solved, nr, n, nr).transpose() - w * x).cwiseAbs().maxCoeff(), bound);
          t.apply_lower_transposed(n, nr, panels_of<T>(w).data(), rows(pad(x)).data(), solved.data());
          EXPECT_LE((from_scratch(solved, nr, n, nr).transpose() - turned(w, hermitian) * x).cwiseAbs().maxCoeff(),
                    bound);
        }
  });
}

TYPED_TEST(ComplexKernels, LayoutsRoundTrip) {
  using T = TypeParam;
  for_tables<T>([](const Kernels<T>& t, bool hermitian) {
    for (const Index m : {1, 9, 20})
      for (const Index n : {1, 6, 17}) {
        const Wide a = random_matrix(m, n, 1);
        const std::int64_t ld = padded<T>(m);
        Array<T> p = panels_of<T>(Wide::Zero(m, n)), back = scratch_of<T>(Wide::Zero(m, n), ld);
        t.pack(m, n, scratch_of<T>(a, ld).data(), ld, p.data());
        EXPECT_EQ(from_panels(p, m, n), a);
        t.unpack(m, n, p.data(), back.data(), ld);
        EXPECT_EQ(from_scratch(back, m, n, ld), a);
        Array<T> q = panels_of<T>(Wide::Zero(n, m));
        t.pack_transposed(m, n, scratch_of<T>(a, ld).data(), ld, q.data());
        EXPECT_EQ(from_panels(q, n, m), a.transpose());
        std::vector<typename Kernels<T>::Real> most(static_cast<std::size_t>(n), 0);
        t.column_max(m, n, p.data(), most.data());
        for (Index j = 0; j < n; ++j)
          EXPECT_NEAR(most[static_cast<std::size_t>(j)],
                      (a.col(j).real().cwiseAbs() + a.col(j).imag().cwiseAbs()).maxCoeff(), 1e-6);
        p[0] = T(0, std::numeric_limits<float>::quiet_NaN());
        t.column_max(m, n, p.data(), most.data());
        EXPECT_TRUE(std::isinf(most[0]));
        (void)hermitian;
      }
  });
}

TYPED_TEST(ComplexKernels, CholeskyAndItsInverse) {
  using T = TypeParam;
  for_tables<T>([](const Kernels<T>& t, bool hermitian) {
    for (const Index n : {1, 3, 8, 21, 70}) {
      const Wide r = random_matrix(n, n, 7), a = r * r.adjoint() + n * Wide::Identity(n, n);
      const std::int64_t ld = padded<T>(n);
      Array<T> c = scratch_of<T>(a, ld);
      ASSERT_EQ(t.potrf(n, c.data(), ld), n);
      const Wide l = lower(from_scratch(c, n, n, ld));
      EXPECT_LE((l * l.adjoint() - a).norm(), 8 * rounding<T>() * n * a.norm());
      EXPECT_EQ(l.diagonal().imag().norm(), 0);
      Array<T> w = panels_of<T>(Wide::Zero(n, n));
      t.invert_lower(n, c.data(), ld, false, w.data());
      EXPECT_LE((from_panels(w, n, n) * l - Wide::Identity(n, n)).norm(), 100 * rounding<T>() * n);
      (void)hermitian;
      Wide bad = a;
      bad(n - 1, n - 1) = -1;
      Array<T> d = scratch_of<T>(bad, ld);
      EXPECT_EQ(t.potrf(n, d.data(), ld), n - 1);
    }
  });
}

// D of d and e: Hermitian or symmetric.
template <class T>
Wide block_diagonal(const std::vector<T>& d, const std::vector<T>& e, bool hermitian) {
  const auto n = static_cast<Index>(d.size());
  Wide m = Wide::Zero(n, n);
  for (Index k = 0; k < n; ++k) {
    const auto at = static_cast<std::size_t>(k);
    m(k, k) = std::complex<double>(d[at]);
    if (k + 1 == n || e[at] == T(0)) continue;
    m(k + 1, k) = std::complex<double>(e[at]);
    m(k, k + 1) = hermitian ? std::conj(m(k + 1, k)) : m(k + 1, k);
  }
  return m;
}

TYPED_TEST(ComplexKernels, PivotedLdl) {
  using T = TypeParam;
  for_tables<T>([](const Kernels<T>& t, bool hermitian) {
    for (const Index n : {1, 2, 5, 19, 60, 130}) {
      const Wide r = random_matrix(n, n, 11);
      Wide a = r + turned(r, hermitian);
      for (Index k = 0; k + 1 < n; k += 3) a(k, k) = 0;  // 2x2 pivots
      const std::int64_t ld = padded<T>(n);
      Array<T> c = scratch_of<T>(a, ld);
      std::vector<T> d(static_cast<std::size_t>(n)), e(d);
      std::vector<std::int32_t> perm(d.size());
      std::vector<char> replaced(d.size());
      const PivotCounts counts = t.ldlt(n, c.data(), ld, {}, perm.data(), d.data(), e.data(), replaced.data());
      Wide l = from_scratch(c, n, n, ld).template triangularView<Eigen::StrictlyLower>();
      l += Wide::Identity(n, n);
      const Wide m = block_diagonal(d, e, hermitian);
      Wide moved(n, n);
      for (Index i = 0; i < n; ++i)
        for (Index j = 0; j < n; ++j)
          moved(i, j) = a(perm[static_cast<std::size_t>(i)], perm[static_cast<std::size_t>(j)]);
      EXPECT_LE((l * m * turned(l, hermitian) - moved).norm(), 40 * rounding<T>() * n * a.norm()) << n;
      EXPECT_LE(l.cwiseAbs().maxCoeff(), 5);
      if (n != 2) {  // [0 a; a b] has a pivot of either size
        EXPECT_EQ(counts.two_by_two > 0, n > 2);
      }
      EXPECT_EQ(counts.perturbed, 0);
      if (!hermitian) continue;
      const Eigen::SelfAdjointEigenSolver<Wide> eigen(a, Eigen::EigenvaluesOnly);
      EXPECT_EQ(counts.negative, (eigen.eigenvalues().array() < 0).count());
    }
  });
}

TYPED_TEST(ComplexKernels, PartialLdlLeavesTheSchurComplement) {
  using T = TypeParam;
  for_tables<T>([](const Kernels<T>& t, bool hermitian) {
    const Index n = 45, k = 27;
    const Wide r = random_matrix(n, n, 13), a = r + turned(r, hermitian);
    const std::int64_t ld = padded<T>(n);
    Array<T> c = scratch_of<T>(a, ld);
    std::vector<T> d(static_cast<std::size_t>(k)), e(d);
    std::vector<std::int32_t> perm(d.size());
    std::vector<char> replaced(d.size());
    t.partial_ldlt(n, k, c.data(), ld, {}, perm.data(), d.data(), e.data(), replaced.data());
    const Wide s =
        a.bottomRightCorner(n - k, n - k) -
        a.bottomLeftCorner(n - k, k) * a.topLeftCorner(k, k).partialPivLu().solve(a.topRightCorner(k, n - k));
    const Wide got = from_scratch(c, n, n, ld).bottomRightCorner(n - k, n - k);
    EXPECT_LE(lower(got - s).norm(), 4000 * rounding<T>() * a.norm());
  });
}

TYPED_TEST(ComplexKernels, PivotedLu) {
  using T = TypeParam;
  for_tables<T>([](const Kernels<T>& t, bool hermitian) {
    for (const Index n : {1, 2, 9, 33, 90}) {
      const Wide a = random_matrix(n, n, 17);
      const std::int64_t ld = padded<T>(n);
      Array<T> c = scratch_of<T>(a, ld);
      std::vector<std::int32_t> perm(static_cast<std::size_t>(n));
      std::vector<char> replaced(perm.size());
      t.getrf(n, c.data(), ld, {}, perm.data(), replaced.data());
      const Wide f = from_scratch(c, n, n, ld), u = f.template triangularView<Eigen::Upper>();
      const Wide l = Wide(f.template triangularView<Eigen::StrictlyLower>()) + Wide::Identity(n, n);
      Wide moved(n, n);
      for (Index i = 0; i < n; ++i) moved.row(i) = a.row(perm[static_cast<std::size_t>(i)]);
      EXPECT_LE((l * u - moved).norm(), 10 * rounding<T>() * n * a.norm());
      EXPECT_LE(l.cwiseAbs().maxCoeff(), 1.5);
      Array<T> w = panels_of<T>(Wide::Zero(n, n));
      t.invert_upper_transposed(n, c.data(), ld, w.data());
      EXPECT_LE((from_panels(w, n, n).transpose() * u - Wide::Identity(n, n)).norm(),
                1e3 * rounding<T>() * n * u.norm() * u.inverse().norm());
      (void)hermitian;
    }
  });
}

}  // namespace complex_kernels_test
}  // namespace espalier::device::host
