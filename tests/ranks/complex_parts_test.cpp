// Complex matrices and vectors of which each rank has a part. The truth is the same system given whole to one process.
#include <gtest/gtest.h>

#include <algorithm>
#include <complex>
#include <functional>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "complex_system.hpp"
#include "espalier/complex_solver.hpp"
#include "on_threads.hpp"
#include "reference/reference.hpp"
#include "solver/as_real_form.hpp"

namespace espalier::ranks {
namespace complex_parts_test {

using Value = std::complex<double>;

struct Entry {
  Index row, col;
  Value value;
};

std::vector<Entry> entries_of(const ComplexSparseMatrix& a) {
  std::vector<Entry> all;
  for (Index c = 0; c < a.cols; ++c)
    for (auto k = static_cast<std::size_t>(a.col_ptr[c]); k < static_cast<std::size_t>(a.col_ptr[c + 1]); ++k)
      all.push_back({a.row_ind[k], c, a.values[k]});
  return all;
}

bool hermitian(Storage storage) { return storage >= Storage::hermitian_lower; }

// The entry of the other triangle.
Entry mirrored(const Entry& e, Storage storage) {
  return {e.col, e.row, hermitian(storage) ? std::conj(e.value) : e.value};
}

// A matrix by columns, rows rising.
ComplexSparseMatrix matrix_of(Index n, std::vector<Entry> entries, Storage storage) {
  std::sort(entries.begin(), entries.end(),
            [](const Entry& a, const Entry& b) { return std::pair(a.col, a.row) < std::pair(b.col, b.row); });
  ComplexSparseMatrix a{n, n, std::vector<Offset>(static_cast<std::size_t>(n) + 1, 0), {}, {}, storage};
  for (const Entry& e : entries) {
    ++a.col_ptr[static_cast<std::size_t>(e.col) + 1];
    a.row_ind.push_back(e.row);
    a.values.push_back(e.value);
  }
  for (std::size_t c = 0; c < static_cast<std::size_t>(n); ++c) a.col_ptr[c + 1] += a.col_ptr[c];
  return a;
}

// The matrix of a lower triangle, with both.
ComplexSparseMatrix both_triangles(const ComplexSparseMatrix& lower, Storage storage) {
  std::vector<Entry> all = entries_of(lower);
  for (const Entry& e : entries_of(lower))
    if (e.row != e.col) all.push_back(mirrored(e, storage));
  return matrix_of(lower.rows, std::move(all), storage);
}

// A part by rows that owns its arrays.
struct LocalMatrix {
  Index first = 0;
  std::vector<Offset> ptr{0};
  std::vector<Index> col;
  std::vector<Value> values;

