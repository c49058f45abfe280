// Every allocation of a small system is made to fail once: each time a Status says so, nothing crashes or hangs, and
// the solver works afterwards. And: a refactorization of the same pattern takes no memory that grows with the system.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "espalier/espalier.hpp"
#include "espalier/inverse.hpp"
#include "espalier/solve_rows.hpp"
#include "matrix/generators/generate.hpp"
#include "reference/reference.hpp"
#include "refused_allocations.hpp"
#include "rounds.hpp"

namespace espalier {
namespace {

using test::allocations;
using test::allocations_left;
using test::bytes_allocated;
using test::held;
using test::kNever;

struct Case {
  const char* name;
  SparseMatrix a;
  Options options;
};

Options two_threads(Kind kind = Kind::automatic) {
  Options o;
  o.threads = 2;
  o.kind = kind;
  o.max_block_size = 16;
  return o;
}

// Runs the three phases; the first failure ends it.
StatusCode run(Solver& s, const Case& c, const std::vector<double>& b, std::vector<double>& x) {
  const AnalysisResult analysis = s.analyze(c.a);
  if (!analysis.status.ok()) return analysis.status.code;
  const FactorResult factor = s.factorize(c.a);
  if (!factor.status.ok()) return factor.status.code;
  return s.solve(b, x, 2).status.code;
}

std::vector<Case> cases() {
  std::vector<Case> list;
  list.push_back({"llt", reference::random_system(150, 6, reference::Values::positive, 1), two_threads()});
  list.push_back({"ldlt", reference::saddle_point(120, 30, 2), two_threads()});
  list.push_back({"lu", reference::random_system(150, 6, reference::Values::general, 3), two_threads()});
  // A positive diagonal, indefinite: the analysis is made again in the middle of factorize().
  SparseMatrix turn = reference::random_system(80, 6, reference::Values::positive, 4);
  for (std::size_t q = 0; q < turn.values.size(); ++q)
    if (turn.row_ind[q] >= 60 && turn.values[q] < 0) turn.values[q] *= 40;
  list.push_back({"llt to ldlt", turn, two_threads()});
  // Multipliers first and no matching: pivots are moved and the plan is laid out again.
  Case moved{"moved pivots", reference::saddle_point(60, 15, 5), two_threads(Kind::ldlt)};
  moved.options.matching = false;
  for (Index k = 0; k < 75; ++k) moved.options.permutation.push_back(74 - k);
  list.push_back(std::move(moved));
  Case mixed{"mixed", reference::random_system(100, 6, reference::Values::indefinite, 6), two_threads()};
  mixed.options.precision = Precision::mixed;
  list.push_back(std::move(mixed));
  return list;
}

constexpr long kEvery = espalier::test::rounds(1L, 3L);  // a hundred times slower

TEST(Allocation, EveryOneFailsOnce) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const std::vector<double> b = reference::random_vector(2 * static_cast<std::int64_t>(c.a.rows), 7);
    std::vector<double> x(b.size());
    long total = 0;
    {
      Solver s(c.options);
      allocations = 0;
      ASSERT_EQ(run(s, c, b, x), StatusCode::ok);
      total = allocations;
    }
    ASSERT_GT(total, 50);
    const std::vector<double> good = x;
    long failures = 0;
    Solver s(c.options);
    constexpr long kStep = espalier::test::rounds(1L, 13L);
    for (long k = 0; k < total; k += kStep) {
      allocations_left = k;
      const StatusCode code = run(s, c, b, x);
      allocations_left = kNever;
      EXPECT_TRUE(code == StatusCode::out_of_memory || code == StatusCode::ok)
          << "allocation " << k << " gave status " << static_cast<int>(code);
      failures += code == StatusCode::out_of_memory ? 1 : 0;
      // Whatever the state, one of the phases can be called without an exception of misuse ...
      if (s.state() == Solver::State::analyzed) {
        EXPECT_NO_THROW((void)s.refactorize(c.a.values));
      }
      if (s.state() == Solver::State::factorized) {
        EXPECT_TRUE(s.solve(b, x, 2).status.ok());
      }
      if (k % 7 != 0) continue;
      // ... and the whole gives the same bits as ever.
      ASSERT_EQ(run(s, c, b, x), StatusCode::ok) << "after allocation " << k;
      EXPECT_EQ(x, good);
    }
    EXPECT_GT(failures, 20 / kStep);
  }
}

