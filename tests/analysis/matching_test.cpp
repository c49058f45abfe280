#include "analysis/matching.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "matrix/generators/generate.hpp"

namespace espalier::analysis {
namespace {

using Dense = std::vector<std::vector<double>>;  // [row][column]; 0: no entry

SparseMatrix sparse_of(const Dense& d, Storage storage = Storage::general) {
  const auto n = static_cast<Index>(d.size());
  SparseMatrix m{n, n, {0}, {}, {}, storage};
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < n; ++i) {
      const bool stored = storage == Storage::general || storage == Storage::symmetric_both ||
                          (storage == Storage::symmetric_lower ? i >= j : i <= j);
      if (!stored || d[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] == 0) continue;
      m.row_ind.push_back(i);
      m.values.push_back(d[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)]);
    }
    m.col_ptr.push_back(static_cast<Offset>(m.row_ind.size()));
  }
  return m;
}

/// Entries with probability `density`, magnitudes 10^-spread .. 10^spread, both signs.
Dense random_dense(std::size_t n, double density, double spread, std::mt19937& random, bool symmetric = false) {
  std::uniform_real_distribution<double> unit(0, 1), exponent(-spread, spread);
  Dense d(n, std::vector<double>(n, 0));
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      if (unit(random) < density) d[i][j] = (unit(random) < 0.5 ? -1 : 1) * std::pow(10, exponent(random));
      if (symmetric && j < i) d[i][j] = d[j][i];
    }
  return d;
}

/// Largest sum of logarithms over all permutations; -infinity when there is none. The truth for small n.
double best_by_enumeration(const Dense& d) {
  std::vector<std::size_t> p(d.size());
  std::iota(p.begin(), p.end(), std::size_t{0});
  double best = -std::numeric_limits<double>::infinity();
  do {
    double sum = 0;
    for (std::size_t j = 0; j < p.size(); ++j) sum += std::log(std::abs(d[p[j]][j]));
    best = std::max(best, sum);
  } while (std::next_permutation(p.begin(), p.end()));
  return best;
}

/// Size of a largest matching by plain augmenting paths: the truth for the structural rank.
Index rank_by_augmenting_paths(const Dense& d) {
  const std::size_t n = d.size();
  std::vector<std::size_t> column_of(n, n);
  Index rank = 0;
  for (std::size_t j = 0; j < n; ++j) {
    std::vector<char> seen(n, 0);
    const std::function<bool(std::size_t)> grow = [&](std::size_t c) {
      for (std::size_t i = 0; i < n; ++i) {
        if (d[i][c] == 0 || seen[i] != 0) continue;
        seen[i] = 1;
        if (column_of[i] == n || grow(column_of[i])) {
          column_of[i] = c;
          return true;
        }
      }
      return false;
    };
    rank += grow(j) ? 1 : 0;
  }
  return rank;
}

/// Dual feasibility and complementary slackness: |r a c| <= 1, equal to 1 on the matching; matched rows are distinct.
void expect_optimal(const Dense& d, const Matching& m, unsigned seed) {
  const double n = static_cast<double>(d.size());
  // Each dual is a sum of at most n path lengths, themselves sums of logarithms below 2000.
  const double tolerance = 2000 * (n + 10) * std::numeric_limits<double>::epsilon();
  for (std::size_t j = 0; j < d.size(); ++j)
    for (std::size_t i = 0; i < d.size(); ++i) {
      const double scaled = std::abs(m.row_scale[i] * d[i][j] * m.col_scale[j]);
      ASSERT_LE(scaled, 1 + tolerance) << "seed " << seed << " entry " << i << "," << j;
      if (m.row_of_col[j] == static_cast<Index>(i)) {
        ASSERT_NEAR(scaled, 1, tolerance) << "seed " << seed;
      }
    }
  std::vector<char> used(d.size(), 0);
  Index matched = 0;
  for (std::size_t j = 0; j < d.size(); ++j) {
    ASSERT_GT(m.row_scale[j], 0);
    ASSERT_GT(m.col_scale[j], 0);
    if (m.row_of_col[j] < 0) continue;
    const auto i = static_cast<std::size_t>(m.row_of_col[j]);
    ASSERT_NE(d[i][j], 0) << "seed " << seed;
    ASSERT_EQ(used[i], 0) << "seed " << seed;
    used[i] = 1;
    ++matched;
  }
  ASSERT_EQ(matched, m.structural_rank);
}

