// Assembly, change of storage, permutation, validation, symmetry and norms, against dense matrices.
#include <limits>
#include <numeric>
#include <span>
#include <stdexcept>

#include "matrix/helpers.hpp"
#include "matrix/multiply.hpp"
#include "matrix/norms.hpp"
#include "matrix/transform.hpp"
#include "matrix/triplets.hpp"
#include "matrix/validate.hpp"

namespace espalier::matrix {
namespace structure_test {

constexpr Storage kSymmetric[] = {Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both};

// A random symmetric matrix of the given storage with duplicates.
SparseMatrix random_symmetric(Index n, Storage storage, unsigned seed) {
  if (storage != Storage::symmetric_both) return random_matrix(n, n, 4, storage, seed);
  auto a = to_general(random_matrix(n, n, 4, Storage::symmetric_lower, seed));
  a.storage = Storage::symmetric_both;
  return a;
}

TEST(ToCsc, EqualsDenseSumForAnyNumberOfThreads) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Index rows = 1 + static_cast<Index>(seed * 7 % 50), cols = 1 + static_cast<Index>(seed * 13 % 60);
    std::mt19937 rng(seed);
    std::vector<Index> row, col;
    std::vector<double> value;
    Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(rows, cols);
    for (int k = 0; k < 400; ++k) {
      row.push_back(static_cast<Index>(rng() % static_cast<unsigned>(rows)));
      col.push_back(static_cast<Index>(rng() % static_cast<unsigned>(cols)));
      value.push_back(static_cast<double>(rng() % 100));
      expected(row.back(), col.back()) += value.back();
    }
    const auto a = to_csc({rows, cols, row, col, value, Storage::general});
    EXPECT_EQ(dense(a), expected) << "seed " << seed;
    EXPECT_TRUE(is_sorted_unique(a));
    validate(a);
    base::ThreadPool pool(3);
    const auto b = to_csc({rows, cols, row, col, value, Storage::general}, &pool);
    EXPECT_EQ(a.values, b.values);
    EXPECT_EQ(a.row_ind, b.row_ind);
    EXPECT_EQ(a.col_ptr, b.col_ptr);
  }
}

TEST(ToCsc, RefusesWrongInput) {
  const std::vector<Index> ok{0, 1}, bad{0, 2}, one{0};
  const std::vector<double> v{1, 2};
  EXPECT_THROW((void)to_csc({2, 2, ok, one, v, Storage::general}), std::invalid_argument);
  EXPECT_THROW((void)to_csc({2, 2, ok, ok, v, Storage::symmetric_upper}), std::invalid_argument);
  expect_error([&] { (void)to_csc({2, 2, bad, ok, v, Storage::general}); }, {"row index"});
  expect_error([&] { (void)to_csc({2, 2, ok, bad, v, Storage::general}); }, {"column index"});
}

TEST(ToCsc, LongColumnsAreSortedStably) {
  const Index n = 1000;
  std::vector<Index> row, col(static_cast<std::size_t>(2 * n), 0);
  std::vector<double> value;
  for (Index i = n; i-- > 0;) row.push_back(i), value.push_back(1e20);
  for (Index i = 0; i < n; ++i) row.push_back(i), value.push_back(i);
  const auto a = to_csc({n, 1, row, col, value, Storage::general});
  ASSERT_EQ(a.nonzeros(), n);
  for (Index i = 0; i < n; ++i) EXPECT_EQ(a.values[static_cast<std::size_t>(i)], 1e20 + i) << "sum in the order given";
}

