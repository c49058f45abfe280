#include "matrix/generators/generate.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "matrix/generators/families.hpp"
#include "matrix/generators/hex8.hpp"
#include "matrix/helpers.hpp"
#include "matrix/norms.hpp"
#include "matrix/transform.hpp"
#include "matrix/triplets.hpp"
#include "matrix/validate.hpp"

namespace espalier::matrix {
namespace generate_test {

constexpr double kEps = std::numeric_limits<double>::epsilon();

GeneratorSpec spec_of(const std::string& text) {
  std::vector<std::string> words;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(' ', begin), text.size());
    words.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parse_generator(words);
}

SparseMatrix generated(const std::string& text) { return generate(spec_of(text)); }

struct Signs {
  int positive = 0, negative = 0, zero = 0;
};

// Signs of the eigenvalues; zero is below n eps |lambda|max.
Signs inertia(const SparseMatrix& a) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(dense(a), Eigen::EigenvaluesOnly);
  const auto& values = eigen.eigenvalues();
  const double tolerance = static_cast<double>(a.rows) * kEps * values.cwiseAbs().maxCoeff();
  Signs s;
  for (const double v : values) ++(std::abs(v) <= tolerance ? s.zero : v > 0 ? s.positive : s.negative);
  return s;
}

// Truth: the sizes named in the project's list of benchmark systems.
TEST(Generate, UnknownsByFormula) {
  const std::pair<const char*, std::int64_t> known[] = {{"elasticity 20", 26460},      {"elasticity 40 40 40", 201720},
                                                        {"elasticity 64", 811200},     {"elasticity 96", 2709792},
                                                        {"plate 200 200", 241200},     {"plate 1200", 8647200},
                                                        {"kkt 20 20 8 8", 102120},     {"kkt 2", 10212},
                                                        {"kkt 200 3 2 2", 22200},      {"kkt 1000 2 1 1", 39000},
                                                        {"kkt 400 10 8 8", 1070400},   {"kkt 20 3x2x2", 2220},
                                                        {"gyroscopic 24", 45000},      {"gyro 48", 345744},
                                                        {"poisson 30", 27000},         {"kkt-redundant 3 2", 10215},
                                                        {"shell 100 60", 36600},       {"kkt-scaled 2", 10212},
                                                        {"elasticity-mass 40", 201720}};
  for (const auto& [words, n] : known) EXPECT_EQ(unknowns(spec_of(words)), n) << words;
}

const char* const kSmall[] = {"elasticity 3 2 4",        "plate 5 4",        "shell 4 6",
                              "poisson 5 4 3",           "kkt 3 2 1 2",      "kkt-scaled 3 2 1 2",
                              "kkt-redundant 2 3 2 1 2", "gyroscopic 3 2 2", "elasticity-mass 3 2 2"};

TEST(Generate, ValidSortedOfTheRightSize) {
  for (const auto* words : kSmall) {
    const auto spec = spec_of(words);
    const auto a = generate(spec);
    validate(a);
    EXPECT_EQ(a.rows, unknowns(spec)) << words;
    EXPECT_TRUE(is_sorted_unique(a)) << words;
    EXPECT_EQ(a.storage, spec.family == Family::gyroscopic ? Storage::general : Storage::symmetric_lower);
    EXPECT_EQ(describe(spec_of(describe(spec))), describe(spec));
  }
}

// Truth: one thread, bit for bit; another seed gives another matrix.
TEST(Generate, ReproducibleForAnyNumberOfThreads) {
  base::ThreadPool pool(3);
  for (const auto* words : kSmall) {
    auto spec = spec_of(words);
    const auto a = generate(spec), b = generate(spec, &pool);
    EXPECT_EQ(a.values, b.values) << words;
    EXPECT_EQ(a.row_ind, b.row_ind) << words;
    spec.seed = 2;
    const auto c = generate(spec);
    EXPECT_TRUE(c.row_ind != a.row_ind || c.values != a.values) << words;
    if (spec.family != Family::kkt_redundant) {
      EXPECT_EQ(c.nonzeros(), a.nonzeros()) << words;
    }
  }
}

// Truth: dense Cholesky.
TEST(Generate, PositiveDefiniteFamilies) {
  for (const auto* words :
       {"elasticity 3 2 4", "elasticity 1", "plate 6 5", "shell 5 6", "poisson 5 4 3", "poisson 1"}) {
    const Eigen::LLT<Eigen::MatrixXd> llt(dense(generated(words)));
    EXPECT_EQ(llt.info(), Eigen::Success) << words;
  }
}

