// Changed patterns of complex systems. Truth: fresh analyses, and the bits of solvers that make everything; the
// campaigns espalier_follow and espalier_value_changes do thousands of these.
#include <gtest/gtest.h>

#include <limits>
#include <optional>
#include <random>
#include <vector>

#include "solver/changed_values.hpp"
#include "solver/complex_common.hpp"
#include "verdict/changes.hpp"
#include "verdict/complex_twin.hpp"

namespace espalier {
namespace complex_change_test {

using namespace changed_values;
using test::Dense;
using test::Sort;
using Value = std::complex<double>;

Options on_cpu() {
  Options o;
  o.device = "cpu";
  o.threads = 2;
  return o;
}

void expect_as_good_as_fresh(bool real_form) {
  std::optional<test::AsRealForm> form;
  if (real_form) form.emplace();
  int followed = 0, hermitian_ones = 0;
  for (int sort = 0; sort < verdict::ChangingSystem::sorts(); ++sort)
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      verdict::ChangingSystem system(sort, static_cast<Index>(30 + 40 * seed), 100 * seed + sort);
      const bool hermitian = system.kind() != Kind::lu && seed % 2 == 0;
      Options o = on_cpu();
      o.kind = system.kind();
      ComplexSolver solver(o);
      Offset fill = solver.analyze(verdict::twin_of<Value>(system.matrix(), hermitian)).nonzeros_factor;
      for (int k = 0; k < 8 && solver.state() != Solver::State::empty; ++k) {
        system.change();
        const verdict::ChangeVerdict v = verdict::follow<Value>(solver, system, fill, hermitian);
        ASSERT_EQ(v.wrong, "") << "sort " << sort << ", seed " << seed << ", change " << k << (hermitian ? ", H" : "");
        followed += v.full ? 0 : 1;
        hermitian_ones += !v.full && hermitian ? 1 : 0;
      }
    }
  EXPECT_GT(followed, 50);
  EXPECT_GT(hermitian_ones, 20);
}

TEST(ComplexChange, IsAsGoodAsAFreshAnalysis) { expect_as_good_as_fresh(false); }

// Real systems of twice the size, as GPUs get them: the tree of the complex one follows.
TEST(ComplexChange, OfRealFormsIsAsGoodAsAFreshAnalysis) { expect_as_good_as_fresh(true); }

TEST(ComplexChange, NumbersThatStayHaveTheBitsOfAWholeFactorization) {
  struct Variant {
    Kind kind;
    bool hermitian;
    Precision precision = Precision::fp64;
    Index block = 0;
  };
  for (const Variant& v : {Variant{Kind::llt, true}, Variant{Kind::ldlt, true}, Variant{Kind::ldlt, false},
                           Variant{Kind::ldlt, true, Precision::fp32, 8}, Variant{Kind::lu, false}}) {
    int kept = 0;
    for (unsigned seed = 1; seed <= 5; ++seed) {
      const SparseMatrix first = v.kind == Kind::lu ? reference::random_system(180, 4, Values::general, seed)
                                 : seed % 2 == 0    ? elasticity(4)
                                                    : reference::random_system(160, 4, Values::positive, seed);
      Options options[] = {bare(true), bare(false)};
      for (Options& o : options) {
        o.kind = v.kind;
        o.precision = v.precision;
        o.max_block_size = v.block;
        o.threads = 1 + static_cast<int>(seed % 3);
      }
      ComplexSolver partial(options[0]), whole(options[1]);
      const auto twin = [&](SparseMatrix a, const std::vector<double>& values) {
        a.values = values;
        return verdict::twin_of<Value>(a, v.hermitian);
      };
      ASSERT_TRUE(partial.analyze(twin(first, first.values)).status.ok());
      ASSERT_TRUE(whole.analyze(twin(first, first.values)).status.ok());
      std::mt19937 random(seed);
      SparseMatrix a = first;
      std::vector<double> now = a.values;
      const std::vector<Value> b = some_right_hand_side<Value>(a.rows, seed);
      bool changed = false;
      for (int round = 0; round < 16; ++round) {
        SCOPED_TRACE(testing::Message() << "kind " << static_cast<int>(v.kind) << ", seed " << seed << ", round "
                                        << round);
        const double share = expect_same_factors(partial, whole, twin(a, now).values, b);
        if (testing::Test::HasFailure()) return;
        kept += changed && share < 1 ? 1 : 0;
        changed = random() % 3 != 0;
        if (!changed) {
          change_values(now, a.values, random);
          continue;
        }
        verdict::change_pattern(a, now, first, random);
        const ComplexSparseMatrix next = twin(a, now);
        const ChangeResult p = partial.analyze_change(next), w = whole.analyze_change(next);
        ASSERT_EQ(p.analysis.status.code, w.analysis.status.code) << p.analysis.status.message;
        if (!p.analysis.status.ok()) break;
        ASSERT_EQ(p.full, w.full);
      }
    }
    EXPECT_GT(kept, 5) << static_cast<int>(v.kind);
  }
}

TEST(ComplexChange, RealFormsMakeAllAndSayWhy) {
  const test::AsRealForm form;
  Options o = on_cpu();
  o.partial_refactorization = true;
  ComplexSolver solver(o);
  Dense a = test::random_dense(40, Sort::hermitian, 3);
  ASSERT_TRUE(solver.analyze(test::sparse(a, Storage::hermitian_lower)).status.ok());
  ASSERT_TRUE(solver.factorize(test::sparse(a, Storage::hermitian_lower)).status.ok());
  a(30, 2) = Value(0, 0.5);
  a(2, 30) = Value(0, -0.5);
  ASSERT_FALSE(solver.analyze_change(test::sparse(a, Storage::hermitian_lower)).full);
  const ComplexFactorResult f = solver.factorize(test::sparse(a, Storage::hermitian_lower));
  ASSERT_TRUE(f.status.ok()) << f.status.message;
  EXPECT_NE(f.whole_reason.find("real one"), std::string::npos) << f.whole_reason;
  test::expect_solutions(solver, a);
}

// What the values of general storage are found to be stays, also where they are real for once.
TEST(ComplexChange, HermitianStaysHermitian) {
  Dense a = test::random_dense(30, Sort::definite, 4);
  ComplexSolver solver(on_cpu());
  ASSERT_TRUE(solver.analyze(test::sparse(a, Storage::general)).status.ok());
  ASSERT_TRUE(solver.factorize(test::sparse(a, Storage::general)).status.ok());
  const auto followed = [&](const Dense& next) {
    const ChangeResult r = solver.analyze_change(test::sparse(next, Storage::general));
    EXPECT_TRUE(r.analysis.status.ok()) << r.analysis.status.message;
    EXPECT_FALSE(r.full) << r.why;
    const ComplexFactorResult f = solver.factorize(test::sparse(next, Storage::general));
    EXPECT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_EQ(f.inertia.positive, 30);  // which symmetric ones do not have
    test::expect_solutions(solver, next);
  };
  Dense real = a.real().cast<Value>();
  followed(real);
  a(25, 3) = Value(0.1, 0.2);
  a(3, 25) = Value(0.1, -0.2);
  followed(a);
  a(25, 3) = Value(0.1, 0.3);
  const ChangeResult r = solver.analyze_change(test::sparse(a, Storage::general));
  EXPECT_TRUE(r.full);
  EXPECT_NE(r.why.find("Hermitian"), std::string::npos) << r.why;
  EXPECT_EQ(r.analysis.kind, Kind::lu);
  ASSERT_TRUE(solver.factorize(test::sparse(a, Storage::general)).status.ok());
  test::expect_solutions(solver, a);
}

// Storage tells one from the other, whatever kind was asked for.
TEST(ComplexChange, SymmetricBecomesHermitian) {
  for (const Kind kind : {Kind::automatic, Kind::ldlt, Kind::lu}) {
    const Dense a = test::random_dense(30, Sort::symmetric, 4), b = test::random_dense(30, Sort::hermitian, 4);
    Options o = on_cpu();
    o.kind = kind;
    ComplexSolver solver(o);
    ASSERT_TRUE(solver.analyze(test::sparse(a, Storage::symmetric_lower)).status.ok());
    const ChangeResult r = solver.analyze_change(test::sparse(b, Storage::hermitian_lower));
    ASSERT_TRUE(r.analysis.status.ok()) << r.analysis.status.message;
    EXPECT_EQ(r.full, kind != Kind::lu) << r.why;
    ASSERT_TRUE(solver.factorize(test::sparse(b, Storage::hermitian_lower)).status.ok());
    test::expect_solutions(solver, b);
  }
}

TEST(ComplexChange, BadMatricesLeaveTheFactorAsItWas) {
  const Dense dense = test::random_dense(20, Sort::hermitian, 1);
  const ComplexSparseMatrix a = test::sparse(dense, Storage::hermitian_lower);
  ComplexSolver solver(on_cpu());
  EXPECT_THROW((void)solver.analyze_change(a), std::logic_error);
  ASSERT_TRUE(solver.analyze(a).status.ok());
  ASSERT_TRUE(solver.factorize(a).status.ok());
  const auto refused = [&](const ComplexSparseMatrix& bad, StatusCode code) {
    const ChangeResult r = solver.analyze_change(bad);
    EXPECT_EQ(r.analysis.status.code, code) << r.analysis.status.message;
    EXPECT_FALSE(r.analysis.status.message.empty());
    ASSERT_EQ(solver.state(), Solver::State::factorized);
    test::expect_solutions(solver, dense);
  };
  ComplexSparseMatrix bad = a;
  bad.values[3] = Value(0, std::numeric_limits<double>::quiet_NaN());
  refused(bad, StatusCode::invalid_input);
  for (const Index row : {Index{-1}, Index{20}, std::numeric_limits<Index>::max()}) {
    bad = a;
    bad.row_ind[5] = row;
    refused(bad, StatusCode::invalid_input);
  }
  bad = a;
  bad.values[0] = Value(1, 1);  // of the diagonal
  refused(bad, StatusCode::invalid_input);
  bad = a;
  bad.values.pop_back();
  refused(bad, StatusCode::invalid_input);
  Dense empty = dense;
  empty.row(17).setZero();
  empty.col(17).setZero();
  bad = test::sparse(empty, Storage::hermitian_lower);
  for (Index c = 17; c < 20; ++c) --bad.col_ptr[static_cast<std::size_t>(c) + 1];
  const auto diagonal = static_cast<std::ptrdiff_t>(bad.col_ptr[17]);
  bad.row_ind.erase(bad.row_ind.begin() + diagonal);
  bad.values.erase(bad.values.begin() + diagonal);
  refused(bad, StatusCode::singular);
  EXPECT_EQ(solver.analyze_change(bad).analysis.status.row, 17);
}

}  // namespace complex_change_test
}  // namespace espalier
