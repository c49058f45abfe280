// What find_modes() says of bad input, and how it behaves: threads, memory, interruption.
#include <atomic>
#include <limits>

#include "modes/modes_common.hpp"

namespace espalier {

using namespace test;

namespace {

// The message, where the status is `code`.
std::string refusal(const MatrixView& k, const MatrixView& m, const ModesOptions& o,
                    StatusCode code = StatusCode::invalid_input) {
  const ModesResult r = find_modes(k, m, o);
  EXPECT_EQ(static_cast<int>(r.status.code), static_cast<int>(code)) << r.status.message;
  EXPECT_FALSE(r.complete);
  EXPECT_EQ(r.count(), 0);
  return r.status.message;
}

bool says(const std::string& text, const std::string& word) { return text.find(word) != std::string::npos; }

}  // namespace

TEST(ModesBehaviour, RefusesMatricesThatDoNotFit) {
  const SparseMatrix k = string(6), m = identity(6);
  EXPECT_TRUE(says(refusal(k, identity(5), lowest(1)), "K is 6 x 6, M is 5 x 5"));
  SparseMatrix wide = identity(6);
  wide.rows = 7;
  wide.storage = Storage::general;
  EXPECT_TRUE(says(refusal(wide, m, lowest(1)), "K is 7 x 6"));
  EXPECT_TRUE(says(refusal(k, wide, lowest(1)), "M is 7 x 6"));
  EXPECT_TRUE(says(refusal(identity(0), identity(0), lowest(1)), "K is empty"));
  SparseMatrix pattern = k;
  pattern.values.clear();
  EXPECT_TRUE(says(refusal(pattern, m, lowest(1)), "K has no values"));
}

TEST(ModesBehaviour, RefusesNumbersThatAreNone) {
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    SparseMatrix k = string(6), m = identity(6);
    k.values[3] = bad;
    EXPECT_TRUE(says(refusal(k, m, lowest(1)), "K: "));
    k = string(6);
    m.values[2] = bad;
    EXPECT_TRUE(says(refusal(k, m, lowest(1)), "M: "));
  }
}

TEST(ModesBehaviour, RefusesWhatIsNotSymmetric) {
  SparseMatrix k = reference::stored_as(string(6), Storage::general);
  k.values[1] *= 1 + 1e-9;
  EXPECT_TRUE(says(refusal(k, identity(6), lowest(1)), "K is not symmetric: entry (1, 0)"));
  k = reference::stored_as(string(6), Storage::general);
  k.values[1] *= 1 + 1e-15;  // rounding of an assembly
  EXPECT_TRUE(find_modes(k, identity(6), lowest(1)).status.ok());
  EXPECT_TRUE(says(refusal(string(6), reference::random_system(6, 3, reference::Values::general, 1), lowest(1)),
                   "M is not symmetric"));
}

TEST(ModesBehaviour, RefusesMassesThatAreNotSemiDefinite) {
  const SparseMatrix k = string(5);
  EXPECT_TRUE(says(refusal(k, diagonal({1, 1, -1, 1, 1}), lowest(1)), "row 2 has entries, and -1 on the diagonal"));
  // No negative diagonal, and a negative eigenvalue: [1 2; 2 1].
  Eigen::MatrixXd m = Eigen::MatrixXd::Identity(5, 5);
  m(3, 1) = m(1, 3) = 2;
  EXPECT_TRUE(says(refusal(k, sparse(m), lowest(1)), "M is not positive semi-definite: it has 1 negative"));
  // A zero on the diagonal, with entries beside it.
  EXPECT_TRUE(says(refusal(k, symmetric(5, {{0, 0, 1.0}, {1, 0, 0.5}, {2, 2, 1.0}}), lowest(1)),
                   "row 1 has entries, and 0 on"));
  EXPECT_TRUE(says(refusal(k, diagonal({0, 0, 0, 0, 0}), lowest(1)), "no entries but zeros"));
}