TEST(Matching, ProductEqualsTheBestOverAllPermutations) {
  int nonsingular = 0;
  for (unsigned seed = 0; seed < 300; ++seed) {
    std::mt19937 random(seed);
    const std::size_t n = 1 + random() % 7;
    const Dense d = random_dense(n, 0.5, 4, random);
    const Matching m = maximum_product_matching(sparse_of(d));
    expect_optimal(d, m, seed);
    const double best = best_by_enumeration(d);
    ASSERT_EQ(std::isfinite(best), m.structural_rank == static_cast<Index>(n)) << "seed " << seed;
    if (!std::isfinite(best)) continue;
    ++nonsingular;
    double sum = 0;
    for (std::size_t j = 0; j < n; ++j) sum += std::log(std::abs(d[static_cast<std::size_t>(m.row_of_col[j])][j]));
    EXPECT_NEAR(sum, best, 1e3 * static_cast<double>(n) * std::numeric_limits<double>::epsilon()) << "seed " << seed;
  }
  EXPECT_GT(nonsingular, 50);
}

TEST(Matching, DualityHoldsOnLargerAndSingularMatrices) {
  int singular = 0;
  for (unsigned seed = 0; seed < 120; ++seed) {
    std::mt19937 random(seed);
    const std::size_t n = 20 + random() % 80;
    const Dense d =
        random_dense(n, (0.5 + 4 * static_cast<double>(seed % 10) / 10) / static_cast<double>(n), 8, random);
    const Matching m = maximum_product_matching(sparse_of(d));
    expect_optimal(d, m, seed);
    ASSERT_EQ(m.structural_rank, rank_by_augmenting_paths(d)) << "seed " << seed;
    singular += m.structural_rank < static_cast<Index>(n) ? 1 : 0;
  }
  EXPECT_GT(singular, 20);
}

/// [H A' -Z; A 0 0; -Z 0 -X], the 3x3 blocks of an interior-point method late in its run: of each pair x, z > 0 with
/// x z = mu one is large and one small. Both triangles.
SparseMatrix late_interior_point(Index variables, Index rows, double mu, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const Index n = 2 * variables + rows;
  std::vector<std::vector<std::pair<Index, double>>> columns(static_cast<std::size_t>(n));
  const auto add = [&](Index i, Index j, double v) {
    columns[static_cast<std::size_t>(j)].emplace_back(i, v);
    if (i != j) columns[static_cast<std::size_t>(i)].emplace_back(j, v);
  };
  for (Index v = 0; v < variables; ++v) {
    const double x = std::exp(normal(random)) * (random() % 2 == 0 ? 1 : mu), z = mu / x;
    add(v, v, random() % 3 == 0 ? 1.0 : 1e-8);
    add(variables + rows + v, v, -std::sqrt(z));
    add(variables + rows + v, variables + rows + v, -x);
  }
  for (Index r = 0; r < rows; ++r)
    for (Index k = 0; k < 4; ++k)  // distinct columns in each row
      add(variables + r, (r + k * (rows + 1)) % variables, normal(random));
  SparseMatrix a{n, n, {0}, {}, {}, Storage::general};
  for (auto& column : columns) {
    std::sort(column.begin(), column.end());
    for (const auto& [i, v] : column) {
      a.row_ind.push_back(i);
      a.values.push_back(v);
    }
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  return a;
}

// The truth is duality: r |a| c <= 1 everywhere and = 1 on a complete matching proves that no product is larger.
TEST(Matching, IsOptimalWhereColumnsBidForRows) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    const double mu = seed % 2 == 0 ? 1e-8 : 1e-3;
    const SparseMatrix a = late_interior_point(1500, 700 + 50 * static_cast<Index>(seed), mu, seed);
    const Matching m = maximum_product_matching(a);
    ASSERT_EQ(m.structural_rank, a.cols) << "seed " << seed;
    std::vector<char> used(static_cast<std::size_t>(a.rows), 0);
    const double rounding = 1e4 * static_cast<double>(a.cols) * std::numeric_limits<double>::epsilon();
    for (Index j = 0; j < a.cols; ++j)
      for (Offset k = a.col_ptr[static_cast<std::size_t>(j)]; k < a.col_ptr[static_cast<std::size_t>(j) + 1]; ++k) {
        const auto i = static_cast<std::size_t>(a.row_ind[static_cast<std::size_t>(k)]);
        const double scaled =
            std::abs(a.values[static_cast<std::size_t>(k)]) * m.row_scale[i] * m.col_scale[static_cast<std::size_t>(j)];
        ASSERT_LE(scaled, 1 + rounding) << "seed " << seed << " column " << j;
        if (m.row_of_col[static_cast<std::size_t>(j)] != static_cast<Index>(i)) continue;
        ASSERT_NEAR(scaled, 1, rounding) << "seed " << seed << " column " << j;
        ASSERT_EQ(used[i]++, 0) << "seed " << seed;
      }
    ASSERT_EQ(std::count(used.begin(), used.end(), 1), a.cols) << "seed " << seed;
  }
}