// Truth: dense eigenvalues. A chain has as many negative eigenvalues as multipliers; scaling by powers of two keeps the
// inertia (Sylvester); k redundant rows add exactly k zero eigenvalues.
TEST(Generate, InertiaOfKktFamilies) {
  struct Case {
    const char* words;
    int negative, zero;
  };
  for (const auto& c : {Case{"kkt 3 2 1 2", 9, 0}, Case{"kkt 1 2 2 2", 3, 0}, Case{"kkt-redundant 2 3 2 1 2", 9, 2},
                        Case{"kkt-redundant 5 1 1 1 1", 3, 5}}) {
    const auto a = generated(c.words);
    const Signs s = inertia(a);
    EXPECT_EQ(s.negative, c.negative) << c.words;
    EXPECT_EQ(s.zero, c.zero) << c.words;
    EXPECT_EQ(s.positive, a.rows - c.negative - c.zero) << c.words;
  }
}

// Truth: in natural numbering D A D divided by powers of two is A, bit for bit, and the scales spread over 12 decades.
TEST(Generate, BadScalingIsExact) {
  auto spec = spec_of("kkt 3 2 1 2");
  spec.numbering = Numbering::natural;
  const auto a = generate(spec);
  spec.family = Family::kkt_scaled;
  const auto b = generate(spec);
  ASSERT_EQ(a.row_ind, b.row_ind);
  std::vector<int> power(static_cast<std::size_t>(a.rows), 1000);
  // Diagonals of the bodies give their own powers.
  int least = 1000, most = -1000;
  for (std::size_t j = 0; j < power.size(); ++j) {
    const auto p = static_cast<std::size_t>(a.col_ptr[j]);
    if (a.col_ptr[j] == a.col_ptr[j + 1] || a.row_ind[p] != static_cast<Index>(j)) continue;
    power[j] = std::ilogb(b.values[p] / a.values[p]) / 2;
    least = std::min(least, power[j]);
    most = std::max(most, power[j]);
  }
  EXPECT_LE(least, -15);
  EXPECT_GE(most, 15);
  for (std::size_t j = 0; j < power.size(); ++j)
    for (Offset k = a.col_ptr[j]; k < a.col_ptr[j + 1]; ++k) {
      const auto p = static_cast<std::size_t>(k);
      const auto i = static_cast<std::size_t>(a.row_ind[p]);
      if (power[i] == 1000 || power[j] == 1000) continue;
      EXPECT_EQ(b.values[p], std::ldexp(a.values[p], power[i] + power[j]));
    }
}

// Truth: random numbering is a permutation of natural numbering that keeps groups of three together.
TEST(Generate, RandomNumberingPermutesGroups) {
  auto spec = spec_of("elasticity 3 2 2");
  const auto a = generate(spec);
  spec.numbering = Numbering::natural;
  const auto b = generate(spec);
  EXPECT_NE(a.row_ind, b.row_ind);
  Eigen::VectorXd ea = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(dense(a)).eigenvalues();
  Eigen::VectorXd eb = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(dense(b)).eigenvalues();
  EXPECT_LE((ea - eb).cwiseAbs().maxCoeff(), a.rows * kEps * eb.maxCoeff());
  const auto full = to_general(a);
  for (Index j = 0; j < full.cols; j += 3)  // the three unknowns of a node have the same neighbours
    for (Index k = 1; k < 3; ++k) {
      const auto c0 = static_cast<std::size_t>(j), c1 = static_cast<std::size_t>(j + k);
      ASSERT_EQ(full.col_ptr[c0 + 1] - full.col_ptr[c0], full.col_ptr[c1 + 1] - full.col_ptr[c1]);
      EXPECT_TRUE(std::equal(full.row_ind.begin() + full.col_ptr[c0], full.row_ind.begin() + full.col_ptr[c0 + 1],
                             full.row_ind.begin() + full.col_ptr[c1]));
    }
}

