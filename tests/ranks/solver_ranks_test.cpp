// A solver on several ranks, here threads with a link between them. The truth is the solver of one process: the same
// bits, whatever the number of ranks and however their messages are late.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <mutex>
#include <string>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "on_threads.hpp"
#include "reference/reference.hpp"

namespace espalier::ranks {
namespace solver_ranks_test {

using reference::random_vector;

SparseMatrix generated(std::vector<std::string> words) { return matrix::generate(matrix::parse_generator(words)); }

// Everything that a user sees of one system.
struct Answer {
  AnalysisResult analysis;
  FactorResult factor;
  SolveResult solve;
  ConditionResult condition;
  std::vector<double> x;
};

struct Wanted {
  SparseMatrix a;
  Options options;
  Index columns = 1;
  Transpose transpose = Transpose::no;
};

Answer answer_of(Solver& solver, const Wanted& w) {
  Answer r;
  r.analysis = solver.analyze(w.a);
  if (!r.analysis.status.ok()) return r;
  r.factor = solver.factorize(w.a);
  if (!r.factor.status.ok()) return r;
  const std::vector<double> b = random_vector(Offset{w.a.rows} * w.columns, 5);
  r.x.assign(b.size(), 0.0);
  r.solve = solver.solve(b, r.x, w.columns, w.transpose);
  r.condition = solver.condition_estimate();
  return r;
}

Answer of_one_process(const Wanted& w) {
  Options options = w.options;
  options.device = "cpu";
  options.threads = 2;
  Solver solver(options);
  return answer_of(solver, w);
}

bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0);
}

void expect_same(const Answer& found, const Answer& truth, bool with_solution) {
  EXPECT_EQ(found.analysis.status.code, truth.analysis.status.code) << found.analysis.status.message;
  EXPECT_EQ(found.analysis.status.message, truth.analysis.status.message);
  EXPECT_EQ(found.factor.status.code, truth.factor.status.code) << found.factor.status.message;
  EXPECT_EQ(found.factor.status.message, truth.factor.status.message);
  EXPECT_EQ(found.factor.inertia.negative, truth.factor.inertia.negative);
  EXPECT_EQ(found.factor.inertia.zero, truth.factor.inertia.zero);
  EXPECT_EQ(found.factor.rank, truth.factor.rank);
  EXPECT_EQ(found.factor.two_by_two, truth.factor.two_by_two);
  EXPECT_EQ(found.factor.perturbed, truth.factor.perturbed);
  EXPECT_EQ(found.factor.delayed, truth.factor.delayed);
  EXPECT_TRUE(same_bits({found.factor.determinant_log, found.factor.determinant_sign},
                        {truth.factor.determinant_log, truth.factor.determinant_sign}));
  EXPECT_EQ(found.factor.dependent_rows, truth.factor.dependent_rows);
  EXPECT_TRUE(same_bits(found.factor.null_vectors, truth.factor.null_vectors));
  EXPECT_EQ(found.solve.status.code, truth.solve.status.code) << found.solve.status.message;
  EXPECT_EQ(found.solve.refinement_steps, truth.solve.refinement_steps);
  EXPECT_EQ(found.solve.backward_error, truth.solve.backward_error);
  EXPECT_EQ(found.condition.estimate, truth.condition.estimate);
  if (with_solution) {
    EXPECT_TRUE(same_bits(found.x, truth.x));
  }
}

void expect_bits_of_one(const Wanted& w, std::vector<int> counts = {2, 3, 4, 8}, const Faults& faults = {},
                        int threads = 1) {
  const Answer truth = of_one_process(w);
  for (const int count : counts) {
    SCOPED_TRACE(std::to_string(count) + " ranks");
    std::mutex mutex;
    on_threads(count, faults, [&](const Ranks& ranks) {
      Options options = w.options;
      options.threads = threads;
      Solver solver(ranks, options);
      const Answer found = answer_of(solver, w);
      const std::lock_guard lock(mutex);
      expect_same(found, truth, ranks.rank() == 0);
    });
  }
}

