// Quadratic eigenvalue problems against the dense method on the linearization, and closed forms.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "espalier/modes.hpp"

namespace espalier {
namespace {

using Complex = std::complex<double>;

SparseMatrix general(const Eigen::MatrixXd& a) {
  SparseMatrix out;
  out.rows = static_cast<Index>(a.rows());
  out.cols = static_cast<Index>(a.cols());
  out.col_ptr.push_back(0);
  for (Eigen::Index j = 0; j < a.cols(); ++j) {
    for (Eigen::Index i = 0; i < a.rows(); ++i)
      if (a(i, j) != 0 || i == j) {
        out.row_ind.push_back(static_cast<Index>(i));
        out.values.push_back(a(i, j));
      }
    out.col_ptr.push_back(static_cast<Offset>(out.row_ind.size()));
  }
  return out;
}

// A chain of n masses with springs to its neighbours and to the ground.
Eigen::MatrixXd chain(int n, double ground) {
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < n; ++i) {
    k(i, i) = 2 + ground;
    if (i > 0) k(i, i - 1) = k(i - 1, i) = -1;
  }
  return k;
}

// All finite eigenvalues with imaginary part >= 0, by distance from the shift.
std::vector<Complex> dense(const Eigen::MatrixXd& k, const Eigen::MatrixXd& c, const Eigen::MatrixXd& m, double shift) {
  const Eigen::Index n = k.rows();
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  a.topRightCorner(n, n).setIdentity();
  a.bottomLeftCorner(n, n) = -m.inverse() * k;
  a.bottomRightCorner(n, n) = -m.inverse() * c;
  const Eigen::VectorXcd all = a.eigenvalues();
  std::vector<Complex> out;
  for (const Complex& l : all)
    if (l.imag() >= -1e-12 * std::abs(l)) out.push_back(l);
  std::sort(out.begin(), out.end(), [&](Complex x, Complex y) { return std::abs(x - shift) < std::abs(y - shift); });
  return out;
}

void expect_dense(const Eigen::MatrixXd& k, const Eigen::MatrixXd& c, const Eigen::MatrixXd& m, Index count,
                  double shift = -0.01) {
  QuadraticModesOptions options;
  options.count = count;
  options.shift = shift;
  options.solver.threads = 1;
  const QuadraticModesResult r = find_quadratic_modes(general(k), general(c), general(m), options);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  ASSERT_EQ(r.count(), count);
  const std::vector<Complex> truth = dense(k, c, m, shift);
  for (Index i = 0; i < count; ++i) {
    EXPECT_LT(std::abs(r.eigenvalues[static_cast<std::size_t>(i)] - truth[static_cast<std::size_t>(i)]),
              1e-8 * std::abs(truth[static_cast<std::size_t>(i)]))
        << i << r.eigenvalues[static_cast<std::size_t>(i)] << truth[static_cast<std::size_t>(i)];
    EXPECT_LT(r.residuals[static_cast<std::size_t>(i)], options.tolerance);
  }
}

TEST(QuadraticModes, AreThoseOfTheDenseMethod) {
  const int n = 60;
  std::mt19937 engine(3);
  std::uniform_real_distribution<double> uniform(0.5, 1.5);
  const Eigen::MatrixXd k = chain(n, 0.02);
  Eigen::MatrixXd m = Eigen::MatrixXd::Zero(n, n), c = Eigen::MatrixXd::Zero(n, n), g = c;
  for (int i = 0; i < n; ++i) m(i, i) = uniform(engine);
  for (int i = 0; i < n; i += 7) c(i, i) = uniform(engine);  // some dampers: not modal
  for (int i = 0; i + 1 < n; ++i) {
    g(i, i + 1) = 0.3 * uniform(engine);
    g(i + 1, i) = -g(i, i + 1);
  }
  expect_dense(k, c, m, 10);
  expect_dense(k, g, m, 10);                // gyroscopic: purely imaginary
  expect_dense(k, 30 * c, m, 10);           // overdamped parts: real eigenvalues
  expect_dense(k + 0.1 * g, c + g, m, 10);  // circulatory
  expect_dense(k, c, m, 6, 0.7);
}

// Truth: m x'' + c x' + k x of one mass; and a mass held by a multiplier beside it.
TEST(QuadraticModes, OfOneMassAndAConstraint) {
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(3, 3), c = k, m = k;
  k(0, 0) = 4;
  c(0, 0) = 0.4;
  m(0, 0) = m(1, 1) = 1;
  k(1, 1) = 1;
  k(1, 2) = k(2, 1) = 1;  // x_1 = 0
  QuadraticModesOptions options;
  options.count = 1;
  const QuadraticModesResult r = find_quadratic_modes(general(k), general(c), general(m), options);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_LT(std::abs(r.eigenvalues[0] - Complex(-0.2, std::sqrt(4 - 0.04))), 1e-12);
  EXPECT_LT(std::abs(r.vectors[1]), 1e-12);
}

TEST(QuadraticModes, SaysWhatCannotBe) {
  const SparseMatrix a = general(chain(4, 1)), zero = general(Eigen::MatrixXd::Zero(4, 4)), b = general(chain(3, 1));
  QuadraticModesOptions options;
  options.count = 2;
  EXPECT_EQ(find_quadratic_modes(a, zero, b, options).status.code, StatusCode::invalid_input);
  EXPECT_EQ(find_quadratic_modes(zero, zero, zero, options).status.code, StatusCode::singular);
  options.count = 0;
  EXPECT_EQ(find_quadratic_modes(a, zero, a, options).status.code, StatusCode::invalid_input);
  options.count = 9;  // more than there are: all of them
  EXPECT_EQ(find_quadratic_modes(a, zero, a, options).count(), 4);
  const SparseMatrix many = general(chain(200, 1)), none = general(Eigen::MatrixXd::Zero(200, 200));
  options.count = 201;
  EXPECT_EQ(find_quadratic_modes(many, none, many, options).status.code, StatusCode::invalid_input);
  options.count = 1;
  options.shift = -INFINITY;
  EXPECT_EQ(find_quadratic_modes(a, zero, a, options).status.code, StatusCode::invalid_input);
  SparseMatrix nan = a;
  nan.values[0] = NAN;
  options.shift = 0;
  EXPECT_EQ(find_quadratic_modes(nan, zero, a, options).status.code, StatusCode::invalid_input);
}

// A bicycle, two unknowns: M, C and K of the benchmark, and its eigenvalues. Truth: J. P. Meijaard, J. M. Papadopoulos,
// A. Ruina, A. L. Schwab, "Linearized dynamics equations for the balance and steer of a bicycle: a benchmark and
// review", Proc. Royal Society A 463, 2007, table 2.
TEST(QuadraticModes, OfABicycle) {
  Eigen::MatrixXd m(2, 2), c1(2, 2), k0(2, 2), k2(2, 2);
  m << 80.81722, 2.31941332208709, 2.31941332208709, 0.29784188199686;
  c1 << 0, 33.86641391492494, -0.85035641456978, 1.68540397397560;
  k0 << -80.95, -2.59951685249872, -2.59951685249872, -0.80329488458618;
  k2 << 0, 76.59734589573222, 0, 2.65431523794604;
  const auto at = [&](double speed, std::vector<Complex> truth) {
    QuadraticModesOptions options;
    options.count = 4;
    const QuadraticModesResult r =
        find_quadratic_modes(general(9.81 * k0 + speed * speed * k2), general(speed * c1), general(m), options);
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    ASSERT_EQ(r.count(), static_cast<Index>(truth.size()));
    for (const Complex& l : r.eigenvalues) {
      double nearest = 1e300;
      for (const Complex& t : truth) nearest = std::min(nearest, std::abs(l - t));
      EXPECT_LT(nearest, 1e-11 * std::abs(l)) << speed << ": " << l;
    }
  };
  at(0, {-3.13164324790656, 3.13164324790656, -5.53094371765393, 5.53094371765393});
  at(5, {{-0.77534188219585, 4.46486771378823}, -0.32286642900409, -14.07838969279822});
  at(10, {{-3.72016840437287, 10.90681139476287}, 0.16105338653172, -24.62459635017404});
}

// As many as there are, in small systems: 2 n real ones, n pairs, both twice where they are multiple; and in units that
// lie 10^6 apart. Truth: the dense method on the linearization.
TEST(QuadraticModes, AllOfSmallSystems) {
  for (const int n : {1, 2, 10, 24, 60, 150}) {
    const Eigen::MatrixXd k = chain(n, 0.1), m = Eigen::MatrixXd::Identity(n, n);
    expect_dense(k, 0.01 * m, m, n);
    expect_dense(k, 20 * m, m, 2 * n, -1e-3);  // overdamped
    Eigen::VectorXd units = Eigen::VectorXd::Ones(n);
    for (int i = 0; i < n; i += 2) units[i] = 1e6;
    const auto scaled = [&](const Eigen::MatrixXd& a) {
      return Eigen::MatrixXd(units.asDiagonal() * a * units.asDiagonal());
    };
    QuadraticModesOptions options;
    options.count = n;
    options.shift = -0.01;
    const QuadraticModesResult plain = find_quadratic_modes(general(k), general(0.01 * m), general(m), options);
    const QuadraticModesResult other =
        find_quadratic_modes(general(scaled(k)), general(scaled(0.01 * m)), general(scaled(m)), options);
    ASSERT_TRUE(other.status.ok()) << n << other.status.message;
    ASSERT_EQ(plain.count(), other.count());
    for (Index i = 0; i < plain.count(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      EXPECT_LT(std::abs(plain.eigenvalues[at] - other.eigenvalues[at]), 1e-10 * std::abs(plain.eigenvalues[at])) << n;
    }
  }
  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(4, 4);
  QuadraticModesOptions options;
  options.count = 8;
  const QuadraticModesResult r = find_quadratic_modes(general(4 * unit), general(0.1 * unit), general(unit), options);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_EQ(r.count(), 4);  // one of each pair
  for (const Complex& l : r.eigenvalues) EXPECT_LT(std::abs(l - Complex(-0.05, std::sqrt(4 - 0.0025))), 1e-13);
}

// Constraints, and unknowns without mass, leave finite eigenvalues alone. Truth: the problem in the null space of the
// constraints.
TEST(QuadraticModes, AllBesideConstraints) {
  std::mt19937 engine(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto random = [&](int rows, int cols) {
    Eigen::MatrixXd a(rows, cols);
    for (double& x : a.reshaped()) x = uniform(engine);
    return a;
  };
  for (const int n : {3, 10, 40}) {
    const int held = n / 3, size = n + held + 1;
    const Eigen::MatrixXd a = random(n, n), g = random(held, n), d = random(n, n);
    Eigen::MatrixXd k = Eigen::MatrixXd::Zero(size, size), c = k, m = k;
    k.topLeftCorner(n, n) = a * a.transpose();
    k.block(n, 0, held, n) = g;
    k.block(0, n, n, held) = g.transpose();
    k(size - 1, size - 1) = 2;  // without mass: follows unknown 0
    k(size - 1, 0) = k(0, size - 1) = 1;
    c.topLeftCorner(n, n) = d;
    m.topLeftCorner(n, n).setIdentity();
    Eigen::MatrixXd inner = a * a.transpose();
    inner(0, 0) -= 0.5;
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(g.transpose());
    const Eigen::MatrixXd z = (qr.householderQ() * Eigen::MatrixXd::Identity(n, n)).rightCols(n - held);
    const std::vector<Complex> truth =
        dense(z.transpose() * inner * z, z.transpose() * d * z, Eigen::MatrixXd::Identity(n - held, n - held), -0.01);
    QuadraticModesOptions options;
    options.count = 2 * size;
    options.shift = -0.01;
    const QuadraticModesResult r = find_quadratic_modes(general(k), general(c), general(m), options);
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    ASSERT_EQ(r.eigenvalues.size(), truth.size()) << n;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      EXPECT_LT(std::abs(r.eigenvalues[i] - truth[i]), 1e-9 * std::abs(truth[i])) << n << ", " << i;
      EXPECT_LT(r.residuals[i], 1e-12);
    }
  }
}

}  // namespace
}  // namespace espalier
