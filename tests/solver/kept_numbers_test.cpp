// Factorizations after Solver::analyze_change() that keep what the change does not reach
// (Options::partial_refactorization). Truth: the bits of a solver that follows the same patterns and makes everything
// each time; espalier_value_changes does thousands of these.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <tuple>
#include <vector>

#include "solver/changed_values.hpp"

namespace espalier {
namespace kept_numbers_test {

using namespace changed_values;

struct Variant {
  const char* name;
  Kind kind;
  Precision precision = Precision::fp64;
  Index block = 0;
  int threads = 2;
  Rescale rescale = Rescale::off;
};

void expect_bits_in_changing_patterns(const Variant& v, const SparseMatrix& first, unsigned seed, int& kept) {
  Options options[] = {bare(true), bare(false)};
  for (Options& o : options) {
    o.kind = v.kind;
    o.precision = v.precision;
    o.max_block_size = v.block;
    o.rescale = v.rescale;
    o.threads = 2;
  }
  options[0].threads = v.threads;
  changed_values::expect_bits_in_changing_patterns(options[0], options[1], first, seed, kept);
}

TEST(KeptNumbers, HaveTheBitsOfAWholeFactorization) {
  const Variant variants[] = {{"llt", Kind::llt},
                              {"llt in small tiles", Kind::llt, Precision::fp64, 8, 3},
                              {"ldlt", Kind::ldlt},
                              {"ldlt in small tiles", Kind::ldlt, Precision::fp64, 8, 1},
                              {"ldlt in FP32", Kind::ldlt, Precision::fp32, 0, 3},
                              {"ldlt rescaled", Kind::ldlt, Precision::fp64, 0, 2, Rescale::on},
                              {"lu", Kind::lu},
                              {"lu in small tiles", Kind::lu, Precision::fp64, 8, 3},
                              {"lu mixed", Kind::lu, Precision::mixed, 0, 1},
                              {"chosen", Kind::automatic}};
  for (const Variant& v : variants) {
    int kept = 0;
    for (unsigned seed = 1; seed <= 4; ++seed) {
      std::vector<SparseMatrix> list{reference::random_system(160, 4, Values::positive, seed), elasticity(4)};
      if (v.kind != Kind::llt) list.push_back(reference::saddle_point(120, 30, seed));
      if (v.kind == Kind::lu) list.push_back(reference::random_system(180, 4, Values::general, seed));
      for (const SparseMatrix& a : list) {
        SCOPED_TRACE(std::string(v.name) + ", n = " + std::to_string(a.rows) + ", seed " + std::to_string(seed));
        expect_bits_in_changing_patterns(v, a, seed, kept);
        if (testing::Test::HasFailure()) return;
      }
    }
    EXPECT_GT(kept, 5) << v.name;
  }
}

TEST(KeptNumbers, AreThoseThatTheChangeDoesNotReach) {
  const SparseMatrix a = natural_elasticity(12), b = in_contact(a);
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    SCOPED_TRACE(static_cast<int>(kind));
    Options o = bare(true);
    o.kind = kind;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    EXPECT_EQ(s.factorize(a).work_share, 1);
    for (int k = 0; k < 3; ++k)
      for (const SparseMatrix* now : {&b, &a}) {
        ASSERT_FALSE(s.analyze_change(*now).full);
        EXPECT_EQ(s.state(), Solver::State::analyzed);
        const FactorResult f = s.factorize(*now);
        ASSERT_TRUE(f.status.ok()) << f.status.message;
        EXPECT_GT(f.work_share, 0);
        EXPECT_LT(f.work_share, 0.8);
        EXPECT_EQ(f.whole_reason, "");
      }
    ASSERT_FALSE(s.analyze_change(a).full);
    EXPECT_EQ(s.factorize(a).work_share, 0) << "nothing has changed";
  }
}

// A budget that has room for the largest of the factors alone: where fronts that stay leave too much between them, all
// is made.
TEST(KeptNumbers, KeepTheirBudget) {
  const SparseMatrix a = natural_elasticity(9);
  std::vector<SparseMatrix> patterns;
  for (Index k = 0; k < 8; ++k) {
    const Index u = a.cols - 3 - 170 * k;
    patterns.push_back(with_spring(a, u, u - 60 - 120 * (k % 3)));
  }
  int whole = 0, kept = 0;
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    Options o = bare(true);
    o.kind = kind;
    o.threads = 2;
    Solver probe(o);  // without numbers, so nothing is left between fronts
    o.host_memory_bytes = probe.analyze(a).predicted_bytes;
    for (const SparseMatrix& b : patterns)
      o.host_memory_bytes = std::max(o.host_memory_bytes, probe.analyze_change(b).analysis.predicted_bytes);
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_TRUE(s.factorize(a).status.ok());
    for (const SparseMatrix& now : patterns) {
      ASSERT_TRUE(s.analyze_change(now).analysis.status.ok());
      const FactorResult f = s.factorize(now);
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      EXPECT_LE(f.peak_host_bytes, o.host_memory_bytes);
      EXPECT_EQ(f.work_share == 1, !f.whole_reason.empty()) << f.work_share << ' ' << f.whole_reason;
      (f.work_share == 1 ? whole : kept) += 1;
      const FactorResult again = s.factorize(now);
      EXPECT_EQ(again.work_share, 0);
      EXPECT_EQ(again.whole_reason, "");
    }
  }
  EXPECT_GT(kept, 0);
  EXPECT_GT(whole, 0);
}

