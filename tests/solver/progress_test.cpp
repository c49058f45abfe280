// What a listener is told of a solver's calls. Truth: the flops of the analysis, and the bits of a solver that nobody
// listens to.
#include "espalier/progress.hpp"

#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "solver/c/c_handle.hpp"
#include "solver/solver_common.hpp"

namespace espalier {
namespace progress_test {

using reference::Values;

struct Told {
  std::vector<ProgressReport> reports;
  // The largest share of a phase that was seen, and whether it never fell but for a new beginning.
  double most(const std::string& phase) const {
    double most = 0;
    for (const ProgressReport& r : reports)
      if (r.phase == phase && r.total > 0) most = std::max(most, r.done / r.total);
    return most;
  }
};

std::vector<double> solved_with(const SparseMatrix& a, const Options& options, const std::vector<double>& b,
                                Index columns, double* flops = nullptr) {
  Solver s(options);
  const AnalysisResult analysis = s.analyze(a);
  EXPECT_TRUE(analysis.status.ok());
  if (flops != nullptr) *flops = analysis.flops;
  EXPECT_TRUE(s.factorize(a).status.ok());
  std::vector<double> x(b.size());
  EXPECT_TRUE(s.solve(b, x, columns).status.ok());
  return x;
}

TEST(Progress, OfAllThatIsDoneAndWithoutABitChanged) {
  const SparseMatrix grid = test::generated({"elasticity", "6"});
  struct Case {
    const char* name;
    SparseMatrix a;
    Options options;
  };
  const std::vector<Case> cases = {
      {"llt", grid, test::options_on("cpu", 1)},
      {"ldlt", reference::saddle_point(300, 80, 5), test::options_on("cpu", 1)},
      {"lu", reference::random_system(900, 4, Values::general, 3), test::options_on("cpu", 1)},
      {"two host devices", grid, test::options_on("host:2", 2)},
      {"out of core", grid, test::options_on("host:1", 2, 800'000)}};
  constexpr Index kColumns = 70;  // more than go together
  for (const Case& c : cases) {
    SCOPED_TRACE(c.name);
    const std::vector<double> b = reference::random_vector(c.a.rows * kColumns, 11);
    const std::vector<double> expected = solved_with(c.a, c.options, b, kColumns);
    Told told;
    double flops = 0;
    {
      const ProgressListener listener([&told](const ProgressReport& r) { told.reports.push_back(r); }, 0);
      EXPECT_EQ(solved_with(c.a, c.options, b, kColumns, &flops), expected);
    }
    const std::size_t count = told.reports.size();
    EXPECT_EQ(solved_with(c.a, c.options, b, kColumns), expected);
    EXPECT_EQ(told.reports.size(), count);  // nobody listens any more
    std::map<std::string, std::string> inside;
    double before = 0;
    bool factorized = false;
    for (const ProgressReport& r : told.reports) {
      if (!r.inside.empty()) inside[r.inside] = r.phase;
      if (r.phase != "factorization") continue;
      EXPECT_EQ(r.unit, "flops");
      EXPECT_DOUBLE_EQ(r.total, flops);
      EXPECT_LE(r.done, r.total);
      EXPECT_TRUE(r.done >= before || r.done == 0);
      factorized = factorized || (r.done > 0.1 * r.total && r.done < 0.9 * r.total);
      before = r.done;
    }
    // With more threads nobody knows which of them sees the middle.
    EXPECT_TRUE(factorized || c.options.threads > 1);
    EXPECT_EQ(told.most("factorization"), 1);
    EXPECT_EQ(told.most("substitution"), 1);
    for (const char* part : {"scaling and matching", "ordering", "plan"}) EXPECT_EQ(inside[part], "analysis") << part;
  }
}

TEST(Progress, FromC) {
  const SparseMatrix a = test::generated({"elasticity", "5"});
  const std::vector<Offset> rows(a.row_ind.begin(), a.row_ind.end());
  espalier_matrix_i64 m{};
  m.size = sizeof m;
  m.rows = m.cols = a.cols;
  m.nonzeros = a.nonzeros();
  m.pointers = a.col_ptr.data();
  m.indices = rows.data();
  m.values = a.values.data();
  m.layout = ESPALIER_CSC;
  m.storage = ESPALIER_SYMMETRIC_LOWER;
  std::map<std::string, int> phases;
  const auto tell = [](const espalier_progress* p, void* user) {
    ++(*static_cast<std::map<std::string, int>*>(user))[p->phase];
    EXPECT_GE(p->seconds, 0);
    EXPECT_STREQ(p->unit, std::string(p->phase) == "factorization" ? "flops" : p->unit);
  };
  ASSERT_EQ(espalier_listen(tell, &phases), ESPALIER_OK);
  const test::Handle handle = test::make();
  ASSERT_EQ(test::analyze(handle.get(), m), ESPALIER_OK);
  ASSERT_EQ(test::factorize(handle.get(), m), ESPALIER_OK);
  EXPECT_GT(phases["analysis"], 0);
  EXPECT_GT(phases["factorization"], 0);
  ASSERT_EQ(espalier_listen(nullptr, nullptr), ESPALIER_OK);
  const auto before = phases;
  ASSERT_EQ(test::factorize(handle.get(), m), ESPALIER_OK);
  EXPECT_EQ(phases, before);
}

}  // namespace progress_test
}  // namespace espalier
