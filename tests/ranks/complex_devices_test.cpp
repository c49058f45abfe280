// Complex systems on ranks with a GPU each, here emulated ones: real forms, whose values and vectors lie there. The
// truth is one process with such a GPU (the same bits), and kernels for complex numbers on the host.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "complex_system.hpp"
#include "emulated_gpu.hpp"
#include "espalier/complex_solver.hpp"
#include "on_threads.hpp"
#include "reference/reference.hpp"
#include "solver/ranks/part_calls.hpp"
#include "solver/session/session_calls.hpp"
#include "solver/solution/solution.hpp"

namespace espalier::ranks {
namespace complex_devices_test {

using Value = std::complex<double>;

constexpr Index kColumns = 2;

std::vector<double> parts_of(const std::vector<Value>& numbers) {
  const auto* first = reinterpret_cast<const double*>(numbers.data());
  return {first, first + 2 * numbers.size()};
}

// The calls of ComplexSolver, of one rank, with a registry of its own; numbers are passed as pairs of doubles.
class Caller {
 public:
  explicit Caller(const Ranks& ranks = {}, Options options = {}, bool named = true, bool refuses = false) {
    gpu_.refuses = refuses;
    options.threads = 1;
    options.device = !named ? "auto" : ranks.size() > 1 ? "emulated:all" : "emulated:0";
    session_.emplace(ranks, options, registry_);
  }

  Status analyze(const ComplexMatrixView& a) {
    return solver::analysis_by(*session_, [&] { session_->analyze_given(solver::given(a)); }).status;
  }
  template <class Local>
  Status analyze(const Local& part) {
    return solver::analysis_by(*session_, [&] { session_->analyze_part(solver::given(part)); }).status;
  }
  FactorResult refactorize(const std::vector<double>& values) {
    if (session_->parts) return solver::refactorize_part(*session_, values);
    return solver::factor_by(*session_, [&](solver::Factor& f) { f.factorize(values); });
  }
  SolveResult solve(std::vector<double>& x, bool transpose = false) {
    const auto whole = [&](double* all) {
      return solver::solve(*session_->factor, {all, all, kColumns, transpose}, session_->context);
    };
    if (session_->parts) return solver::solve_part(*session_, x, x, kColumns, whole);
    return solver::solve_by(*session_, [&] { return whole(x.data()); });
  }
  solver::Session& session() { return *session_; }
  [[nodiscard]] const EmulatedWork& work() const { return gpu_.work; }