TEST(Matching, EmptyAndZeroMatrices) {
  const Matching none = maximum_product_matching(sparse_of({}));
  EXPECT_EQ(none.structural_rank, 0);
  const Matching zero = maximum_product_matching(sparse_of(Dense(3, std::vector<double>(3, 0))));
  EXPECT_EQ(zero.structural_rank, 0);
  EXPECT_EQ(zero.row_scale, std::vector<double>(3, 1));
  EXPECT_EQ(zero.row_of_col, std::vector<Index>(3, -1));
}

TEST(SymmetricMatching, PairsAreEntriesAndScalingBoundsThem) {
  base::ThreadPool pool(1);
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937 random(seed);
    const std::size_t n = 1 + random() % 40;
    Dense d = random_dense(n, 3.0 / static_cast<double>(n), 5, random, true);
    for (std::size_t k = 0; k < n; ++k)
      if (random() % 2 == 0) d[k][k] = 0;
    const Storage storage = seed % 3 == 0   ? Storage::symmetric_lower
                            : seed % 3 == 1 ? Storage::symmetric_upper
                                            : Storage::symmetric_both;
    const SymmetricMatching m = symmetric_matching(sparse_of(d, storage), pool);
    ASSERT_EQ(m.structural_rank, rank_by_augmenting_paths(d)) << "seed " << seed;
    const double tolerance = 2000 * (static_cast<double>(n) + 10) * std::numeric_limits<double>::epsilon();
    for (std::size_t v = 0; v < n; ++v) {
      const auto w = static_cast<std::size_t>(m.pair[v]);
      ASSERT_EQ(static_cast<std::size_t>(m.pair[w]), v) << "seed " << seed;
      if (w != v) {
        ASSERT_NE(d[v][w], 0) << "seed " << seed;
      }
      for (std::size_t u = 0; u < n; ++u)
        ASSERT_LE(std::abs(m.scale[v] * d[v][u] * m.scale[u]), 1 + tolerance) << "seed " << seed;
    }
  }
}

TEST(SymmetricMatching, PositiveDefiniteMatrixStaysOnItsDiagonal) {
  // |a_ij| < sqrt(a_ii a_jj), so no permutation has a larger product than the identity, and s_i = a_ii^(-1/2).
  std::mt19937 random(3);
  const std::size_t n = 30;
  const Dense b = random_dense(n, 0.3, 2, random);
  Dense d(n, std::vector<double>(n, 0));
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t k = 0; k < n; ++k) d[i][j] += b[i][k] * b[j][k] + (i == j ? 1e-3 : 0);
  base::ThreadPool pool(1);
  const SymmetricMatching m = symmetric_matching(sparse_of(d, Storage::symmetric_lower), pool);
  for (std::size_t v = 0; v < n; ++v) {
    EXPECT_EQ(m.pair[v], static_cast<Index>(v));
    EXPECT_NEAR(m.scale[v] * m.scale[v] * d[v][v], 1, 16 * std::numeric_limits<double>::epsilon());
  }
}

TEST(SymmetricMatching, MultipliersArePairedWithWhatTheyTouch) {
  // K = [D B^T; B 0], B with entries in distinct columns: every multiplier must be matched off its diagonal.
  std::mt19937 random(11);
  const std::size_t n = 40, m = 10;
  Dense d(n + m, std::vector<double>(n + m, 0));
  for (std::size_t k = 0; k < n; ++k) d[k][k] = 2 + static_cast<double>(random() % 5);
  for (std::size_t k = 0; k < m; ++k)
    for (std::size_t u : {4 * k, 4 * k + 1, (4 * k + 7) % n})
      d[n + k][u] = d[u][n + k] = 1 + static_cast<double>(random() % 3);
  base::ThreadPool pool(2);
  const SymmetricMatching matching = symmetric_matching(sparse_of(d, Storage::symmetric_lower), pool);
  EXPECT_EQ(matching.structural_rank, static_cast<Index>(n + m));
  for (std::size_t k = n; k < n + m; ++k) {
    ASSERT_NE(matching.pair[k], static_cast<Index>(k));
    EXPECT_NE(d[k][static_cast<std::size_t>(matching.pair[k])], 0);
  }
}

