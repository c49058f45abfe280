// Ranks that die, stop, lack memory or are interrupted: a clear status on all others, never a hang.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <string>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "on_threads.hpp"
#include "reference/reference.hpp"

namespace espalier::ranks {
namespace failures_test {

SparseMatrix system_of(const std::string& kind) {
  if (kind == "llt")
    return matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "5", "4", "4"}));
  if (kind == "ldlt") return reference::saddle_point(300, 60, 3);
  return matrix::generate(matrix::parse_generator(std::vector<std::string>{"gyroscopic", "4", "4", "4"}));
}

// Everything with one solver; the first failure.
Status life_of(const Ranks& ranks, const SparseMatrix& a, const Options& options = {}) {
  Options o = options;
  o.threads = 1;
  Solver solver(ranks, o);
  if (Status s = solver.analyze(a).status; !s.ok()) return s;
  for (int k = 0; k < 2; ++k) {
    if (Status s = solver.factorize(a).status; !s.ok()) return s;
    std::vector<double> x(static_cast<std::size_t>(a.rows), 1.0);
    if (Status s = solver.solve(x, x).status; !s.ok()) return s;
  }
  return {};
}

// The k-th message of a rank is its last, for k all over its life: with deaths that are told (ULFM) and in silence.
TEST(RankFailures, DeathAtAnyMessage) {
  for (const char* kind : {"llt", "ldlt", "lu"}) {
    const SparseMatrix a = system_of(kind);
    for (const bool told : {true, false})
      for (const std::int64_t at : {1, 5, 13, 20, 31, 60}) {
        SCOPED_TRACE(std::string(kind) + ", message " + std::to_string(at) + (told ? ", told" : ", in silence"));
        Faults faults;
        faults.dead_rank = 1;
        faults.dies_at = at;
        faults.deaths_are_told = told;
        std::mutex mutex;
        std::vector<Status> ends(3);
        const auto begin = std::chrono::steady_clock::now();
        const ThreadRanks shared(3, faults);
        std::vector<std::thread> threads;
        for (int r = 0; r < 3; ++r)
          threads.emplace_back([&, r] {
            Status end;
            try {
              end = life_of(Ranks(shared.table(r), 0.25), a);
            } catch (const Error& e) {  // in the first exchange
              end = e.status();
            }
            const std::lock_guard lock(mutex);
            ends[static_cast<std::size_t>(r)] = end;
          });
        for (std::thread& t : threads) t.join();
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
        EXPECT_LT(took.count(), 20);
        if (ends[1].ok()) continue;  // it lived through all of it
        for (const int r : {0, 2}) {
          EXPECT_EQ(ends[static_cast<std::size_t>(r)].code, StatusCode::device_error);
          EXPECT_NE(ends[static_cast<std::size_t>(r)].message.find("rank 1"), std::string::npos)
              << ends[static_cast<std::size_t>(r)].message;
        }
      }
  }
}

// The same where each rank has a part of the entries and of the values, and with an analysis that is saved and loaded.
Status life_in_parts(const Ranks& ranks, const SparseMatrix& a, const std::string& path) {
  std::vector<Index> row, col;
  std::vector<double> values;
  for (Index c = 0; c < a.cols; ++c)
    for (auto k = static_cast<std::size_t>(a.col_ptr[c]); k < static_cast<std::size_t>(a.col_ptr[c + 1]); ++k) {
      if (static_cast<int>(k % static_cast<std::size_t>(ranks.size())) != ranks.rank()) continue;
      row.push_back(a.row_ind[k]);
      col.push_back(c);
      values.push_back(a.values[k]);
    }
  Options o;
  o.threads = 1;
  Solver solver(ranks, o);
  if (Status s = solver.analyze(LocalEntries{a.rows, row, col, values, a.storage}).status; !s.ok()) return s;
  if (Status s = solver.save_analysis(path); !s.ok()) return s;
  for (int k = 0; k < 2; ++k) {
    if (Status s = solver.refactorize(values).status; !s.ok()) return s;
    std::vector<double> x(ranks.rank() == 0 ? static_cast<std::size_t>(a.rows) : 0, 1.0);
    if (Status s = solver.solve(x, x).status; !s.ok()) return s;
  }
  if (Status s = solver.load_analysis(path, a).status; !s.ok()) return s;
  return solver.factorize(a).status;
}