TEST(ModesBehaviour, RefusesMoreModesThanThereAre) {
  EXPECT_TRUE(
      says(refusal(string(5), diagonal({1, 0, 1, 0, 1}), lowest(4)), "4 modes are asked for, and there are 3 finite"));
  EXPECT_EQ(find_modes(string(5), diagonal({1, 0, 1, 0, 1}), lowest(3)).count(), 3);
  // A constraint takes one unknown away.
  const SparseMatrix k = symmetric(3, {{0, 0, 2.0}, {1, 1, 3.0}, {2, 0, 1.0}, {2, 1, -1.0}});
  EXPECT_TRUE(says(refusal(k, diagonal({1, 1, 0}), lowest(2)), "there are 1 finite"));
  const ModesResult r = find_modes(k, diagonal({1, 1, 0}), lowest(1));
  ASSERT_EQ(r.count(), 1) << r.status.message;
  EXPECT_NEAR(r.eigenvalues[0], 2.5, 1e-12);
}

TEST(ModesBehaviour, RefusesOptionsThatCannotBe) {
  const SparseMatrix k = string(5), m = identity(5);
  EXPECT_TRUE(says(refusal(k, m, ModesOptions{}), "nothing is asked for"));
  const auto with = [&](const auto& change) {
    ModesOptions o = lowest(1);
    change(o);
    return refusal(k, m, o);
  };
  EXPECT_TRUE(says(with([](ModesOptions& o) { o.count = -1; }), "count = -1"));
  EXPECT_TRUE(says(with([](ModesOptions& o) { o.below = std::nan(""); }), "below = nan"));
  EXPECT_TRUE(says(with([](ModesOptions& o) { o.tolerance = 0; }), "tolerance = 0"));
  EXPECT_TRUE(says(with([](ModesOptions& o) { o.shift = std::numeric_limits<double>::infinity(); }), "shift = inf"));
  EXPECT_TRUE(says(with([](ModesOptions& o) { o.block_size = -3; }), "block_size = -3"));
  EXPECT_TRUE(says(with([](ModesOptions& o) { o.basis_size = -1; }), "basis_size = -1"));
}

TEST(ModesBehaviour, AShiftOnAnEigenvalueIsNamed) {
  const SparseMatrix k = diagonal({1, 2, 3, 4, 5}), m = identity(5);
  ModesOptions o = lowest(2);
  o.shift = 2;
  EXPECT_TRUE(says(refusal(k, m, o, StatusCode::singular), "the shift 2 is an eigenvalue"));
  o.shift = 2.5;
  expect_modes(find_modes(k, m, o), k, m, {1, 2}, 2);
  // A bound on one is moved a little.
  const ModesResult r = find_modes(k, m, all_below(3));
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_TRUE(r.count() == 2 || r.count() == 3);
}

TEST(ModesBehaviour, ASingularPencilIsNamed) {
  // The third unknown has neither mass nor stiffness; two equal constraints.
  EXPECT_TRUE(
      says(refusal(diagonal({1, 2, 0}), diagonal({1, 1, 0}), lowest(1), StatusCode::singular), "singular for every s"));
  const SparseMatrix twice = symmetric(4, {{0, 0, 2.0}, {1, 1, 3.0}, {2, 0, 1.0}, {3, 0, 1.0}});
  EXPECT_TRUE(says(refusal(twice, diagonal({1, 1, 0, 0}), lowest(1), StatusCode::singular), "constraints depend"));
}

TEST(ModesBehaviour, ASearchOfWhichNothingIsLeftIsNamed) {
  // What is multiplied with M and solved for, twice, is below the smallest number: no basis begins.
  const SparseMatrix k = string(20);
  EXPECT_TRUE(says(refusal(k, diagonal(std::vector<double>(20, 1e-300)), lowest(3), StatusCode::accuracy_not_reached),
                   "nothing is left of a random vector"));
  ModesOptions o = lowest(3);
  o.shift = 1e300;
  EXPECT_TRUE(says(refusal(k, identity(20), o, StatusCode::accuracy_not_reached), "the shift is too far"));
}

TEST(ModesBehaviour, MassesWithoutStiffnessMoveFreely) {
  const SparseMatrix nothing = diagonal(std::vector<double>(20, 0.0)), m = identity(20);
  const ModesResult r = find_modes(nothing, m, lowest(3));
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  ASSERT_EQ(r.count(), 3);
  EXPECT_TRUE(r.complete) << r.completeness;
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(r.eigenvalues[i], 0, 1e-12);
    EXPECT_LE(r.residuals[i], 1e-12);
  }
}

