// Truth: a plug-in that misbehaves on request, and diagonal systems whose solution is b / a.
#include "rivals/session.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "rivals/real_equivalent.hpp"
#include "rivals/systems.hpp"

namespace espalier::bench {
namespace {

SparseMatrix diagonal_matrix(Index n) {
  SparseMatrix a;
  a.rows = a.cols = n;
  a.storage = Storage::symmetric_lower;
  a.col_ptr.push_back(0);
  for (Index k = 0; k < n; ++k) {
    a.row_ind.push_back(k);
    a.values.push_back(2.0 + k);
    a.col_ptr.push_back(k + 1);
  }
  return a;
}

Plan plan_for(const std::vector<std::string>& rivals) {
  Plan plan;
  plan.rivals = rivals;
  plan.kind = Kind::llt;
  plan.repetitions = 3;
  plan.analyses = 2;
  plan.columns = 4;
  plan.pause_seconds = 0;
  plan.child.folder = ESPALIER_RIVALS_FOLDER;
  plan.child.timeout_seconds = 20;
  return plan;
}

std::vector<Row> run(const Plan& plan) {
  return compare(diagonal_matrix(50), plan, [](const std::string&) {});
}

TEST(Session, TakesEverySampleOfARivalThatBehaves) {
  const Row row = run(plan_for({"faulty"})).front();
  EXPECT_EQ(row.verdict.outcome, Outcome::ok) << row.verdict.message;
  EXPECT_EQ(row.analysis.seconds.size(), 2U);
  EXPECT_EQ(row.first_factorization.seconds.size(), 1U);
  EXPECT_EQ(row.refactorization.seconds.size(), 3U);
  EXPECT_EQ(row.solve_one.seconds.size(), 3U);
  EXPECT_EQ(row.solve_many.seconds.size(), 3U);
  EXPECT_LE(row.error.componentwise, 1e-15);
  EXPECT_GE(row.peak_bytes, 0);
}

TEST(Session, GoesOnWhateverOneRivalDoes) {
  const struct {
    const char* spec;
    Outcome outcome;
  } cases[] = {{"nobody", Outcome::missing},
               {"faulty:missing", Outcome::missing},
               {"faulty:crash", Outcome::crashed},
               {"faulty:exit", Outcome::crashed},
               {"faulty:memory", Outcome::out_of_memory},
               {"faulty:wrong", Outcome::wrong_answer},
               {"faulty:refuse", Outcome::failed},
               {"faulty:unheard", Outcome::failed},
               {"faulty", Outcome::ok}};
  for (const bool one_at_a_time : {false, true}) {
    Plan plan = plan_for({});
    plan.one_at_a_time = one_at_a_time;
    for (const auto& one : cases) plan.rivals.emplace_back(one.spec);
    const std::vector<Row> rows = run(plan);
    ASSERT_EQ(rows.size(), std::size(cases));
    for (std::size_t k = 0; k < rows.size(); ++k) {
      EXPECT_EQ(rows[k].spec, cases[k].spec);
      EXPECT_EQ(rows[k].verdict.outcome, cases[k].outcome) << cases[k].spec << ": " << rows[k].verdict.message;
      EXPECT_EQ(rows[k].verdict.message.empty(), rows[k].verdict.ok());
    }
  }
}

TEST(Session, EndsARivalThatHangs) {
  Plan plan = plan_for({"faulty:hang", "faulty"});
  plan.child.timeout_seconds = 0.5;
  const std::vector<Row> rows = run(plan);
  EXPECT_EQ(rows[0].verdict.outcome, Outcome::timed_out) << rows[0].verdict.message;
  EXPECT_EQ(rows[1].verdict.outcome, Outcome::ok) << rows[1].verdict.message;
}

TEST(Session, SaysWhatARivalDoesNotOffer) {
  Plan plan = plan_for({"faulty"});
  plan.kind = Kind::lu;
  EXPECT_EQ(run(plan).front().verdict.outcome, Outcome::not_offered);
}

TEST(Session, RefusesASymmetricKindForAGeneralMatrix) {
  SparseMatrix a = diagonal_matrix(5);
  a.storage = Storage::general;
  EXPECT_THROW(compare(a, plan_for({"faulty"}), [](const std::string&) {}), std::invalid_argument);
}

TEST(Samples, MedianAndLeast) {
  EXPECT_EQ((Samples{{3, 1, 2}}).median(), 2);
  EXPECT_EQ((Samples{{4, 1, 2, 3}}).median(), 2.5);
  EXPECT_EQ((Samples{{4, 1, 2, 3}}).least(), 1);
  EXPECT_TRUE(std::isnan(Samples{}.median()));
}

TEST(Session, ComplexSystemsAreSolvedAndJudged) {
  for (const char* words : {"damped elasticity 3", "hermitian elasticity 3", "hermitian kkt 2 2 2 2",
                            "damped kkt 2 2 2 2", "damped gyroscopic 3", "damped elasticity 3 as lu"}) {
    const std::string text = words;
    const std::size_t as = text.find(" as ");
    const System system = make_any_system(text.substr(0, as));
    Plan plan = plan_for({"espalier", "pardiso", "mumps", "cholmod", "faulty"});
    plan.repetitions = 1;
    plan.warm = false;
    plan.kind = as == std::string::npos ? automatic_kind(system.view()) : Kind::lu;
    const std::vector<Row> rows = compare(system.view(), plan, [](const std::string&) {});
    ASSERT_EQ(rows[0].verdict.outcome, Outcome::ok) << words << ": " << rows[0].verdict.message;
    for (const Row& row : rows) {
      if (row.verdict.ok()) {
        EXPECT_LE(row.error.normwise, 1e-12) << words << ' ' << row.spec;
        EXPECT_TRUE(row.checked);
      } else {
        EXPECT_TRUE(row.verdict.outcome == Outcome::missing || row.verdict.outcome == Outcome::not_offered)
            << words << ' ' << row.spec << ": " << row.verdict.message;
      }
    }
    EXPECT_EQ(rows.back().verdict.outcome, Outcome::not_offered) << "faulty knows real numbers only";
    if (system.numbers != Numbers::hermitian || plan.kind != Kind::ldlt) continue;
    // P A P^* has the inertia of A.
    plan.rivals = {"espalier"};
    const System real = make_any_system(text.substr(text.find(' ') + 1));
    const Row row = compare(real.view(), plan, [](const std::string&) {}).front();
    EXPECT_EQ(rows[0].inertia.negative, row.inertia.negative) << words;
    EXPECT_GT(row.inertia.negative, 0) << words;
  }
}

TEST(Session, WrongComplexAnswersAreFound) {
  // A solution to the transposed system of a Hermitian matrix (its conjugate) is wrong by its imaginary parts only.
  const System system = make_any_system("hermitian elasticity 2");
  RealEquivalent equivalent(system.view());
  const MatrixView a = equivalent.with_values(system.a.values);
  std::vector<double> x(static_cast<std::size_t>(a.cols)), b(x.size(), 0);
  for (std::size_t k = 0; k < x.size(); ++k) x[k] = std::cos(3.0 * static_cast<double>(k));
  for (Index c = 0; c < a.cols; ++c)
    for (Offset k = a.col_ptr[c]; k < a.col_ptr[c + 1]; ++k) b[a.row_ind[k]] += a.values[k] * x[c];
  EXPECT_LE(matrix::backward_errors(a, x, b).normwise, 1e-15);
  for (std::size_t k = 1; k < x.size(); k += 2) x[k] = -x[k];
  EXPECT_GE(matrix::backward_errors(a, x, b).normwise, 1e-3);
}

TEST(Session, ComplexKindsAndWordsAreChecked) {
  const System damped = make_any_system("damped elasticity 2");
  EXPECT_EQ(automatic_kind(damped.view()), Kind::ldlt);
  Plan plan = plan_for({"espalier"});
  EXPECT_THROW(compare(damped.view(), plan, [](const std::string&) {}), std::invalid_argument) << "no llt";
  EXPECT_EQ(automatic_kind(make_any_system("hermitian elasticity 2").view()), Kind::llt);
  EXPECT_EQ(automatic_kind(make_any_system("hermitian kkt 2 2 2 2").view()), Kind::ldlt);
  EXPECT_EQ(automatic_kind(make_any_system("damped gyroscopic 2").view()), Kind::lu);
  for (const char* words :
       {"damped", "hermitian", "damped damped elasticity 2", "hermitian gyroscopic 2", "hermitian x"})
    EXPECT_THROW(make_any_system(words), Error) << words;
}

}  // namespace
}  // namespace espalier::bench