// Truth: assembly by definition, element after element into a dense matrix.
TEST(Generate, ElasticityIsTheSumOfItsElements) {
  auto spec = spec_of("elasticity 2 2 1");
  spec.numbering = Numbering::natural;
  const auto a = generate(spec);
  const HexStiffness k = hex8_stiffness(hex_box(1, 1, 1), 1.0, 0.3);
  // The factors are not known here; they are found from single entries, then all entries must agree.
  const auto node = [](Index x, Index y, Index z) { return (x - 1) * 6 + y * 2 + z; };
  const Eigen::MatrixXd d = dense(a);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(d.rows(), d.cols());
  for (Index ex = 0; ex < 2; ++ex)
    for (Index ey = 0; ey < 2; ++ey) {
      const auto at = [&](std::size_t c) {
        return std::array<Index, 3>{ex + static_cast<Index>(c & 1), ey + static_cast<Index>(c >> 1 & 1),
                                    static_cast<Index>(c >> 2)};
      };
      // Corners 1 and 7 differ in y and z and stand on the far face: only this element holds both.
      const auto p = at(1), q = at(7);
      const double f = d(3 * node(p[0], p[1], p[2]), 3 * node(q[0], q[1], q[2])) / (ex == 0 ? 1.0 : k[3 * 24 + 21]);
      double factor = f;
      if (ex == 0) {  // the face x = 1 belongs to two elements; take away the other one's part
        const auto r = at(1), s = at(7);
        const HexStiffness& e = k;
        const double other = d(3 * node(2, r[1], r[2]), 3 * node(2, s[1], s[2])) / e[3 * 24 + 21];
        factor = (f - other * e[0 * 24 + 18]) / e[3 * 24 + 21];
      }
      EXPECT_GE(factor, 0.7 - 10 * kEps);
      EXPECT_LT(factor, 1.3 + 10 * kEps);
      for (std::size_t u = 0; u < 8; ++u)
        for (std::size_t v = 0; v < 8; ++v) {
          const auto pu = at(u), pv = at(v);
          if (pu[0] == 0 || pv[0] == 0) continue;
          for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = 0; j < 3; ++j)
              sum(3 * node(pu[0], pu[1], pu[2]) + static_cast<Index>(i),
                  3 * node(pv[0], pv[1], pv[2]) + static_cast<Index>(j)) += factor * k[(3 * u + i) * 24 + 3 * v + j];
        }
    }
  EXPECT_LE((d - sum).cwiseAbs().maxCoeff(), 1000 * kEps);
}

// Truth: K is symmetric and the coupling skew, so the symmetric part is the elasticity matrix of the same seed, and the
// sum of the (x, y) coupling over all nodes of a box is 0.8 times the mass that is not clamped.
TEST(Generate, GyroscopicIsElasticityPlusSkew) {
  auto spec = spec_of("gyroscopic 3 2 2");
  const auto g = generate(spec);
  spec.family = Family::elasticity;
  const auto k = generate(spec);
  const Eigen::MatrixXd dg = dense(g), dk = dense(k);
  EXPECT_LE(((dg + dg.transpose()) / 2 - dk).cwiseAbs().maxCoeff(), 4 * kEps);
  const Eigen::MatrixXd skew = (dg - dg.transpose()) / 2;
  EXPECT_GT(skew.cwiseAbs().maxCoeff(), 0.01);
  double coupling = 0;
  for (Index a = 0; a < skew.rows(); a += 3)
    for (Index b = 0; b < skew.cols(); b += 3) {
      coupling += skew(a, b + 1);
      EXPECT_LE(std::abs(skew(a, b)), 4 * kEps);
      EXPECT_LE(std::abs(skew(a + 2, b)), 4 * kEps);
      EXPECT_NEAR(skew(a, b + 1), -skew(a + 1, b), 4 * kEps);
    }
  // Integral of (sum of the free N_a)^2 over the box: free nodes sum to 1 but in the first layer, where they sum to x.
  EXPECT_NEAR(coupling, 0.8 * (2 * 2 * (2 + 1.0 / 3)), 1000 * kEps);
  EXPECT_TRUE(structure_is_symmetric(g));
  EXPECT_FALSE(values_are_symmetric(g));
}