// The answer of rank 0.
Answer of_ranks(const Wanted& w, int count) {
  Answer first;
  on_threads(count, {}, [&](const Ranks& ranks) {
    Options options = w.options;
    options.threads = 1;
    Solver solver(ranks, options);
    Answer found = answer_of(solver, w);
    if (ranks.rank() == 0) first = std::move(found);
  });
  return first;
}

TEST(SolverRanks, PositiveDefinite) {
  expect_bits_of_one({generated({"elasticity", "8", "6", "5"}), {}, 3});
  expect_bits_of_one({generated({"poisson", "9"}), {}});
}

TEST(SolverRanks, Indefinite) {
  expect_bits_of_one({generated({"kkt", "3", "4", "2", "2"}), {}, 2});
  expect_bits_of_one({reference::saddle_point(300, 60, 3), {}});
}

TEST(SolverRanks, Unsymmetric) {
  expect_bits_of_one({generated({"gyroscopic", "6", "5", "4"}), {}});
  expect_bits_of_one({generated({"gyroscopic", "6", "5", "4"}), {}, 2, Transpose::yes});
}

TEST(SolverRanks, MixedPrecision) {
  Options o;
  o.precision = Precision::mixed;
  expect_bits_of_one({generated({"elasticity", "6", "5", "4"}), o}, {2, 3});
}

// Tiles of 32 columns: fronts of many tiles, shared column by column.
TEST(SolverRanks, NarrowTiles) {
  Options o;
  o.max_block_size = 32;
  expect_bits_of_one({generated({"elasticity", "9", "9", "9"}), o, 2}, {2, 3, 5});
  expect_bits_of_one({generated({"gyroscopic", "7", "7", "7"}), o}, {3});
}

TEST(SolverRanks, SeveralThreadsEach) {
  Options o;
  o.max_block_size = 32;
  expect_bits_of_one({generated({"elasticity", "8"}), o}, {2, 3}, {}, 2);
  expect_bits_of_one({generated({"kkt", "2", "6", "4", "4"}), o}, {2}, {}, 3);
}

// Messages that are late, receipts that end in any order, and few that may be under way.
TEST(SolverRanks, DelaysAndFewCredits) {
  Options o;
  o.max_block_size = 32;
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Faults faults;
    faults.seed = seed;
    faults.most_delay = 2e-4;
    faults.reorder = true;
    faults.credits = seed % 2 == 0 ? 1 : 3;
    expect_bits_of_one({generated({"elasticity", "5", "5", "5"}), o}, {3}, faults, seed == 2 ? 2 : 1);
    expect_bits_of_one({reference::saddle_point(200, 40, seed), o}, {4}, faults);
    expect_bits_of_one({generated({"gyroscopic", "4"}), o}, {2}, faults);
  }
}

// A strip of a grid, unsymmetric, whose first unknown has next to nothing on its diagonal and beside it: its only
// partner is the last one.
SparseMatrix partner_at_the_other_end(Index length, Index width) {
  const Index n = length * width;
  std::vector<reference::Triple> t;
  const auto add = [&](Index i, Index j, double value) {
    t.push_back({i, j, value});
    if (i != j) t.push_back({j, i, 0.7 * value});
  };
  for (Index k = 1; k < n; ++k) {
    add(k, k, 4.1);
    if (k % width != 0) add(k, k - 1, k == 1 ? 1e-12 : -1);
    if (k >= width) add(k, k - width, k == width ? 1e-12 : -1);
  }
  add(0, 0, 1e-13);
  add(n - 1, 0, 1);
  return reference::from_triples(n, t, Storage::general);
}

// Pivots that fail and move to later fronts, whose contributions other ranks have.
TEST(SolverRanks, MovedPivots) {
  Options o;
  o.matching = false;
  o.pivot_threshold = 0.3;
  for (const Index width : {0, 32}) {
    o.max_block_size = width;
    for (const Wanted& w : {Wanted{reference::saddle_point(300, 60, 3), o},
                            Wanted{reference::random_system(300, 3, reference::Values::indefinite, 3), o, 2},
                            Wanted{partner_at_the_other_end(60, 6), o}}) {
      const Answer one = of_one_process(w), two = of_ranks(w, 2);
      EXPECT_GT(two.factor.delayed, 0) << "no pivot has moved: the test has not tested anything";
      // One process finds failures in another order, since it goes on with what it has: it may move others.
      EXPECT_EQ(two.factor.inertia.negative, one.factor.inertia.negative);
      EXPECT_NEAR(two.factor.determinant_log, one.factor.determinant_log, 1e-8);
      EXPECT_LE(two.solve.backward_error, 1e-15);
      for (const int count : {3, 5, 8}) {
        SCOPED_TRACE(std::to_string(count) + " ranks");
        expect_same(of_ranks(w, count), two, true);
      }
    }
  }
}

