// Complex systems on several ranks, here threads with a link between them. The truth is the solver of one process: the
// same bits. Ranks are on hosts, which have kernels for complex numbers, and take real forms where they are told to.
#include <gtest/gtest.h>

#include <cmath>
#include <mutex>
#include <optional>
#include <vector>

#include "complex_system.hpp"
#include "espalier/complex_solver.hpp"
#include "on_threads.hpp"
#include "reference/reference.hpp"
#include "solver/as_real_form.hpp"

namespace espalier::ranks {
namespace complex_ranks_test {

using Value = std::complex<double>;

struct Answer {
  AnalysisResult analysis;
  ComplexFactorResult factor;
  SolveResult solve;
  double condition = 0;
  std::vector<Value> x;
};

Answer answer_of(ComplexSolver& solver, const ComplexSparseMatrix& a, bool first, Transpose transpose) {
  Answer r;
  const ComplexMatrixView mine = first ? a.view() : ComplexMatrixView();
  r.analysis = solver.analyze(mine);
  if (!r.analysis.status.ok()) return r;
  r.factor = solver.factorize(mine);
  if (!r.factor.status.ok()) return r;
  r.factor = solver.refactorize(mine.values);
  const std::vector<double> parts = reference::random_vector(Offset{a.rows} * 4, 5);
  std::vector<Value> b;
  for (std::size_t k = 0; first && k < parts.size(); k += 2) b.emplace_back(parts[k], parts[k + 1]);
  r.x.resize(b.size());
  r.solve = solver.solve(b, r.x, 2, transpose);
  r.condition = solver.condition_estimate().estimate;
  return r;
}

void expect_same(const Answer& found, const Answer& truth, bool first) {
  EXPECT_EQ(found.analysis.status.code, truth.analysis.status.code) << found.analysis.status.message;
  EXPECT_EQ(found.factor.status.code, truth.factor.status.code) << found.factor.status.message;
  EXPECT_EQ(found.factor.inertia.negative, truth.factor.inertia.negative);
  EXPECT_EQ(found.factor.rank, truth.factor.rank);
  EXPECT_EQ(found.factor.determinant_log, truth.factor.determinant_log);
  EXPECT_TRUE(same_number(found.factor.determinant_phase, truth.factor.determinant_phase));
  EXPECT_EQ(found.factor.null_vectors, truth.factor.null_vectors);
  EXPECT_EQ(found.solve.status.code, truth.solve.status.code) << found.solve.status.message;
  EXPECT_EQ(found.solve.backward_error, truth.solve.backward_error);
  EXPECT_EQ(found.condition, truth.condition);
  if (first) {
    EXPECT_EQ(found.x, truth.x);
  }
}

void expect_bits_of_one(const ComplexSparseMatrix& a, const Options& options, Transpose transpose = Transpose::no) {
  Options alone = options;
  alone.threads = 2;
  ComplexSolver solver(alone);
  const Answer truth = answer_of(solver, a, true, transpose);
  for (const int count : {2, 3}) {
    std::mutex mutex;
    on_threads(count, {}, [&](const Ranks& ranks) {
      Options mine = options;
      mine.threads = 1;
      ComplexSolver shared(ranks, mine);
      const Answer found = answer_of(shared, a, ranks.rank() == 0, transpose);
      const std::lock_guard lock(mutex);
      SCOPED_TRACE(testing::Message() << "rank " << ranks.rank() << " of " << count);
      expect_same(found, truth, ranks.rank() == 0);
    });
  }
}

// The forms in which hosts factorize them; GPUs take the second alone.
class ComplexRanks : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    if (GetParam()) real_form_.emplace();
  }

 private:
  std::optional<test::AsRealForm> real_form_;
};
INSTANTIATE_TEST_SUITE_P(Forms, ComplexRanks, testing::Bool(),
                         [](const auto& form) { return form.param ? "Real" : "Native"; });

TEST_P(ComplexRanks, HaveTheBitsOfOneProcess) {
  using reference::Values;
  const SparseMatrix definite = reference::random_system(900, 4, Values::positive, 1);
  expect_bits_of_one(complex_of(definite, Storage::hermitian_lower), {});
  expect_bits_of_one(complex_of(definite, Storage::symmetric_lower), {}, Transpose::conjugate);
  Options ldlt;
  ldlt.kind = Kind::ldlt;
  expect_bits_of_one(complex_of(reference::random_system(600, 4, Values::indefinite, 2), Storage::hermitian_lower),
                     ldlt);
  const SparseMatrix general = reference::random_system(600, 4, Values::general, 3);
  expect_bits_of_one(complex_of(general, Storage::general), {}, Transpose::yes);
  expect_bits_of_one(complex_of(general, Storage::general), {}, Transpose::conjugate);
  Options mixed;
  mixed.precision = Precision::mixed;
  expect_bits_of_one(complex_of(definite, Storage::symmetric_lower), mixed);
}

