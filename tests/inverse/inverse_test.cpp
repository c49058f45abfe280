// Truth: dense inverses by Eigen, refined columns, closed forms, differences.
#include "espalier/inverse.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>
#include <string>

#include "base/at.hpp"
#include "matrix/generators/generate.hpp"
#include "reference/reference.hpp"

namespace espalier::test {

namespace {

constexpr double kRounding = std::numeric_limits<double>::epsilon();

SparseMatrix generated(const std::vector<std::string>& words) {
  return matrix::generate(matrix::parse_generator(words));
}

std::vector<double> dense_inverse(const MatrixView& a) {
  std::vector<double> identity(at(a.cols) * at(a.cols), 0);
  for (Index i = 0; i < a.cols; ++i) identity[at(i) * at(a.cols) + at(i)] = 1;
  return reference::solve(a, identity, a.cols, false);
}

Solver factorized_by(const MatrixView& a, const Options& o) {
  Solver s(o);
  const AnalysisResult analysis = s.analyze(a);
  EXPECT_TRUE(analysis.status.ok()) << analysis.status.message;
  const FactorResult f = s.factorize(a);
  EXPECT_TRUE(f.status.ok()) << f.status.message;
  return s;
}

/// The largest difference from the dense inverse over the largest entry of the column.
double apart(const std::vector<double>& dense, Index n, const MatrixView& pattern, const std::vector<double>& x,
             bool transpose = false) {
  double most = 0;
  for (Index j = 0; j < n; ++j)
    for (Offset q = pattern.col_ptr[at(j)]; q < pattern.col_ptr[at(j) + 1]; ++q) {
      const Index i = pattern.row_ind[at(q)], column = transpose ? i : j, unknown = transpose ? j : i;
      double largest = 0;
      for (Index k = 0; k < n; ++k) largest = std::max(largest, std::abs(dense[at(column) * at(n) + at(k)]));
      most = std::max(most, std::abs(x[at(q)] - dense[at(column) * at(n) + at(unknown)]) / largest);
      if (std::isnan(x[at(q)])) return x[at(q)];
    }
  return most;
}

SparseMatrix random_pattern(Index n, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<reference::Triple> list;
  for (Index k = 0; k < 3 * n; ++k) {
    const auto row = static_cast<Index>(random() % at(n)), col = static_cast<Index>(random() % at(n));
    list.push_back({row, col, 1.0});
  }
  std::sort(list.begin(), list.end(), [](const auto& a, const auto& b) { return a.col < b.col; });
  return reference::from_triples(n, list, Storage::general);
}

SparseMatrix system_of(int sort, Index n, std::uint64_t seed) {
  switch (sort) {
    case 0:
      return reference::random_system(n, 3, reference::Values::positive, seed);
    case 1:
      return reference::random_system(n, 3, reference::Values::indefinite, seed);
    case 2:
      return reference::random_system(n, 3, reference::Values::general, seed);
    default:
      return reference::saddle_point(n, std::max<Index>(1, n / 4), seed);
  }
}

}  // namespace

// Every kind, storage, order and width of tiles; entries of A and others.
TEST(SelectedInverse, RandomSystemsAgreeWithDenseInverses) {
  std::mt19937_64 random(71);
  Index compared = 0, solved = 0, two_by_two = 0, delayed = 0;
  for (int run = 0; run < 400; ++run) {
    const int sort = run % 4;
    const auto n = static_cast<Index>(run < 8 ? 1 + run / 4 : 1 + random() % 90);
    if (sort == 3 && n < 3) continue;
    SparseMatrix a = system_of(sort, n, random());
    const Storage storages[] = {Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both,
                                Storage::general};
    if (a.storage != Storage::general) a = reference::stored_as(a, storages[random() % 4], random() % 3 == 0);
    const double condition = reference::condition(a);
    if (!(condition < 1e9)) continue;
    Options o;
    o.threads = 1 + static_cast<int>(random() % 3);
    o.max_block_size = random() % 2 == 0 ? 8 : 0;
    o.kind = sort == 0 && random() % 2 == 0 ? Kind::llt : random() % 4 == 0 ? Kind::lu : Kind::automatic;
    o.matching = random() % 3 != 0;
    if (random() % 3 == 0) {
      o.permutation.resize(at(a.cols));
      std::iota(o.permutation.begin(), o.permutation.end(), 0);
      std::shuffle(o.permutation.begin(), o.permutation.end(), random);
    }
    SCOPED_TRACE("run " + std::to_string(run) + ", n " + std::to_string(a.cols));
    Solver s = factorized_by(a, o);
    const FactorResult f = s.factorize(a);
    two_by_two += f.two_by_two;
    delayed += f.delayed;
    const std::vector<double> dense = dense_inverse(a);
    const double limit = 100 * condition * kRounding;
    for (const bool transpose : {false, true}) {
      std::vector<double> x(at(a.nonzeros()));
      const InverseResult r = selected_inverse(s, a, x, transpose ? Transpose::yes : Transpose::no);
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      EXPECT_LE(apart(dense, a.cols, a, x, transpose), limit);
      EXPECT_GT(r.checked, 0);
      if (transpose) {
        EXPECT_EQ(r.solved, 0) << "entries of A^-T where A stores something are those of the factor";
      }
      EXPECT_LE(r.error, limit);
    }
    std::vector<double> diagonal(at(a.cols));
    const InverseResult d = inverse_diagonal(s, diagonal);
    ASSERT_TRUE(d.status.ok()) << d.status.message;
    for (Index i = 0; i < a.cols; ++i) {
      const double* column = dense.data() + at(i) * at(a.cols);
      double largest = 0;
      for (Index k = 0; k < a.cols; ++k) largest = std::max(largest, std::abs(column[k]));
      EXPECT_NEAR(diagonal[at(i)], column[i], limit * largest);
    }
    const SparseMatrix any = random_pattern(a.cols, random());
    std::vector<double> x(at(any.nonzeros()));
    const InverseResult r = selected_inverse(s, any, x);
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    const double error = apart(dense, a.cols, any, x);
    EXPECT_LE(error, limit);
    if (a.cols <= 8) {
      EXPECT_LE(error, 2 * r.error + 10 * condition * kRounding);
    }
    solved += r.solved;
    ++compared;
  }
  EXPECT_GT(compared, 300);
  EXPECT_GT(solved, 1000);
  EXPECT_GT(two_by_two, 100);
  EXPECT_GT(delayed, 10);
}

TEST(SelectedInverse, ThreadsChangeNoBits) {
  for (const auto& words : std::vector<std::vector<std::string>>{{"elasticity", "7"}, {"kkt", "2", "5", "3", "3"}}) {
    const SparseMatrix a = generated(words);
    for (const Kind kind : {Kind::automatic, Kind::lu}) {
      std::vector<double> first;
      for (const int threads : {1, 2, 3}) {
        Options o;
        o.device = "cpu";
        o.kind = kind;
        o.threads = threads;
        Solver s = factorized_by(a, o);
        std::vector<double> x(at(a.nonzeros()));
        ASSERT_TRUE(selected_inverse(s, a, x).status.ok());
        if (first.empty()) first = x;
        EXPECT_EQ(first, x) << threads;
      }
    }
  }
}

// Fronts of many tiles; every entry of 50 columns, to ten digits.
TEST(SelectedInverse, LargeFrontsAgreeWithSolutions) {
  const SparseMatrix a = generated({"elasticity", "9"});
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    SCOPED_TRACE(static_cast<int>(kind));
    Options o;
    o.device = "cpu";
    o.kind = kind;
    o.threads = 2;
    Solver s = factorized_by(a, o);
    std::vector<double> x(at(a.nonzeros()));
    const InverseResult r = selected_inverse(s, a, x);
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    EXPECT_EQ(r.solved, 0);
    EXPECT_LE(r.error, 1e-11);
    std::vector<double> b(at(a.cols) * 50, 0), columns(b.size());
    for (Index c = 0; c < 50; ++c) b[at(c) * at(a.cols) + at(c * (a.cols / 50))] = 1;
    ASSERT_TRUE(s.solve(b, columns, 50).status.ok());
    for (Index c = 0; c < 50; ++c) {
      const Index j = c * (a.cols / 50);
      for (Offset q = a.col_ptr[at(j)]; q < a.col_ptr[at(j) + 1]; ++q) {
        const double truth = columns[at(c) * at(a.cols) + at(a.row_ind[at(q)])];
        EXPECT_NEAR(x[at(q)], truth, 1e-10 * std::abs(truth)) << j;
      }
    }
  }
}

