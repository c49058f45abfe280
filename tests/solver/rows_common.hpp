/// \file
/// Random right-hand sides with few entries and wanted unknowns, and whole solutions as their truth.
#pragma once

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <vector>

#include "espalier/solve_rows.hpp"

namespace espalier::test {

/// Right-hand sides with few entries, some of them in one place, and wanted unknowns.
template <class Value>
struct RowsCase {
  std::vector<Offset> col_ptr{0};
  std::vector<Index> row_ind, rows;
  std::vector<Value> values, dense;

  RowsCase(Index n, Index columns, std::mt19937& random) {
    std::uniform_int_distribution<Index> row(0, n - 1), few(0, 3);
    std::uniform_real_distribution<double> number(-1, 1);
    dense.resize(static_cast<std::size_t>(n) * static_cast<std::size_t>(columns));
    for (Index c = 0; c < columns; ++c) {
      for (Index k = few(random); k > 0; --k) {
        row_ind.push_back(row(random));
        values.push_back(Value(number(random)));
        dense[static_cast<std::size_t>(c) * static_cast<std::size_t>(n) + static_cast<std::size_t>(row_ind.back())] +=
            values.back();
      }
      col_ptr.push_back(static_cast<Offset>(values.size()));
    }
    for (Index k = few(random); k >= 0; --k) rows.push_back(row(random));
  }
  [[nodiscard]] SparseColumnsOf<Value> b() const { return {col_ptr, row_ind, values}; }
  [[nodiscard]] Index columns() const { return static_cast<Index>(col_ptr.size()) - 1; }
};

inline Options unrefined(int threads) {
  Options o;
  o.threads = threads;
  o.refinement_steps = 0;
  o.required_backward_error = std::numeric_limits<double>::infinity();
  return o;
}

/// @returns the share of the factor that was read
template <class SolverType, class Value>
double expect_bits_of_whole(SolverType& s, const RowsCase<Value>& given, Index n, Transpose transpose) {
  std::vector<Value> whole(given.dense.size()), x(given.rows.size() * static_cast<std::size_t>(given.columns()));
  EXPECT_TRUE(s.solve(given.dense, whole, given.columns(), transpose).status.ok());
  const SolveRowsResult r = solve_rows(s, given.b(), given.rows, x, transpose);
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  for (std::size_t c = 0; c < static_cast<std::size_t>(given.columns()); ++c)
    for (std::size_t k = 0; k < given.rows.size(); ++k)
      EXPECT_EQ(x[c * given.rows.size() + k],
                whole[c * static_cast<std::size_t>(n) + static_cast<std::size_t>(given.rows[k])])
          << "column " << c << ", unknown " << given.rows[k];
  return r.share;
}

/// One load, the unknown where it acts, and what is told of the factor. Truth: the whole solution. @return it
inline double expect_one_row(Solver& s, Index n) {
  const std::vector<Offset> one = {0, 1};
  const std::vector<Index> row = {4}, wanted = {4};
  const std::vector<double> load = {2};
  std::vector<double> x(1), b(static_cast<std::size_t>(n)), whole(b.size());
  const SolveRowsResult r = solve_rows(s, {one, row, load}, wanted, x);
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_LT(r.share, 1);
  EXPECT_GT(r.backward_error, 0);
  EXPECT_LT(r.componentwise_error, 1e-10);
  b[4] = 2;
  EXPECT_TRUE(s.solve(b, whole).status.ok());
  EXPECT_NEAR(x[0], whole[4], 1e-12 * std::abs(whole[4]));
  return x[0];
}

}  // namespace espalier::test
