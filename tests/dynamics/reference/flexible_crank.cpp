#include "dynamics/reference/flexible_crank.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "dynamics/reference/extrapolation.hpp"

namespace espalier::dynamics {

namespace {

template <class Real>
using Vec4 = Eigen::Matrix<Real, 4, 1>;
template <class Real>
using Vec7 = Eigen::Matrix<Real, 7, 1>;

constexpr double kM2 = .151104, kM3 = .075552, kL1 = .15, kL2 = .30, kJ1 = .002727, kJ2 = .0045339259;
constexpr double kE = .20e12, kB = .0080, kH = .0080, kRho = 7870, kOmega = 150;
constexpr double kPi = 3.1415927;  // as the test set has it

// Matrices of the rod's finite elements; b, c without the density.
template <class Real>
struct Rod {
  using Vec = Vec4<Real>;
  Eigen::Matrix<Real, 4, 4> m, k, b;
  Vec c1, c2, c12, c21;
  Rod() {
    const Real pi = kPi, pi3 = pi * pi * pi, volume = Real(kB) * kH * kL2, mass = kRho * volume;
    const Real stiff = kE * Real(kB) * kH / kL2, bending = stiff * pi3 * pi * (Real(kH) / kL2) * (Real(kH) / kL2);
    m.setZero();
    k.setZero();
    b.setZero();
    m(0, 0) = m(1, 1) = mass / 2;
    m.template block<2, 2>(2, 2) << 8 * mass, mass, mass, 2 * mass;
    k(0, 0) = bending / 24;
    k(1, 1) = bending * 2 / 3;
    k.template block<2, 2>(2, 2) << 16 * stiff / 3, -8 * stiff / 3, -8 * stiff / 3, 7 * stiff / 3;
    b(0, 2) = -volume * 16 / pi3;
    b(0, 3) = volume * (8 / pi3 - 1 / pi);
    b(1, 3) = volume / 2 / pi;
    b = (b - b.transpose()).eval();
    c1 = volume * Vec(0, 0, Real(2) / 3, Real(1) / 6);
    c2 = volume * Vec(2 / pi, 0, 0, 0);
    c12 = kL2 * volume * Vec(0, 0, Real(1) / 3, Real(1) / 6);
    c21 = kL2 * volume * Vec(1 / pi, -1 / (2 * pi), 0, 0);
  }
};

template <class Real>
const Rod<Real>& rod() {
  static const Rod<Real> r;
  return r;
}

template <class Real>
Eigen::Matrix<Real, 7, 7> mass_of(const Vec7<Real>& q) {
  const Rod<Real>& r = rod<Real>();
  const Vec4<Real> e = q.template tail<4>();
  const Real s = std::sin(q[0] - q[1]), c = std::cos(q[0] - q[1]);
  Eigen::Matrix<Real, 7, 7> m = Eigen::Matrix<Real, 7, 7>::Zero();
  m(0, 0) = kJ1 + kM2 * Real(kL1) * kL1;
  m(0, 1) = m(1, 0) = kL1 * Real(kL2) * kM2 * c / 2 + kRho * Real(kL1) * (s * r.c2.dot(e) + c * r.c1.dot(e));
  m(1, 1) = kJ2 + e.dot(r.m * e) + 2 * kRho * r.c12.dot(e);
  m(2, 2) = kM3;
  const Vec4<Real> first = kRho * Real(kL1) * (c * r.c2 - s * r.c1);
  const Vec4<Real> second = kRho * (r.c21 + r.b.transpose() * e);
  m.template block<1, 4>(0, 3) = first.transpose();
  m.template block<4, 1>(3, 0) = first;
  m.template block<1, 4>(1, 3) = second.transpose();
  m.template block<4, 1>(3, 1) = second;
  m.template block<4, 4>(3, 3) = r.m;
  return m;
}

template <class Real>
Vec7<Real> force_of(const Vec7<Real>& q, const Vec7<Real>& v) {
  const Rod<Real>& r = rod<Real>();
  const Vec4<Real> e = q.template tail<4>(), rate = v.template tail<4>(), momentum = r.m * e, spin = r.b * rate;
  const Real s = std::sin(q[0] - q[1]), c = std::cos(q[0] - q[1]), w1 = v[0], w2 = v[1];
  const Real coupling = Real(kL1) * kL2 * kM2 / 2, moving = kRho * Real(kL1);
  Vec7<Real> f;
  f[0] = -coupling * w2 * w2 * s + moving * w2 * w2 * (c * r.c2.dot(e) - s * r.c1.dot(e)) -
         2 * moving * w2 * (c * r.c1.dot(rate) + s * r.c2.dot(rate));
  f[1] = coupling * w1 * w1 * s + moving * w1 * w1 * (s * r.c1.dot(e) - c * r.c2.dot(e)) -
         2 * kRho * w2 * r.c12.dot(rate) - 2 * w2 * rate.dot(momentum) - kRho * rate.dot(spin);
  f[2] = 0;
  f.template tail<4>() =
      w2 * w2 * (momentum + kRho * r.c12) + kRho * (kL1 * w1 * w1 * (c * r.c1 + s * r.c2) + 2 * w2 * spin) - r.k * e;
  return f;
}

// Phi_q and gamma; the rod's tip moves with q4 along the rod.
template <class Real>
Eigen::Matrix<Real, 3, 7> jacobian_of(const Vec7<Real>& q) {
  const Real length = kL2 + q[6], s2 = std::sin(q[1]), c2 = std::cos(q[1]);
  Eigen::Matrix<Real, 3, 7> g = Eigen::Matrix<Real, 3, 7>::Zero();
  g(0, 0) = kL1 * std::cos(q[0]);
  g(0, 1) = length * c2;
  g(0, 6) = s2;
  g(1, 0) = kL1 * std::sin(q[0]);
  g(1, 1) = length * s2;
  g(1, 2) = 1;
  g(1, 6) = -c2;
  g(2, 0) = 1;
  return g;
}

template <class Real>
Eigen::Matrix<Real, 3, 1> gamma_of(const Vec7<Real>& q, const Vec7<Real>& v) {
  const Real length = kL2 + q[6], s2 = std::sin(q[1]), c2 = std::cos(q[1]), w1 = v[0], w2 = v[1];
  return {kL1 * std::sin(q[0]) * w1 * w1 + length * s2 * w2 * w2 - 2 * w2 * c2 * v[6],
          -kL1 * std::cos(q[0]) * w1 * w1 - length * c2 * w2 * w2 - 2 * w2 * s2 * v[6], 0};
}

Vec7<double> seven(ConstSpan x) { return Eigen::Map<const Vec7<double>>(x.data()); }

void constraint(double t, ConstSpan q, Span phi) {
  const double length = kL2 + q[6];
  phi[0] = kL1 * std::sin(q[0]) + length * std::sin(q[1]);
  phi[1] = q[2] - kL1 * std::cos(q[0]) - length * std::cos(q[1]);
  phi[2] = q[0] - kOmega * t;
}

}  // namespace

DaeFunctions flexible_crank_functions() {
  DaeFunctions f;
  f.coordinates = 7;
  f.constraints = 3;
  f.mass = [](ConstSpan q, MatrixEntries out) {
    const auto m = mass_of<double>(seven(q));
    for (Index i = 0; i < 7; ++i) {
      for (Index j = 0; j < 7; ++j) out(i, j) = m(i, j);
    }
  };
  f.force = [](double, ConstSpan q, ConstSpan v, Span out) {
    const auto x = force_of<double>(seven(q), seven(v));
    std::copy_n(x.data(), 7, out.begin());
  };
  f.constraint = constraint;
  f.constraint_jacobian = [](double, ConstSpan q, MatrixEntries out) {
    const auto g = jacobian_of<double>(seven(q));
    for (Index i = 0; i < 3; ++i) {
      for (Index j = 0; j < 7; ++j) out(i, j) = g(i, j);
    }
  };
  f.constraint_rate = [](double, ConstSpan, Span phi_t) {
    phi_t[0] = phi_t[1] = 0;
    phi_t[2] = -kOmega;
  };
  f.constraint_gamma = [](double, ConstSpan q, ConstSpan v, Span out) {
    const auto x = gamma_of<double>(seven(q), seven(v));
    std::copy_n(x.data(), 3, out.begin());
  };
  return f;
}

State flexible_crank_start() {
  State s(Sizes{7, 7, 3});
  s.q = {0, 0, kL1 + kL2 + .169327969e-4, 0, 0, .103339863e-4, .169327969e-4};
  s.v = {150,           -kL1 * 150 / (kL2 + .169327969e-4), -.268938672e-5, .444896105, .463434311e-2, -.178591076e-5,
         -.268938672e-5};
  return s;
}

std::array<double, 24> flexible_crank_truth(int steps) {
  using Real = long double;
  using Values = std::array<Real, 14>;
  using Kkt = Eigen::Matrix<Real, 10, 10>;
  const auto solve = [](const Values& y) {
    const Vec7<Real> q = Eigen::Map<const Vec7<Real>>(y.data()), v = Eigen::Map<const Vec7<Real>>(y.data() + 7);
    Kkt k = Kkt::Zero();
    k.topLeftCorner<7, 7>() = mass_of<Real>(q);
    k.bottomLeftCorner<3, 7>() = jacobian_of<Real>(q);
    k.topRightCorner<7, 3>() = k.bottomLeftCorner<3, 7>().transpose();
    Eigen::Matrix<Real, 10, 1> b;
    b << force_of<Real>(q, v), gamma_of<Real>(q, v);
    return Eigen::Matrix<Real, 10, 1>(k.partialPivLu().solve(b));
  };
  const auto rate = [&](const Values& y) {
    const auto x = solve(y);
    Values out;
    std::copy_n(y.begin() + 7, 7, out.begin());
    std::copy_n(x.data(), 7, out.begin() + 7);
    return out;
  };
  const State start = flexible_crank_start();
  Values y;
  std::copy(start.q.begin(), start.q.end(), y.begin());
  std::copy(start.v.begin(), start.v.end(), y.begin() + 7);
  for (int k = 0; k < steps; ++k) y = extrapolation_step(rate, y, .1L / steps);
  const auto x = solve(y);
  std::array<double, 24> out{};
  for (std::size_t i = 0; i < 14; ++i) out[i] = static_cast<double>(y[i]);
  for (std::size_t i = 0; i < 10; ++i) out[14 + i] = static_cast<double>(x[static_cast<Eigen::Index>(i)]);
  return out;
}

const std::array<double, 24>& flexible_crank_reference() {
  static const std::array<double, 24> y = {15.00000000000104,
                                           -0.3311734988256260,
                                           0.1697373328427860,
                                           0.1893192899613509e-3,
                                           0.2375751249879174e-4,
                                           -0.5323896770569702e-5,
                                           -0.8363313279112129e-5,
                                           150,
                                           0.6025346755138369e2,
                                           -0.8753116326670527e1,
                                           -0.3005541400289738e-1,
                                           -0.5500431812571696e-2,
                                           0.4974111734266989e-3,
                                           0.1105560003626645e-2,
                                           0,
                                           0.6488737541276957e4,
                                           0.2167938629509884e4,
                                           0.3391137060286523e2,
                                           0.1715134772216488,
                                           -0.1422449408912512e1,
                                           0.1003946428124810e1,
                                           -0.6232935833287916e2,
                                           -0.1637920993367306e3,
                                           0.2529857947066878e2};
  return y;
}

}  // namespace espalier::dynamics
