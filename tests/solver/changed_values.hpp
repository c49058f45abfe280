/// \file
/// Sequences of changed values, by solvers that make what has changed alone and by others that make everything.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "reference/reference.hpp"
#include "solver/complex_common.hpp"
#include "verdict/value_changes.hpp"

namespace espalier::changed_values {

using reference::Values;
using verdict::change_values;

inline SparseMatrix elasticity(int n) {
  return matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", std::to_string(n)}));
}

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

inline Options bare(bool partial) {
  Options o;
  o.partial_refactorization = partial;
  o.refinement_steps = 0;
  o.required_backward_error = std::numeric_limits<double>::infinity();
  o.singular = SingularMatrix::report;
  return o;
}

struct Shares {
  int none = 0, some = 0, all = 0;  ///< factorizations by what they have made
};

/// Factorizes by both: the bits of solutions, and all that is said of the matrix. @returns the share of work of the
/// first
template <class AnySolver, class T>
double expect_same_factors(AnySolver& partial, AnySolver& full, const std::vector<T>& values, const std::vector<T>& b) {
  const auto p = partial.refactorize(values), f = full.refactorize(values);
  EXPECT_EQ(p.status.code, f.status.code) << p.status.message << " / " << f.status.message;
  EXPECT_EQ(p.inertia.negative, f.inertia.negative);
  EXPECT_EQ(p.inertia.zero, f.inertia.zero);
  EXPECT_EQ(p.rank, f.rank);
  EXPECT_EQ(p.perturbed, f.perturbed);
  EXPECT_EQ(p.two_by_two, f.two_by_two);
  EXPECT_EQ(p.delayed, f.delayed);
  EXPECT_EQ(p.dependent_rows, f.dependent_rows);
  EXPECT_EQ(std::memcmp(&p.determinant_log, &f.determinant_log, sizeof(double)), 0)
      << p.determinant_log << " / " << f.determinant_log;
  EXPECT_LE(p.work_share, 1);
  EXPECT_EQ(f.work_share, 1);
  if (p.status.ok() && f.status.ok())
    for (const Transpose t : {Transpose::no, Transpose::yes}) {
      std::vector<T> x(b.size()), y(b.size());
      (void)partial.solve(b, x, 1, t);
      (void)full.solve(b, y, 1, t);
      EXPECT_TRUE(same_bits(x, y)) << "of share " << p.work_share;
    }
  return p.work_share;
}

template <class T>
std::vector<T> some_right_hand_side(Index rows, unsigned seed) {
  const std::vector<double> numbers = reference::random_vector(std::int64_t{2} * rows, seed);
  std::vector<T> b;
  for (Index i = 0; i < rows; ++i) b.push_back(numbers[static_cast<std::size_t>(2 * i)]);
  return b;
}

/// A check of a sequence of changed values. Adds to `shares`, if it is there.
template <class AnySolver, class Matrix>
void expect_bits_of_all(Options options, Options full_options, const Matrix& a, unsigned seed, int rounds,
                        Shares* shares = nullptr) {
  using T = typename std::decay_t<decltype(a.values)>::value_type;
  std::mt19937 random(seed);
  AnySolver partial(std::move(options)), full(std::move(full_options));
  ASSERT_TRUE(partial.analyze(a).status.ok());
  ASSERT_TRUE(full.analyze(a).status.ok());
  std::vector<T> now = a.values;
  const std::vector<T> b = some_right_hand_side<T>(a.rows, seed);
  for (int round = 0; round < rounds; ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    const double share = expect_same_factors(partial, full, now, b);
    if (testing::Test::HasFailure()) return;
    if (shares != nullptr) ++(share == 0 ? shares->none : share < 1 ? shares->some : shares->all);
    change_values(now, a.values, random);
  }
}

/// What came of sequences in budgets.
struct BudgetTally {
  int some = 0, moved = 0, out_of_core = 0;
};

/// A solver that follows changes beside new ones with the same options, which make everything. Where pivots have moved
/// the plan is another, since it knows what came before. Now and then a value is none.
template <class AnySolver, class Matrix>
void follow_beside_new(const Options& options, const Matrix& a, unsigned seed, int rounds, BudgetTally& tally) {
  using T = typename std::decay_t<decltype(a.values)>::value_type;
  std::mt19937 random(seed);
  AnySolver partial(options);
  ASSERT_TRUE(partial.analyze(a).status.ok());
  std::vector<T> now = a.values;
  const std::vector<T> b(static_cast<std::size_t>(a.rows), T(1));
  for (int round = 0; round < rounds; ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    if (round % 4 == 3) {
      std::vector<T> bad = now;
      bad[static_cast<std::size_t>(random()) % bad.size()] = std::numeric_limits<double>::quiet_NaN();
      EXPECT_FALSE(partial.refactorize(bad).status.ok());
    }
    const auto p = partial.refactorize(now);
    AnySolver fresh(options);
    ASSERT_TRUE(fresh.analyze(a).status.ok());
    const auto f = fresh.refactorize(now);
    ASSERT_EQ(f.work_share, 1);
    if (p.delayed > 0 || f.delayed > 0) {
      ++tally.moved;
      return;
    }
    ASSERT_EQ(p.status.code, f.status.code) << p.status.message << " / " << f.status.message;
    EXPECT_TRUE(!p.status.ok() || p.whole_reason.empty()) << p.whole_reason;
    EXPECT_EQ(p.inertia.negative, f.inertia.negative);
    EXPECT_EQ(p.rank, f.rank);
    EXPECT_EQ(p.perturbed, f.perturbed);
    EXPECT_EQ(p.two_by_two, f.two_by_two);
    EXPECT_EQ(p.determinant_log, f.determinant_log);
    tally.some += p.work_share > 0 && p.work_share < 1 ? 1 : 0;
    if (p.status.ok()) {
      tally.out_of_core += !p.devices.empty() && p.devices.front().streamed_out_bytes > 0 ? 1 : 0;
      for (const Transpose t : {Transpose::no, Transpose::yes}) {
        std::vector<T> x(b.size()), y(b.size());
        ASSERT_TRUE(partial.solve(b, x, 1, t).status.ok());
        ASSERT_TRUE(fresh.solve(b, y, 1, t).status.ok());
        ASSERT_TRUE(same_bits(x, y)) << "of share " << p.work_share;
      }
    }
    change_values(now, a.values, random);
  }
}

/// With imaginary parts off the diagonal, of a symmetric matrix on it as well.
inline ComplexSparseMatrix turned(const SparseMatrix& real, Storage storage) {
  ComplexSparseMatrix a;
  a.rows = real.rows;
  a.cols = real.cols;
  a.col_ptr = real.col_ptr;
  a.row_ind = real.row_ind;
  a.storage = storage;
  for (Index c = 0; c < a.cols; ++c)
    for (auto q = static_cast<std::size_t>(a.col_ptr[c]); q < static_cast<std::size_t>(a.col_ptr[c + 1]); ++q) {
      const double v = real.values[q];
      a.values.emplace_back(v, storage == Storage::hermitian_lower && a.row_ind[q] == c ? 0.0 : 0.02 * v);
    }
  return a;
}

/// Patterns and values change by turns; now and then a pattern changes twice before it is factorized.
/// @param kept  counts the patterns whose factorization has not made everything
inline void expect_bits_in_changing_patterns(const Options& partial_options, const Options& whole_options,
                                             const SparseMatrix& first, unsigned seed, int& kept) {
  Solver partial(partial_options), whole(whole_options);
  ASSERT_TRUE(partial.analyze(first).status.ok());
  ASSERT_TRUE(whole.analyze(first).status.ok());
  std::mt19937 random(seed);
  SparseMatrix a = first;
  std::vector<double> now = a.values;
  const std::vector<double> b = some_right_hand_side<double>(a.rows, seed);
  bool changed = false;
  for (int round = 0; round < 16; ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    const double share = expect_same_factors(partial, whole, now, b);
    if (testing::Test::HasFailure()) return;
    kept += changed && share < 1 ? 1 : 0;
    changed = random() % 3 != 0;
    if (!changed) {
      change_values(now, a.values, random);
      continue;
    }
    for (unsigned times = 1 + random() % 2; times > 0; --times) {
      verdict::change_pattern(a, now, first, random);
      const ChangeResult p = partial.analyze_change(a), w = whole.analyze_change(a);
      ASSERT_EQ(p.analysis.status.code, w.analysis.status.code) << p.analysis.status.message;
      if (!p.analysis.status.ok()) return;
      ASSERT_EQ(p.full, w.full);
    }
  }
}

// A spring between two unknowns, on the diagonals and beside.
inline SparseMatrix with_spring(const SparseMatrix& a, Index u, Index v) {
  std::vector<reference::Triple> t;
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
      t.push_back({a.row_ind[static_cast<std::size_t>(q)], c, a.values[static_cast<std::size_t>(q)]});
  t.push_back({u, u, 1.0});
  t.push_back({v, v, 1.0});
  t.push_back({std::max(u, v), std::min(u, v), -1.0});
  return reference::from_triples(a.cols, t, a.storage);
}

inline SparseMatrix natural_elasticity(Index n) {
  matrix::GeneratorSpec spec = matrix::parse_generator(std::vector<std::string>{"elasticity", std::to_string(n)});
  spec.numbering = matrix::Numbering::natural;
  return matrix::generate(spec);
}

// Two nodes of a face, two apart: most of the body is far away.
inline SparseMatrix in_contact(const SparseMatrix& a) { return with_spring(a, a.cols - 3, a.cols - 9); }

}  // namespace espalier::changed_values
