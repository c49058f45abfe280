// Entries that make a matrix singular are refused by name, and the factor of the values before is there. Truth:
// residuals with these values, bits of whole factorizations.
#include "espalier/solve_rows.hpp"
#include "solver/solver_common.hpp"

namespace espalier {
namespace singular_changes_test {

using namespace test;

// All entries of a row and a column become zero; `row` alone has others than that.
std::vector<Offset> entries_of(const SparseMatrix& a, Index row) {
  std::vector<Offset> places;
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
      if (c == row || a.row_ind[static_cast<std::size_t>(q)] == row) places.push_back(q);
  return places;
}

void check(const std::vector<std::string>& words, Kind kind, bool partial, const char* device,
           Rescale rescale = Rescale::off) {
  SCOPED_TRACE(words[0] + ", partial " + std::to_string(static_cast<int>(partial)) + ", " + device + ", rescale " +
               std::to_string(static_cast<int>(rescale)));
  const SparseMatrix a = generated(words);
  Options o = two_threads();
  o.kind = kind;
  o.device = device;
  o.partial_refactorization = partial;
  o.rescale = rescale;
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  const std::vector<double> b(static_cast<std::size_t>(a.rows), 1.0);
  std::vector<double> before(b.size()), x(b.size());
  ASSERT_TRUE(s.solve(b, before).status.ok());
  for (const Index row : {Index{0}, a.rows / 2, a.rows - 1}) {
    const std::vector<Offset> places = entries_of(a, row);
    const std::vector<double> zeros(places.size(), 0.0);
    const FactorResult r = s.refactorize_entries(places, zeros);
    if (kind == Kind::llt)
      EXPECT_NE(r.status.code, StatusCode::ok);
    else
      EXPECT_EQ(r.status.code, StatusCode::singular) << r.status.message;
    EXPECT_NE(r.status.message, "");
    EXPECT_EQ(r.status.row, row) << r.status.message;
    ASSERT_EQ(s.state(), Solver::State::factorized);
    EXPECT_EQ(s.values(), a.values);
    const SolveResult solved = s.solve(b, x);
    ASSERT_TRUE(solved.status.ok()) << solved.status.message;
    EXPECT_LT(solved.backward_error, 1e-12);
    for (std::size_t k = 0; k < x.size(); ++k) EXPECT_NEAR(x[k], before[k], 1e-8 * (1 + std::abs(before[k])));
    const std::vector<Offset> begin = {0, 1};
    const std::vector<Index> one = {row};
    const std::vector<double> load = {1.0};
    std::vector<double> some(1), unit(b.size()), whole(b.size());
    ASSERT_TRUE(solve_rows(s, {begin, one, load}, one, some).status.ok());
    unit[static_cast<std::size_t>(row)] = 1;
    ASSERT_TRUE(s.solve(unit, whole).status.ok());
    EXPECT_NEAR(some[0], whole[static_cast<std::size_t>(row)], 1e-8 * std::abs(some[0]));
  }
  // A good change is taken as if nothing had been.
  std::vector<double> values = a.values;
  std::vector<Offset> places = {a.nonzeros() - 1};
  values.back() *= 1.25;
  ASSERT_TRUE(s.refactorize_entries(places, std::vector<double>{values.back()}).status.ok());
  ASSERT_TRUE(s.solve(b, x).status.ok());
  SparseMatrix changed = a;
  changed.values = values;
  Solver fresh(o);
  ASSERT_TRUE(fresh.analyze(a).status.ok());
  ASSERT_TRUE(fresh.factorize(changed).status.ok());
  ASSERT_TRUE(fresh.solve(b, before).status.ok());
  for (std::size_t k = 0; k < x.size(); ++k) EXPECT_NEAR(x[k], before[k], 1e-8 * (1 + std::abs(before[k])));
}

TEST(SingularChanges, AreNamedAndTheFactorBeforeIsThere) {
  for (const bool partial : {false, true})
    for (const char* device : {"cpu", "host:2,1"}) {
      check({"elasticity", "4"}, Kind::llt, partial, device);
      check({"elasticity", "4"}, Kind::ldlt, partial, device);
      check({"gyroscopic", "3"}, Kind::lu, partial, device);
    }
}

// New scales of a row of zeros are an error before the first front, which takes all of the factor with it.
TEST(SingularChanges, AreNamedWhereScalesAreAnew) {
  for (const bool partial : {false, true}) {
    check({"elasticity", "4"}, Kind::ldlt, partial, "cpu", Rescale::on);
    check({"gyroscopic", "3"}, Kind::lu, partial, "cpu", Rescale::on);
  }
}

}  // namespace singular_changes_test
}  // namespace espalier
