// Modes in closed form: strings, membranes, solids of springs; with multiple eigenvalues and rigid motions.
#include <algorithm>

#include "modes/modes_common.hpp"

namespace espalier {

using namespace test;

namespace {

// 4 sin^2(j pi / (2 (n + 1))), j = 1 ... n: the string that is held at both ends.
std::vector<double> string_eigenvalues(Index n) {
  std::vector<double> out;
  for (Index j = 1; j <= n; ++j) out.push_back(4 * std::pow(std::sin(j * kPi / (2.0 * (n + 1))), 2));
  return out;
}

// Sums of three of them: -Laplace by 7 points.
std::vector<double> solid_eigenvalues(Index nx, Index ny, Index nz) {
  std::vector<double> out;
  for (const double x : string_eigenvalues(nx))
    for (const double y : string_eigenvalues(ny))
      for (const double z : string_eigenvalues(nz)) out.push_back(x + y + z);
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace

TEST(ModesClosedForms, AStringHeldAtBothEnds) {
  for (const Index n : {1, 2, 3, 7, 8, 9, 200}) {
    const SparseMatrix k = string(n), m = identity(n);
    for (const Index count : {Index{1}, std::min<Index>(n, 5), std::min<Index>(n, 60)})
      expect_modes(find_modes(k, m, lowest(count)), k, m, string_eigenvalues(n), static_cast<std::size_t>(count));
  }
}

TEST(ModesClosedForms, AllModesOfASmallString) {
  for (const Index n : {1, 4, 30}) {
    const SparseMatrix k = string(n), m = identity(n);
    expect_modes(find_modes(k, m, lowest(n)), k, m, string_eigenvalues(n), static_cast<std::size_t>(n));
  }
}

TEST(ModesClosedForms, AFreeStringHasARigidMotion) {
  const Index n = 150;
  std::vector<double> truth;
  for (Index j = 0; j < n; ++j) truth.push_back(4 * std::pow(std::sin(j * kPi / (2.0 * n)), 2));
  const SparseMatrix k = string(n, false), m = identity(n);
  const ModesResult r = find_modes(k, m, lowest(12));
  expect_modes(r, k, m, truth, 12);
  for (Index i = 1; i < n; ++i) EXPECT_NEAR(r.vectors[static_cast<std::size_t>(i)], r.vectors[0], 1e-9);
}

TEST(ModesClosedForms, ModesOfTwentyFreeStringsAreTwentyFold) {
  // Twenty equal eigenvalues in the place of each: more than a block of the search has vectors.
  const Index n = 40, strings = 20;
  std::vector<reference::Triple> t;
  for (Index s = 0; s < strings; ++s)
    for (Index i = 0; i < n; ++i) {
      t.push_back({s * n + i, s * n + i, i > 0 && i + 1 < n ? 2.0 : 1.0});
      if (i + 1 < n) t.push_back({s * n + i + 1, s * n + i, -1.0});
    }
  std::vector<double> truth;
  for (Index j = 0; j < n; ++j) truth.insert(truth.end(), strings, 4 * std::pow(std::sin(j * kPi / (2.0 * n)), 2));
  const SparseMatrix k = symmetric(n * strings, t), m = identity(n * strings);
  expect_modes(find_modes(k, m, lowest(50)), k, m, truth, 50);
  expect_modes(find_modes(k, m, lowest(60)), k, m, truth, 60);
}

TEST(ModesClosedForms, ACubeHasEigenvaluesOfMultiplicitySix) {
  const SparseMatrix k = generated({"poisson", "9"}), m = identity(729);
  const std::vector<double> truth = solid_eigenvalues(9, 9, 9);
  for (const Index count : {1, 2, 3, 4, 10, 47, 120})
    expect_modes(find_modes(k, m, lowest(count)), k, m, truth, static_cast<std::size_t>(count));
}

TEST(ModesClosedForms, HundredsOfModesOfAPlate) {
  // 60 x 40 nodes: eigenvalues that are close together, found from several shifts.
  const SparseMatrix k = generated({"poisson", "60", "40", "1"}), m = identity(2400);
  const std::vector<double> truth = solid_eigenvalues(60, 40, 1);
  const ModesResult r = find_modes(k, m, lowest(400));
  expect_modes(r, k, m, truth, 400);
  EXPECT_GT(r.factorizations, 3);
}

TEST(ModesClosedForms, AllBelowABound) {
  const SparseMatrix k = generated({"poisson", "12", "11", "1"}), m = identity(132);
  const std::vector<double> truth = solid_eigenvalues(12, 11, 1);
  for (const std::size_t count : {1U, 2U, 17U, 60U, 131U}) {
    const double bound = (truth[count - 1] + truth[count]) / 2;
    ASSERT_GT(truth[count] - truth[count - 1], 1e-6);
    expect_modes(find_modes(k, m, all_below(bound)), k, m, truth, count);
  }
  const ModesResult none = find_modes(k, m, all_below(truth[0] / 2));
  EXPECT_TRUE(none.status.ok()) << none.status.message;
  EXPECT_TRUE(none.complete) << none.completeness;
  EXPECT_EQ(none.count(), 0);
  EXPECT_EQ(find_modes(k, m, all_below(-1e6)).count(), 0);
  expect_modes(find_modes(k, m, all_below(1e6)), k, m, truth, 132);
}

TEST(ModesClosedForms, ACountAndABoundMeanTheFewerOfBoth) {
  const SparseMatrix k = string(100), m = identity(100);
  const std::vector<double> truth = string_eigenvalues(100);
  ModesOptions o = lowest(5);
  o.below = (truth[7] + truth[8]) / 2;
  expect_modes(find_modes(k, m, o), k, m, truth, 5);
  o.count = 20;
  expect_modes(find_modes(k, m, o), k, m, truth, 8);
}

TEST(ModesClosedForms, AShiftOfTheCallersInTheMiddle) {
  const SparseMatrix k = string(300), m = identity(300);
  const std::vector<double> truth = string_eigenvalues(300);
  for (const double shift : {-5.0, -1e-3, (truth[10] + truth[11]) / 2, (truth[19] + truth[20]) / 2}) {
    ModesOptions o = lowest(20);
    o.shift = shift;
    expect_modes(find_modes(k, m, o), k, m, truth, 20);
  }
}

TEST(ModesClosedForms, UnitsDoNotMatter) {
  // Eigenvalues from 1e-12 to 1e12: steel in mm and tonnes, or atoms.
  for (const double unit : {1e-12, 1e-3, 1e6, 1e12}) {
    SparseMatrix k = string(120);
    for (double& v : k.values) v *= unit;
    const SparseMatrix m = identity(120);
    std::vector<double> truth = string_eigenvalues(120);
    for (double& v : truth) v *= unit;
    expect_modes(find_modes(k, m, lowest(10)), k, m, truth, 10);
  }
}

}  // namespace espalier