 private:
  EmulatedGpu gpu_;
  const device::Registry registry_{{&device::registry().host(), &gpu_}, {}};
  std::optional<solver::Session> session_;
};

// What a caller sees.
struct Answer {
  FactorResult factor;
  SolveResult solve;
  double condition = 0;
  std::vector<double> x;
};

// The answer of a matrix that is analyzed: values twice, since the first ones have been on the host at the analysis.
Answer answer_of(Caller& caller, const std::vector<double>& values, const std::vector<double>& b, bool transpose) {
  Answer r;
  (void)caller.refactorize(values);
  r.factor = caller.refactorize(values);
  if (!r.factor.status.ok()) return r;
  r.x = b;
  r.solve = caller.solve(r.x, transpose);
  r.condition = solver::condition_of(caller.session(), "condition_estimate").estimate;
  return r;
}

void expect_same(const Answer& found, const Answer& truth) {
  EXPECT_EQ(found.factor.status.code, truth.factor.status.code) << found.factor.status.message;
  EXPECT_EQ(found.factor.rank, truth.factor.rank);
  EXPECT_EQ(found.factor.inertia.negative, truth.factor.inertia.negative);
  EXPECT_EQ(found.factor.inertia.positive, truth.factor.inertia.positive);
  EXPECT_EQ(found.factor.delayed, truth.factor.delayed);
  EXPECT_EQ(found.factor.determinant_log, truth.factor.determinant_log);
  EXPECT_EQ(found.factor.null_vectors, truth.factor.null_vectors);
  EXPECT_EQ(found.solve.status.code, truth.solve.status.code) << found.solve.status.message;
  EXPECT_EQ(found.solve.backward_error, truth.solve.backward_error);
  EXPECT_EQ(found.condition, truth.condition);
}

std::vector<double> right_hand_sides(Index n) { return reference::random_vector(2 * Offset{n} * kColumns, 5); }

Answer truth_of(const ComplexSparseMatrix& a, const Options& options, bool transpose) {
  Caller alone({}, options);
  const Status analysis = alone.analyze(a.view());
  EXPECT_TRUE(analysis.ok()) << analysis.message;
  Answer truth = answer_of(alone, parts_of(a.values), right_hand_sides(a.rows), transpose);
  EXPECT_NE(alone.session().current().system->real_form, nullptr);
  EXPECT_GT(alone.work().sent, 0) << "the linear system is not there: nothing is tested";
  return truth;
}

// Rows [first, end) of a matrix by rows; what is stored by columns as a symmetric triangle are rows of the other one.
struct Rows {
  Rows(const ComplexSparseMatrix& a, Index begin, Index end) : n(a.rows), first(begin), storage(a.storage) {
    if (a.storage == Storage::symmetric_lower) storage = Storage::symmetric_upper;
    if (a.storage == Storage::hermitian_lower) storage = Storage::hermitian_upper;
    const bool general = a.storage == Storage::general, conjugates = a.storage == Storage::hermitian_lower;
    std::vector<std::vector<std::size_t>> of_row(static_cast<std::size_t>(n));
    std::vector<Index> col_of(a.values.size());
    for (Index c = 0; c < n; ++c)
      for (auto q = static_cast<std::size_t>(a.col_ptr[c]); q < static_cast<std::size_t>(a.col_ptr[c + 1]); ++q) {
        of_row[static_cast<std::size_t>(general ? a.row_ind[q] : c)].push_back(q);
        col_of[q] = general ? c : a.row_ind[q];
      }
    for (Index r = begin; r < end; ++r) {
      for (const std::size_t q : of_row[static_cast<std::size_t>(r)]) {
        col.push_back(col_of[q]);
        values.push_back(conjugates ? std::conj(a.values[q]) : a.values[q]);
      }
      ptr.push_back(static_cast<Offset>(col.size()));
    }
  }
  [[nodiscard]] ComplexLocalRows view() const { return {n, first, ptr, col, values, storage}; }
  // These rows of each column.
  [[nodiscard]] std::vector<double> of(const std::vector<double>& v) const {
    std::vector<double> piece;
    const auto count = 2 * (static_cast<Offset>(ptr.size()) - 1);
    for (Index c = 0; c < kColumns && !v.empty(); ++c) {
      const auto from = v.begin() + 2 * (Offset{c} * n + first);
      piece.insert(piece.end(), from, from + count);
    }
    return piece;
  }

