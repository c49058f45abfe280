/// \file
/// A number with its exact first and second derivatives by N variables (forward automatic differentiation of second
/// order). The strain measures of beams are written once with it; their tangents are exact by construction.
#pragma once

#include <cmath>

#include "dynamics/elements/dispatch.hpp"

namespace espalier::dynamics {

template <int kN>
struct Jet {
  double v = 0;           ///< value
  double g[kN] = {};      ///< gradient
  double h[kN][kN] = {};  ///< Hessian, symmetric, both halves stored

  /// Variable number i with value x.
  static ESPALIER_INLINE Jet variable(double x, int i) {
    Jet j;
    j.v = x;
    j.g[i] = 1;
    return j;
  }
  ESPALIER_INLINE Jet& operator+=(const Jet& b) { return add(b, 1); }
  ESPALIER_INLINE Jet& operator-=(const Jet& b) { return add(b, -1); }
  /// this += s * b
  ESPALIER_INLINE Jet& add(const Jet& b, double s) {
    v += s * b.v;
    for (int i = 0; i < kN; ++i) g[i] += s * b.g[i];
    for (int i = 0; i < kN; ++i)
      for (int j = 0; j < kN; ++j) h[i][j] += s * b.h[i][j];
    return *this;
  }
};

template <int kN>
ESPALIER_INLINE Jet<kN> operator+(Jet<kN> a, const Jet<kN>& b) {
  return a += b;
}
template <int kN>
ESPALIER_INLINE Jet<kN> operator-(Jet<kN> a, const Jet<kN>& b) {
  return a -= b;
}
template <int kN>
ESPALIER_INLINE Jet<kN> operator*(double s, const Jet<kN>& a) {
  Jet<kN> c;
  return c.add(a, s);
}
template <int kN>
ESPALIER_INLINE Jet<kN> operator-(const Jet<kN>& a, double s) {
  Jet<kN> c = a;
  c.v -= s;
  return c;
}

/// (a b)'' = a b'' + b a'' + a' b'^T + b' a'^T
template <int kN>
ESPALIER_INLINE Jet<kN> operator*(const Jet<kN>& a, const Jet<kN>& b) {
  Jet<kN> c;
  c.v = a.v * b.v;
  for (int i = 0; i < kN; ++i) c.g[i] = a.v * b.g[i] + b.v * a.g[i];
  for (int i = 0; i < kN; ++i)
    for (int j = 0; j < kN; ++j) c.h[i][j] = a.v * b.h[i][j] + b.v * a.h[i][j] + a.g[i] * b.g[j] + b.g[i] * a.g[j];
  return c;
}

/// f(a) for a scalar function with value f, derivative df, second derivative ddf at a.v.
template <int kN>
ESPALIER_INLINE Jet<kN> chain(const Jet<kN>& a, double f, double df, double ddf) {
  Jet<kN> c;
  c.v = f;
  for (int i = 0; i < kN; ++i) c.g[i] = df * a.g[i];
  for (int i = 0; i < kN; ++i)
    for (int j = 0; j < kN; ++j) c.h[i][j] = df * a.h[i][j] + ddf * a.g[i] * a.g[j];
  return c;
}
template <int kN>
ESPALIER_INLINE Jet<kN> sqrt(const Jet<kN>& a) {
  const double root = std::sqrt(a.v);
  return chain(a, root, 0.5 / root, -0.25 / (root * a.v));
}
template <int kN>
ESPALIER_INLINE Jet<kN> inverse(const Jet<kN>& a) {
  const double r = 1 / a.v;
  return chain(a, r, -r * r, 2 * r * r * r);
}

/// A 3-vector of jets.
template <int kN>
struct Jet3 {
  Jet<kN> x[3];
};
template <int kN>
ESPALIER_INLINE Jet<kN> dot(const Jet3<kN>& a, const Jet3<kN>& b) {
  Jet<kN> c = a.x[0] * b.x[0];
  c += a.x[1] * b.x[1];
  return c += a.x[2] * b.x[2];
}
template <int kN>
ESPALIER_INLINE Jet3<kN> cross(const Jet3<kN>& a, const Jet3<kN>& b) {
  Jet3<kN> c;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    c.x[i] = a.x[j] * b.x[k];
    c.x[i] -= a.x[k] * b.x[j];
  }
  return c;
}
template <int kN>
ESPALIER_INLINE Jet3<kN> operator*(const Jet<kN>& s, const Jet3<kN>& a) {
  return {{s * a.x[0], s * a.x[1], s * a.x[2]}};
}
template <int kN>
ESPALIER_INLINE Jet3<kN> operator+(const Jet3<kN>& a, const Jet3<kN>& b) {
  return {{a.x[0] + b.x[0], a.x[1] + b.x[1], a.x[2] + b.x[2]}};
}

}  // namespace espalier::dynamics