  [[nodiscard]] ComplexLocalRows view(Index n, Storage storage) const { return {n, first, ptr, col, values, storage}; }
};

// Rows [first, end) of these entries, columns falling.
LocalMatrix rows_of(std::vector<Entry> entries, Index first, Index end) {
  std::sort(entries.begin(), entries.end(),
            [](const Entry& a, const Entry& b) { return std::pair(a.row, b.col) < std::pair(b.row, a.col); });
  LocalMatrix p;
  p.first = first;
  auto e = std::find_if(entries.begin(), entries.end(), [&](const Entry& x) { return x.row >= first; });
  for (Index r = first; r < end; ++r) {
    for (; e != entries.end() && e->row == r; ++e) {
      p.col.push_back(e->col);
      p.values.push_back(e->value);
    }
    p.ptr.push_back(static_cast<Offset>(p.col.size()));
  }
  return p;
}

std::vector<Value> random_numbers(Offset count) {
  const std::vector<double> parts = reference::random_vector(2 * count, 9);
  std::vector<Value> v;
  for (std::size_t k = 0; k < parts.size(); k += 2) v.emplace_back(parts[k], parts[k + 1]);
  return v;
}

Options one_thread() {
  Options o;
  o.device = "cpu";
  o.threads = 1;
  return o;
}

struct Truth {
  std::vector<Value> x;
  ComplexFactorResult factor;
};
Truth truth_of(const ComplexSparseMatrix& a, const std::vector<Value>& b, Index columns, Transpose transpose) {
  ComplexSolver solver(one_thread());
  EXPECT_TRUE(solver.analyze(a).status.ok());
  Truth t;
  t.factor = solver.factorize(a);
  EXPECT_TRUE(t.factor.status.ok()) << t.factor.status.message;
  t.x.resize(b.size());
  EXPECT_TRUE(solver.solve(b, t.x, columns, transpose).status.ok());
  return t;
}

// Rows of each column.
std::vector<Value> piece(const std::vector<Value>& v, Index n, RowRange rows, Index columns) {
  std::vector<Value> p;
  for (Index c = 0; c < columns; ++c)
    p.insert(p.end(), v.begin() + Offset{c} * n + rows.first, v.begin() + Offset{c} * n + rows.first + rows.count);
  return p;
}

constexpr Index kColumns = 2;

// The parts of a matrix, which to one process is `a`, as entries of a storage; each rank has the rows from begin[rank]
// to begin[rank + 1].
void solve_by_rows(const ComplexSparseMatrix& a, const std::vector<Entry>& entries, Storage storage,
                   const std::vector<Index>& begin, Transpose transpose) {
  const auto count = static_cast<int>(begin.size()) - 1;
  const Index n = a.rows;
  const std::vector<Value> b = random_numbers(Offset{n} * kColumns);
  const Truth truth = truth_of(a, b, kColumns, transpose);
  on_threads(count, {}, [&](const Ranks& ranks) {
    SCOPED_TRACE(testing::Message() << "rank " << ranks.rank() << " of " << count << ", storage "
                                    << static_cast<int>(storage));
    const auto r = static_cast<std::size_t>(ranks.rank());
    const RowRange rows{begin[r], begin[r + 1] - begin[r]};
    const LocalMatrix part = rows_of(entries, rows.first, rows.first + rows.count);
    ComplexSolver solver(ranks, one_thread());
    const AnalysisResult analysis = solver.analyze(part.view(n, storage));
    ASSERT_TRUE(analysis.status.ok()) << analysis.status.message;
    const ComplexFactorResult factor = solver.refactorize(part.values);
    ASSERT_TRUE(factor.status.ok()) << factor.status.message;
    EXPECT_EQ(factor.determinant_log, truth.factor.determinant_log);
    EXPECT_TRUE(same_number(factor.determinant_phase, truth.factor.determinant_phase));
    EXPECT_EQ(factor.inertia.negative, truth.factor.inertia.negative);
    EXPECT_EQ(solver.rows().first, rows.first);
    EXPECT_EQ(solver.rows().count, rows.count);
    std::vector<Value> x = piece(b, n, rows, kColumns);
    const SolveResult solve = solver.solve(x, x, kColumns, transpose);  // in place
    EXPECT_TRUE(solve.status.ok()) << solve.status.message;
    EXPECT_EQ(x, piece(truth.x, n, rows, kColumns));
    // All of it on the last rank.
    const bool last = ranks.rank() + 1 == ranks.size();
    solver.set_rows({0, last ? n : 0});
    std::vector<Value> all = last ? b : std::vector<Value>();
    EXPECT_TRUE(solver.solve(all, all, kColumns, transpose).status.ok());
    if (last) {
      EXPECT_EQ(all, truth.x);
    }
  });
}

void solve_by_rows_on_ranks(const ComplexSparseMatrix& a, const std::vector<Entry>& entries, Storage storage,
                            Transpose transpose = Transpose::no) {
  const Index n = a.rows;
  solve_by_rows(a, entries, storage, {0, n / 2, n}, transpose);
  solve_by_rows(a, entries, storage, {0, 7, n - 1, n}, transpose);
  solve_by_rows(a, entries, storage, {0, 0, n / 3, n / 3, n, n}, transpose);  // some have none
}

// The forms in which hosts factorize them; GPUs take the second alone.
class ComplexParts : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    if (GetParam()) real_form_.emplace();
  }

 private:
  std::optional<test::AsRealForm> real_form_;
};
INSTANTIATE_TEST_SUITE_P(Forms, ComplexParts, testing::Bool(),
                         [](const auto& form) { return form.param ? "Real" : "Native"; });