// Pivots that fail and move to later fronts, whose contributions other ranks have. One process finds failures in
// another order, and may move others.
TEST_P(ComplexRanks, MovedPivots) {
  Options options;
  options.kind = Kind::ldlt;
  options.matching = false;
  options.pivot_threshold = 0.3;
  options.threads = 1;
  for (const Storage storage : {Storage::symmetric_lower, Storage::hermitian_lower}) {
    const ComplexSparseMatrix a =
        complex_of(reference::random_system(300, 3, reference::Values::indefinite, 3), storage);
    ComplexSolver alone(options);
    const Answer one = answer_of(alone, a, true, Transpose::no);
    std::optional<Answer> two;
    for (const int count : {2, 3, 5}) {
      std::vector<Answer> found(static_cast<std::size_t>(count));
      on_threads(count, {}, [&](const Ranks& ranks) {
        ComplexSolver shared(ranks, options);
        found[static_cast<std::size_t>(ranks.rank())] = answer_of(shared, a, ranks.rank() == 0, Transpose::no);
      });
      if (!two) two = found.front();
      for (std::size_t r = 0; r < found.size(); ++r) {
        SCOPED_TRACE(testing::Message() << "rank " << r << " of " << count);
        expect_same(found[r], *two, r == 0);
      }
    }
    EXPECT_GT(two->factor.delayed, 0) << "no pivot moves: nothing is tested";
    EXPECT_EQ(two->factor.inertia.negative, one.factor.inertia.negative);
    EXPECT_NEAR(two->factor.determinant_log, one.factor.determinant_log, 1e-8);
    EXPECT_LE(two->solve.backward_error, 1e-15);
  }
}

TEST_P(ComplexRanks, SingularSystemsAndWrongArraysEndOnAllRanks) {
  ComplexSparseMatrix a =
      complex_of(reference::random_system(60, 4, reference::Values::positive, 1), Storage::symmetric_lower);
  on_threads(2, {}, [&](const Ranks& ranks) {
    const bool first = ranks.rank() == 0;
    ComplexSolver solver(ranks);
    const ComplexMatrixView mine = first ? a.view() : ComplexMatrixView();
    ASSERT_TRUE(solver.analyze(mine).status.ok());
    ComplexMatrixView bad = mine;
    if (first) bad.values = bad.values.first(3);
    EXPECT_EQ(solver.factorize(bad).status.code, StatusCode::invalid_input);
    EXPECT_EQ(solver.refactorize(bad.values).status.code, StatusCode::invalid_input);
    ASSERT_TRUE(solver.refactorize(mine.values).status.ok());
    std::vector<Value> b(first ? 60 : 0), x(b);
    EXPECT_EQ(solver.solve(std::span<const Value>(b).first(first ? 7 : 0), x).status.code, StatusCode::invalid_input);
    EXPECT_EQ(solver.solve(b, std::span<Value>(x).first(0)).status.code, StatusCode::invalid_input);
    EXPECT_TRUE(solver.solve(b, x).status.ok());
    std::vector<Value> zeros(first ? a.values.size() : 0);
    const ComplexFactorResult r = solver.refactorize(zeros);
    EXPECT_EQ(r.status.code, StatusCode::singular);
    EXPECT_EQ(r.rank, 0);
  });
}

// All ranks follow a changed pattern: the bits of one process.
TEST(ComplexRanks, ChangedPatterns) {
  for (const bool real_form : {false, true}) {
    std::optional<test::AsRealForm> form;
    if (real_form) form.emplace();
    const ComplexSparseMatrix b = complex_of(
        reference::stored_as(reference::random_system(600, 4, reference::Values::positive, 2), Storage::general),
        Storage::general);
    ComplexSparseMatrix a{b.rows, b.cols, {0}, {}, {}, b.storage};
    int seen = 0;
    for (Index c = 0; c < b.cols; ++c) {
      for (Offset k = b.col_ptr[c]; k < b.col_ptr[c + 1]; ++k) {
        if (b.row_ind[k] != c && ++seen % 60 == 0) continue;
        a.row_ind.push_back(b.row_ind[k]);
        a.values.push_back(b.values[k]);
      }
      a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
    }
    const auto life = [&](ComplexSolver& solver, bool first) {
      const ComplexMatrixView before = first ? a.view() : ComplexMatrixView(), now = first ? b.view() : before;
      EXPECT_TRUE(solver.analyze(before).status.ok());
      EXPECT_TRUE(solver.factorize(before).status.ok());
      const ChangeResult change = solver.analyze_change(now);
      EXPECT_TRUE(change.analysis.status.ok()) << change.analysis.status.message;
      EXPECT_FALSE(change.full) << change.why;
      EXPECT_TRUE(solver.factorize(now).status.ok());
      std::vector<Value> x;
      for (const double v : reference::random_vector(first ? a.rows : 0, 7)) x.push_back(v);
      EXPECT_TRUE(solver.solve(x, x).status.ok());
      return x;
    };
    Options options;
    options.device = "cpu";
    options.threads = 1;
    options.kind = Kind::lu;
    ComplexSolver alone(options);
    const std::vector<Value> truth = life(alone, true);
    for (const int count : {2, 3})
      on_threads(count, {}, [&](const Ranks& ranks) {
        ComplexSolver solver(ranks, options);
        const std::vector<Value> x = life(solver, ranks.rank() == 0);
        if (ranks.rank() == 0) {
          EXPECT_EQ(x, truth) << count << " ranks";
        }
      });
  }
}

}  // namespace complex_ranks_test
}  // namespace espalier::ranks
