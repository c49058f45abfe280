// Truth: single systems through Solver, bit by bit; backward errors in long double.
#include <cmath>

#include "batch/batch_common.hpp"

namespace espalier::test {

namespace {

TEST(Batch, HasTheBitsOfSingleSystems) {
  for (const Index n : {1, 3, 50, 200}) {
    SCOPED_TRACE(n);
    expect_bits_of_single_systems(reference::random_system(n, 3, reference::Values::positive, 1), Kind::automatic, 7, 1,
                                  Transpose::no);
    expect_bits_of_single_systems(reference::random_system(n, 3, reference::Values::indefinite, 2), Kind::ldlt, 7, 2,
                                  Transpose::no);
    for (const Transpose turned : {Transpose::yes, Transpose::conjugate})
      expect_bits_of_single_systems(reference::random_system(n, 3, reference::Values::general, 3), Kind::lu, 7, 1,
                                    turned);
  }
}

// Pivots that one system moves must not be moved for the next.
TEST(Batch, SystemsDoNotLearnFromEachOther) {
  expect_bits_of_single_systems(reference::saddle_point(150, 50, 7), Kind::ldlt, 9, 1, Transpose::no);
}

TEST(Batch, FailuresAreNamedAndTouchNobodyElse) {
  const SparseMatrix a = reference::random_system(40, 3, reference::Values::positive, 1);
  constexpr Index kCount = 12;
  std::vector<double> values = values_of(a, kCount, 1);
  const std::size_t nonzeros = a.values.size();
  std::fill_n(values.begin() + static_cast<std::ptrdiff_t>(3 * nonzeros), nonzeros, 0.0);  // rank 0
  for (std::size_t q = 5 * nonzeros; q < 6 * nonzeros; ++q) values[q] = -values[q];        // negative definite
  values[8 * nonzeros + 2] = std::numeric_limits<double>::quiet_NaN();
  Batch batch(options_of(Kind::llt, 2));
  ASSERT_TRUE(batch.analyze(a).status.ok());
  const std::vector<double> b = reference::random_vector(40 * kCount, 2);
  std::vector<double> x(b.size());
  const BatchResult r = batch.solve(values, b, x, kCount);
  EXPECT_EQ(r.failed, 3);
  EXPECT_EQ(r.status.code, r.systems[3].status.code);
  EXPECT_NE(r.status.message.find("3 of 12 systems failed, first system 3"), std::string::npos) << r.status.message;
  EXPECT_EQ(r.systems[5].status.code, StatusCode::not_positive_definite);
  EXPECT_EQ(r.systems[8].status.code, StatusCode::invalid_input);
  for (Index k = 0; k < kCount; ++k) {
    const bool fails = k == 3 || k == 5 || k == 8;
    EXPECT_EQ(r.systems[static_cast<std::size_t>(k)].status.ok(), !fails) << k;
    EXPECT_EQ(std::isnan(x[static_cast<std::size_t>(40 * k)]), fails) << k;
  }
  const std::vector<double> good = values_of(a, kCount, 1);
  EXPECT_TRUE(batch.solve(good, b, x, kCount).status.ok());
}

TEST(Batch, EmptyBatchesAndBadSizes) {
  const SparseMatrix a = reference::random_system(10, 3, reference::Values::positive, 1);
  Batch batch(options_of(Kind::automatic, 2));
  std::vector<double> b(10, 1.0), x(10);
  EXPECT_THROW((void)batch.solve(a.values, b, x, 1), std::logic_error);
  ASSERT_TRUE(batch.analyze(a).status.ok());
  EXPECT_TRUE(batch.solve({}, {}, {}, 0).status.ok());
  EXPECT_THROW((void)batch.solve(a.values, b, x, 2), std::invalid_argument);
  EXPECT_THROW((void)batch.solve(a.values, b, x, 1, 0), std::invalid_argument);
  EXPECT_THROW((void)batch.solve(a.values, b, x, -1), std::invalid_argument);
  SparseMatrix bad = a;
  bad.row_ind[0] = 99;
  EXPECT_EQ(batch.analyze(bad).status.code, StatusCode::invalid_input);
  EXPECT_THROW((void)batch.solve(a.values, b, x, 1), std::logic_error);
}

TEST(Batch, CanBeStopped) {
  const SparseMatrix a = reference::random_system(200, 3, reference::Values::positive, 1);
  Options o = options_of(Kind::automatic, 2);
  bool stop = false;
  o.interrupted = [&] { return stop; };
  o.interrupted_every = 0;
  Batch batch(o);
  ASSERT_TRUE(batch.analyze(a).status.ok());
  constexpr Index kCount = 50;
  const std::vector<double> values = values_of(a, kCount, 1), b = reference::random_vector(200 * kCount, 2);
  std::vector<double> x(b.size());
  stop = true;
  EXPECT_EQ(batch.solve(values, b, x, kCount).status.code, StatusCode::cancelled);
  stop = false;
  EXPECT_TRUE(batch.solve(values, b, x, kCount).status.ok());
}

TEST(Batch, SystemsOfAnyPatternsAtOnce) {
  std::vector<SparseMatrix> matrices;
  std::vector<std::vector<double>> b, x;
  for (Index k = 0; k < 30; ++k) {
    const auto values = static_cast<reference::Values>(k % 3);
    matrices.push_back(reference::random_system(1 + 7 * k, 3, values, static_cast<std::uint64_t>(k)));
    b.push_back(reference::random_vector(2 * matrices.back().cols, static_cast<std::uint64_t>(k)));
    x.emplace_back(b.back().size());
  }
  std::vector<System> systems;
  for (std::size_t k = 0; k < matrices.size(); ++k) systems.push_back({matrices[k], b[k], x[k], 2});
  const BatchResult r = solve_systems(systems, options_of(Kind::automatic, 2));
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  for (std::size_t k = 0; k < matrices.size(); ++k) {
    Solver single(options_of(Kind::automatic, 1));
    ASSERT_TRUE(single.analyze(matrices[k]).status.ok());
    ASSERT_TRUE(single.factorize(matrices[k]).status.ok());
    std::vector<double> expected(b[k].size());
    (void)single.solve(b[k], expected, 2);
    EXPECT_EQ(x[k], expected) << k;
  }
  systems[4].x = systems[4].x.subspan(1);
  EXPECT_THROW((void)solve_systems(systems), std::invalid_argument);
  systems[4].x = x[4];
  matrices[4].values[0] = std::numeric_limits<double>::infinity();
  const BatchResult bad = solve_systems(systems, options_of(Kind::automatic, 2));
  EXPECT_EQ(bad.failed, 1);
  EXPECT_EQ(bad.systems[4].status.code, StatusCode::invalid_input);
  EXPECT_TRUE(std::isnan(x[4][0]));
}

}  // namespace

}  // namespace espalier::test
