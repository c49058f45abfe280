// Matrices and vectors of which each rank has a part. The truth is the same system given whole to one process.
#include <gtest/gtest.h>

#include <cstring>
#include <mutex>
#include <string>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "on_threads.hpp"
#include "reference/reference.hpp"

namespace espalier::ranks {
namespace parts_test {

using reference::random_vector;

// A part by rows that owns its arrays.
struct LocalMatrix {
  Index first = 0;
  std::vector<Offset> ptr{0};
  std::vector<Index> col;
  std::vector<double> values;
};

// Rows [first, end) of `a`; every value times `scale`.
LocalMatrix rows_of(const SparseMatrix& a, Index first, Index end, double scale = 1) {
  std::vector<std::vector<std::pair<Index, double>>> rows(static_cast<std::size_t>(end - first));
  for (Index c = 0; c < a.cols; ++c)
    for (Offset k = a.col_ptr[static_cast<std::size_t>(c)]; k < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++k) {
      const Index r = a.row_ind[static_cast<std::size_t>(k)];
      if (r >= first && r < end)
        rows[static_cast<std::size_t>(r - first)].emplace_back(c, scale * a.values[static_cast<std::size_t>(k)]);
    }
  LocalMatrix p;
  p.first = first;
  for (const auto& row : rows) {
    for (const auto& [c, v] : row) {
      p.col.push_back(c);
      p.values.push_back(v);
    }
    p.ptr.push_back(static_cast<Offset>(p.col.size()));
  }
  return p;
}

LocalRows view(const LocalMatrix& p, const SparseMatrix& a) {
  return {a.rows, p.first, p.ptr, p.col, p.values, a.storage};
}

std::vector<double> solution_of_one(const SparseMatrix& a, const std::vector<double>& b, Index columns) {
  Options o;
  o.device = "cpu";
  o.threads = 1;
  Solver solver(o);
  EXPECT_TRUE(solver.analyze(a).status.ok());
  EXPECT_TRUE(solver.factorize(a).status.ok());
  std::vector<double> x(b.size());
  EXPECT_TRUE(solver.solve(b, x, columns).status.ok());
  return x;
}

// Rows [begin, end) of each column.
std::vector<double> piece(const std::vector<double>& v, Index n, RowRange rows, Index columns) {
  std::vector<double> p;
  for (Index c = 0; c < columns; ++c)
    p.insert(p.end(), v.begin() + Offset{c} * n + rows.first, v.begin() + Offset{c} * n + rows.first + rows.count);
  return p;
}

Options one_thread() {
  Options o;
  o.threads = 1;
  return o;
}

void expect_piece(const std::vector<double>& x, const std::vector<double>& truth, Index n, RowRange rows,
                  Index columns) {
  const std::vector<double> wanted = piece(truth, n, rows, columns);
  ASSERT_EQ(x.size(), wanted.size());
  EXPECT_TRUE(x.empty() || std::memcmp(x.data(), wanted.data(), x.size() * sizeof(double)) == 0);
}

class Parts : public testing::Test {
 protected:
  void solve_by_rows(const SparseMatrix& a, const std::vector<Index>& begin) {
    const auto count = static_cast<int>(begin.size()) - 1;
    const Index n = a.rows, columns = 2;
    const std::vector<double> b = random_vector(Offset{n} * columns, 9);
    const std::vector<double> truth = solution_of_one(a, b, columns);
    on_threads(count, {}, [&](const Ranks& ranks) {
      const auto r = static_cast<std::size_t>(ranks.rank());
      const LocalMatrix part = rows_of(a, begin[r], begin[r + 1]);
      Solver solver(ranks, one_thread());
      const AnalysisResult analysis = solver.analyze(view(part, a));
      ASSERT_TRUE(analysis.status.ok()) << analysis.status.message;
      ASSERT_TRUE(solver.refactorize(part.values).status.ok());
      const RowRange rows{begin[r], begin[r + 1] - begin[r]};
      EXPECT_EQ(solver.rows().first, rows.first);
      EXPECT_EQ(solver.rows().count, rows.count);
      std::vector<double> x = piece(b, n, rows, columns);
      const SolveResult solve = solver.solve(x, x, columns);  // in place
      EXPECT_TRUE(solve.status.ok()) << solve.status.message;
      EXPECT_LE(solve.backward_error, 1e-15);
      expect_piece(x, truth, n, rows, columns);
      // All of it on the last rank.
      const bool last = ranks.rank() + 1 == ranks.size();
      solver.set_rows({0, last ? n : 0});
      std::vector<double> all = last ? b : std::vector<double>();
      EXPECT_TRUE(solver.solve(all, all, columns).status.ok());
      if (last) expect_piece(all, truth, n, {0, n}, columns);
    });
  }
};

TEST_F(Parts, ByRows) {
  const SparseMatrix a =
      matrix::generate(matrix::parse_generator(std::vector<std::string>{"gyroscopic", "5", "4", "3"}));
  const Index n = a.rows;
  solve_by_rows(a, {0, n / 2, n});
  solve_by_rows(a, {0, 7, n - 1, n});
  solve_by_rows(a, {0, 0, n / 3, n / 3, n, n});  // some have none
}

TEST_F(Parts, OfASymmetricMatrixOneTriangle) {
  const SparseMatrix a =
      matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "5", "4", "3"}));
  ASSERT_EQ(a.storage, Storage::symmetric_lower);
  solve_by_rows(a, {0, a.rows / 4, a.rows});
}

