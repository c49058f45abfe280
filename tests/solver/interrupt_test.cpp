// A caller stops calls at every border of work that there is. Truth: the documented state afterwards, and the bits of a
// solver that was never stopped.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <thread>

#include "rounds.hpp"
#include "solver/c/c_handle.hpp"
#include "solver/solver_common.hpp"

namespace espalier {
namespace interrupt_test {

using reference::Values;

struct Case {
  const char* name;
  SparseMatrix a;
  Options options;
};

// Positive and indefinite, with pivots that move, one that llt gives up, unsymmetric, several devices, out of core.
std::vector<Case> cases() {
  const SparseMatrix grid = test::generated({"elasticity", "4"});
  SparseMatrix indefinite = reference::random_system(200, 4, Values::indefinite, 7);
  return {{"llt", grid, test::options_on("cpu", 2)},
          {"llt, one thread", grid, test::options_on("cpu", 1)},
          {"ldlt", reference::saddle_point(300, 80, 5), test::options_on("cpu", 3)},
          {"indefinite", std::move(indefinite), test::options_on("cpu", 2)},
          {"lu", reference::random_system(300, 4, Values::general, 3), test::options_on("cpu", 2)},
          {"two host devices", grid, test::options_on("host:2", 2)},
          {"out of core", test::generated({"elasticity", "6"}), test::options_on("host:1", 2, 800'000)}};
}

// Asked `stop_at` times (from 1) the caller says stop; 0: never.
struct Caller {
  long asked = 0, stop_at = 0;
  bool stops() { return ++asked == stop_at; }
};

struct Outcome {
  StatusCode analyze = StatusCode::ok, factorize = StatusCode::ok, solve = StatusCode::ok;
  std::vector<double> x;
};

Outcome calls(Solver& s, const SparseMatrix& a, const std::vector<double>& b) {
  Outcome r;
  r.x.resize(b.size());
  r.analyze = s.analyze(a).status.code;
  EXPECT_EQ(s.state(), r.analyze == StatusCode::ok ? Solver::State::analyzed : Solver::State::empty);
  if (r.analyze != StatusCode::ok) return r;
  r.factorize = s.factorize(a).status.code;
  EXPECT_EQ(s.state(), r.factorize == StatusCode::ok ? Solver::State::factorized : Solver::State::analyzed);
  if (r.factorize != StatusCode::ok) return r;
  r.solve = s.solve(b, r.x).status.code;
  EXPECT_EQ(s.state(), Solver::State::factorized);
  return r;
}

// What the call that was stopped had not done, on the same object.
std::vector<double> go_on(Solver& s, const SparseMatrix& a, const std::vector<double>& b, const Outcome& stopped) {
  std::vector<double> x(b.size());
  if (stopped.analyze != StatusCode::ok) {
    EXPECT_EQ(stopped.analyze, StatusCode::cancelled);
    EXPECT_TRUE(s.analyze(a).status.ok());
  }
  if (stopped.factorize != StatusCode::ok || stopped.analyze != StatusCode::ok) {
    EXPECT_TRUE(stopped.analyze != StatusCode::ok || stopped.factorize == StatusCode::cancelled);
    const FactorResult f = s.refactorize(a.values);
    EXPECT_TRUE(f.status.ok()) << f.status.message;
  }
  const SolveResult r = s.solve(b, x);
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  return x;
}

TEST(Interrupt, AtEveryBorderOfWorkTheSolverStaysUsable) {
  for (Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const std::vector<double> b = reference::random_vector(c.a.rows, 11);
    Caller caller;
    c.options.interrupted = [&caller] { return caller.stops(); };
    Solver never(c.options);
    const Outcome whole = calls(never, c.a, b);
    ASSERT_EQ(whole.solve, StatusCode::ok);
    const long borders = caller.asked;
    ASSERT_GT(borders, 20);
    long in_analysis = 0, in_factor = 0, in_solve = 0;
    const long step = std::max(1L, borders / espalier::test::rounds(50L, 20L));
    for (long k = 1; k <= borders; k += step) {
      SCOPED_TRACE(k);
      caller = {0, k};
      Solver s(c.options);
      const Outcome stopped = calls(s, c.a, b);
      in_analysis += static_cast<long>(stopped.analyze == StatusCode::cancelled);
      in_factor += static_cast<long>(stopped.factorize == StatusCode::cancelled);
      in_solve += static_cast<long>(stopped.solve == StatusCode::cancelled);
      caller = {};
      const std::vector<double> x = go_on(s, c.a, b, stopped);
      EXPECT_EQ(x, whole.x);
      if (::testing::Test::HasFailure()) return;
    }
    if (c.options.threads > 1) continue;  // others may have done all the work of a call
    EXPECT_GT(in_analysis, 0);
    EXPECT_GT(in_factor, 0);
    EXPECT_GT(in_solve, 0);
  }
}

// Who interrupts one solver does not interrupt its clone, which works at the same time.
TEST(Interrupt, AClonesCallsAreItsOwn) {
  const SparseMatrix a = test::generated({"elasticity", "6"});
  const auto caller = std::this_thread::get_id();
  Options o = test::options_on("cpu", 2);
  bool stop = false;
  o.interrupted = [&stop, caller] { return std::this_thread::get_id() == caller && stop; };
  Solver original(o);
  ASSERT_TRUE(original.analyze(a).status.ok());
  Solver clone = original.clone(2);
  stop = true;
  std::thread other([&] {
    for (int k = 0; k < 20; ++k) EXPECT_TRUE(clone.refactorize(a.values).status.ok());
  });
  for (int k = 0; k < 20; ++k) EXPECT_EQ(original.refactorize(a.values).status.code, StatusCode::cancelled);
  other.join();
  stop = false;
  test::expect_small_error(clone, a);
}

// Values as factorize() got them, from every form in which they are kept.
TEST(Interrupt, ValuesComeBackInTheCallersOrder) {
  const SparseMatrix lower = reference::random_system(60, 4, Values::positive, 2);
  for (const Storage storage :
       {Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both, Storage::general})
    for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu})
      for (const bool split : {false, true}) {
        if (storage == Storage::general && split) continue;
        const SparseMatrix a = storage == Storage::general ? reference::random_system(60, 4, Values::general, 2)
                                                           : reference::stored_as(lower, storage, split);
        if (storage == Storage::general && kind != Kind::lu) continue;
        SCOPED_TRACE(static_cast<int>(storage) * 100 + static_cast<int>(kind) * 10 + static_cast<int>(split));
        Options o = test::two_threads();
        o.kind = kind;
        Solver s(o);
        ASSERT_TRUE(s.analyze(a).status.ok());
        EXPECT_TRUE(s.has_pattern(a));
        EXPECT_THROW((void)s.values(), std::logic_error);
        std::vector<double> twice = a.values;
        for (double& v : twice) v *= 2;
        ASSERT_TRUE(s.refactorize(twice).status.ok());
        const std::vector<double> back = s.values();
        ASSERT_EQ(back.size(), twice.size());
        if (!split) {
          EXPECT_EQ(back, twice);
          continue;
        }
        SparseMatrix given = a, found = a;  // entries that are split come back as one
        given.values = twice;
        found.values = back;
        EXPECT_EQ(reference::dense(given), reference::dense(found));
      }
  SparseMatrix other = lower;
  other.row_ind.back() = other.row_ind.back() == 0 ? 1 : other.row_ind.back();
  Solver s(test::two_threads());
  EXPECT_THROW((void)s.has_pattern(lower), std::logic_error);
  ASSERT_TRUE(s.analyze(lower).status.ok());
  EXPECT_FALSE(s.has_pattern(reference::random_system(60, 5, Values::positive, 9)));
}

// The smallest block that takes one thread longer than that to factorize; sanitizers and machines differ by a factor of
// a hundred.
SparseMatrix block_that_takes(std::chrono::milliseconds time) {
  for (int size = 6;; size += 2) {
    SparseMatrix a = test::generated({"elasticity", std::to_string(size)});
    Solver s(test::options_on("cpu", 1));
    EXPECT_TRUE(s.analyze(a).status.ok());
    auto shortest = std::chrono::steady_clock::duration::max();  // others may have had the processor meanwhile
    for (int k = 0; k < 3; ++k) {
      const auto begin = std::chrono::steady_clock::now();
      EXPECT_TRUE(s.factorize(a).status.ok());
      shortest = std::min(shortest, std::chrono::steady_clock::now() - begin);
      if (shortest < time) break;
    }
    if (shortest > time || size == 30) return a;
  }
}

// The C interface asks every 20 ms.
TEST(Interrupt, FromC) {
  const SparseMatrix a = block_that_takes(std::chrono::milliseconds(80));
  const std::vector<Offset> rows(a.row_ind.begin(), a.row_ind.end());
  espalier_matrix_i64 m{};
  m.size = sizeof m;
  m.rows = m.cols = a.cols;
  m.nonzeros = a.nonzeros();
  m.pointers = a.col_ptr.data();
  m.indices = rows.data();
  m.values = a.values.data();
  m.layout = ESPALIER_CSC;
  m.storage = a.storage == Storage::symmetric_lower ? ESPALIER_SYMMETRIC_LOWER : ESPALIER_SYMMETRIC_BOTH;
  struct Answer {
    int asked = 0, stop = 0;
  } answer;
  const auto ask = [](void* user) {
    auto* told = static_cast<Answer*>(user);
    ++told->asked;
    return told->stop;
  };
  const test::Handle handle = test::make();
  ASSERT_EQ(espalier_set_option(handle.get(), "threads", "1"), ESPALIER_OK);
  ASSERT_EQ(espalier_set_interrupt(handle.get(), ask, &answer), ESPALIER_OK);
  ASSERT_EQ(test::analyze(handle.get(), m), ESPALIER_OK);
  espalier_solver* copy = nullptr;
  ASSERT_EQ(espalier_clone(handle.get(), 1, &copy), ESPALIER_OK);
  const test::Handle clone(copy);
  for (espalier_solver* s : {handle.get(), clone.get()}) {
    answer = {0, 1};
    EXPECT_EQ(test::factorize(s, m), ESPALIER_CANCELLED);
    EXPECT_EQ(answer.asked, 1);
    EXPECT_STRNE(espalier_last_error(s), "");
    answer.stop = 0;
    EXPECT_EQ(test::factorize(s, m), ESPALIER_OK) << espalier_last_error(s);
    EXPECT_GT(answer.asked, 1);
  }
}

}  // namespace interrupt_test
}  // namespace espalier