// Calls on a factor: a few new values, a few unknowns, the diagonal of the inverse. Where memory fails, the answer is
// that of the values before or of the new ones, or the solver says that it has no factor. Truth: bits of whole calls.
TEST(Allocation, EveryOneOfCallsOnAFactorFailsOnce) {
  for (Case c : cases()) {
    SCOPED_TRACE(c.name);
    c.options.partial_refactorization = true;
    const auto n = static_cast<std::size_t>(c.a.rows);
    std::vector<Offset> places;
    std::vector<double> changed = c.a.values, some;
    for (std::size_t j = 0; j < n; j += 40)
      for (Offset q = c.a.col_ptr[j]; q < c.a.col_ptr[j + 1]; ++q) {
        const auto at = static_cast<std::size_t>(q);
        if (static_cast<std::size_t>(c.a.row_ind[at]) != j) continue;
        changed[at] *= 1.5;
        places.push_back(q);
        some.push_back(changed[at]);
      }
    const std::vector<double> b = reference::random_vector(2 * static_cast<std::int64_t>(n), 7);
    const std::vector<Offset> begin = {0, 2, 3};
    const std::vector<Index> rows = {0, 5, 7}, wanted = {3, 0, 11};
    const std::vector<double> loads = {1, -2, 3};
    struct Answers {
      std::vector<double> whole, few, diagonal;
    };
    const auto answers = [&](Solver& s) {
      Answers out{std::vector<double>(b.size()), std::vector<double>(6), std::vector<double>(n)};
      EXPECT_TRUE(s.solve(b, out.whole, 2).status.ok());
      EXPECT_TRUE(solve_rows(s, {begin, rows, loads}, wanted, out.few).status.ok());
      EXPECT_TRUE(inverse_diagonal(s, out.diagonal).status.ok());
      return out;
    };
    Solver s(c.options);
    ASSERT_TRUE(s.analyze(c.a).status.ok());
    ASSERT_TRUE(s.factorize(c.a).status.ok());
    ASSERT_TRUE(s.refactorize(changed).status.ok());
    const Answers after = answers(s);
    ASSERT_TRUE(s.refactorize(c.a.values).status.ok());
    const Answers before = answers(s);
    std::vector<double> few(6), diagonal(n), x(b.size());
    const std::vector<std::function<StatusCode()>> calls = {
        [&] { return s.refactorize_entries(places, some).status.code; },
        [&] {
          return solve_rows(s, {begin, rows, loads}, wanted, few).status.code;
        },
        [&] { return inverse_diagonal(s, diagonal).status.code; }};
    for (std::size_t which = 0; which < calls.size(); ++which) {
      ASSERT_TRUE(s.refactorize(c.a.values).status.ok());
      allocations = 0;
      ASSERT_EQ(calls[which](), StatusCode::ok);
      const long total = allocations;
      long failures = 0;
      for (long k = 0; k < total; k += kEvery) {
        ASSERT_TRUE(s.refactorize(c.a.values).status.ok()) << "call " << which << ", allocation " << k;
        allocations_left = k;
        StatusCode code = StatusCode::cancelled;
        try {
          code = calls[which]();
        } catch (const std::bad_alloc&) {  // that is no status
        }
        allocations_left = kNever;
        ASSERT_TRUE(code == StatusCode::out_of_memory || code == StatusCode::ok)
            << "call " << which << ", allocation " << k << " gave status " << static_cast<int>(code);
        failures += code == StatusCode::out_of_memory ? 1 : 0;
        if (s.state() != Solver::State::factorized) {
          EXPECT_EQ(which, 0U) << "a call that only reads took the factor away";
          continue;
        }
        ASSERT_TRUE(s.solve(b, x, 2).status.ok());
        // Where there is no memory for the result alone, the new factor is there.
        const bool made = which == 0 && (code == StatusCode::ok || s.values() == changed);
        EXPECT_EQ(x, made ? after.whole : before.whole) << "call " << which << ", allocation " << k;
        if (code == StatusCode::ok && which == 1) {
          EXPECT_EQ(few, before.few) << "allocation " << k;
        }
        if (code == StatusCode::ok && which == 2) {
          EXPECT_EQ(diagonal, before.diagonal) << "allocation " << k;
        }
      }
      EXPECT_GT(failures, which == 0 ? 0 : 2) << "call " << which << ", of " << total;
    }
  }
}

// Whatever fails, the solver's end gives everything back.
TEST(Allocation, NothingStaysBehindAFailure) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const std::vector<double> b = reference::random_vector(2 * static_cast<std::int64_t>(c.a.rows), 7);
    std::vector<double> x(b.size());
    const auto once = [&](long failing) {
      const long before = held;
      {
        Solver s(c.options);
        allocations = 0;
        allocations_left = failing;
        (void)run(s, c, b, x);
        allocations_left = kNever;
      }
      return held - before;
    };
    (void)once(kNever);  // what threads and the library keep for good
    (void)once(kNever);
    const long total = allocations;
    ASSERT_GT(total, 50);
    // What is made once and kept may be made only now, when the other thread happens to come in time: that is no leak.
    for (long k = 0; k < total; k += espalier::test::rounds(2L, 11L)) {
      if (once(k) == 0) continue;
      ASSERT_EQ(once(k), 0) << "allocation " << k;
    }
  }
}

TEST(Allocation, RefactorizationTakesNoMemoryThatGrows) {
  for (const char* family : {"elasticity", "kkt", "gyroscopic"}) {
    long before = -1;
    for (const char* size : {"3", "5"}) {
      std::vector<std::string> words{family, size};
      if (std::string(family) == "kkt") words = {family, size, "4", "3", "3"};
      const SparseMatrix a = matrix::generate(matrix::parse_generator(words));
      Solver s(two_threads());
      ASSERT_TRUE(s.analyze(a).status.ok());
      ASSERT_TRUE(s.factorize(a).status.ok());
      ASSERT_TRUE(s.refactorize(a.values).status.ok());
      // The least of several: a worker that meets its largest tile for the first time grows its scratch once.
      long taken = kNever, bytes = kNever;
      for (int round = 0; round < 6; ++round) {
        allocations = 0;
        bytes_allocated = 0;
        const FactorResult f = s.refactorize(a.values);
        taken = std::min<long>(taken, allocations);
        bytes = std::min<long>(bytes, bytes_allocated);
        ASSERT_TRUE(f.status.ok());
      }
      // The result itself holds a list of devices with names; nothing else may allocate.
      EXPECT_LE(taken, 8) << family << ' ' << size;
      EXPECT_LE(bytes, 2048) << family << ' ' << size;
      EXPECT_TRUE(before < 0 || taken == before) << family << ": " << before << ", then " << taken;
      before = taken;
    }
  }
}

}  // namespace
}  // namespace espalier