// Through a memory that holds half of the factorization.
TEST(SelectedInverse, OutOfCore) {
  for (const auto& words : std::vector<std::vector<std::string>>{{"elasticity", "8"}, {"kkt", "3", "8", "4", "4"}}) {
    const SparseMatrix a = generated(words);
    for (const Kind kind : {Kind::automatic, Kind::lu}) {
      Options o;
      o.device = "host:2";
      o.kind = kind;
      Solver whole(o);
      ASSERT_TRUE(whole.analyze(a).status.ok());
      o.device_memory_bytes = whole.factorize(a).devices.front().peak_bytes / 2;
      Solver s(o);
      ASSERT_TRUE(s.analyze(a).status.ok());
      ASSERT_GT(s.factorize(a).devices.front().streamed_out_bytes, 0);
      std::vector<double> x(at(a.nonzeros())), y(x);
      ASSERT_TRUE(selected_inverse(whole, a, x).status.ok());
      const InverseResult r = selected_inverse(s, a, y);
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      double most = 0;
      for (std::size_t q = 0; q < x.size(); ++q) most = std::max(most, std::abs(x[q]));
      for (std::size_t q = 0; q < x.size(); ++q) ASSERT_NEAR(x[q], y[q], 1e-8 * most);
      EXPECT_LE(r.error, 1e-8);
    }
  }
}