TEST(RankFailures, DeathInPartsAndWithASavedAnalysis) {
  const SparseMatrix a = system_of("lu");
  const std::string path = testing::TempDir() + "espalier_ranks_that_die";
  int dead = 0;
  for (const int victim : {0, 2})
    for (const std::int64_t at : {7, 19, 33, 50, 80, 110, 140}) {
      SCOPED_TRACE("rank " + std::to_string(victim) + " dies at message " + std::to_string(at));
      Faults faults;
      faults.dead_rank = victim;
      faults.dies_at = at;
      faults.deaths_are_told = at % 2 == 0;
      std::vector<Status> ends(3);
      const ThreadRanks shared(3, faults);
      std::vector<std::thread> threads;
      for (int r = 0; r < 3; ++r)
        threads.emplace_back([&, r] {
          Status& end = ends[static_cast<std::size_t>(r)];
          try {
            end = life_in_parts(Ranks(shared.table(r), 0.25), a, path);
          } catch (const Error& e) {  // in the first exchange
            end = e.status();
          }
        });
      for (std::thread& t : threads) t.join();
      if (ends[static_cast<std::size_t>(victim)].ok()) continue;  // it lived through all of it
      ++dead;
      for (int r = 0; r < 3; ++r) {
        if (r == victim) continue;
        const Status& end = ends[static_cast<std::size_t>(r)];
        EXPECT_EQ(end.code, StatusCode::device_error);
        EXPECT_NE(end.message.find("rank " + std::to_string(victim)), std::string::npos) << end.message;
      }
    }
  EXPECT_GE(dead, 8);
}

// After a loss every call says the same, at once.
TEST(RankFailures, NothingWorksAfterALoss) {
  const SparseMatrix a = system_of("llt");
  Faults faults;
  faults.dead_rank = 0;
  faults.dies_at = 30;
  on_threads(
      2, faults,
      [&](const Ranks& ranks) {
        Options o;
        o.threads = 1;
        Solver solver(ranks, o);
        Status first;
        for (int k = 0; k < 100 && first.ok(); ++k) {
          first = solver.analyze(a).status;
          if (first.ok()) first = solver.factorize(a).status;
        }
        EXPECT_EQ(first.code, StatusCode::device_error);
        if (ranks.rank() == 0) return;
        const auto begin = std::chrono::steady_clock::now();
        EXPECT_EQ(solver.analyze(a).status.message, first.message);
        EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(), 0.2);
        EXPECT_NE(first.message.find("rank 0 on host "), std::string::npos) << first.message;
      },
      0.3);
}

// A rank whose budget is too small: the same error on all, and a larger budget works.
TEST(RankFailures, MemoryOfOneRank) {
  const SparseMatrix a = system_of("llt");
  on_threads(3, {}, [&](const Ranks& ranks) {
    Options o;
    if (ranks.rank() == 1) o.host_memory_bytes = 1000;
    const Status poor = life_of(ranks, a, o);
    EXPECT_EQ(poor.code, StatusCode::out_of_memory);
    EXPECT_NE(poor.message.find("rank 1"), std::string::npos) << poor.message;
    EXPECT_TRUE(life_of(ranks, a).ok());
  });
}