TEST(KeptNumbers, SayWhyThereAreNone) {
  const SparseMatrix a = natural_elasticity(9), b = in_contact(a);
  for (const auto& [device, budget, why] :
       {std::tuple{"host:2", Offset{0}, "several devices"}, {"host:1,1", Offset{3'000'000}, "in core"}}) {
    SCOPED_TRACE(device);
    Options o = bare(true);
    o.threads = 2;
    o.device = device;
    o.device_memory_bytes = budget;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_TRUE(s.factorize(a).status.ok());
    ASSERT_TRUE(s.analyze_change(b).analysis.status.ok());
    const FactorResult f = s.factorize(b);
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_EQ(f.work_share, 1);
    EXPECT_NE(f.whole_reason.find(why), std::string::npos) << f.whole_reason;
  }
  Solver s(bare(true));
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  const SparseMatrix other = natural_elasticity(8);
  ASSERT_TRUE(s.analyze_change(other).full);
  FactorResult f = s.factorize(other);
  EXPECT_EQ(f.work_share, 1);
  EXPECT_NE(f.whole_reason.find("analyzed anew"), std::string::npos) << f.whole_reason;
  f = s.factorize(other);
  EXPECT_EQ(f.work_share, 0);
  EXPECT_EQ(f.whole_reason, "");
  ASSERT_TRUE(s.analyze(a).status.ok());  // the caller has said so
  EXPECT_EQ(s.factorize(a).whole_reason, "");
}

// Refused patterns leave the factor, with what the next one may keep.
TEST(KeptNumbers, OutliveRefusedPatterns) {
  const SparseMatrix a = natural_elasticity(9);
  Solver s(bare(true));
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  SparseMatrix bad = a;
  bad.values[3] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(s.analyze_change(bad).analysis.status.code, StatusCode::invalid_input);
  bad = a;
  bad.row_ind[3] = a.rows;
  EXPECT_EQ(s.analyze_change(bad).analysis.status.code, StatusCode::invalid_input);
  EXPECT_EQ(s.factorize(a).work_share, 0);
  const SparseMatrix b = in_contact(a);
  ASSERT_TRUE(s.analyze_change(b).analysis.status.ok());
  std::vector<double> values = b.values;
  values[5] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(s.refactorize(values).status.code, StatusCode::invalid_input);
  EXPECT_LT(s.factorize(b).work_share, 1) << "values that were refused have not touched what is kept";
}

// What a stopped factorization has made is nothing to go on from.
TEST(KeptNumbers, AfterAStopAreRight) {
  const SparseMatrix a = natural_elasticity(6), b = in_contact(a);
  int stopped = 0;
  for (int calls = 1; calls < 60; calls += 2) {
    int left = -1;
    Options o = bare(true);
    o.threads = 1;
    o.interrupted_every = 0;
    o.interrupted = [&left] { return left >= 0 && left-- == 0; };
    Solver s(o), whole(bare(false));
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_TRUE(whole.analyze(a).status.ok());
    ASSERT_TRUE(s.factorize(a).status.ok());
    ASSERT_TRUE(whole.analyze_change(b).analysis.status.ok());
    left = calls;
    const ChangeResult change = s.analyze_change(b);
    if (!change.analysis.status.ok()) {
      ++stopped;
      left = -1;
      EXPECT_EQ(s.state(), Solver::State::factorized);
      EXPECT_EQ(s.factorize(a).work_share, 0) << "the factor of before is there";
      ASSERT_TRUE(s.analyze_change(b).analysis.status.ok());
    } else if (!s.factorize(b).status.ok()) {
      ++stopped;
    }
    left = -1;
    std::vector<double> values = b.values;
    values[9] *= 1.5;
    (void)expect_same_factors(s, whole, values, some_right_hand_side<double>(a.rows, 4));
    if (testing::Test::HasFailure()) return;
  }
  EXPECT_GT(stopped, 5);
}

// A clone has the analysis, with places between which there is room, and no numbers.
TEST(KeptNumbers, AreNotThoseOfClones) {
  const SparseMatrix a = natural_elasticity(8), b = in_contact(a);
  Solver s(bare(true));
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  ASSERT_TRUE(s.analyze_change(b).analysis.status.ok());
  Solver clone = s.clone();
  (void)expect_same_factors(s, clone, b.values, some_right_hand_side<double>(a.rows, 4));
}

}  // namespace kept_numbers_test
}  // namespace espalier
