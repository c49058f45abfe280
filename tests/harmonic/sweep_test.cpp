// Frequency responses at given points: closed forms, a dense reference, resonances, bad input.
#include "harmonic/harmonic_common.hpp"

namespace espalier {
namespace {

using test::Complex;
using test::kI;
using test::kTwoPi;
using test::range;
using test::scalar;
using test::sparse;

// Truth: 1 / (k (1 + i eta) + i w c - w^2 m).
TEST(Harmonic, OneMassIsItsClosedForm) {
  const double k = 400, c = 0.7, m = 2.5, eta = 0.02;
  const std::vector<Complex> f = {{3, 1}};
  for (const bool logarithmic : {false, true}) {
    HarmonicOptions o = range(0.1, 9, 40);
    o.loss_factor = eta;
    o.logarithmic = logarithmic;
    const HarmonicResult r = harmonic_response(scalar(k), scalar(c), scalar(m), f, 1, o);
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    ASSERT_EQ(r.points.size(), 40U);
    EXPECT_EQ(r.points.front().frequency, 0.1);
    EXPECT_EQ(r.points.back().frequency, 9);
    for (std::size_t i = 0; i < r.points.size(); ++i) {
      const double w = kTwoPi * r.points[i].frequency;
      const Complex truth = f[0] / (k * Complex(1, eta) + kI * w * c - w * w * m);
      EXPECT_LE(std::abs(r.response(i, 0, 0) - truth), 1e-13 * std::abs(truth)) << r.points[i].frequency;
      EXPECT_LE(r.points[i].backward_error, 1e-15);
      EXPECT_TRUE(r.points[i].solved);
    }
  }
}

// Truth: two equal masses, springs k to the walls and k2 between: x1 +- x2 decouple.
TEST(Harmonic, TwoMassesAreTheirClosedForm) {
  const double k = 100, k2 = 30, c = 0.3;
  Eigen::MatrixXd stiffness(2, 2);
  stiffness << k + k2, -k2, -k2, k + k2;
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(2, 2);
  const std::vector<Complex> f = {1.0, 0.0};
  const HarmonicResult r = harmonic_response(sparse(stiffness), sparse(c * one), sparse(one), f, 1, range(0, 4, 33));
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  for (std::size_t i = 0; i < r.points.size(); ++i) {
    const double w = kTwoPi * r.points[i].frequency;
    const Complex together = 1.0 / (k + kI * w * c - w * w), apart = 1.0 / (k + 2 * k2 + kI * w * c - w * w);
    EXPECT_LE(std::abs(r.response(i, 0, 0) - 0.5 * (together + apart)), 1e-13 * std::abs(together));
    EXPECT_LE(std::abs(r.response(i, 0, 1) - 0.5 * (together - apart)), 1e-13 * std::abs(together));
  }
}

// Truth: a rod, clamped, pulled at its end: u(L) = tan(b L) / (E A b), b = w / sqrt(E / rho); with a loss factor E is
// complex. Linear elements with lumped and consistent mass in equal parts are exact to fourth order.
TEST(Harmonic, ARodIsItsClosedForm) {
  constexpr int n = 400;
  const double h = 1.0 / n, eta = 0.01;
  Eigen::MatrixXd k = test::chain(n) / h, m = Eigen::MatrixXd::Zero(n, n);
  k(n - 1, n - 1) = 1 / h;
  for (int i = 0; i < n; ++i) {
    m(i, i) = (i + 1 < n ? 10.0 : 5.0) / 12 * h;
    if (i > 0) m(i, i - 1) = m(i - 1, i) = h / 12;
  }
  std::vector<Complex> f(n);
  f[n - 1] = 1;
  HarmonicOptions o = range(0.05, 2.2, 87);
  o.loss_factor = eta;
  o.observed = {n - 1};
  const HarmonicResult r = harmonic_response(sparse(k), {}, sparse(m), f, 1, o);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_EQ(r.outputs, 1);
  for (std::size_t i = 0; i < r.points.size(); ++i) {
    const double w = kTwoPi * r.points[i].frequency;
    const Complex e(1, eta), b = w / std::sqrt(e), truth = std::tan(b) / (e * b);
    // Waves travel with an error of (w h)^4 / 480; the end, where the force acts, answers with one of (w h)^2 / 24.
    EXPECT_LE(std::abs(r.response(i, 0, 0) - truth), (2e-6 + std::pow(w * h, 2) / 12) * std::abs(truth))
        << r.points[i].frequency;
  }
}

// Truth: Eigen's dense L U, of symmetric and unsymmetric matrices, several loads.
TEST(Harmonic, IsTheDenseAnswer) {
  constexpr int n = 40;
  std::mt19937 engine(7);
  std::uniform_real_distribution<double> uniform(0.5, 1.5);
  const Eigen::MatrixXd k = test::chain(n);
  Eigen::MatrixXd c = Eigen::MatrixXd::Zero(n, n), m = c, g = c;
  for (int i = 0; i < n; ++i) m(i, i) = uniform(engine);
  for (int i = 0; i < n; i += 5) c(i, i) = 0.2 * uniform(engine);
  for (int i = 1; i < n; ++i) g(i, i - 1) = -(g(i - 1, i) = 0.1 * uniform(engine));
  Eigen::MatrixXcd f = Eigen::MatrixXcd::Random(n, 3);
  for (const bool gyroscopic : {false, true}) {
    const Eigen::MatrixXd damping = gyroscopic ? Eigen::MatrixXd(c + g) : c;
    HarmonicOptions o = range(0.01, 0.4, 25);
    o.observed = {n - 1, 0, 7};
    o.shapes_at = {0.2, 0.1};
    const HarmonicResult r = harmonic_response(sparse(k), sparse(damping), sparse(m), test::flat(f), 3, o);
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    ASSERT_EQ(r.points.size(), 27U);  // the frequencies of shapes are points, too
    for (std::size_t i = 0; i < r.points.size(); ++i) {
      const Eigen::MatrixXcd x = test::dense_response(k, damping, m, 0, f, r.points[i].frequency);
      for (Index l = 0; l < 3; ++l)
        for (Index j = 0; j < 3; ++j)
          EXPECT_LE(std::abs(r.response(i, l, j) - x(o.observed[static_cast<std::size_t>(j)], l)), 1e-11 * x.norm());
      EXPECT_LE(r.points[i].backward_error, 1e-14);
    }
    ASSERT_EQ(r.shape_frequencies, (std::vector<double>{0.1, 0.2}));
    ASSERT_EQ(r.shapes.size(), 2U * 3 * n);
    const Eigen::MatrixXcd x = test::dense_response(k, damping, m, 0, f, 0.2);
    EXPECT_LE((Eigen::Map<const Eigen::MatrixXcd>(r.shapes.data() + 3 * n, n, 3) - x).norm(), 1e-11 * x.norm());
    EXPECT_EQ(r.factorizations, 27);
  }
}

// Rows of constraints: x_0 follows x_1 by a multiplier; truth: the same system with both as one.
TEST(Harmonic, ConstraintsByMultipliersHold) {
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(3, 3), c = k, m = k;
  k << 5, 0, 1, 0, 2, -1, 1, -1, 0;
  m.diagonal() << 1, 2, 0;
  c.diagonal() << 0.1, 0, 0;
  const std::vector<Complex> f = {1.0, 0.0, 0.0};
  const HarmonicResult r = harmonic_response(sparse(k), sparse(c), sparse(m), f, 1, range(0, 1, 21));
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  for (std::size_t i = 0; i < r.points.size(); ++i) {
    const double w = kTwoPi * r.points[i].frequency;
    const Complex truth = 1.0 / (7.0 + kI * w * 0.1 - 3 * w * w);
    EXPECT_LE(std::abs(r.response(i, 0, 0) - truth), 1e-13 * std::abs(truth));
    EXPECT_LE(std::abs(r.response(i, 0, 1) - truth), 1e-13 * std::abs(truth));
  }
}

// Several frequencies at the same time: the bits of one thread, of a symmetric, an unsymmetric and a bordered system,
// at given and at chosen frequencies, and in whatever company a frequency is solved.
TEST(Harmonic, ThreadsAndCompanyDoNotChangeTheBits) {
  constexpr int n = 40;
  std::mt19937 engine(11);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Eigen::MatrixXd k = test::chain(n), c = 0.01 * k, m = Eigen::MatrixXd::Identity(n, n), g = c;
  for (int i = 1; i < n; ++i) g(i, i - 1) = -(g(i - 1, i) = 0.1 * uniform(engine));
  Eigen::MatrixXd bordered = k, massless = m, damped = c;
  for (const int i : {9, 16, 26}) {  // the last masses are multipliers of constraints
    const int row = n - 1 - i % 3;
    bordered.row(row).setZero(), bordered.col(row).setZero();
    bordered(row, i) = bordered(i, row) = 1;
    bordered(row, i + 1) = bordered(i + 1, row) = -1;
    massless.row(row).setZero(), massless.col(row).setZero();
    damped.row(row).setZero(), damped.col(row).setZero();
  }
  const std::vector<Complex> f = test::flat(Eigen::MatrixXcd::Identity(n, 2));
  struct Setting {
    const Eigen::MatrixXd &k, &c, &m;
  };
  for (const Setting& one : {Setting{k, c, m}, Setting{k, g, m}, Setting{bordered, damped, massless}})
    for (const double tolerance : {0.0, 1e-4}) {
      HarmonicOptions o = range(0.005, 0.3, 25, tolerance);
      o.observed = {3, 15};
      o.shapes_at = {0.1, 0.2};
      const HarmonicResult alone = harmonic_response(sparse(one.k), sparse(one.c), sparse(one.m), f, 2, o);
      ASSERT_TRUE(alone.status.ok()) << alone.status.message;
      for (const int threads : {2, 5}) {
        o.solver.threads = threads;
        const HarmonicResult r = harmonic_response(sparse(one.k), sparse(one.c), sparse(one.m), f, 2, o);
        EXPECT_EQ(r.factorizations, alone.factorizations);
        EXPECT_EQ(r.responses, alone.responses) << threads;
        EXPECT_EQ(r.shapes, alone.shapes) << threads;
      }
      if (tolerance > 0) continue;
      // The analysis is that of the first frequency: the others have the same bits without the company between.
      o.frequencies = {alone.points[0].frequency, alone.points[20].frequency};
      o.shapes_at.clear();
      const HarmonicResult two = harmonic_response(sparse(one.k), sparse(one.c), sparse(one.m), f, 2, o);
      for (Index l = 0; l < 2; ++l)
        for (Index i = 0; i < 2; ++i) EXPECT_EQ(two.response(1, l, i), alone.response(20, l, i));
    }
}

// A frequency on an undamped resonance, as near as numbers are: that point says so, the others are right.
TEST(Harmonic, AnUndampedResonanceIsSaid) {
  constexpr int n = 30;
  const Eigen::MatrixXd k = test::chain(n), one = Eigen::MatrixXd::Identity(n, n);
  const double resonance = 2 * std::sin(3 * std::numbers::pi / (2 * (n + 1))) / kTwoPi;
  std::vector<Complex> f(n);
  f[0] = 1;
  HarmonicOptions o = range(0, 0, 2);
  o.frequencies = {0.9 * resonance, resonance, 1.1 * resonance, (1 + 1e-6) * 1.2 * resonance};
  const HarmonicResult r = harmonic_response(sparse(k), {}, sparse(one), f, 1, o);
  EXPECT_EQ(r.status.code, StatusCode::singular);
  EXPECT_NE(r.status.message.find("resonance without damping"), std::string::npos) << r.status.message;
  ASSERT_EQ(r.points.size(), 4U);
  for (const std::size_t i : {0U, 2U, 3U}) {
    ASSERT_TRUE(r.points[i].status.ok()) << r.points[i].status.message;
    const Eigen::MatrixXcd x =
        test::dense_response(k, 0 * k, one, 0, Eigen::MatrixXcd(Eigen::VectorXcd::Unit(n, 0)), r.points[i].frequency);
    EXPECT_LE(std::abs(r.response(i, 0, 4) - x(4, 0)), 1e-11 * x.norm());
  }
  EXPECT_EQ(r.points[1].status.code, StatusCode::singular);
  EXPECT_TRUE(std::isnan(r.response(1, 0, 4).real()));
  // The same with one mass, whose Z is a rounding error there, not zero; near it, the answer is given.
  o.frequencies = {std::sqrt(3.0) / kTwoPi, std::sqrt(3.0) / kTwoPi * (1 + 1e-9)};
  const HarmonicResult one_mass = harmonic_response(scalar(3), {}, scalar(1), std::vector<Complex>{1.0}, 1, o);
  ASSERT_EQ(one_mass.points.size(), 2U);
  EXPECT_EQ(one_mass.points[0].status.code, StatusCode::singular);
  EXPECT_TRUE(one_mass.points[1].status.ok()) << one_mass.points[1].status.message;
  EXPECT_NEAR(one_mass.response(1, 0, 0).real() * -6e-9, 1, 1e-6);
}

TEST(Harmonic, SaysWhatCannotBe) {
  const SparseMatrix a = sparse(test::chain(4)), one = sparse(Eigen::MatrixXd::Identity(4, 4)),
                     three = sparse(Eigen::MatrixXd::Identity(3, 3)), zero = sparse(Eigen::MatrixXd::Zero(4, 4));
  const std::vector<Complex> f = {1.0, 0.0, 0.0, 0.0};
  const auto code = [&](const HarmonicOptions& o) { return harmonic_response(a, {}, one, f, 1, o).status.code; };
  const HarmonicOptions good = range(0.1, 0.2, 3);
  ASSERT_EQ(code(good), StatusCode::ok);
  const auto expect_refused = [&](const std::function<void(HarmonicOptions&)>& spoil, const char* word) {
    HarmonicOptions o = good;
    spoil(o);
    const Status s = harmonic_response(a, {}, one, f, 1, o).status;
    EXPECT_EQ(s.code, StatusCode::invalid_input) << word;
    EXPECT_NE(s.message.find(word), std::string::npos) << s.message;
  };
  expect_refused([](HarmonicOptions& o) { o.from = -1; }, "from = -1");
  expect_refused([](HarmonicOptions& o) { o.to = NAN; }, "to = nan");
  expect_refused([](HarmonicOptions& o) { o.to = INFINITY; }, "to = inf");
  expect_refused([](HarmonicOptions& o) { o.to = 0.05; }, "must be above from");
  expect_refused([](HarmonicOptions& o) { o.points = 1; }, "points = 1");
  expect_refused([](HarmonicOptions& o) { o.points = -7; }, "points = -7");
  expect_refused([](HarmonicOptions& o) { o.to = o.from * (1 + 1e-15), o.points = 100; }, "cannot be told apart");
  expect_refused([](HarmonicOptions& o) { o.from = 0, o.logarithmic = true; }, "equal ratios");
  expect_refused([](HarmonicOptions& o) { o.frequencies = {1, 1}; }, "must rise");
  expect_refused([](HarmonicOptions& o) { o.frequencies = {-1, 1}; }, "at least 0");
  expect_refused([](HarmonicOptions& o) { o.frequencies = {1}, o.tolerance = 1e-3; }, "range of frequencies");
  expect_refused([](HarmonicOptions& o) { o.tolerance = 2; }, "tolerance = 2");
  expect_refused([](HarmonicOptions& o) { o.tolerance = -1e-3; }, "tolerance");
  expect_refused([](HarmonicOptions& o) { o.tolerance = NAN; }, "tolerance");
  expect_refused([](HarmonicOptions& o) { o.loss_factor = -0.1; }, "loss_factor");
  expect_refused([](HarmonicOptions& o) { o.observed = {4}; }, "observed: 4");
  expect_refused([](HarmonicOptions& o) { o.max_solves = 0; }, "max_solves");
  expect_refused([](HarmonicOptions& o) { o.shapes_at = {-3}; }, "shapes_at");
  const auto refused = [&](const MatrixView& k, const MatrixView& c, const MatrixView& m, std::vector<Complex> load,
                           Index columns) {
    EXPECT_EQ(harmonic_response(k, c, m, load, columns, good).status.code, StatusCode::invalid_input);
  };
  refused(a, {}, three, f, 1);
  refused(a, three, one, f, 1);
  refused(a, {}, one, {}, 0);
  refused(a, {}, one, f, 2);
  refused(a, {}, one, {0.0, 0.0, 0.0, 0.0}, 1);
  refused(a, {}, one, {NAN, 0.0, 0.0, 0.0}, 1);
  refused({}, {}, {}, {}, 1);
  SparseMatrix nan = a;
  nan.values[0] = NAN;
  refused(nan, {}, one, f, 1);
  // Without mass there are no resonances: K + i w C is solved; without anything nothing is.
  EXPECT_EQ(harmonic_response(a, one, zero, f, 1, good).status.code, StatusCode::ok);
  EXPECT_EQ(harmonic_response(zero, {}, zero, f, 1, good).status.code, StatusCode::singular);
  HarmonicOptions stopped = good;
  stopped.solver.interrupted = [] { return true; };
  stopped.solver.interrupted_every = 0;
  EXPECT_EQ(code(stopped), StatusCode::cancelled);
}

// Factors beside each other hear of a stop within themselves, not between two frequencies alone: the caller is asked at
// each of their pieces of work.
TEST(Harmonic, AStopIsHeardWithinAFactorization) {
  const auto generated = [](std::vector<std::string> words) {
    return matrix::generate(matrix::parse_generator(words));
  };
  const SparseMatrix k = generated({"elasticity", "6"}), m = generated({"elasticity-mass", "6"});
  std::vector<Complex> f(static_cast<std::size_t>(k.rows));
  f[0] = 1;
  int asked = 0;
  HarmonicOptions o = range(0, 1, 20);
  o.loss_factor = 0.01;
  o.solver.threads = 2;
  o.solver.interrupted_every = 0;
  o.solver.interrupted = [&] { return ++asked < 0; };
  ASSERT_TRUE(harmonic_response(k, {}, m, f, 1, o).status.ok());
  // Threads that wait ask as well: how often depends on the machine. Without them it is some 19 times for each
  // frequency.
  EXPECT_GT(asked, 10 * o.points);
  for (const int after : {2 * o.points, 5 * o.points, 10 * o.points}) {
    asked = 0;
    o.solver.interrupted = [&] { return ++asked >= after; };
    EXPECT_EQ(harmonic_response(k, {}, m, f, 1, o).status.code, StatusCode::cancelled);
    EXPECT_EQ(asked, after);  // nobody asks again
  }
}

}  // namespace
}  // namespace espalier