TEST_P(ComplexParts, General) {
  const ComplexSparseMatrix a =
      complex_of(reference::random_system(300, 4, reference::Values::general, 3), Storage::general);
  solve_by_rows_on_ranks(a, entries_of(a), Storage::general);
  solve_by_rows_on_ranks(a, entries_of(a), Storage::general, Transpose::conjugate);
}

// Matrices of either triangle and of both; what is given as the upper triangle is kept as the lower one.
TEST_P(ComplexParts, SymmetricAndHermitian) {
  using reference::Values;
  for (const Values values : {Values::positive, Values::indefinite})
    for (const Storage storage : {Storage::symmetric_lower, Storage::hermitian_lower}) {
      const ComplexSparseMatrix lower = complex_of(reference::random_system(200, 4, values, 1), storage);
      solve_by_rows_on_ranks(lower, entries_of(lower), storage, Transpose::yes);
      std::vector<Entry> upper;
      for (const Entry& e : entries_of(lower)) upper.push_back(mirrored(e, storage));
      const bool conjugates = hermitian(storage);
      solve_by_rows_on_ranks(lower, upper, conjugates ? Storage::hermitian_upper : Storage::symmetric_upper);
      const Storage both = conjugates ? Storage::hermitian_both : Storage::symmetric_both;
      const ComplexSparseMatrix whole = both_triangles(lower, both);
      solve_by_rows_on_ranks(whole, entries_of(whole), both, Transpose::conjugate);
    }
}

TEST_P(ComplexParts, OfOneUnknown) {
  const ComplexSparseMatrix a = matrix_of(1, {{0, 0, {2, 0}}}, Storage::hermitian_lower);
  solve_by_rows(a, entries_of(a), a.storage, {0, 0, 1, 1}, Transpose::no);
}

// Each rank has all rows, with a part of each value that differs from the others': powers of two, so that sums are
// exact.
TEST_P(ComplexParts, OverlapsAreSummed) {
  const ComplexSparseMatrix a =
      complex_of(reference::random_system(200, 4, reference::Values::positive, 1), Storage::hermitian_lower);
  const Index n = a.rows;
  const std::vector<Value> b = random_numbers(n);
  const Truth truth = truth_of(a, b, 1, Transpose::no);
  on_threads(3, {}, [&](const Ranks& ranks) {
    const double share = ranks.rank() == 0 ? 0.5 : 0.25;
    LocalMatrix part = rows_of(entries_of(a), 0, n);
    for (Value& v : part.values) v *= share;
    ComplexSolver solver(ranks, one_thread());
    ASSERT_TRUE(solver.analyze(part.view(n, a.storage)).status.ok());
    ASSERT_TRUE(solver.refactorize(part.values).status.ok());
    std::vector<Value> x(b);
    for (Value& v : x) v *= share;
    EXPECT_TRUE(solver.solve(x, x).status.ok());
    EXPECT_EQ(x, truth.x);
  });
}

// Entries of a Hermitian triangle anywhere, some as their mirror images. Rank 0 has the vectors.
TEST_P(ComplexParts, EntriesAnywhere) {
  const ComplexSparseMatrix a =
      complex_of(reference::random_system(200, 4, reference::Values::indefinite, 2), Storage::hermitian_lower);
  const Index n = a.rows;
  const std::vector<Value> b = random_numbers(n);
  const Truth truth = truth_of(a, b, 1, Transpose::no);
  const std::vector<Entry> entries = entries_of(a);
  on_threads(3, {}, [&](const Ranks& ranks) {
    std::vector<Index> row, col;
    std::vector<Value> values;
    for (std::size_t k = 0; k < entries.size(); ++k) {
      if (static_cast<int>(7 * k % 3) != ranks.rank()) continue;
      const Entry e = k % 5 == 0 ? mirrored(entries[k], a.storage) : entries[k];
      row.push_back(e.row);
      col.push_back(e.col);
      values.push_back(e.value);
    }
    ComplexSolver solver(ranks, one_thread());
    ASSERT_TRUE(solver.analyze(ComplexLocalEntries{n, row, col, values, a.storage}).status.ok());
    for (int again = 0; again < 2; ++again) {
      ASSERT_TRUE(solver.refactorize(values).status.ok());
      std::vector<Value> x = ranks.rank() == 0 ? b : std::vector<Value>();
      EXPECT_TRUE(solver.solve(x, x).status.ok());
      if (ranks.rank() == 0) {
        EXPECT_EQ(x, truth.x);
      }
    }
  });
}

