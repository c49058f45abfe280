#include "dynamics/reference/andrews.hpp"

#include <cmath>
#include <vector>

namespace espalier::dynamics {

namespace {

constexpr double m1 = .04325, m2 = .00365, m3 = .02373, m4 = .00706, m5 = .07050, m6 = .00706, m7 = .05498;
constexpr double i1 = 2.194e-6, i2 = 4.410e-7, i3 = 5.255e-6, i4 = 5.667e-7, i5 = 1.169e-5, i6 = 5.667e-7,
                 i7 = 1.912e-5;
constexpr double xa = -.06934, ya = -.00227, xb = -.03635, yb = .03273, xc = .014, yc = .072;
constexpr double c0 = 4530, l0 = .07785, d = .028, da = .0115, e = .02, ea = .01421, rr = .007, ra = .00092;
constexpr double ss = .035, sa = .01874, sb = .01043, sc = .018, sd = .02, ta = .02308, tb = .00916;
constexpr double u = .04, ua = .01228, ub = .00449, zf = .02, zt = .04, fa = .01421, mom = .033;
enum { kBeta, kTheta, kGamma, kPhi, kDelta, kOmega, kEpsilon };

void mass(ConstSpan q, MatrixEntries m) {
  const double ct = std::cos(q[kTheta]), sp = std::sin(q[kPhi]), so = std::sin(q[kOmega]);
  m(0, 0) = m1 * ra * ra + m2 * (rr * rr - 2 * da * rr * ct + da * da) + i1 + i2;
  m(0, 1) = m(1, 0) = m2 * (da * da - da * rr * ct) + i2;
  m(1, 1) = m2 * da * da + i2;
  m(2, 2) = m3 * (sa * sa + sb * sb) + i3;
  m(3, 3) = m4 * (e - ea) * (e - ea) + i4;
  m(3, 4) = m(4, 3) = m4 * ((e - ea) * (e - ea) + zt * (e - ea) * sp) + i4;
  m(4, 4) = m4 * (zt * zt + 2 * zt * (e - ea) * sp + (e - ea) * (e - ea)) + m5 * (ta * ta + tb * tb) + i4 + i5;
  m(5, 5) = m6 * (zf - fa) * (zf - fa) + i6;
  m(5, 6) = m(6, 5) = m6 * ((zf - fa) * (zf - fa) - u * (zf - fa) * so) + i6;
  m(6, 6) = m6 * ((zf - fa) * (zf - fa) - 2 * u * (zf - fa) * so + u * u) + m7 * (ua * ua + ub * ub) + i6 + i7;
}

void force(double /*t*/, ConstSpan q, ConstSpan v, Span f) {
  const double sg = std::sin(q[kGamma]), cg = std::cos(q[kGamma]);
  const double x = sd * cg + sc * sg + xb - xc, y = sd * sg - sc * cg + yb - yc, length = std::hypot(x, y);
  const double f_spring = -c0 * (length - l0) / length, fx = f_spring * x, fy = f_spring * y;
  const double be = v[kBeta], th = v[kTheta], ph = v[kPhi], de = v[kDelta], om = v[kOmega], ep = v[kEpsilon];
  const double st = std::sin(q[kTheta]), cp = std::cos(q[kPhi]), co = std::cos(q[kOmega]);
  f[0] = mom - m2 * da * rr * th * (th + 2 * be) * st;
  f[1] = m2 * da * rr * be * be * st;
  f[2] = fx * (sc * cg - sd * sg) + fy * (sd * cg + sc * sg);
  f[3] = m4 * zt * (e - ea) * de * de * cp;
  f[4] = -m4 * zt * (e - ea) * ph * (ph + 2 * de) * cp;
  f[5] = -m6 * u * (zf - fa) * ep * ep * co;
  f[6] = m6 * u * (zf - fa) * om * (om + 2 * ep) * co;
}

void constraint(double /*t*/, ConstSpan q, Span g) {
  const double bt = q[0] + q[1], pd = q[3] + q[4], oe = q[5] + q[6];
  const double cx = rr * std::cos(q[0]) - d * std::cos(bt), cy = rr * std::sin(q[0]) - d * std::sin(bt);
  g[0] = cx - ss * std::sin(q[2]) - xb;
  g[1] = cy + ss * std::cos(q[2]) - yb;
  g[2] = cx - e * std::sin(pd) - zt * std::cos(q[4]) - xa;
  g[3] = cy + e * std::cos(pd) - zt * std::sin(q[4]) - ya;
  g[4] = cx - zf * std::cos(oe) - u * std::sin(q[6]) - xa;
  g[5] = cy - zf * std::sin(oe) + u * std::cos(q[6]) - ya;
}

void constraint_jacobian(double /*t*/, ConstSpan q, MatrixEntries g) {
  const double sb0 = std::sin(q[0]), cb0 = std::cos(q[0]), sbt = std::sin(q[0] + q[1]), cbt = std::cos(q[0] + q[1]);
  const double spd = std::sin(q[3] + q[4]), cpd = std::cos(q[3] + q[4]);
  const double soe = std::sin(q[5] + q[6]), coe = std::cos(q[5] + q[6]);
  for (Index i = 0; i < 6; i += 2) {
    g(i, 0) = -rr * sb0 + d * sbt;
    g(i, 1) = d * sbt;
    g(i + 1, 0) = rr * cb0 - d * cbt;
    g(i + 1, 1) = -d * cbt;
  }
  g(0, 2) = -ss * std::cos(q[2]);
  g(1, 2) = -ss * std::sin(q[2]);
  g(2, 3) = -e * cpd;
  g(2, 4) = -e * cpd + zt * std::sin(q[4]);
  g(3, 3) = -e * spd;
  g(3, 4) = -e * spd - zt * std::cos(q[4]);
  g(4, 5) = zf * soe;
  g(4, 6) = zf * soe - u * std::cos(q[6]);
  g(5, 5) = -zf * coe;
  g(5, 6) = -zf * coe - u * std::sin(q[6]);
}

// gamma = -(d/dt Phi_q) v
void gamma(double /*t*/, ConstSpan q, ConstSpan v, Span g) {
  const double b2 = v[0] * v[0], bt2 = (v[0] + v[1]) * (v[0] + v[1]), pd2 = (v[3] + v[4]) * (v[3] + v[4]);
  const double oe2 = (v[5] + v[6]) * (v[5] + v[6]);
  const double x = -rr * std::cos(q[0]) * b2 + d * std::cos(q[0] + q[1]) * bt2;
  const double y = -rr * std::sin(q[0]) * b2 + d * std::sin(q[0] + q[1]) * bt2;
  g[0] = -(x + ss * std::sin(q[2]) * v[2] * v[2]);
  g[1] = -(y - ss * std::cos(q[2]) * v[2] * v[2]);
  g[2] = -(x + e * std::sin(q[3] + q[4]) * pd2 + zt * std::cos(q[4]) * v[4] * v[4]);
  g[3] = -(y - e * std::cos(q[3] + q[4]) * pd2 + zt * std::sin(q[4]) * v[4] * v[4]);
  g[4] = -(x + zf * std::cos(q[5] + q[6]) * oe2 + u * std::sin(q[6]) * v[6] * v[6]);
  g[5] = -(y + zf * std::sin(q[5] + q[6]) * oe2 - u * std::cos(q[6]) * v[6] * v[6]);
}

// dF/dv and the mass matrix; dF/dq is left out: it is of no use at the step sizes of this problem and W need not be
// exact.
void tangent(const StateView& s, const TangentWeights& weights, MatrixEntries w) {
  std::array<double, 49> m{};
  mass(s.q, {m.data(), 7, 7, false});
  for (Index i = 0; i < 7; ++i) {
    for (Index j = 0; j < 7; ++j) w(i, j) = weights.a * m[static_cast<std::size_t>(7 * i + j)];
  }
  const double a = m2 * da * rr * std::sin(s.q[kTheta]), b = m4 * zt * (e - ea) * std::cos(s.q[kPhi]);
  const double c = m6 * u * (zf - fa) * std::cos(s.q[kOmega]), h = weights.v;
  w(0, 0) += h * a * 2 * s.v[kTheta];
  w(0, 1) += h * a * 2 * (s.v[kTheta] + s.v[kBeta]);
  w(1, 0) -= h * a * 2 * s.v[kBeta];
  w(3, 4) -= h * b * 2 * s.v[kDelta];
  w(4, 3) += h * b * 2 * (s.v[kPhi] + s.v[kDelta]);
  w(4, 4) += h * b * 2 * s.v[kPhi];
  w(5, 6) += h * c * 2 * s.v[kEpsilon];
  w(6, 5) -= h * c * 2 * (s.v[kOmega] + s.v[kEpsilon]);
  w(6, 6) -= h * c * 2 * s.v[kOmega];
}

}  // namespace

DaeFunctions andrews_functions() {
  DaeFunctions f;
  f.coordinates = 7;
  f.constraints = 6;
  f.mass = mass;
  f.force = force;
  f.constraint = constraint;
  f.constraint_jacobian = constraint_jacobian;
  f.constraint_gamma = gamma;
  f.tangent = tangent;
  return f;
}

State andrews_start() {
  State s(Sizes{7, 7, 6});
  s.q = {-0.0617138900142764496358948458001, 0,
         0.455279819163070380255912382449,   0.222668390165885884674473185609,
         0.487364979543842550225598953530,   -0.222668390165885884674473185609,
         1.23054744454982119249735015568};
  s.a[0] = 14222.4439199541138705911625887;
  s.a[1] = -10666.8329399655854029733719415;
  s.lambda[0] = 98.5668703962410896057654982170;
  s.lambda[1] = -6.12268834425566265503114393122;
  return s;
}

const std::array<double, 27>& andrews_reference() {
  static const std::array<double, 27> y = {
      0.1581077119629904e2, -0.1575637105984298e2, 0.4082224013073101e-1, -0.5347301163226948e0, 0.5244099658805304e0,
      0.5347301163226948e0, 0.1048080741042263e1,  0.1139920302151208e4,  -0.1424379294994111e4, 0.1103291221937134e2,
      0.1929337464421385e2, 0.5735699284790808e0,  -0.1929337464421385e2, 0.3231791658026955e0,  -0.2463176316945196e5,
      0.5185037701610329e5, 0.3241025686413781e6,  0.5667493645176213e6,  0.1674362929479361e5,  -0.5667493645176222e6,
      0.9826520791458422e4, 0.1991753333731910e3,  -0.2975531228015052e2, 0.2306654119098399e2,  0.3145271365475927e2,
      0.2264249232082739e2, 0.1161740700019673e2};
  return y;
}

double andrews_energy(const StateView& s) {
  std::array<double, 49> m{};
  mass(s.q, {m.data(), 7, 7, false});
  double twice = 0;
  for (std::size_t i = 0; i < 7; ++i) {
    for (std::size_t j = 0; j < 7; ++j) twice += s.v[i] * m[7 * i + j] * s.v[j];
  }
  const double sg = std::sin(s.q[kGamma]), cg = std::cos(s.q[kGamma]);
  const double stretch = std::hypot(sd * cg + sc * sg + xb - xc, sd * sg - sc * cg + yb - yc) - l0;
  return twice / 2 + c0 * stretch * stretch / 2 - mom * s.q[kBeta];
}

}  // namespace espalier::dynamics