TEST(SolverRanks, SingularMatrices) {
  Options report;
  report.singular = SingularMatrix::report;
  expect_bits_of_one({generated({"kkt-redundant", "3", "2", "4", "2", "2"}), {}}, {2, 4});
  expect_bits_of_one({generated({"kkt-redundant", "3", "2", "4", "2", "2"}), report}, {2, 4});
  // Nothing in a row and a column.
  SparseMatrix empty = generated({"poisson", "6"});
  for (std::size_t k = 0; k < empty.values.size(); ++k)
    if (empty.row_ind[k] == 40) empty.values[k] = 0;
  for (Offset k = empty.col_ptr[40]; k < empty.col_ptr[41]; ++k) empty.values[static_cast<std::size_t>(k)] = 0;
  expect_bits_of_one({empty, {}}, {3});
}

// A row that is full: one front above all others.
TEST(SolverRanks, DenseRow) {
  SparseMatrix a = generated({"poisson", "8", "8", "8"});
  std::vector<reference::Triple> all;
  const Index n = a.cols;
  for (Index c = 0; c < n; ++c)
    for (Offset k = a.col_ptr[static_cast<std::size_t>(c)]; k < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++k)
      all.push_back({a.row_ind[static_cast<std::size_t>(k)], c, a.values[static_cast<std::size_t>(k)]});
  for (Index c = 0; c < n; ++c) all.push_back({n, c, 0.01});
  all.push_back({n, n, 50});
  expect_bits_of_one({reference::from_triples(n + 1, all, a.storage), {}});
}

// One rank's values alone are far from the range in which factors work, those of all are not.
TEST(SolverRanks, PartsOfOtherScales) {
  SparseMatrix a = generated({"poisson", "7"});
  std::vector<reference::Triple> all;
  const Index n = a.cols;
  for (const Index block : {0, 1})
    for (Index c = 0; c < n; ++c)
      for (Offset k = a.col_ptr[static_cast<std::size_t>(c)]; k < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++k)
        all.push_back({a.row_ind[static_cast<std::size_t>(k)] + block * n, c + block * n,
                       (block == 0 ? 1 : 1e-150) * a.values[static_cast<std::size_t>(k)]});
  Options o;
  o.kind = Kind::llt;
  const Wanted wanted{reference::from_triples(2 * n, all, a.storage), o};
  ASSERT_TRUE(of_one_process(wanted).factor.status.ok());
  expect_bits_of_one(wanted, {2});
}

// Far more ranks than there is work.
TEST(SolverRanks, TinyMatrices) {
  const Options o;
  expect_bits_of_one({reference::from_triples(1, {{0, 0, 4}}, Storage::general), o}, {2, 8});
  expect_bits_of_one({reference::random_system(5, 2, reference::Values::positive, 1), o}, {2, 8});
  expect_bits_of_one({reference::random_system(40, 3, reference::Values::general, 1), o}, {8});
  expect_bits_of_one({reference::from_triples(3, {{0, 0, 1}, {1, 1, 2}, {2, 2, 3}}, Storage::symmetric_lower), o}, {5});
}

// One rank orders, and all have its tree: what the others would make of it is not looked at.
TEST(SolverRanks, OneRankOrdersForAll) {
  Wanted w{generated({"elasticity", "5", "4", "4"}), {}};
  for (Index k = 0; k < w.a.rows; ++k) w.options.permutation.push_back(w.a.rows - 1 - k);
  const Answer truth = of_one_process(w);
  on_threads(3, {}, [&](const Ranks& ranks) {
    Wanted mine = w;
    mine.options.threads = 1;
    if (ranks.rank() != 0) mine.options.permutation = {0};
    Solver solver(ranks, mine.options);
    expect_same(answer_of(solver, mine), truth, ranks.rank() == 0);
    mine.options.permutation = ranks.rank() == 0 ? std::vector<Index>{0} : w.options.permutation;
    Solver wrong(ranks, mine.options);
    const Status status = wrong.analyze(mine.a).status;
    EXPECT_EQ(status.code, StatusCode::invalid_input);
    EXPECT_NE(status.message.find("rank 0"), std::string::npos) << status.message;
  });
}