  Index n, first;
  Storage storage;
  std::vector<Offset> ptr{0};
  std::vector<Index> col;
  std::vector<Value> values;
};

// All on rank 0, rows on each rank, entries anywhere.
void expect_bits_of_one(const ComplexSparseMatrix& a, const Options& options = {}, bool transpose = false) {
  const Index n = a.rows;
  const Answer truth = truth_of(a, options, transpose);
  const std::vector<double> b = right_hand_sides(n);
  for (const int count : {2, 3}) {
    const auto trace = [&](const Ranks& ranks, const char* way) {
      return testing::Message() << "rank " << ranks.rank() << " of " << count << ", " << way;
    };
    on_threads(count, {}, [&](const Ranks& ranks) {
      SCOPED_TRACE(trace(ranks, "all on rank 0"));
      const bool first = ranks.rank() == 0;
      Caller caller(ranks, options);
      const Status analysis = caller.analyze(first ? a.view() : ComplexMatrixView());
      ASSERT_TRUE(analysis.ok()) << analysis.message;
      EXPECT_TRUE(caller.session().current().device.one_a_rank);
      const Answer found = answer_of(caller, first ? parts_of(a.values) : std::vector<double>(),
                                     first ? b : std::vector<double>(), transpose);
      expect_same(found, truth);
      if (first) {
        EXPECT_EQ(found.x, truth.x);
      }
    });
    on_threads(count, {}, [&](const Ranks& ranks) {
      SCOPED_TRACE(trace(ranks, "rows"));
      const auto border = [&](int r) { return r == 0 ? 0 : r == count ? n : 7 * r; };
      const Rows rows(a, border(ranks.rank()), border(ranks.rank() + 1));
      Caller caller(ranks, options);
      const Status analysis = caller.analyze(rows.view());
      ASSERT_TRUE(analysis.ok()) << analysis.message;
      const Answer found = answer_of(caller, parts_of(rows.values), rows.of(b), transpose);
      expect_same(found, truth);
      EXPECT_EQ(found.x, rows.of(truth.x));
    });
    on_threads(count, {}, [&](const Ranks& ranks) {
      SCOPED_TRACE(trace(ranks, "entries anywhere"));
      std::vector<Index> row, col;
      std::vector<Value> values;
      for (Index c = 0; c < n; ++c)
        for (auto q = static_cast<std::size_t>(a.col_ptr[c]); q < static_cast<std::size_t>(a.col_ptr[c + 1]); ++q) {
          if (static_cast<int>(q) % count != ranks.rank()) continue;
          row.push_back(a.row_ind[q]);
          col.push_back(c);
          values.push_back(a.values[q]);
        }
      Caller caller(ranks, options);
      const Status analysis = caller.analyze(ComplexLocalEntries{n, row, col, values, a.storage});
      ASSERT_TRUE(analysis.ok()) << analysis.message;
      const Answer found =
          answer_of(caller, parts_of(values), ranks.rank() == 0 ? b : std::vector<double>(), transpose);
      expect_same(found, truth);
      if (ranks.rank() == 0) {
        EXPECT_EQ(found.x, truth.x);
      }
    });
  }
}

// That of the host's kernels for complex numbers: the same counts, and solutions as far apart as errors of rounding.
void expect_answer_of_host(const ComplexSparseMatrix& a, const Options& given = {}, bool transpose = false) {
  Options options = given;
  options.device = "cpu";
  ComplexSolver host(options);
  ASSERT_TRUE(host.analyze(a).status.ok());
  const ComplexFactorResult factor = host.factorize(a);
  ASSERT_TRUE(factor.status.ok()) << factor.status.message;
  const Answer found = truth_of(a, given, transpose);
  EXPECT_EQ(found.factor.rank, factor.rank);
  EXPECT_EQ(found.factor.inertia.negative, factor.inertia.negative);
  EXPECT_NEAR(found.factor.determinant_log, factor.determinant_log, 1e-9 * std::abs(factor.determinant_log) + 1e-9);
  const std::vector<double> parts = right_hand_sides(a.rows);
  std::vector<Value> b, x(parts.size() / 2);
  for (std::size_t k = 0; k < parts.size(); k += 2) b.emplace_back(parts[k], parts[k + 1]);
  ASSERT_TRUE(host.solve(b, x, kColumns, transpose ? Transpose::yes : Transpose::no).status.ok());
  double largest = 0;
  for (const Value& v : x) largest = std::max(largest, std::abs(v));
  const double bound = 1e-14 * host.condition_estimate().estimate * largest;
  for (std::size_t k = 0; k < x.size(); ++k)
    ASSERT_LE(std::abs(x[k] - Value(found.x[2 * k], found.x[2 * k + 1])), bound) << k;
  EXPECT_LE(found.solve.backward_error, 1e-15);
}

void expect_right(const ComplexSparseMatrix& a, const Options& options = {}, bool transpose = false) {
  expect_answer_of_host(a, options, transpose);
  expect_bits_of_one(a, options, transpose);
}

TEST(ComplexDevices, Definite) {
  expect_right(complex_of(reference::random_system(300, 4, reference::Values::positive, 1), Storage::hermitian_lower));
}

TEST(ComplexDevices, Symmetric) {
  expect_right(complex_of(reference::random_system(300, 4, reference::Values::positive, 1), Storage::symmetric_lower));
  expect_right(
      complex_of(reference::random_system(200, 4, reference::Values::indefinite, 2), Storage::symmetric_lower));
}

TEST(ComplexDevices, Hermitian) {
  Options ldlt;
  ldlt.kind = Kind::ldlt;
  expect_right(complex_of(reference::random_system(300, 4, reference::Values::indefinite, 2), Storage::hermitian_lower),
               ldlt);
}

TEST(ComplexDevices, GeneralAndTransposed) {
  const ComplexSparseMatrix a =
      complex_of(reference::random_system(300, 4, reference::Values::general, 3), Storage::general);
  expect_right(a);
  expect_right(a, {}, true);
}

// Pivots find other places by values that all ranks have, and the system is laid out again.
TEST(ComplexDevices, PivotsThatMove) {
  for (const Storage storage : {Storage::symmetric_lower, Storage::hermitian_lower}) {
    Options options;
    options.kind = Kind::ldlt;
    options.matching = false;
    options.pivot_threshold = 0.3;
    const ComplexSparseMatrix a =
        complex_of(reference::random_system(300, 3, reference::Values::indefinite, 3), storage);
    EXPECT_GT(truth_of(a, options, false).factor.delayed, 0) << "no pivot moves: nothing is tested";
    expect_right(a, options);
  }
}

TEST(ComplexDevices, SingularMatrices) {
  SparseMatrix real = reference::random_system(120, 4, reference::Values::positive, 1);
  for (const Storage storage : {Storage::symmetric_lower, Storage::hermitian_lower}) {
    ComplexSparseMatrix a = complex_of(real, storage);
    for (Index c = 0; c < a.cols; ++c)  // row and column 17 vanish
      for (auto q = static_cast<std::size_t>(a.col_ptr[c]); q < static_cast<std::size_t>(a.col_ptr[c + 1]); ++q)
        if (c == 17 || a.row_ind[q] == 17) a.values[q] = 0;
    Options options;
    options.kind = Kind::ldlt;
    options.singular = SingularMatrix::report;
    EXPECT_EQ(truth_of(a, options, false).factor.rank, 119);
    expect_bits_of_one(a, options);
    options.singular = SingularMatrix::error;
    EXPECT_EQ(truth_of(a, options, false).factor.status.code, StatusCode::singular);
    expect_bits_of_one(a, options);
  }
}

// Said on all ranks in the same words, which name the entry; the next values are taken.
TEST(ComplexDevices, ValuesThatAreNotFinite) {
  const ComplexSparseMatrix a =
      complex_of(reference::random_system(120, 4, reference::Values::positive, 1), Storage::hermitian_lower);
  std::vector<Status> ends(2);
  on_threads(2, {}, [&](const Ranks& ranks) {
    const Rows rows(a, ranks.rank() == 0 ? 0 : 60, ranks.rank() == 0 ? 60 : 120);
    Caller caller(ranks);
    ASSERT_TRUE(caller.analyze(rows.view()).ok());
    std::vector<double> bad = parts_of(rows.values);
    if (ranks.rank() == 1) bad[1] = std::numeric_limits<double>::quiet_NaN();
    ends[static_cast<std::size_t>(ranks.rank())] = caller.refactorize(bad).status;
    bad.pop_back();
    bad.pop_back();
    EXPECT_EQ(caller.refactorize(bad).status.code, StatusCode::invalid_input);
    const Status again = caller.refactorize(parts_of(rows.values)).status;
    EXPECT_TRUE(again.ok()) << again.message;
    std::vector<double> few(7);
    EXPECT_EQ(caller.solve(few).status.code, StatusCode::invalid_input);
    std::vector<double> x = rows.of(right_hand_sides(a.rows));
    EXPECT_TRUE(caller.solve(x).status.ok());
  });
  EXPECT_EQ(ends[0].code, StatusCode::invalid_input);
  EXPECT_EQ(ends[0].message, ends[1].message);
  EXPECT_NE(ends[0].message.find("nan"), std::string::npos) << ends[0].message;
}

// A device each where that is predicted to be faster; where the devices then have no memory, the hosts take over, and
// factorize the real form as it is.
TEST(ComplexDevices, AreChosenAndReplaced) {
  for (const Storage storage : {Storage::symmetric_lower, Storage::general}) {
    const ComplexSparseMatrix a = complex_of(
        reference::random_system(
            300, 4, storage == Storage::general ? reference::Values::general : reference::Values::positive, 1),
        storage);
    const Answer truth = truth_of(a, {}, false);
    for (const bool refuses : {false, true})
      on_threads(3, {}, [&](const Ranks& ranks) {
        SCOPED_TRACE(testing::Message() << "rank " << ranks.rank() << (refuses ? ", refuses" : ""));
        Caller caller(ranks, {}, false, refuses);
        const bool first = ranks.rank() == 0;
        ASSERT_TRUE(caller.analyze(first ? a.view() : ComplexMatrixView()).ok());
        EXPECT_TRUE(caller.session().current().device.one_a_rank);
        const Answer found = answer_of(caller, first ? parts_of(a.values) : std::vector<double>(),
                                       first ? right_hand_sides(a.rows) : std::vector<double>(), false);
        EXPECT_TRUE(found.factor.status.ok()) << found.factor.status.message;
        EXPECT_NE(caller.session().current().device.one_a_rank, refuses);
        EXPECT_LE(found.solve.backward_error, 1e-15);
        if (!refuses) {
          expect_same(found, truth);
        }
      });
  }
}

}  // namespace complex_devices_test
}  // namespace espalier::ranks