TEST(ModesBehaviour, TheSameBitsForAnyNumberOfThreads) {
  const SparseMatrix k = generated({"elasticity", "8"}), m = generated({"elasticity-mass", "8"});
  ModesOptions o = lowest(30);
  o.solver.device = "cpu";  // with few threads a GPU may be faster, whose bits are others
  o.solver.threads = 1;
  const ModesResult one = find_modes(k, m, o);
  ASSERT_TRUE(one.complete) << one.completeness;
  for (const int threads : {2, 3, 7}) {
    o.solver.threads = threads;
    const ModesResult r = find_modes(k, m, o);
    EXPECT_EQ(r.eigenvalues, one.eigenvalues) << threads;
    EXPECT_EQ(r.vectors, one.vectors) << threads;
    EXPECT_EQ(r.residuals, one.residuals) << threads;
  }
}

TEST(ModesBehaviour, AnotherSeedAndAnotherBlockFindTheSame) {
  const SparseMatrix k = generated({"elasticity", "5"}), m = generated({"elasticity-mass", "5"});
  const std::vector<double> truth = dense_eigenvalues(dense(k), dense(m));
  for (const Index block : {1, 3, 16, 200})
    for (const std::uint64_t seed : {1U, 99U}) {
      ModesOptions o = lowest(15);
      o.block_size = block;
      o.seed = seed;
      expect_modes(find_modes(k, m, o), k, m, truth, 15);
    }
}

TEST(ModesBehaviour, AShortBasisIsRestarted) {
  const SparseMatrix k = generated({"poisson", "40", "30", "1"}), m = identity(1200);
  ModesOptions o = lowest(20);
  const ModesResult roomy = find_modes(k, m, o);
  o.basis_size = 40;
  o.block_size = 4;
  const ModesResult r = find_modes(k, m, o);
  EXPECT_GT(r.restarts, 0);
  expect_modes(r, k, m, roomy.eigenvalues, 20);
}

TEST(ModesBehaviour, StopsWhenTheCallerSaysSo) {
  const SparseMatrix k = generated({"elasticity", "10"}), m = generated({"elasticity-mass", "10"});
  for (const int after : {0, 1, 5, 40, 200}) {
    std::atomic<int> asked{0};
    ModesOptions o = lowest(100);
    o.solver.interrupted = [&] { return ++asked > after; };
    o.solver.interrupted_every = 0;
    const ModesResult r = find_modes(k, m, o);
    EXPECT_EQ(static_cast<int>(r.status.code), static_cast<int>(StatusCode::cancelled))
        << after << ": " << r.status.message;
    EXPECT_FALSE(r.complete);
  }
}

TEST(ModesBehaviour, MemoryThatIsTooSmallIsNamed) {
  const SparseMatrix k = generated({"elasticity", "8"}), m = generated({"elasticity-mass", "8"});
  ModesOptions o = lowest(40);
  o.solver.host_memory_bytes = 100 << 10;
  EXPECT_EQ(static_cast<int>(find_modes(k, m, o).status.code), static_cast<int>(StatusCode::out_of_memory));
  const Offset enough = find_modes(k, m, lowest(40)).peak_bytes;
  EXPECT_GT(enough, Offset{1944} * 8 * 80);
  o.solver.host_memory_bytes = enough / 2;
  const ModesResult r = find_modes(k, m, o);
  if (!r.status.ok()) {
    EXPECT_EQ(static_cast<int>(r.status.code), static_cast<int>(StatusCode::out_of_memory));
    EXPECT_FALSE(r.status.message.empty());
  }
}

TEST(ModesBehaviour, WithoutProofNothingIsClaimed) {
  const SparseMatrix k = string(50), m = identity(50);
  ModesOptions o = lowest(6);
  o.prove = false;
  const ModesResult r = find_modes(k, m, o);
  EXPECT_TRUE(r.status.ok());
  EXPECT_EQ(r.count(), 6);
  EXPECT_FALSE(r.complete);
  EXPECT_EQ(r.factorizations, 1);
}

}  // namespace espalier