TEST(PairsForLu, MultipliersStandBesideWhatTheyTouch) {
  // K = [F B^T; C 0], the signs of B and C opposite, F unsymmetric: incompressible flow in small.
  std::mt19937 random(12);
  const std::size_t n = 40, m = 10;
  Dense d(n + m, std::vector<double>(n + m, 0));
  for (std::size_t k = 0; k < n; ++k) {
    d[k][k] = 2 + static_cast<double>(random() % 5);
    d[k][(k + 1) % n] = 1, d[(k + 1) % n][k] = -0.5;
  }
  for (std::size_t k = 0; k < m; ++k)
    for (std::size_t u : {4 * k, 4 * k + 1, (4 * k + 7) % n}) {
      d[u][n + k] = 1 + static_cast<double>(random() % 3);
      d[n + k][u] = -d[u][n + k];
    }
  base::ThreadPool pool(2);
  const SparseMatrix a = sparse_of(d);
  const std::vector<Index> pair = pairs_for_lu(a, maximum_product_matching(a), pool);
  ASSERT_EQ(pair.size(), n + m);
  for (std::size_t v = 0; v < n + m; ++v) {
    const auto w = static_cast<std::size_t>(pair[v]);
    EXPECT_EQ(static_cast<std::size_t>(pair[w]), v);
    EXPECT_TRUE(w == v || (d[v][w] != 0 && d[w][v] != 0));
    EXPECT_TRUE(v < n || w < n) << "multiplier " << v - n << " stands alone";
  }
}

TEST(PairsForLu, RowsFollowAMatchingThatLiesOffThePattern) {
  base::ThreadPool pool(1);
  const auto none = [&](const Dense& d) {
    const SparseMatrix a = sparse_of(d);
    return pairs_for_lu(a, maximum_product_matching(a), pool).empty();
  };
  EXPECT_TRUE(none({{4, 1, 0}, {1, 4, 1}, {0, 1, 4}})) << "on the diagonal already";
  EXPECT_TRUE(none({{0, 5, 0}, {0, 0, 5}, {5, 0, 0}})) << "no entry has a counterpart";
  const double e = 1e-7;
  EXPECT_TRUE(none({{e, 1, e}, {e, e, 1}, {1, e, e}})) << "no pair and no diagonal entry of the cycle is a pivot";
  EXPECT_FALSE(none({{0, 2, 0}, {3, 0, 0}, {0, 0, 4}}));
}

TEST(Equilibrate, BringsTheLargestEntriesOfRowsAndColumnsNearOne) {
  base::ThreadPool one(1);
  for (const Storage storage : {Storage::general, Storage::symmetric_lower}) {
    std::mt19937 random(5);
    Dense d = random_dense(50, 0.2, 3, random, storage != Storage::general);
    std::vector<double> wild(50);
    for (double& w : wild) w = std::pow(10.0, static_cast<double>(random() % 13) - 6);
    for (std::size_t i = 0; i < 50; ++i)
      for (std::size_t j = 0; j < 50; ++j) d[i][j] = (i == j ? 1.0 : d[i][j]) * wild[i] * wild[j];
    const Scaling s = equilibrate(sparse_of(d, storage), one);
    for (std::size_t i = 0; i < 50; ++i) {
      double row = 0;
      for (std::size_t j = 0; j < 50; ++j) row = std::max(row, std::abs(s.row[i] * d[i][j] * s.col[j]));
      // Three sweeps leave spread^(1/8); the spread is at most 1e27 here, powers of two add a factor of 2.
      EXPECT_LE(row, 2 * std::pow(1e27, 0.125));
      EXPECT_GE(row, 0.5 / std::pow(1e27, 0.125));
      EXPECT_EQ(std::exp2(std::round(std::log2(s.row[i]))), s.row[i]);
    }
    if (storage != Storage::general) {
      EXPECT_EQ(s.row, s.col);
    }
  }
}

TEST(Equilibrate, GivesTheSameBitsForAnyNumberOfThreads) {
  constexpr Index kSide = 300;  // more columns than a thread takes at a time
  const SparseMatrix a = matrix::generate(
      matrix::parse_generator(std::vector<std::string>{"poisson", std::to_string(kSide), std::to_string(kSide), "1"}));
  SparseMatrix wild = a;
  std::mt19937 random(7);
  for (double& v : wild.values) v *= std::exp2(static_cast<double>(random() % 200) - 100);
  base::ThreadPool one(1), three(3);
  const Scaling s = equilibrate(wild, one), t = equilibrate(wild, three);
  EXPECT_EQ(s.row, t.row);
  EXPECT_EQ(s.col, t.col);
}