TEST(Transform, TransposeAndExpansionEqualDense) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    const auto g = random_matrix(13, 17, 4, Storage::general, seed);
    EXPECT_EQ(dense(transpose(g)), dense(g).transpose());
    EXPECT_EQ(dense(to_general(g)), dense(g));
    for (const auto storage : kSymmetric) {
      const auto s = random_symmetric(15, storage, seed);
      const auto general = to_general(s), lower = to_lower(s);
      EXPECT_EQ(general.storage, Storage::general);
      EXPECT_EQ(dense(general), dense(s));
      EXPECT_TRUE(is_sorted_unique(general));
      EXPECT_EQ(lower.storage, Storage::symmetric_lower);
      EXPECT_EQ(dense(lower), dense(s));
      EXPECT_TRUE(is_sorted_unique(lower));
      EXPECT_EQ(dense(transpose(s)), dense(s));
      validate(lower);
    }
  }
  EXPECT_THROW((void)to_lower(random_matrix(3, 3, 1, Storage::general, 1)), std::invalid_argument);
}

TEST(Transform, PermutationEqualsPAPt) {
  const Index n = 19;
  std::vector<Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), std::mt19937(5));
  Eigen::MatrixXd p = Eigen::MatrixXd::Zero(n, n);
  for (Index k = 0; k < n; ++k) p(k, order[static_cast<std::size_t>(k)]) = 1;
  for (const auto storage :
       {Storage::general, Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both}) {
    const auto a = storage == Storage::general ? random_matrix(n, n, 3, storage, 2) : random_symmetric(n, storage, 2);
    const auto b = permute_symmetric(a, order);
    EXPECT_EQ(dense(b), p * dense(a) * p.transpose());
    EXPECT_EQ(b.symmetric(), a.symmetric());
    EXPECT_TRUE(is_sorted_unique(b));
  }
  order[0] = order[1];
  EXPECT_THROW((void)permute_symmetric(random_matrix(n, n, 3, Storage::general, 2), order), std::invalid_argument);
}

TEST(Transform, OrdersThatAreNoPermutationAreRefused) {
  for (const std::vector<Index>& order : {std::vector<Index>{-1, 0}, {2, 0}, {1, 1}})
    EXPECT_THROW((void)invert_permutation(order), std::invalid_argument);
  EXPECT_EQ(invert_permutation(std::vector<Index>{2, 0, 1}), (std::vector<Index>{1, 2, 0}));
}

// Truth: sizes that do not fit are named before anything is read or written.
TEST(Multiply, RefusesVectorsOfOtherSizes) {
  const SparseMatrix a{2, 3, {0, 1, 1, 2}, {0, 1}, {1, 2}, Storage::general};
  std::vector<double> x(3), y(2);
  EXPECT_NO_THROW(multiply(a, Transpose::no, x, y, 1));
  EXPECT_THROW(multiply(a, Transpose::no, std::span(x).first(2), y, 1), std::invalid_argument);
  EXPECT_THROW(multiply(a, Transpose::no, x, std::span(y).first(1), 1), std::invalid_argument);
  EXPECT_THROW(multiply(a, Transpose::yes, x, y, 1), std::invalid_argument);
  EXPECT_THROW(multiply(a, Transpose::no, x, y, -1), std::invalid_argument);
}

TEST(Validate, NamesWhatIsWrong) {
  const SparseMatrix good{3, 2, {0, 2, 3}, {0, 2, 1}, {1, 2, 3}, Storage::general};
  validate(good);
  const auto expect = [&](const std::function<void(SparseMatrix&)>& damage, const std::vector<std::string>& parts) {
    SparseMatrix a = good;
    damage(a);
    expect_error([&] { validate(a); }, parts);
  };
  expect([](auto& a) { a.rows = -1; }, {"negative"});
  expect([](auto& a) { a.storage = Storage::symmetric_lower; }, {"3 x 2", "symmetric"});
  expect([](auto& a) { a.col_ptr.pop_back(); }, {"column pointers"});
  expect([](auto& a) { a.col_ptr[0] = 1; }, {"must be 0"});
  expect([](auto& a) { a.col_ptr[1] = 4; }, {"fall", "column 1"});
  expect([](auto& a) { a.row_ind.pop_back(); }, {"2 row indices"});
  expect([](auto& a) { a.values.push_back(1); }, {"4 values"});
  expect([](auto& a) { a.row_ind[2] = 3; }, {"column 1", "row index 3"});
  expect([](auto& a) { a.row_ind[0] = -1; }, {"column 0", "-1"});
  expect([](auto& a) { a.values[1] = std::numeric_limits<double>::quiet_NaN(); }, {"(2, 0)", "nan"});
  expect([](auto& a) { a.values[2] = -std::numeric_limits<double>::infinity(); }, {"(1, 1)", "inf"});
  const SparseMatrix lower{2, 2, {0, 1, 2}, {0, 0}, {1, 1}, Storage::symmetric_lower};
  expect_error([&] { validate(lower); }, {"(0, 1)", "lower"});
  const SparseMatrix upper{2, 2, {0, 2, 2}, {0, 1}, {1, 1}, Storage::symmetric_upper};
  expect_error([&] { validate(upper); }, {"(1, 0)", "upper"});
}