// Without ranks there is one part; values of the whole matrix are in its own order.
TEST_P(ComplexParts, OfOneProcess) {
  const ComplexSparseMatrix a =
      complex_of(reference::random_system(200, 4, reference::Values::general, 1), Storage::general);
  const std::vector<Value> b = random_numbers(a.rows);
  const Truth truth = truth_of(a, b, 1, Transpose::no);
  const LocalMatrix part = rows_of(entries_of(a), 0, a.rows);
  ComplexSolver solver(one_thread());
  ASSERT_TRUE(solver.analyze(part.view(a.rows, a.storage)).status.ok());
  for (const bool whole : {false, true}) {
    ASSERT_TRUE((whole ? solver.factorize(a) : solver.refactorize(part.values)).status.ok());
    std::vector<Value> x = b;
    EXPECT_TRUE(solver.solve(x, x).status.ok());
    EXPECT_EQ(x, truth.x);
  }
}

// A file that ranks save is that of one process with the same pattern by columns, and the other way round.
TEST_P(ComplexParts, SavedAnalyses) {
  const ComplexSparseMatrix a =
      complex_of(reference::random_system(200, 4, reference::Values::positive, 1), Storage::symmetric_lower);
  const Index n = a.rows;
  const std::vector<Value> b = random_numbers(n);
  const Truth truth = truth_of(a, b, 1, Transpose::no);
  const std::string path = testing::TempDir() + "espalier_complex_parts";
  const auto expect_truth = [&](ComplexSolver& solver, const LocalMatrix& part) {
    ASSERT_TRUE(solver.refactorize(part.values).status.ok());
    const RowRange rows = solver.rows();
    std::vector<Value> x = piece(b, n, rows, 1);
    EXPECT_TRUE(solver.solve(x, x).status.ok());
    EXPECT_EQ(x, piece(truth.x, n, rows, 1));
  };
  on_threads(3, {}, [&](const Ranks& ranks) {
    const LocalMatrix part = rows_of(entries_of(a), n * ranks.rank() / 3, n * (ranks.rank() + 1) / 3);
    ComplexSolver solver(ranks, one_thread());
    ASSERT_TRUE(solver.analyze(part.view(n, a.storage)).status.ok());
    ASSERT_TRUE(solver.save_analysis(path).ok());
    ComplexSolver loaded(ranks, one_thread());
    const AnalysisResult analysis = loaded.load_analysis(path, part.view(n, a.storage));
    ASSERT_TRUE(analysis.status.ok()) << analysis.status.message;
    EXPECT_EQ(analysis.nonzeros_factor, solver.analysis().nonzeros_factor);
    expect_truth(loaded, part);
    // Another pattern.
    LocalMatrix other = part;
    if (ranks.rank() == 1) {
      other.col.pop_back();
      other.values.pop_back();
      --other.ptr.back();
    }
    EXPECT_EQ(loaded.load_analysis(path, other.view(n, a.storage)).status.code, StatusCode::invalid_input);
  });
  ComplexSolver alone(one_thread());
  ASSERT_TRUE(alone.load_analysis(path, a).status.ok());
  ASSERT_TRUE(alone.save_analysis(path).ok());
  on_threads(2, {}, [&](const Ranks& ranks) {
    const LocalMatrix part = rows_of(entries_of(a), n * ranks.rank() / 2, n * (ranks.rank() + 1) / 2);
    ComplexSolver solver(ranks, one_thread());
    ASSERT_TRUE(solver.load_analysis(path, part.view(n, a.storage)).status.ok());
    expect_truth(solver, part);
  });
}