// Truth: the coupling of the gyroscopic system of the same seed is 0.8 times the mass between x and y.
TEST(Generate, MassOfElasticityInItsNumbering) {
  auto spec = spec_of("gyroscopic 3 2 2");
  const Eigen::MatrixXd g = dense(generate(spec)), skew = (g - g.transpose()) / 2;
  spec.family = Family::elasticity_mass;
  const Eigen::MatrixXd m = dense(generate(spec));
  ASSERT_EQ(m.rows(), skew.rows());
  for (Index a = 0; a < m.rows(); a += 3)
    for (Index b = 0; b < m.cols(); b += 3)
      for (Index i = 0; i < 3; ++i)
        for (Index k = 0; k < 3; ++k) EXPECT_NEAR(m(a + i, b + k), i == k ? skew(a, b + 1) / 0.8 : 0.0, 8 * kEps);
  EXPECT_EQ(Eigen::LLT<Eigen::MatrixXd>(m).info(), Eigen::Success);
}

// Truth: rigid translations of a body of the chain have no strain, so u^T (K + M/2) u = mass / 2; the rows of a joint
// sum to 1 over a face and to 0 over both.
TEST(Generate, ChainOfBodies) {
  auto spec = spec_of("kkt 2 2 1 3");
  spec.numbering = Numbering::natural;
  const Eigen::MatrixXd d = dense(generate(spec));
  const Index body = 3 * 3 * 2 * 4;
  ASSERT_EQ(d.rows(), 2 * body + 6);
  for (Index b = 0; b < 2; ++b)
    for (Index direction = 0; direction < 3; ++direction) {
      Eigen::VectorXd u = Eigen::VectorXd::Zero(d.rows());
      for (Index i = direction; i < body; i += 3) u(b * body + i) = 1;
      EXPECT_NEAR(u.dot(d * u), 0.5 * (2 * 1 * 3), 1000 * kEps);
      const Eigen::VectorXd forces = (d * u).tail(6);
      Eigen::VectorXd expected = Eigen::VectorXd::Zero(6);
      if (b == 0) expected(direction) = -1, expected(3 + direction) = 1;
      if (b == 1) expected(3 + direction) = -1;
      EXPECT_LE((forces - expected).cwiseAbs().maxCoeff(), 100 * kEps);
    }
  EXPECT_EQ(d.bottomRightCorner(6, 6).cwiseAbs().maxCoeff(), 0);
}

// Truth: eigenvalues of the 7-point Laplacian, 6 - 2 (cos + cos + cos).
TEST(Generate, PoissonSpectrum) {
  const auto a = generated("poisson 4 3 2");
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(dense(a)).eigenvalues();
  std::vector<double> expected;
  for (int x = 1; x <= 4; ++x)
    for (int y = 1; y <= 3; ++y)
      for (int z = 1; z <= 2; ++z)
        expected.push_back(6 - 2 * (std::cos(x * M_PI / 5) + std::cos(y * M_PI / 4) + std::cos(z * M_PI / 3)));
  std::sort(expected.begin(), expected.end());
  for (Index i = 0; i < a.rows; ++i) EXPECT_NEAR(values(i), expected[static_cast<std::size_t>(i)], 24 * 12 * kEps);
}

TEST(Generate, WordsThatAreWrong) {
  expect_error([] { (void)spec_of(""); }, {"no system", "elasticity NX"});
  expect_error([] { (void)spec_of("cube 3"); }, {"'cube'", "known systems"});
  expect_error([] { (void)spec_of("elasticity"); }, {"3 sizes", "found 0"});
  expect_error([] { (void)spec_of("elasticity 3 4"); }, {"found 2"});
  expect_error([] { (void)spec_of("plate 3 4 5"); }, {"2 sizes"});
  expect_error([] { (void)spec_of("elasticity 0"); }, {"size 0"});
  expect_error([] { (void)spec_of("elasticity -4"); }, {"size -4"});
  expect_error([] { (void)spec_of("elasticity 4y4"); }, {"'4y4'"});
  expect_error([] { (void)spec_of("elasticity 4x"); }, {"'4x'"});
  expect_error([] { (void)spec_of("elasticity 99999999999999999999"); }, {"not a size"});
  expect_error([] { (void)spec_of("kkt"); }, {"bodies"});
  expect_error([] { (void)spec_of("kkt-redundant 3"); }, {"bodies"});
  expect_error([] { (void)generated("elasticity 1000"); }, {"2^31"});
  // 1 TB: more than any machine that runs tests.
  (void)message_of([] { (void)generated("elasticity 890 890 890"); }, StatusCode::out_of_memory);
}

}  // namespace generate_test
}  // namespace espalier::matrix
