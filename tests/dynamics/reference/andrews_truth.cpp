#include "dynamics/reference/andrews_truth.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "dynamics/reference/extrapolation.hpp"

namespace espalier::dynamics {

namespace {

using Real = long double;
constexpr std::size_t kN = 7, kM = 6;

// x0 + x1 t + x2 t^2
struct Series {
  Real x0 = 0, x1 = 0, x2 = 0;
};
Series operator+(Series a, Series b) { return {a.x0 + b.x0, a.x1 + b.x1, a.x2 + b.x2}; }
Series operator-(Series a, Series b) { return {a.x0 - b.x0, a.x1 - b.x1, a.x2 - b.x2}; }
Series operator*(Real s, Series a) { return {s * a.x0, s * a.x1, s * a.x2}; }
Series operator+(Series a, Real s) { return {a.x0 + s, a.x1, a.x2}; }
Series sine(Series a) {
  const Real s = std::sin(a.x0), c = std::cos(a.x0);
  return {s, c * a.x1, c * a.x2 - s * a.x1 * a.x1 / 2};
}
Series cosine(Series a) {
  const Real s = std::sin(a.x0), c = std::cos(a.x0);
  return {c, -s * a.x1, -s * a.x2 - c * a.x1 * a.x1 / 2};
}

constexpr Real kD = .028L, kE = .02L, kEa = .01421L, kRr = .007L, kSs = .035L, kU = .04L, kZf = .02L, kZt = .04L;
constexpr Real kDa = .0115L, kFa = .01421L, kXa = -.06934L, kYa = -.00227L, kXb = -.03635L, kYb = .03273L;
constexpr Real kM1 = .04325L, kM2 = .00365L, kM3 = .02373L, kM4 = .00706L, kM5 = .07050L, kM6 = .00706L, kM7 = .05498L;
constexpr Real kI1 = 2.194e-6L, kI2 = 4.410e-7L, kI3 = 5.255e-6L, kI4 = 5.667e-7L, kI5 = 1.169e-5L, kI6 = 5.667e-7L,
               kI7 = 1.912e-5L;

using Vec = std::array<Real, kN>;

// The loop closures along the line q + v t.
std::array<Series, kM> closures(const Vec& q, const Vec& v) {
  std::array<Series, kN> s;
  for (std::size_t i = 0; i < kN; ++i) s[i] = {q[i], v[i], 0};
  const Series bt = s[0] + s[1], pd = s[3] + s[4], oe = s[5] + s[6];
  const Series x = kRr * cosine(s[0]) - kD * cosine(bt), y = kRr * sine(s[0]) - kD * sine(bt);
  return {x - kSs * sine(s[2]) + (-kXb),
          y + kSs * cosine(s[2]) + (-kYb),
          x - kE * sine(pd) - kZt * cosine(s[4]) + (-kXa),
          y + kE * cosine(pd) - kZt * sine(s[4]) + (-kYa),
          x - kZf * cosine(oe) - kU * sine(s[6]) + (-kXa),
          y - kZf * sine(oe) + kU * cosine(s[6]) + (-kYa)};
}

struct Accelerations {
  Vec a;
  std::array<Real, kM> lambda;
};

void mass_and_force(const Vec& q, const Vec& v, std::array<Vec, kN>& m, Vec& f) {
  const Real ct = std::cos(q[1]), st = std::sin(q[1]), sp = std::sin(q[3]), cp = std::cos(q[3]), so = std::sin(q[5]),
             co = std::cos(q[5]);
  const Real ee = kE - kEa, zf = kZf - kFa, ra = .00092L;
  for (Vec& row : m) row.fill(0);
  m[0][0] = kM1 * ra * ra + kM2 * (kRr * kRr - 2 * kDa * kRr * ct + kDa * kDa) + kI1 + kI2;
  m[0][1] = m[1][0] = kM2 * (kDa * kDa - kDa * kRr * ct) + kI2;
  m[1][1] = kM2 * kDa * kDa + kI2;
  m[2][2] = kM3 * (.01874L * .01874L + .01043L * .01043L) + kI3;
  m[3][3] = kM4 * ee * ee + kI4;
  m[3][4] = m[4][3] = kM4 * (ee * ee + kZt * ee * sp) + kI4;
  m[4][4] = kM4 * (kZt * kZt + 2 * kZt * ee * sp + ee * ee) + kM5 * (.02308L * .02308L + .00916L * .00916L) + kI4 + kI5;
  m[5][5] = kM6 * zf * zf + kI6;
  m[5][6] = m[6][5] = kM6 * (zf * zf - kU * zf * so) + kI6;
  m[6][6] = kM6 * (zf * zf - 2 * kU * zf * so + kU * kU) + kM7 * (.01228L * .01228L + .00449L * .00449L) + kI6 + kI7;

  const Real sc = .018L, sd = .02L, sg = std::sin(q[2]), cg = std::cos(q[2]);
  const Real x = sd * cg + sc * sg + kXb - .014L, y = sd * sg - sc * cg + kYb - .072L;
  const Real length = std::sqrt(x * x + y * y), pull = -4530 * (length - .07785L) / length;
  f[0] = .033L - kM2 * kDa * kRr * v[1] * (v[1] + 2 * v[0]) * st;
  f[1] = kM2 * kDa * kRr * v[0] * v[0] * st;
  f[2] = pull * x * (sc * cg - sd * sg) + pull * y * (sd * cg + sc * sg);
  f[3] = kM4 * kZt * ee * v[4] * v[4] * cp;
  f[4] = -kM4 * kZt * ee * v[3] * (v[3] + 2 * v[4]) * cp;
  f[5] = -kM6 * kU * zf * v[6] * v[6] * co;
  f[6] = kM6 * kU * zf * v[5] * (v[5] + 2 * v[6]) * co;
}

Accelerations accelerations(const Vec& q, const Vec& v) {
  constexpr std::size_t kSize = kN + kM;
  std::array<std::array<Real, kSize + 1>, kSize> k{};
  std::array<Vec, kN> m;
  Vec f;
  mass_and_force(q, v, m, f);
  for (std::size_t i = 0; i < kN; ++i) {
    Vec direction{};
    direction[i] = 1;
    const auto g = closures(q, direction);
    for (std::size_t j = 0; j < kM; ++j) k[i][kN + j] = k[kN + j][i] = g[j].x1;
    for (std::size_t j = 0; j < kN; ++j) k[i][j] = m[i][j];
    k[i][kSize] = f[i];
  }
  const auto along = closures(q, v);
  for (std::size_t j = 0; j < kM; ++j) k[kN + j][kSize] = -2 * along[j].x2;
  for (std::size_t c = 0; c < kSize; ++c) {  // Gauss-Jordan with row pivoting
    std::size_t pivot = c;
    for (std::size_t r = c + 1; r < kSize; ++r) {
      if (std::abs(k[r][c]) > std::abs(k[pivot][c])) pivot = r;
    }
    std::swap(k[c], k[pivot]);
    for (std::size_t r = 0; r < kSize; ++r) {
      if (r == c) continue;
      const Real factor = k[r][c] / k[c][c];
      for (std::size_t j = c; j <= kSize; ++j) k[r][j] -= factor * k[c][j];
    }
  }
  Accelerations out{};
  for (std::size_t i = 0; i < kN; ++i) out.a[i] = k[i][kSize] / k[i][i];
  for (std::size_t j = 0; j < kM; ++j) out.lambda[j] = k[kN + j][kSize] / k[kN + j][kN + j];
  return out;
}

using Point = std::array<Real, 2 * kN>;

Point rate(const Point& p) {
  Vec q, v;
  std::copy_n(p.begin(), kN, q.begin());
  std::copy_n(p.begin() + kN, kN, v.begin());
  const Vec a = accelerations(q, v).a;
  Point out;
  std::copy_n(v.begin(), kN, out.begin());
  std::copy_n(a.begin(), kN, out.begin() + kN);
  return out;
}

}  // namespace

AndrewsTruth andrews_truth(int steps) {
  Point p{-0.0617138900142764496358948458001L, 0,
          0.455279819163070380255912382449L,   0.222668390165885884674473185609L,
          0.487364979543842550225598953530L,   -0.222668390165885884674473185609L,
          1.23054744454982119249735015568L};
  for (int k = 0; k < steps; ++k) p = extrapolation_step(rate, p, .03L / steps);
  Vec q, v;
  std::copy_n(p.begin(), kN, q.begin());
  std::copy_n(p.begin() + kN, kN, v.begin());
  const Accelerations end = accelerations(q, v);
  AndrewsTruth out;
  std::copy(p.begin(), p.end(), out.y.begin());
  std::copy(end.a.begin(), end.a.end(), out.y.begin() + 2 * kN);
  std::copy(end.lambda.begin(), end.lambda.end(), out.y.begin() + 3 * kN);
  for (const Series& g : closures(q, v)) {
    out.position = std::max(out.position, std::abs(g.x0));
    out.velocity = std::max(out.velocity, std::abs(g.x1));
  }
  return out;
}

}  // namespace espalier::dynamics