// What is wrong on one rank is said on all, in the same words, and the solver works on.
TEST_P(ComplexParts, MistakesOfOneRank) {
  const ComplexSparseMatrix a =
      complex_of(reference::random_system(120, 4, reference::Values::positive, 1), Storage::hermitian_lower);
  const Index n = a.rows;
  std::mutex mutex;
  std::vector<Status> said;
  const auto note = [&](const Status& status) {
    const std::lock_guard lock(mutex);
    said.push_back(status);
  };
  const auto expect_said = [&](const std::string& words) {
    const std::lock_guard lock(mutex);
    ASSERT_EQ(said.size(), 3U);
    for (const Status& status : said) {
      EXPECT_EQ(status.code, StatusCode::invalid_input);
      EXPECT_EQ(status.message, said[0].message);
      EXPECT_NE(status.message.find(words), std::string::npos) << status.message;
    }
    said.clear();
  };
  // Ranks run `mistake` with a solver that has a factor, and go on with it.
  using Mistake = std::function<Status(ComplexSolver&, const LocalMatrix&, int rank)>;
  const auto expect_mistake = [&](const std::string& words, const Mistake& mistake) {
    SCOPED_TRACE(words);
    on_threads(3, {}, [&](const Ranks& ranks) {
      const LocalMatrix part = rows_of(entries_of(a), n * ranks.rank() / 3, n * (ranks.rank() + 1) / 3);
      ComplexSolver solver(ranks, one_thread());
      ASSERT_TRUE(solver.analyze(part.view(n, a.storage)).status.ok());
      ASSERT_TRUE(solver.refactorize(part.values).status.ok());
      note(mistake(solver, part, ranks.rank()));
      if (solver.state() == ComplexSolver::State::empty) {
        ASSERT_TRUE(solver.analyze(part.view(n, a.storage)).status.ok());
      }
      const Status again = solver.refactorize(part.values).status;
      EXPECT_TRUE(again.ok()) << again.message;
    });
    expect_said(words);
  };
  const auto analyzed = [&](ComplexSolver& solver, const LocalMatrix& part) {
    return solver.analyze(part.view(n, a.storage)).status;
  };
  expect_mistake("columns", [&](ComplexSolver& solver, LocalMatrix part, int rank) {
    if (rank == 1) part.col[3] = n;
    return analyzed(solver, part);
  });
  expect_mistake("values of entries", [&](ComplexSolver& solver, LocalMatrix part, int rank) {
    if (rank == 2) part.values.pop_back();
    return analyzed(solver, part);
  });
  expect_mistake("whether there are values", [&](ComplexSolver& solver, LocalMatrix part, int rank) {
    if (rank == 1) part.values.clear();
    return analyzed(solver, part);
  });
  expect_mistake("its storage or its numbers", [&](ComplexSolver& solver, const LocalMatrix& part, int rank) {
    return solver.analyze(part.view(n, rank == 1 ? Storage::symmetric_lower : a.storage)).status;
  });
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_mistake("nan", [&](ComplexSolver& solver, LocalMatrix part, int rank) {
    if (rank == 2) part.values[0] = {0, nan};
    return analyzed(solver, part);
  });
  // The first entry of row 0 is on the diagonal.
  expect_mistake("the diagonal of a Hermitian matrix is real", [&](ComplexSolver& solver, LocalMatrix part, int rank) {
    if (rank == 0) part.values[0] += Value(0, 1);
    return analyzed(solver, part);
  });
  expect_mistake("the diagonal of a Hermitian matrix is real", [&](ComplexSolver& solver, LocalMatrix part, int rank) {
    if (rank == 0) part.values[0] += Value(0, 1);
    return solver.refactorize(part.values).status;
  });
  expect_mistake("entries of this rank's part", [&](ComplexSolver& solver, LocalMatrix part, int rank) {
    if (rank == 1) part.values.pop_back();
    return solver.refactorize(part.values).status;
  });
  expect_mistake("nan", [&](ComplexSolver& solver, LocalMatrix part, int rank) {
    if (rank == 2) part.values[1] = {nan, 0};
    return solver.refactorize(part.values).status;
  });
  expect_mistake("values on this rank", [&](ComplexSolver& solver, const LocalMatrix&, int rank) {
    std::vector<Value> x(static_cast<std::size_t>(solver.rows().count - (rank == 1 ? 1 : 0)));
    return solver.solve(x, x).status;
  });
  expect_mistake("no rank gives row", [&](ComplexSolver& solver, const LocalMatrix&, int rank) {
    if (rank == 1) solver.set_rows({0, 3});
    std::vector<Value> x(static_cast<std::size_t>(solver.rows().count), 1.0);
    return solver.solve(x, x).status;
  });
}

}  // namespace complex_parts_test
}  // namespace espalier::ranks