// In a circulant the variance is the mean of 1 / eigenvalue; on a torus of m x m likewise.
TEST(SelectedInverse, VariancesOfAMarkovFieldOnATorus) {
  constexpr Index kSide = 12;
  constexpr double kKappa = 0.3;
  std::vector<reference::Triple> list;
  const auto number = [](Index i, Index j) { return (i + kSide) % kSide * kSide + (j + kSide) % kSide; };
  for (Index i = 0; i < kSide; ++i)
    for (Index j = 0; j < kSide; ++j) {
      list.push_back({number(i, j), number(i, j), 4 + kKappa});
      for (const auto& [di, dj] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}})
        list.push_back({number(i + di, j + dj), number(i, j), -1});
    }
  const SparseMatrix q = reference::from_triples(kSide * kSide, list, Storage::symmetric_both);
  double variance = 0;
  for (Index k = 0; k < kSide; ++k)
    for (Index l = 0; l < kSide; ++l) {
      const double angle = 2 * std::numbers::pi / kSide;
      variance += 1 / (4 + kKappa - 2 * std::cos(angle * k) - 2 * std::cos(angle * l)) / (kSide * kSide);
    }
  Solver s = factorized_by(q, {});
  std::vector<double> x(at(q.cols));
  const InverseResult r = inverse_diagonal(s, x);
  ASSERT_TRUE(r.status.ok());
  for (const double v : x) EXPECT_NEAR(v, variance, 1e-13 * variance);
  EXPECT_LE(r.error, 1e-13);
  EXPECT_EQ(r.checked, 8);
}

TEST(SelectedInverse, GradientOfTheLogarithmOfTheDeterminant) {
  for (const auto values : {reference::Values::positive, reference::Values::general}) {
    SparseMatrix a = reference::random_system(40, 3, values, 12);
    Solver s = factorized_by(a, {});
    std::vector<double> gradient(at(a.nonzeros()));
    ASSERT_TRUE(selected_inverse(s, a, gradient, Transpose::yes).status.ok());
    for (Offset q = 0; q < a.nonzeros(); q += 7) {
      constexpr double kStep = 1e-6;
      double logs[2] = {};
      for (const int side : {0, 1}) {
        SparseMatrix b = a;
        b.values[at(q)] += side == 0 ? -kStep : kStep;
        logs[side] = reference::determinant(b).log;
      }
      const auto col = std::upper_bound(a.col_ptr.begin(), a.col_ptr.end(), q) - a.col_ptr.begin() - 1;
      const bool twice = a.symmetric() && a.row_ind[at(q)] != col;
      EXPECT_NEAR((twice ? 2 : 1) * gradient[at(q)], (logs[1] - logs[0]) / (2 * kStep), 1e-6);
    }
  }
}