TEST(Validate, ReportsTheFirstColumnForAnyNumberOfThreads) {
  const Index n = 100000;
  SparseMatrix a{n, n, {0}, {}, {}, Storage::general};
  for (Index j = 0; j < n; ++j) {
    a.row_ind.push_back(j >= 70000 ? n : j);
    a.values.push_back(1);
    a.col_ptr.push_back(j + 1);
  }
  base::ThreadPool pool(4);
  for (int repeat = 0; repeat < 10; ++repeat) expect_error([&] { validate(a, &pool); }, {"column 70000 "});
}

TEST(Symmetry, EqualsDenseComparison) {
  int symmetric = 0, structural = 0;
  for (unsigned seed = 0; seed < 400; ++seed) {
    const Index n = 1 + static_cast<Index>(seed % 5);
    auto a = seed % 3 == 0 ? to_general(random_matrix(n, n, 2, Storage::symmetric_lower, seed))
                           : random_matrix(n, n, 2, Storage::general, seed);
    const Eigen::MatrixXd d = dense(a);
    auto pattern = a;
    std::fill(pattern.values.begin(), pattern.values.end(), 1.0);
    const Eigen::MatrixXd s = dense(pattern).cwiseMin(1.0);
    EXPECT_EQ(values_are_symmetric(a), d == d.transpose()) << "seed " << seed;
    EXPECT_EQ(structure_is_symmetric(a), s == s.transpose()) << "seed " << seed;
    symmetric += d == d.transpose() ? 1 : 0;
    structural += s == s.transpose() ? 1 : 0;
  }
  EXPECT_GT(symmetric, 100);
  EXPECT_LT(structural, 300);
  EXPECT_FALSE(values_are_symmetric(random_matrix(2, 3, 1, Storage::general, 1)));
}

TEST(Symmetry, AbsentEntryEqualsExplicitZero) {
  const SparseMatrix a{3, 3, {0, 2, 3, 4}, {0, 2, 1, 2}, {1, 0, 2, 3}, Storage::general};
  EXPECT_TRUE(values_are_symmetric(a));
  EXPECT_FALSE(structure_is_symmetric(a));
}

TEST(Norms, EqualDense) {
  base::ThreadPool pool(2);
  for (const auto storage :
       {Storage::general, Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both}) {
    SparseMatrix a =
        storage == Storage::general ? random_matrix(12, 9, 4, storage, 3) : random_symmetric(12, storage, 3);
    sum_duplicates_sorted(a);
    const Eigen::MatrixXd d = dense(a);
    EXPECT_EQ(norm_inf(a), d.cwiseAbs().rowwise().sum().maxCoeff());
    EXPECT_EQ(norm_one(a, &pool), d.cwiseAbs().colwise().sum().maxCoeff());
  }
  const SparseMatrix nan{1, 1, {0, 1}, {0}, {std::numeric_limits<double>::quiet_NaN()}, Storage::general};
  EXPECT_TRUE(std::isinf(norm_inf(nan)));
  EXPECT_EQ(norm_inf(SparseMatrix{0, 0, {0}, {}, {}, Storage::general}), 0);
}

}  // namespace structure_test
}  // namespace espalier::matrix