// Each rank has a part of the plan; a saved analysis is whole, whoever wrote it, and serves any number of ranks.
TEST(SolverRanks, SavedAnalyses) {
  const SparseMatrix a = generated({"kkt", "2", "6", "4", "4"});
  const std::string path = testing::TempDir() + "espalier_ranks_analysis";
  const std::vector<double> b = random_vector(a.rows, 3);
  const auto solution = [&](Solver& solver) {
    EXPECT_TRUE(solver.factorize(a).status.ok());
    std::vector<double> x = b;
    EXPECT_TRUE(solver.solve(x, x).status.ok());
    return x;
  };
  Options options;
  options.device = "cpu";
  options.threads = 1;
  Solver alone(options);
  ASSERT_TRUE(alone.analyze(a).status.ok());
  const std::vector<double> truth = solution(alone);
  on_threads(3, {}, [&](const Ranks& ranks) {
    Solver solver(ranks, options);
    ASSERT_TRUE(solver.analyze(a).status.ok());
    const Status saved = solver.save_analysis(path);
    ASSERT_TRUE(saved.ok()) << saved.message;
    const std::vector<double> x = solution(solver);  // goes on with the part
    if (ranks.rank() == 0) {
      EXPECT_TRUE(same_bits(x, truth));
    }
  });
  Solver loaded(options);
  ASSERT_TRUE(loaded.load_analysis(path, a).status.ok());
  EXPECT_TRUE(same_bits(solution(loaded), truth));
  on_threads(2, {}, [&](const Ranks& ranks) {
    Solver solver(ranks, options);
    ASSERT_TRUE(solver.load_analysis(path, a).status.ok());
    const std::vector<double> x = solution(solver);
    if (ranks.rank() == 0) {
      EXPECT_TRUE(same_bits(x, truth));
    }
  });
}

// What follows a change of the pattern follows it on all ranks: the same tree, the same bits.
TEST(SolverRanks, ChangedPatterns) {
  const SparseMatrix a = generated({"gyroscopic", "6", "6", "6"});
  SparseMatrix b{a.rows, a.cols, {0}, {}, {}, a.storage};
  int seen = 0;
  for (Index c = 0; c < a.cols; ++c) {
    for (Offset k = a.col_ptr[c]; k < a.col_ptr[c + 1]; ++k) {
      if (c < 60 && a.row_ind[k] != c && ++seen % 40 == 0) continue;
      b.row_ind.push_back(a.row_ind[k]);
      b.values.push_back(a.values[k]);
    }
    b.col_ptr.push_back(static_cast<Offset>(b.row_ind.size()));
  }
  ASSERT_GT(seen, 40);
  const auto life = [&](Solver& solver) {
    EXPECT_TRUE(solver.analyze(a).status.ok());
    EXPECT_TRUE(solver.factorize(a).status.ok());
    const ChangeResult change = solver.analyze_change(b);
    EXPECT_TRUE(change.analysis.status.ok()) << change.analysis.status.message;
    EXPECT_FALSE(change.full) << change.why;
    EXPECT_TRUE(solver.factorize(b).status.ok());
    std::vector<double> x = random_vector(a.rows, 7);
    EXPECT_TRUE(solver.solve(x, x).status.ok());
    return x;
  };
  Options options;
  options.device = "cpu";
  options.threads = 1;
  Solver alone(options);
  const std::vector<double> truth = life(alone);
  for (const int count : {2, 3})
    on_threads(count, {}, [&](const Ranks& ranks) {
      Solver solver(ranks, options);
      const std::vector<double> x = life(solver);
      if (ranks.rank() == 0) {
        EXPECT_TRUE(same_bits(x, truth)) << count << " ranks";
      }
    });
}

}  // namespace solver_ranks_test
}  // namespace espalier::ranks