TEST(SelectedInverse, Traces) {
  std::mt19937_64 random(5);
  for (const auto values : {reference::Values::positive, reference::Values::indefinite, reference::Values::general}) {
    const SparseMatrix a = reference::random_system(30, 3, values, 3);
    const SparseMatrix b = reference::random_system(30, 2, values, 4);
    const std::vector<double> x = dense_inverse(a), full = reference::dense(b);
    double trace = 0, scale = 0;
    for (Index i = 0; i < 30; ++i)
      for (Index j = 0; j < 30; ++j) {
        trace += x[at(j) * 30 + at(i)] * full[at(i) * 30 + at(j)];
        scale += std::abs(x[at(j) * 30 + at(i)] * full[at(i) * 30 + at(j)]);
      }
    Solver s = factorized_by(a, {});
    const double limit = 100 * reference::condition(a) * kRounding * scale;
    for (const Storage storage : {Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both}) {
      const TraceResult r = trace_of_inverse(s, b.symmetric() ? reference::stored_as(b, storage) : b);
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      EXPECT_NEAR(r.trace, trace, limit);
      EXPECT_GT(r.trace_error, 0);
    }
    // trace(A^-1 A) = n, whatever A
    const TraceResult r = trace_of_inverse(s, a);
    EXPECT_NEAR(r.trace, 30, 1e-9);
    const SparseMatrix none = reference::from_triples(30, {}, Storage::general);
    const TraceResult nothing = trace_of_inverse(s, none);
    EXPECT_TRUE(nothing.status.ok());
    EXPECT_EQ(nothing.trace, 0);
    EXPECT_EQ(nothing.trace_error, 0);
  }
}

TEST(SelectedInverse, BlocksOfNodes) {
  const SparseMatrix a = generated({"elasticity", "4"});
  Solver s = factorized_by(a, {});
  const std::vector<double> dense = dense_inverse(a);
  std::vector<double> x(at(a.cols) * 3);
  ASSERT_TRUE(inverse_blocks(s, 3, x).status.ok());
  for (Index i = 0; i < a.cols; ++i)
    for (Index c = 0; c < 3; ++c) {
      const Index column = i / 3 * 3 + c;
      const double truth = dense[at(column) * at(a.cols) + at(i)];
      EXPECT_NEAR(x[at(i / 3 * 9 + c * 3 + i % 3)], truth, 1e-10 * std::abs(dense[at(i) * at(a.cols) + at(i)]));
    }
  EXPECT_THROW((void)inverse_blocks(s, 0, x), std::invalid_argument);
  EXPECT_THROW((void)inverse_blocks(s, 7, x), std::invalid_argument);
}

TEST(SelectedInverse, SingularMatricesAreRefused) {
  SparseMatrix a = reference::from_triples(
      4, {{0, 0, 2}, {1, 0, 1}, {0, 1, 1}, {1, 1, 2}, {2, 2, 1}, {3, 2, 1}, {2, 3, 1}, {3, 3, 1}}, Storage::general);
  for (const SingularMatrix what : {SingularMatrix::report, SingularMatrix::null_vectors}) {
    Options o;
    o.singular = what;
    Solver s = factorized_by(a, o);
    std::vector<double> x(4);
    const InverseResult r = inverse_diagonal(s, x);
    EXPECT_EQ(r.status.code, StatusCode::singular);
    EXPECT_NE(r.status.message.find("rank is 3 of 4"), std::string::npos) << r.status.message;
    EXPECT_GE(r.status.row, 2);
  }
  Solver s;
  ASSERT_TRUE(s.analyze(a).status.ok());
  EXPECT_EQ(s.factorize(a).status.code, StatusCode::singular);
  std::vector<double> x(4);
  EXPECT_THROW((void)inverse_diagonal(s, x), std::logic_error);
}

