// Ranks that make only what has changed (Options::partial_refactorization). Truth: the bits of a solver of one process
// that makes everything; what all ranks say of their work.
#include <gtest/gtest.h>

#include <mutex>
#include <string>
#include <vector>

#include "on_threads.hpp"
#include "solver/changed_values.hpp"

namespace espalier::ranks {
namespace partial_ranks_test {

using namespace changed_values;

// What a sequence of changes comes to: of each, what is said of the factor and the bits of a solution.
template <class AnyFactor, class T>
struct Followed {
  std::vector<AnyFactor> factors;
  std::vector<std::vector<T>> solutions;
};

template <class AnySolver, class Matrix>
auto follow(AnySolver& solver, const Matrix& a, unsigned seed, int rounds) {
  using T = typename std::decay_t<decltype(a.values)>::value_type;
  std::mt19937 random(seed);
  Followed<decltype(solver.refactorize(a.values)), T> found;
  EXPECT_TRUE(solver.analyze(a).status.ok());
  std::vector<T> now = a.values;
  for (int k = 0; k < rounds; ++k) {
    found.factors.push_back(solver.refactorize(now));
    std::vector<T> b(now.size() > 0 ? static_cast<std::size_t>(a.rows) : 0, T(1)), x(b.size());
    if (found.factors.back().status.ok()) {
      EXPECT_TRUE(solver.solve(b, x).status.ok());
    }
    found.solutions.push_back(std::move(x));
    change_values(now, a.values, random);
  }
  return found;
}

struct RanksTally {
  int some = 0;
};

template <class AnySolver, class RankSolver, class Matrix>
void expect_bits_of_one(const Options& options, const Matrix& a, unsigned seed, int count, const Faults& faults,
                        RanksTally& tally) {
  SCOPED_TRACE(std::to_string(count) + " ranks, n = " + std::to_string(a.rows) + ", seed " + std::to_string(seed));
  constexpr int kRounds = 12;
  Options full = options;
  full.partial_refactorization = false;
  full.device = "cpu";
  AnySolver one(full);
  const auto truth = follow(one, a, seed, kRounds);
  std::mutex mutex;
  std::vector<double> shares;
  on_threads(count, faults, [&](const Ranks& ranks) {
    Options mine = options;
    mine.threads = 1 + static_cast<int>(seed) % 2;
    RankSolver solver(ranks, mine);
    const auto found = follow(solver, a, seed, kRounds);
    const std::lock_guard lock(mutex);
    for (std::size_t k = 0; k < truth.factors.size(); ++k) {
      const auto &f = found.factors[k], &t = truth.factors[k];
      EXPECT_EQ(f.status.code, t.status.code) << f.status.message << " / " << t.status.message;
      EXPECT_EQ(f.inertia.negative, t.inertia.negative);
      EXPECT_EQ(f.rank, t.rank);
      EXPECT_EQ(f.two_by_two, t.two_by_two);
      EXPECT_EQ(f.delayed, t.delayed);
      EXPECT_EQ(f.perturbed, t.perturbed);
      EXPECT_EQ(f.dependent_rows, t.dependent_rows);
      EXPECT_EQ(f.determinant_log, t.determinant_log);
      EXPECT_TRUE(!f.status.ok() || f.whole_reason.empty()) << f.whole_reason;
      if (shares.size() <= k) shares.push_back(f.work_share);
      EXPECT_EQ(f.work_share, shares[k]) << "ranks do not agree";
      if (ranks.rank() > 0) continue;  // solutions are the first one's
      EXPECT_TRUE(same_bits(found.solutions[k], truth.solutions[k])) << "round " << k << ", share " << f.work_share;
      tally.some += f.work_share > 0 && f.work_share < 1 ? 1 : 0;
    }
  });
}

TEST(PartialRanks, HaveTheBitsOfAWholeOneOfOneProcess) {
  RanksTally tally;
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu})
    for (const int count : {2, 3, 4})
      for (unsigned seed = 1; seed <= 2; ++seed) {
        Options o = bare(true);
        o.kind = kind;
        o.max_block_size = count == 3 ? 16 : 0;
        o.precision = seed == 2 ? Precision::mixed : Precision::fp64;
        std::vector<SparseMatrix> list{elasticity(6), reference::random_system(160, 4, Values::positive, seed)};
        if (kind != Kind::llt) list.push_back(reference::saddle_point(150, 30, seed));
        for (const SparseMatrix& a : list) expect_bits_of_one<Solver, Solver>(o, a, seed, count, {}, tally);
        if (testing::Test::HasFailure()) return;
      }
  EXPECT_GT(tally.some, 20);
}

TEST(PartialRanks, OfComplexSystemsToo) {
  RanksTally tally;
  for (const auto sort : {test::Sort::symmetric, test::Sort::hermitian, test::Sort::general}) {
    const Storage storage = sort == test::Sort::general     ? Storage::general
                            : sort == test::Sort::hermitian ? Storage::hermitian_lower
                                                            : Storage::symmetric_lower;
    const ComplexSparseMatrix a = test::sparse(test::random_dense(120, sort, 4), storage);
    expect_bits_of_one<ComplexSolver, ComplexSolver>(bare(true), a, 2, 3, {}, tally);
  }
}

TEST(PartialRanks, LateMessagesDoNotMatter) {
  RanksTally tally;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    Faults faults;
    faults.most_delay = 2e-3;
    faults.reorder = true;
    faults.credits = 3;
    faults.seed = seed;
    expect_bits_of_one<Solver, Solver>(bare(true), elasticity(5), seed, 3, faults, tally);
  }
  EXPECT_GT(tally.some, 0);
}

// One rank dies in one of the factorizations: what came before is right, and the others hear of it.
TEST(PartialRanks, ADeathIsAnErrorOnTheOthers) {
  const SparseMatrix a = elasticity(5);
  Options o = bare(true), full = bare(false);
  o.threads = full.threads = 1;
  Solver one(full);
  const auto truth = follow(one, a, 5, 8);
  int late = 0;
  for (const std::int64_t dies_at : {200, 400, 600, 800}) {
    Faults faults;
    faults.dead_rank = 1;
    faults.dies_at = dies_at;
    faults.deaths_are_told = true;
    std::mutex mutex;
    on_threads(3, faults, [&](const Ranks& ranks) {
      Solver solver(ranks, o);
      if (!solver.analyze(a).status.ok()) return;
      std::mt19937 random(5);
      std::vector<double> now = a.values;
      const std::vector<double> b(static_cast<std::size_t>(a.rows), 1.0);
      for (const auto& t : truth.factors) {
        const FactorResult f = solver.refactorize(now);
        std::vector<double> x(b.size());
        const Status solved = f.status.ok() ? solver.solve(b, x).status : f.status;
        const std::lock_guard lock(mutex);
        const auto k = static_cast<std::size_t>(&t - truth.factors.data());
        if (!solved.ok() && t.status.ok()) {
          late += k > 0 && ranks.rank() == 0 ? 1 : 0;
          EXPECT_NE(solved.message.find("rank"), std::string::npos) << solved.message;
          return;
        }
        if (ranks.rank() == 0) {
          EXPECT_TRUE(same_bits(x, truth.solutions[k]));
        }
        change_values(now, a.values, random);
      }
    });
  }
  EXPECT_GT(late, 0) << "nobody died in a factorization of a part";
}

}  // namespace partial_ranks_test
}  // namespace espalier::ranks