// Every rank has all rows, with a part of each value: a power of two, so that sums are exact.
TEST_F(Parts, OverlapsAreSummed) {
  const SparseMatrix a =
      matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "4", "4", "3"}));
  const Index n = a.rows;
  const std::vector<double> b = random_vector(n, 9), truth = solution_of_one(a, b, 1);
  on_threads(2, {}, [&](const Ranks& ranks) {
    const LocalMatrix part = rows_of(a, 0, n, 0.5);
    Solver solver(ranks, one_thread());
    ASSERT_TRUE(solver.analyze(view(part, a)).status.ok());
    ASSERT_TRUE(solver.refactorize(part.values).status.ok());
    std::vector<double> x(b);
    for (double& v : x) v *= 0.5;  // right-hand sides likewise
    EXPECT_TRUE(solver.solve(x, x).status.ok());
    expect_piece(x, truth, n, {0, n}, 1);
  });
}

TEST_F(Parts, EntriesAnywhere) {
  const SparseMatrix a =
      matrix::generate(matrix::parse_generator(std::vector<std::string>{"gyroscopic", "4", "4", "3"}));
  const Index n = a.rows;
  const std::vector<double> b = random_vector(n, 9), truth = solution_of_one(a, b, 1);
  on_threads(3, {}, [&](const Ranks& ranks) {
    std::vector<Index> row, col;
    std::vector<double> values;
    for (Index c = 0; c < n; ++c)
      for (Offset k = a.col_ptr[static_cast<std::size_t>(c)]; k < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++k) {
        if ((7 * k + c) % 3 != ranks.rank()) continue;
        row.push_back(a.row_ind[static_cast<std::size_t>(k)]);
        col.push_back(c);
        values.push_back(a.values[static_cast<std::size_t>(k)]);
      }
    Solver solver(ranks, one_thread());
    ASSERT_TRUE(solver.analyze(LocalEntries{n, row, col, values}).status.ok());
    for (int again = 0; again < 2; ++again) {
      ASSERT_TRUE(solver.refactorize(values).status.ok());
      std::vector<double> x = ranks.rank() == 0 ? b : std::vector<double>();
      EXPECT_TRUE(solver.solve(x, x).status.ok());
      if (ranks.rank() == 0) expect_piece(x, truth, n, {0, n}, 1);
    }
  });
}

// Without ranks there is one part.
TEST_F(Parts, OfOneProcess) {
  const SparseMatrix a =
      matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "4", "4", "3"}));
  const std::vector<double> b = random_vector(a.rows, 9), truth = solution_of_one(a, b, 1);
  const LocalMatrix part = rows_of(a, 0, a.rows);
  Solver solver(one_thread());
  ASSERT_TRUE(solver.analyze(view(part, a)).status.ok());
  for (const bool whole : {false, true}) {  // of the whole, values are in its own order
    ASSERT_TRUE((whole ? solver.factorize(a) : solver.refactorize(part.values)).status.ok());
    std::vector<double> x = b;
    EXPECT_TRUE(solver.solve(x, x).status.ok());
    expect_piece(x, truth, a.rows, {0, a.rows}, 1);
  }
}

// What is wrong on one rank is said on all, in the same words, and the solver works on.
TEST_F(Parts, MistakesOfOneRank) {
  const SparseMatrix a =
      matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "4", "4", "3"}));
  const Index n = a.rows;
  std::mutex mutex;
  std::vector<std::string> said;
  const auto note = [&](const Status& status) {
    const std::lock_guard lock(mutex);
    EXPECT_EQ(status.code, StatusCode::invalid_input);
    said.push_back(status.message);
  };
  on_threads(3, {}, [&](const Ranks& ranks) {
    const Index begin = n / 3 * ranks.rank(), end = ranks.rank() == 2 ? n : n / 3 * (ranks.rank() + 1);
    const LocalMatrix good = rows_of(a, begin, end);
    LocalMatrix bad = good;
    if (ranks.rank() == 1) bad.col[3] = n;  // beyond the last column
    Solver solver(ranks, one_thread());
    note(solver.analyze(view(bad, a)).status);
    ASSERT_TRUE(solver.analyze(view(good, a)).status.ok());
    note(solver.refactorize(std::span(good.values).first(good.values.size() - (ranks.rank() == 2 ? 1 : 0))).status);
    ASSERT_TRUE(solver.refactorize(good.values).status.ok());
    std::vector<double> x(static_cast<std::size_t>(end - begin), 1.0);
    if (ranks.rank() == 0) solver.set_rows({0, 5});  // the others are nobody's
    note(solver.solve(x, x).status);
    solver.set_rows({begin, end - begin});
    std::vector<double> values = good.values;
    if (ranks.rank() == 1) values[0] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(solver.refactorize(values).status.code, StatusCode::invalid_input);
    ASSERT_TRUE(solver.refactorize(good.values).status.ok());
    std::fill(x.begin(), x.end(), 1.0);
    EXPECT_TRUE(solver.solve(x, x).status.ok());
  });
  ASSERT_EQ(said.size(), 9U);
  for (const std::string& text : said)
    EXPECT_NE(text.find("on host") == std::string::npos && text.find("no rank") == std::string::npos, true) << text;
}

}  // namespace parts_test
}  // namespace espalier::ranks