TEST(SelectedInverse, BadInput) {
  const SparseMatrix a = reference::random_system(10, 3, reference::Values::positive, 1);
  Solver s;
  std::vector<double> x(10);
  EXPECT_THROW((void)inverse_diagonal(s, x), std::logic_error);
  ASSERT_TRUE(s.analyze(a).status.ok());
  EXPECT_THROW((void)inverse_diagonal(s, x), std::logic_error);
  ASSERT_TRUE(s.factorize(a).status.ok());
  std::vector<double> nine(9);
  EXPECT_THROW((void)inverse_diagonal(s, nine), std::invalid_argument);
  EXPECT_THROW((void)selected_inverse(s, a, nine), std::invalid_argument);
  SparseMatrix bad = a;
  bad.row_ind.back() = 10;
  std::vector<double> values(at(a.nonzeros()));
  EXPECT_EQ(selected_inverse(s, bad, values).status.code, StatusCode::invalid_input);
  EXPECT_EQ(trace_of_inverse(s, bad).status.code, StatusCode::invalid_input);
  bad = a;
  bad.values[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(trace_of_inverse(s, bad).status.code, StatusCode::invalid_input);
  MatrixView without = a;
  without.values = {};
  EXPECT_EQ(trace_of_inverse(s, without).status.code, StatusCode::invalid_input);
  const SparseMatrix smaller = reference::random_system(9, 3, reference::Values::positive, 1);
  EXPECT_EQ(trace_of_inverse(s, smaller).status.code, StatusCode::invalid_input);
  // A failed factorization leaves none.
  EXPECT_FALSE(s.refactorize(bad.values).status.ok());
  EXPECT_THROW((void)inverse_diagonal(s, x), std::logic_error);
  ASSERT_TRUE(s.factorize(a).status.ok());
  EXPECT_TRUE(inverse_diagonal(s, x).status.ok());
}

TEST(SelectedInverse, FollowsValuesAndPatterns) {
  SparseMatrix a = reference::random_system(60, 3, reference::Values::positive, 8);
  Solver s = factorized_by(a, {});
  std::vector<double> x(60);
  for (double& v : a.values) v *= 4;
  ASSERT_TRUE(s.refactorize(a.values).status.ok());
  ASSERT_TRUE(inverse_diagonal(s, x).status.ok());
  std::vector<double> dense = dense_inverse(a);
  for (Index i = 0; i < 60; ++i) EXPECT_NEAR(x[at(i)], dense[at(i) * 61], 1e-12 * dense[at(i) * 61]);
  const Solver clone = s.clone();
  EXPECT_EQ(clone.state(), Solver::State::analyzed);
  const std::vector<double> full = reference::dense(a);
  std::vector<reference::Triple> list;
  for (Index c = 0; c < 60; ++c)
    for (Index r = c; r < 60; ++r)
      if (const double v = full[at(c) * 60 + at(r)]; v != 0 || (r == 59 && c == 0))
        list.push_back({r, c, v + (r == 59 && c == 0 ? 0.5 : 0) + (r == c ? 1 : 0)});
  const SparseMatrix changed = reference::from_triples(60, list, Storage::symmetric_lower);
  ASSERT_TRUE(s.analyze_change(changed).analysis.status.ok());
  EXPECT_THROW((void)inverse_diagonal(s, x), std::logic_error);
  ASSERT_TRUE(s.factorize(changed).status.ok());
  std::vector<double> entries(at(changed.nonzeros()));
  ASSERT_TRUE(selected_inverse(s, changed, entries).status.ok());
  dense = dense_inverse(changed);
  EXPECT_LE(apart(dense, 60, changed, entries), 1e-12);
}

TEST(SelectedInverse, UnitsAndScalings) {
  for (const auto values : {reference::Values::positive, reference::Values::indefinite, reference::Values::general}) {
    const SparseMatrix a = reference::random_system(50, 3, values, 21);
    SparseMatrix b = a;  // D A D, powers of two: A^-1 comes back without rounding
    const auto unit = [](Index i) { return (i * 37) % 61 - 30; };
    for (Index c = 0; c < 50; ++c)
      for (Offset q = b.col_ptr[at(c)]; q < b.col_ptr[at(c) + 1]; ++q)
        b.values[at(q)] = std::ldexp(b.values[at(q)], unit(b.row_ind[at(q)]) + unit(c));
    Solver s = factorized_by(b, {});
    std::vector<double> x(at(b.nonzeros()));
    ASSERT_TRUE(selected_inverse(s, b, x, Transpose::yes).status.ok());
    for (Index c = 0; c < 50; ++c)
      for (Offset q = b.col_ptr[at(c)]; q < b.col_ptr[at(c) + 1]; ++q)
        x[at(q)] = std::ldexp(x[at(q)], unit(b.row_ind[at(q)]) + unit(c));
    EXPECT_LE(apart(dense_inverse(a), 50, a, x, true), 1000 * reference::condition(a) * kRounding);
  }
}

// What is said of the error holds: in FP32, and where the matrix is nearly singular.
TEST(SelectedInverse, ErrorsAreToldAsTheyAre) {
  for (const Precision precision : {Precision::fp64, Precision::fp32, Precision::mixed})
    for (const double small : {1.0, 1e-4, 1e-9}) {
      SparseMatrix a = reference::random_system(60, 3, reference::Values::positive, 30);
      std::vector<reference::Triple> list{{0, 0, 1}, {1, 0, 1}, {1, 1, 1 + small}};
      for (Index c = 0; c < 60; ++c)
        for (Offset q = a.col_ptr[at(c)]; q < a.col_ptr[at(c) + 1]; ++q)
          list.push_back({a.row_ind[at(q)] + 2, c + 2, a.values[at(q)]});
      const SparseMatrix joined = reference::from_triples(62, list, Storage::symmetric_lower);
      Options o;
      o.precision = precision;
      Solver s(o);
      ASSERT_TRUE(s.analyze(joined).status.ok());
      if (!s.factorize(joined).status.ok()) continue;  // singular in FP32
      std::vector<double> x(62);
      const InverseResult r = inverse_diagonal(s, x);
      // [1 1; 1 1 + s]^-1 = [1 + s, -1; -1, 1] / s
      const double exact = (1 + small) - 1, error = std::abs(x[1] * exact - 1);
      EXPECT_LE(error, 2 * r.error + 1e-15) << small;
      EXPECT_TRUE(r.status.ok() || r.status.code == StatusCode::accuracy_not_reached) << r.status.message;
      EXPECT_EQ(r.status.ok(), r.error <= 1e-3);
      if (precision == Precision::fp64) {
        EXPECT_LE(r.error, 1e-14 / small);
      }
    }
}

TEST(SelectedInverse, MemoryAndInterruption) {
  const SparseMatrix a = generated({"elasticity", "8"});
  Options o;
  o.threads = 1;
  Solver whole(o);
  ASSERT_TRUE(whole.analyze(a).status.ok());
  const Offset peak = whole.factorize(a).peak_host_bytes;
  std::vector<double> x(at(a.nonzeros()));
  bool refused = false, stop = false;
  o.host_memory_bytes = peak + peak / 50;
  o.interrupted = [&stop] { return stop; };
  o.interrupted_every = 0;
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  const FactorResult f = s.factorize(a);
  ASSERT_TRUE(f.status.ok()) << f.status.message;
  const InverseResult r = selected_inverse(s, a, x);
  refused = r.status.code == StatusCode::out_of_memory;
  EXPECT_TRUE(refused) << r.status.message;
  std::vector<double> diagonal(at(a.cols)), b(at(a.cols), 1), y(at(a.cols));
  EXPECT_TRUE(s.solve(b, y).status.ok());  // the factor is as it was
  stop = true;
  EXPECT_EQ(inverse_diagonal(s, diagonal).status.code, StatusCode::cancelled);
  stop = false;
  EXPECT_TRUE(s.solve(b, y).status.ok());
}

// Forests: nothing couples the unknowns, or small groups of them.
TEST(SelectedInverse, DisconnectedSystems) {
  for (const Index group : {1, 2, 5}) {
    std::vector<reference::Triple> list;
    for (Index i = 0; i < 100; ++i) {
      list.push_back({i, i, 2.0 + i});
      if (i % group + 1 < group) list.push_back({i + 1, i, 1});
    }
    const SparseMatrix a = reference::from_triples(100, list, Storage::symmetric_lower);
    Options o;
    o.threads = 3;
    Solver s = factorized_by(a, o);
    std::vector<double> x(100);
    ASSERT_TRUE(inverse_diagonal(s, x).status.ok());
    const std::vector<double> dense = dense_inverse(a);
    for (Index i = 0; i < 100; ++i) EXPECT_NEAR(x[at(i)], dense[at(i) * 101], 1e-15);
    // Entries between groups are zero.
    const SparseMatrix far = reference::from_triples(100, {{99, 0, 1}, {0, 99, 1}}, Storage::general);
    std::vector<double> zeros(2, 1);
    const InverseResult r = selected_inverse(s, far, zeros);
    EXPECT_EQ(zeros, std::vector<double>(2, 0));
    EXPECT_EQ(r.solved, 2);
  }
}

}  // namespace espalier::test
