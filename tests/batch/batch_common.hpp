/// \file
/// Batches of tests, and the single systems that are their truth.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "espalier/batch.hpp"
#include "reference/reference.hpp"

namespace espalier::test {

inline constexpr double kEps = std::numeric_limits<double>::epsilon();

inline Options options_of(Kind kind, int threads) {
  Options o;
  o.kind = kind;
  o.threads = threads;
  return o;
}

// `count` systems of the pattern of `a`: its values, each changed by up to a third.
inline std::vector<double> values_of(const SparseMatrix& a, Index count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<double> values;
  for (Index k = 0; k < count; ++k)
    for (const double v : a.values) values.push_back(v * (1 + static_cast<double>(random() % 1000) / 3000));
  return values;
}

inline SparseMatrix system_of(const SparseMatrix& pattern, std::span<const double> values, Index k) {
  SparseMatrix a = pattern;
  std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(k) * std::ssize(a.values), a.values.size(),
              a.values.begin());
  return a;
}

/// Systems together on the host, for as long as this lives: so many in a chunk or group.
class InChunks {
 public:
  explicit InChunks(Index systems) { ::setenv("ESPALIER_BATCH_CHUNK", std::to_string(systems).c_str(), 1); }
  InChunks(const InChunks&) = delete;
  InChunks& operator=(const InChunks&) = delete;
  ~InChunks() { ::unsetenv("ESPALIER_BATCH_CHUNK"); }
};

/// A grid with a constraint for every fifth unknown: the zero block proves the inertia of each system.
inline SparseMatrix constrained_chain(Index n) {
  SparseMatrix a;
  a.rows = a.cols = n;
  a.storage = Storage::symmetric_lower;
  a.col_ptr.push_back(0);
  const Index m = n / 6, k = n - m;
  for (Index c = 0; c < n; ++c) {
    const auto add = [&](Index r, double v) {
      a.row_ind.push_back(r);
      a.values.push_back(v);
    };
    add(c, c < k ? 4.5 : 0.0);
    if (c + 1 < k) add(c + 1, -1);
    if (c < k && c % 5 < 2 && c / 5 < m) add(k + c / 5, c % 5 == 0 ? 1 : -0.5);
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  return a;
}

/// @param log  gets the lines of the batches
inline void expect_bits_of_single_systems(const SparseMatrix& a, Kind kind, Index count, Index columns,
                                          Transpose transpose, std::string* log = nullptr) {
  const std::vector<double> values = values_of(a, count, 5);
  const std::size_t size = static_cast<std::size_t>(a.cols) * static_cast<std::size_t>(columns);
  const std::vector<double> b = reference::random_vector(static_cast<std::int64_t>(size) * count, 9);
  for (const int threads : {1, 2, 3}) {
    Options options = options_of(kind, threads);
    if (log != nullptr) options.log = [log](const std::string& line) { *log += line + "\n"; };
    Batch batch(options);
    ASSERT_TRUE(batch.analyze(a).status.ok());
    std::vector<double> x(b);  // in place
    const BatchResult result = batch.solve(values, x, x, count, columns, transpose);
    ASSERT_TRUE(result.status.ok()) << result.status.message;
    ASSERT_EQ(result.systems.size(), static_cast<std::size_t>(count));
    Solver analyzed(options_of(kind, 1));
    ASSERT_TRUE(analyzed.analyze(a).status.ok());
    for (Index k = 0; k < count; ++k) {
      Solver single = analyzed.clone();
      const SparseMatrix one = system_of(a, values, k);
      const FactorResult factor = single.factorize(one);
      ASSERT_TRUE(factor.status.ok());
      const std::vector<double> mine(b.begin() + static_cast<std::ptrdiff_t>(size) * k,
                                     b.begin() + static_cast<std::ptrdiff_t>(size) * (k + 1));
      std::vector<double> expected(size);
      (void)single.solve(mine, expected, columns, transpose);
      const std::vector<double> got(x.begin() + static_cast<std::ptrdiff_t>(size) * k,
                                    x.begin() + static_cast<std::ptrdiff_t>(size) * (k + 1));
      EXPECT_EQ(got, expected) << "system " << k << ", " << threads << " threads";
      const SystemResult& r = result.systems[static_cast<std::size_t>(k)];
      EXPECT_EQ(r.inertia.negative, factor.inertia.negative);
      EXPECT_EQ(r.inertia.positive, factor.inertia.positive);
      EXPECT_EQ(r.rank, a.cols);
      EXPECT_LE(reference::backward_error(one, mine, got, columns, transpose != Transpose::no), 8 * kEps);
      EXPECT_LE(r.backward_error, 8 * kEps);
    }
  }
}

}  // namespace espalier::test
