// Factorizations of which only what has changed is made (Options::partial_refactorization). Truth: the bits of a solver
// that makes everything each time.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <tuple>

#include "rounds.hpp"
#include "solver/changed_values.hpp"

namespace espalier {
namespace partial_refactorization_test {

using namespace changed_values;

struct Variant {
  const char* name;
  Kind kind;
  Precision precision = Precision::fp64;
  Index block = 0;
  int threads = 2;
  bool report = false;
  Rescale rescale = Rescale::off;
  const char* device = "cpu";
};

std::vector<Variant> variants() {
  return {{"llt", Kind::llt},
          {"llt in small tiles", Kind::llt, Precision::fp64, 8, 3},
          {"ldlt", Kind::ldlt},
          {"ldlt in small tiles", Kind::ldlt, Precision::fp64, 8, 1},
          {"ldlt in FP32", Kind::ldlt, Precision::fp32, 0, 3},
          {"ldlt rescaled", Kind::ldlt, Precision::fp64, 0, 2, false, Rescale::on},
          {"lu", Kind::lu},
          {"lu in small tiles", Kind::lu, Precision::fp64, 8, 3},
          {"lu mixed", Kind::lu, Precision::mixed, 0, 1},
          {"chosen", Kind::automatic},
          {"llt on two devices", Kind::llt, Precision::fp64, 8, 2, false, Rescale::off, "host:2"},
          {"ldlt on three devices", Kind::ldlt, Precision::fp64, 8, 4, false, Rescale::off, "host:3"},
          {"ldlt in FP32 on two devices", Kind::ldlt, Precision::fp32, 0, 2, false, Rescale::off, "host:2"},
          {"lu on two devices", Kind::lu, Precision::fp64, 8, 3, false, Rescale::on, "host:2"}};
}

std::vector<SparseMatrix> matrices(Kind kind, unsigned seed) {
  std::vector<SparseMatrix> list;
  list.push_back(reference::random_system(160, 4, Values::positive, seed));
  if (kind != Kind::llt) list.push_back(reference::saddle_point(120, 30, seed));
  if (kind == Kind::lu) list.push_back(reference::random_system(180, 4, Values::general, seed));
  list.push_back(elasticity(4));
  return list;
}

TEST(PartialRefactorization, HasTheBitsOfAWholeOne) {
  int some = 0;
  for (const Variant& v : variants())
    for (unsigned seed = 1; seed <= (std::string(v.device) == "cpu" ? 4U : 2U); ++seed)
      for (const SparseMatrix& a : matrices(v.kind, seed)) {
        SCOPED_TRACE(std::string(v.name) + ", n = " + std::to_string(a.rows) + ", seed " + std::to_string(seed));
        Options partial = bare(true), full = bare(false);
        for (Options* o : {&partial, &full}) {
          o->kind = v.kind;
          o->precision = v.precision;
          o->max_block_size = v.block;
          o->rescale = v.rescale;
          o->device = v.device;
        }
        partial.threads = v.threads;
        full.threads = std::string(v.device) == "cpu" ? 2 : 3;
        Shares shares;
        expect_bits_of_all<Solver>(partial, full, a, seed, espalier::test::rounds(25, 8), &shares);
        if (testing::Test::HasFailure()) return;
        some += shares.some;
      }
  EXPECT_GT(some, espalier::test::rounds(800, 150));
}

TEST(PartialRefactorization, OfComplexSystemsToo) {
  for (const auto sort : {test::Sort::symmetric, test::Sort::hermitian, test::Sort::definite, test::Sort::general})
    for (unsigned seed = 1; seed <= 4; ++seed) {
      SCOPED_TRACE("sort " + std::to_string(static_cast<int>(sort)) + ", seed " + std::to_string(seed));
      const bool hermitian = sort == test::Sort::hermitian || sort == test::Sort::definite;
      const Storage storage = sort == test::Sort::general ? Storage::general
                              : hermitian                 ? Storage::hermitian_lower
                                                          : Storage::symmetric_lower;
      const ComplexSparseMatrix a = test::sparse(test::random_dense(90, sort, seed), storage);
      expect_bits_of_all<ComplexSolver>(bare(true), bare(false), a, seed, 20);
    }
}

// One element of the surface of a clamped box.
TEST(PartialRefactorization, MakesWhatValuesReach) {
  const SparseMatrix a = elasticity(10);
  Solver s(bare(true));
  ASSERT_TRUE(s.analyze(a).status.ok());
  EXPECT_EQ(s.factorize(a).work_share, 1);
  EXPECT_EQ(s.factorize(a).work_share, 0) << "nothing has changed";
  std::vector<double> values = a.values;
  values.front() *= 1.25;
  const FactorResult one = s.refactorize(values);
  EXPECT_GT(one.work_share, 0);
  EXPECT_LT(one.work_share, 0.7) << "the fronts from one entry to the root";
  for (double& v : values) v *= 3;
  EXPECT_GT(s.refactorize(values).work_share, 0.99);
  Solver other(bare(false));
  ASSERT_TRUE(other.analyze(a).status.ok());
  (void)other.factorize(a);
  EXPECT_EQ(other.factorize(a).work_share, 1) << "everything is made where nobody asks for less";
}

// On one device and several, in core and out of core; and where nothing is kept.
TEST(PartialRefactorization, SaysWhereEverythingIsMade) {
  const SparseMatrix a = elasticity(9);
  for (const auto& [device, budget, why] : {std::tuple{"cpu", Offset{0}, ""},
                                            {"reference", Offset{0}, "keeps no fronts"},
                                            {"host:2", Offset{0}, ""},
                                            {"host:1,2", Offset{4'000'000}, ""},
                                            {"host:2", Offset{2'000'000}, ""},
                                            {"host:3", Offset{1'500'000}, ""}}) {
    SCOPED_TRACE(std::string(device) + ", " + why);
    Options partial = bare(true), full = bare(false);
    for (Options* o : {&partial, &full}) {
      o->threads = 2;
      o->device = device;
      o->device_memory_bytes = budget;
    }
    Solver s(partial), whole(full);
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_TRUE(whole.analyze(a).status.ok());
    std::vector<double> values = a.values;
    for (int k = 0; k < 3; ++k, values[static_cast<std::size_t>(40 * k)] *= 1.5) {
      const FactorResult f = s.refactorize(values);
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      EXPECT_EQ(f.whole_reason.find(why) != std::string::npos, true) << f.whole_reason;
      EXPECT_EQ(f.whole_reason.empty(), std::string(why).empty()) << f.whole_reason;
      EXPECT_EQ(f.work_share<1, k> 0 && f.whole_reason.empty());
      const FactorResult w = whole.refactorize(values);
      ASSERT_TRUE(w.status.ok()) << w.status.message;
      EXPECT_TRUE(w.whole_reason.empty()) << "nobody asked";
      const std::vector<double> b = reference::random_vector(a.rows, 4);
      std::vector<double> x(b.size()), y(b.size());
      ASSERT_TRUE(s.solve(b, x).status.ok());
      ASSERT_TRUE(whole.solve(b, y).status.ok());
      for (std::size_t i = 0; i < x.size(); ++i) ASSERT_NEAR(x[i], y[i], 1e-9 * (1 + std::abs(y[i])));
    }
  }
}

TEST(PartialRefactorization, KeepsItsBudget) {
  const SparseMatrix a = elasticity(8);
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    Options o = bare(true);
    o.kind = kind;
    o.threads = 2;
    Solver probe(o);
    const AnalysisResult analysis = probe.analyze(a);
    ASSERT_TRUE(analysis.status.ok());
    o.host_memory_bytes = analysis.predicted_bytes;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    for (int k = 0; k < 3; ++k) {
      const FactorResult f = s.factorize(a);
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      EXPECT_LE(f.peak_host_bytes, analysis.predicted_bytes);
    }
  }
}

TEST(PartialRefactorization, RefusedValuesLeaveTheFactor) {
  const SparseMatrix a = reference::random_system(150, 4, Values::positive, 3);
  const std::vector<double> b = reference::random_vector(a.rows, 4);
  Solver s(bare(true));
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  std::vector<double> before(b.size()), after(b.size());
  ASSERT_TRUE(s.solve(b, before).status.ok());
  std::vector<double> bad = a.values;
  bad[7] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(s.refactorize(bad).status.code, StatusCode::invalid_input);
  const std::vector<Offset> beyond{a.nonzeros()}, first{0};
  const std::vector<double> one{1}, inf{std::numeric_limits<double>::infinity()};
  EXPECT_EQ(s.refactorize_entries(beyond, one).status.code, StatusCode::invalid_input);
  EXPECT_EQ(s.refactorize_entries(std::vector<Offset>{-1}, one).status.code, StatusCode::invalid_input);
  EXPECT_EQ(s.refactorize_entries(first, inf).status.code, StatusCode::invalid_input);
  EXPECT_THROW((void)s.refactorize_entries(first, {}), std::invalid_argument);
  ASSERT_EQ(s.state(), Solver::State::factorized);
  ASSERT_TRUE(s.solve(b, after).status.ok());
  EXPECT_TRUE(same_bits(before, after));
}

TEST(PartialRefactorization, TakesSomeEntriesAlone) {
  for (const bool partial : {true, false})
    for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
      const SparseMatrix a = reference::random_system(150, 4, Values::positive, 5);
      Options o = bare(partial);
      o.kind = kind;
      Solver s(o);
      ASSERT_TRUE(s.analyze(a).status.ok());
      ASSERT_TRUE(s.factorize(a).status.ok());
      const std::vector<Offset> places{3, 40, 3};
      const std::vector<double> values{9, a.values[40] * 1.5, 1.25 * a.values[3]};
      const FactorResult f = s.refactorize_entries(places, values);
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      EXPECT_EQ(f.work_share < 1, partial);
      std::vector<double> expected = a.values;
      expected[3] *= 1.25;
      expected[40] *= 1.5;
      EXPECT_TRUE(same_bits(s.values(), expected));
      Options again = bare(false);
      again.kind = kind;
      Solver other(again);
      ASSERT_TRUE(other.analyze(a).status.ok());
      ASSERT_TRUE(other.refactorize(expected).status.ok());
      const std::vector<double> b = reference::random_vector(a.rows, 4);
      std::vector<double> x(b.size()), y(b.size());
      (void)s.solve(b, x);
      (void)other.solve(b, y);
      EXPECT_TRUE(same_bits(x, y));
    }
}

