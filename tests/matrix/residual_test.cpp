#include "matrix/residual.hpp"

#include <cmath>
#include <limits>

#include "matrix/generators/generate.hpp"
#include "matrix/helpers.hpp"
#include "matrix/multiply.hpp"
#include "matrix/norms.hpp"
#include "matrix/transform.hpp"

namespace espalier::matrix {
namespace residual_test {

constexpr double kEps = std::numeric_limits<double>::epsilon();
constexpr Storage kAll[] = {Storage::general, Storage::symmetric_lower, Storage::symmetric_upper,
                            Storage::symmetric_both};

SparseMatrix with_storage(Index n, Storage storage, unsigned seed) {
  if (storage != Storage::symmetric_both) return random_matrix(n, n, 4, storage, seed);
  auto a = to_general(random_matrix(n, n, 4, Storage::symmetric_lower, seed));
  a.storage = Storage::symmetric_both;
  return a;
}

std::vector<double> random_vector(std::size_t n, unsigned seed) {
  std::mt19937_64 rng(seed);
  std::vector<double> v(n);
  for (auto& x : v) x = std::ldexp(static_cast<double>(rng() >> 11), -52) - 1;
  return v;
}

// Truth: dense products of small integers, which are exact.
TEST(Multiply, EqualsDense) {
  for (const auto storage : kAll)
    for (const auto transpose : {Transpose::no, Transpose::yes, Transpose::conjugate}) {
      const auto a = with_storage(23, storage, 9);
      const Eigen::MatrixXd d = transpose == Transpose::no ? dense(a) : Eigen::MatrixXd(dense(a).transpose());
      const Index k = 3;
      Eigen::MatrixXd x(23, k), y(23, k);
      for (Index i = 0; i < 23 * k; ++i) x.data()[i] = i % 7 - 3;
      multiply(a, transpose, {x.data(), 23u * 3}, {y.data(), 23u * 3}, k);
      EXPECT_EQ(y, d * x);
    }
  const auto r = random_matrix(5, 8, 2, Storage::general, 1);
  std::vector<double> x(8, 1.0), y(5), z(5, 1.0), w(8);
  multiply(r, Transpose::no, x, y);
  EXPECT_EQ(Eigen::VectorXd::Map(y.data(), 5), dense(r) * Eigen::VectorXd::Ones(8));
  multiply(r, Transpose::yes, z, w);
  EXPECT_EQ(Eigen::VectorXd::Map(w.data(), 8), dense(r).transpose() * Eigen::VectorXd::Ones(5));
  EXPECT_THROW(multiply(r, Transpose::no, y, x), std::invalid_argument);
}

// Truth: the run on one thread, bit for bit, on a matrix large enough for several ranges.
TEST(Multiply, SameBitsForAnyNumberOfThreads) {
  const auto a = generate(parse_generator(std::vector<std::string>{"elasticity", "12"}));
  ASSERT_GT(a.nonzeros(), 1 << 17);
  const auto n = static_cast<std::size_t>(a.rows);
  const auto x = random_vector(n, 1), b = random_vector(n, 2);
  std::vector<double> y1(n), yt(n), r1(n), rt(n);
  multiply(a, Transpose::no, x, y1);
  residual(a, x, b, r1);
  for (const int threads : {2, 3, 5}) {
    base::ThreadPool pool(threads);
    multiply(a, Transpose::no, x, yt, 1, &pool);
    residual(a, x, b, rt, 1, Transpose::no, &pool);
    EXPECT_EQ(y1, yt) << threads;
    EXPECT_EQ(r1, rt) << threads;
  }
}

#ifdef __SIZEOF_FLOAT128__
__extension__ typedef __float128 Quad;

// Truth: sums in 113 bits. Cancellation is forced: b = fl(A x), so the residual is rounding errors of A x alone.
TEST(Residual, HasTwiceTheWorkingPrecision) {
  for (const auto storage : kAll)
    for (const auto transpose : {Transpose::no, Transpose::yes}) {
      auto a = with_storage(200, storage, 4);
      if (storage != Storage::symmetric_both) a.values = random_vector(a.values.size(), 8);
      const auto x = random_vector(200, 5);
      std::vector<double> b(200), r(200);
      multiply(a, transpose, x, b);
      residual(a, x, b, r, 1, transpose);
      std::vector<Quad> exact(b.begin(), b.end());
      const bool half = storage == Storage::symmetric_lower || storage == Storage::symmetric_upper;
      for (Index j = 0; j < 200; ++j)
        for (Offset p = a.col_ptr[static_cast<std::size_t>(j)]; p < a.col_ptr[static_cast<std::size_t>(j) + 1]; ++p) {
          const auto i = static_cast<std::size_t>(a.row_ind[static_cast<std::size_t>(p)]),
                     c = static_cast<std::size_t>(j);
          const Quad v = a.values[static_cast<std::size_t>(p)];
          const bool swap = transpose == Transpose::yes && !half;
          exact[swap ? c : i] -= v * x[swap ? i : c];
          if (half && i != c) exact[c] -= v * x[i];
        }
      double largest = 0;
      for (std::size_t i = 0; i < 200; ++i) {
        // Dot2's bound with n <= 40 terms of size <= 1 each.
        const double bound = kEps * std::abs(static_cast<double>(exact[i])) + 1600 * kEps * kEps * 41;
        EXPECT_LE(std::abs(static_cast<double>(exact[i] - static_cast<Quad>(r[i]))), bound) << i;
        largest = std::max(largest, std::abs(r[i]));
      }
      EXPECT_GT(largest, 0) << "something was measured";
      EXPECT_LT(largest, 100 * kEps);
    }
}
#endif

// Truth: closed form. A = [2], x = 1 + h: the residual is -2 h, |A||x| + |b| = 4 + 2 h.
TEST(BackwardErrors, ClosedForm) {
  const SparseMatrix a{1, 1, {0, 1}, {0}, {2.0}, Storage::symmetric_lower};
  const double h = 0x1p-20;
  const auto e = backward_errors(a, std::vector<double>{1 + h}, std::vector<double>{2.0});
  EXPECT_EQ(e.normwise, 2 * h / (4 + 2 * h));
  EXPECT_EQ(e.componentwise, 2 * h / (4 + 2 * h));
  EXPECT_EQ(e.worst_row, 0);
}

// Truth: the definitions, dense.
TEST(BackwardErrors, EqualTheirDefinitions) {
  for (const auto transpose : {Transpose::no, Transpose::yes}) {
    const Index n = 30, k = 2;
    const auto a = random_matrix(n, n, 5, Storage::general, 6);
    const auto x = random_vector(60, 1), b = random_vector(60, 2);
    const Eigen::MatrixXd d = transpose == Transpose::no ? dense(a) : Eigen::MatrixXd(dense(a).transpose());
    // Entry by entry, since random_matrix() repeats entries: |A| here is the sum of magnitudes.
    auto magnitudes = a;
    for (auto& v : magnitudes.values) v = std::abs(v);
    const Eigen::MatrixXd m =
        transpose == Transpose::no ? dense(magnitudes) : Eigen::MatrixXd(dense(magnitudes).transpose());
    double normwise = 0, componentwise = 0;
    for (Index c = 0; c < k; ++c) {
      const Eigen::VectorXd xc = Eigen::VectorXd::Map(x.data() + c * n, n),
                            bc = Eigen::VectorXd::Map(b.data() + c * n, n);
      const Eigen::VectorXd r = (bc - d * xc).cwiseAbs();
      const Eigen::VectorXd s = m * xc.cwiseAbs() + bc.cwiseAbs();
      normwise = std::max(normwise, r.maxCoeff() / (m.rowwise().sum().maxCoeff() * xc.cwiseAbs().maxCoeff() +
                                                    bc.cwiseAbs().maxCoeff()));
      componentwise = std::max(componentwise, (r.array() / s.array()).maxCoeff());
    }
    const auto e = backward_errors(a, x, b, k, transpose);
    EXPECT_NEAR(e.normwise, normwise, 100 * kEps);
    EXPECT_NEAR(e.componentwise, componentwise, 100 * kEps);
    EXPECT_GT(e.componentwise, 0.01);
  }
}

TEST(BackwardErrors, ZeroOverZeroIsZeroAndNonsenseIsInfinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  const SparseMatrix a{2, 2, {0, 1, 1}, {0}, {1.0}, Storage::general};
  const std::vector<double> x{1, 1}, b{1, 0}, impossible{1, 1};
  EXPECT_EQ(backward_errors(a, x, b).componentwise, 0);
  EXPECT_EQ(backward_errors(a, x, b).worst_row, -1);
  EXPECT_EQ(backward_errors(a, x, impossible).componentwise, 1);
  EXPECT_EQ(backward_errors(a, x, impossible).worst_row, 1);
  EXPECT_EQ(backward_errors(a, std::vector<double>{nan, 1}, b).normwise, inf);
  EXPECT_EQ(backward_errors(a, std::vector<double>{1, inf}, b).componentwise, inf);
}

}  // namespace residual_test
}  // namespace espalier::matrix