// One rank has room for few right-hand sides alone, or none: all take them one by one, or all say so. Never do they
// part.
TEST(RankFailures, RightHandSidesOfOneRank) {
  const SparseMatrix a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "5"}));
  const Index columns = 40;
  const std::vector<double> b = reference::random_vector(Offset{a.rows} * columns, 5);
  const Offset vector = Offset{a.rows} * 4;  // bytes of one in FP32
  std::vector<double> truth;
  Offset predicted = 0;
  int solved = 0, refused = 0;
  for (const Offset vectors : {1000, -200, 0, 4, 20, 60}) {  // beside what is predicted; the first run predicts it
    std::vector<StatusCode> codes(3);
    std::vector<double> of_first;
    Offset of_one = 0;
    on_threads(3, {}, [&](const Ranks& ranks) {
      Options o;
      o.threads = 1;
      o.precision = Precision::mixed;
      if (ranks.rank() == 1 && predicted > 0) o.host_memory_bytes = predicted + vectors * vector;
      Solver solver(ranks, o);
      const AnalysisResult analysis = solver.analyze(a);
      ASSERT_TRUE(analysis.status.ok());
      const FactorResult factor = solver.factorize(a);
      std::vector<double> x(b.size());
      const Status status = factor.status.ok() ? solver.solve(b, x, columns).status : factor.status;
      codes[static_cast<std::size_t>(ranks.rank())] = status.code;
      if (ranks.rank() == 1) of_one = analysis.predicted_bytes;
      if (ranks.rank() == 0) of_first = x;
    });
    if (predicted == 0) truth = of_first;
    predicted = of_one;
    if (codes[0] == StatusCode::ok) {
      ASSERT_EQ(of_first.size(), truth.size());
      for (std::size_t k = 0; k < truth.size(); ++k) ASSERT_NEAR(of_first[k], truth[k], 1e-9) << vectors;
    }
    EXPECT_EQ(codes[0], codes[1]);
    EXPECT_EQ(codes[0], codes[2]);
    (codes[0] == StatusCode::ok ? solved : refused) += 1;
  }
  EXPECT_GE(solved, 4);
  EXPECT_GE(refused, 1);
}

// A rank that cannot read what all others can: the saved analysis of another matrix, or none.
TEST(RankFailures, ASavedAnalysisThatOneRankLacks) {
  const SparseMatrix a = system_of("llt");
  const std::string path = testing::TempDir() + "espalier_ranks_analysis_of_two";
  on_threads(3, {}, [&](const Ranks& ranks) {
    ASSERT_TRUE(life_in_parts(ranks, a, path).ok());
    Options o;
    o.threads = 1;
    Solver solver(ranks, o);
    const Status lacks = solver.load_analysis(ranks.rank() == 2 ? path + "_not_there" : path, a).status;
    EXPECT_EQ(lacks.code, StatusCode::invalid_input);
    EXPECT_NE(lacks.message.find("rank 2"), std::string::npos) << lacks.message;
    o.host_memory_bytes = ranks.rank() == 1 ? 1000 : 0;
    Solver poor(ranks, o);
    ASSERT_TRUE(poor.load_analysis(path, a).status.ok());
    const Status refused = poor.factorize(a).status;
    EXPECT_EQ(refused.code, StatusCode::out_of_memory);
    EXPECT_NE(refused.message.find("rank 1"), std::string::npos) << refused.message;
    ASSERT_TRUE(solver.load_analysis(path, a).status.ok());
    EXPECT_TRUE(solver.factorize(a).status.ok());
  });
}

TEST(RankFailures, InterruptedOnOneRank) {
  const SparseMatrix a = system_of("lu");
  on_threads(3, {}, [&](const Ranks& ranks) {
    Options o;
    o.interrupted_every = 0;
    int asked = 0;
    if (ranks.rank() == 2) o.interrupted = [&asked] { return ++asked > 40; };
    EXPECT_EQ(life_of(ranks, a, o).code, StatusCode::cancelled);
    EXPECT_TRUE(life_of(ranks, a).ok());
  });
}

// Matrices that differ, or options: an error on all.
TEST(RankFailures, DifferentOptions) {
  const SparseMatrix a = system_of("llt");
  on_threads(2, {}, [&](const Ranks& ranks) {
    Options o;
    if (ranks.rank() == 1) o.max_block_size = 32;
    const Status s = life_of(ranks, a, o);
    EXPECT_EQ(s.code, StatusCode::invalid_input);
    EXPECT_NE(s.message.find("different plans"), std::string::npos) << s.message;
    o.device = "host:2";
    o.max_block_size = 0;
    EXPECT_EQ(life_of(ranks, a, o).code, StatusCode::device_error);
    EXPECT_TRUE(life_of(ranks, a).ok());
  });
}

TEST(RankFailures, TablesThatAreNotWhole) {
  espalier_rank_functions t{};
  t.size = sizeof t;
  EXPECT_THROW(Ranks{t}, Error);
  const ThreadRanks shared(1);
  EXPECT_THROW(Ranks(shared.table(0), -1), Error);
  const Ranks alone(shared.table(0));
  EXPECT_TRUE(life_of(alone, system_of("llt")).ok());
}

}  // namespace failures_test
}  // namespace espalier::ranks