TEST(PartialRefactorization, OfPartsOfAnEntryOnlyTheSumIsKnown) {
  SparseMatrix a;
  a.rows = a.cols = 2;
  a.storage = Storage::general;
  a.col_ptr = {0, 3, 4};
  a.row_ind = {0, 1, 1, 1};
  a.values = {2, 1, 1, 3};
  Solver s(bare(true));
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  const std::vector<double> five{5};
  EXPECT_EQ(s.refactorize_entries(std::vector<Offset>{1}, five).status.code, StatusCode::invalid_input);
  EXPECT_TRUE(s.refactorize_entries(std::vector<Offset>{3}, five).status.ok());
}

// What a stopped factorization has left is no factor to go on from.
TEST(PartialRefactorization, AfterAStopEverythingIsMade) {
  const SparseMatrix a = elasticity(6);
  for (int calls = 1; calls < 40; calls += 3) {
    int left = -1;
    Options o = bare(true);
    o.threads = 1;
    o.interrupted_every = 0;
    o.interrupted = [&left] { return left >= 0 && left-- == 0; };
    Solver s(o), whole(bare(false));
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_TRUE(whole.analyze(a).status.ok());
    ASSERT_TRUE(s.factorize(a).status.ok());
    std::vector<double> values = a.values;
    values[5] *= 1.5;
    left = calls;
    (void)s.refactorize(values);
    const bool has_factor = s.state() == Solver::State::factorized;  // it was stopped before or after its work
    left = -1;
    values[9] *= 1.5;
    const FactorResult f = s.refactorize(values);
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_EQ(f.work_share < 1, has_factor);
    ASSERT_TRUE(whole.refactorize(values).status.ok());
    const std::vector<double> b = reference::random_vector(a.rows, 4);
    std::vector<double> x(b.size()), y(b.size());
    (void)s.solve(b, x);
    (void)whole.solve(b, y);
    EXPECT_TRUE(same_bits(x, y));
  }
}

}  // namespace partial_refactorization_test
}  // namespace espalier