/// A permuted matrix of entries around 1, and `tiny` ones elsewhere, on the diagonal too.
Dense with_tiny_entries(std::size_t n, double tiny, bool symmetric, std::mt19937& random) {
  std::uniform_real_distribution<double> magnitude(0.5, 1);
  std::uniform_int_distribution<std::size_t> place(0, n - 1);
  std::vector<std::size_t> p(n);
  std::iota(p.begin(), p.end(), std::size_t{0});
  std::shuffle(p.begin(), p.end(), random);
  Dense d(n, std::vector<double>(n, 0));
  const auto set = [&](std::size_t i, std::size_t j, double v) {
    if (d[i][j] == 0) d[i][j] = v;
    if (symmetric && d[j][i] == 0) d[j][i] = v;
  };
  for (std::size_t j = 0; j < n; ++j) set(p[j], j, magnitude(random));
  for (std::size_t k = 0; k < 3 * n; ++k) set(place(random), place(random), magnitude(random));
  for (std::size_t k = 0; k < 4 * n; ++k) set(place(random), place(random), tiny * magnitude(random));
  for (std::size_t j = 0; j < n; ++j) set(j, j, tiny);
  return d;
}

// Rounding errors among the entries must not be measures of their rows: all entries around 1 stay there.
TEST(Matching, TinyEntriesSetNoScale) {
  std::mt19937 random(11);
  for (const double tiny : {1e-9, 1e-20, 1e-70, 1e-160})
    for (int run = 0; run < 10; ++run)
      for (const bool symmetric : {false, true}) {
        SCOPED_TRACE(::testing::Message() << tiny << ", run " << run << (symmetric ? ", symmetric" : ""));
        const Dense d = with_tiny_entries(60, tiny, symmetric, random);
        std::vector<double> row, col;
        if (symmetric) {
          const SparseMatrix m = sparse_of(d, Storage::symmetric_lower);
          base::ThreadPool pool(1);
          row = col = symmetric_matching(m, pool).scale;
        } else {
          const SparseMatrix m = sparse_of(d);
          const Matching found = maximum_product_matching(m);
          row = found.row_scale;
          col = found.col_scale;
        }
        double least = 1;
        for (std::size_t j = 0; j < d.size(); ++j)
          for (std::size_t i = 0; i < d.size(); ++i)
            if (d[i][j] > 0.1) least = std::min(least, row[i] * d[i][j] * col[j]);
        EXPECT_GT(least, 1e-4);
      }
}

/// [0 B; B^T -d I] with B of entries around 1, times 2^exponent.
Dense regularised(std::size_t half, double d, int exponent, std::mt19937& random) {
  std::uniform_real_distribution<double> magnitude(0.5, 1);
  Dense a(2 * half, std::vector<double>(2 * half, 0));
  for (std::size_t i = 0; i < half; ++i) {
    for (const std::size_t j : {i, (i + 1) % half, static_cast<std::size_t>(random()) % half})
      a[i][half + j] = a[half + j][i] = std::ldexp(magnitude(random), exponent);
    a[half + i][half + i] = -std::ldexp(d, exponent);
  }
  return a;
}

// How far a residual of rounding size in the scaled matrix may lie above rounding in the caller's: a row's factor times
// a column's is no less than 1 over this, for entries around 1.
double spread(const std::vector<double>& row, const std::vector<double>& col, int exponent) {
  const double least = *std::min_element(row.begin(), row.end()) * *std::min_element(col.begin(), col.end());
  return 1 / std::ldexp(least, exponent);
}

// A tiny diagonal beside rows that have none is none, either: whatever it is, the factors stay together, in all units.
TEST(Matching, TinyDiagonalsBesideMissingOnesSetNoScale) {
  base::ThreadPool pool(1);
  std::mt19937 random(12);
  for (const double d : {1e-5, 1e-8, 1e-12, 1e-20, 1e-50, 1e-150})
    for (const int exponent : {0, 332, -332})
      for (const std::size_t half : {1, 2, 20}) {
        SCOPED_TRACE(::testing::Message() << d << ", 2^" << exponent << ", half " << half);
        const Dense a = regularised(half, d, exponent, random);
        const SymmetricMatching m = symmetric_matching(sparse_of(a, Storage::symmetric_lower), pool);
        EXPECT_LT(spread(m.scale, m.scale, exponent), 1e3);
        Dense shuffled = a;
        std::shuffle(shuffled.begin(), shuffled.end(), random);
        for (const Dense& rows : {a, shuffled}) {
          const Matching found = maximum_product_matching(sparse_of(rows));
          EXPECT_LT(spread(found.row_scale, found.col_scale, exponent), 1e3);
        }
      }
}

}  // namespace
}  // namespace espalier::analysis
