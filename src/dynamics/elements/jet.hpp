/// \file
/// A number with its exact first and second derivatives by N variables (forward automatic differentiation). The strain
/// measures of beams are written once with it; their tangents are exact by construction.
#pragma once

#include <cmath>

#include "dynamics/elements/dispatch.hpp"
#include "dynamics/elements/jet_kernels.hpp"

namespace espalier::dynamics {

/// @tparam kOrder how many derivatives are carried: 2 for tangents, 1 for forces, 0 for plain values
template <int kN, int kOrder = 2>
struct Jet {
  static constexpr int kVariables = kOrder > 0 ? kN : 0;
  static constexpr int kSquares = kOrder > 1 ? kN : 0;
  double v = 0;                                             ///< value
  double g[kOrder > 0 ? kN : 1] = {};                       ///< gradient
  double h[kOrder > 1 ? kN : 1][kOrder > 1 ? kN : 1] = {};  ///< Hessian, symmetric, both halves stored

  /// Variable number i with value x.
  static ESPALIER_INLINE Jet variable(double x, int i) {
    Jet j;
    j.v = x;
    if constexpr (kOrder > 0) j.g[i] = 1;
    return j;
  }
  ESPALIER_INLINE Jet& operator+=(const Jet& b) { return add(b, 1); }
  ESPALIER_INLINE Jet& operator-=(const Jet& b) { return add(b, -1); }
  /// this += s * b
  ESPALIER_INLINE Jet& add(const Jet& b, double s) {
    v += s * b.v;
    for (int i = 0; i < kVariables; ++i) g[i] += s * b.g[i];
    if constexpr (kSquares == kLargeJet)
      add_hessian(s, &b.h[0][0], &h[0][0]);
    else
      for (int i = 0; i < kSquares; ++i)
        for (int j = 0; j < kSquares; ++j) h[i][j] += s * b.h[i][j];
    return *this;
  }
};

template <int kN, int kOrder>
ESPALIER_INLINE Jet<kN, kOrder> operator+(Jet<kN, kOrder> a, const Jet<kN, kOrder>& b) {
  return a += b;
}
template <int kN, int kOrder>
ESPALIER_INLINE Jet<kN, kOrder> operator-(Jet<kN, kOrder> a, const Jet<kN, kOrder>& b) {
  return a -= b;
}
template <int kN, int kOrder>
ESPALIER_INLINE Jet<kN, kOrder> operator*(double s, const Jet<kN, kOrder>& a) {
  Jet<kN, kOrder> c;
  return c.add(a, s);
}
template <int kN, int kOrder>
ESPALIER_INLINE Jet<kN, kOrder> operator-(const Jet<kN, kOrder>& a, double s) {
  Jet<kN, kOrder> c = a;
  c.v -= s;
  return c;
}

/// (a b)'' = a b'' + b a'' + a' b'^T + b' a'^T
template <int kN, int kOrder>
ESPALIER_INLINE Jet<kN, kOrder> operator*(const Jet<kN, kOrder>& a, const Jet<kN, kOrder>& b) {
  Jet<kN, kOrder> c;
  c.v = a.v * b.v;
  for (int i = 0; i < c.kVariables; ++i) c.g[i] = a.v * b.g[i] + b.v * a.g[i];
  if constexpr (c.kSquares == kLargeJet)
    product_hessian(b.v, &a.h[0][0], a.v, &b.h[0][0], a.g, b.g, &c.h[0][0]);
  else
    for (int i = 0; i < c.kSquares; ++i)
      for (int j = 0; j < c.kSquares; ++j)
        c.h[i][j] = a.v * b.h[i][j] + b.v * a.h[i][j] + a.g[i] * b.g[j] + b.g[i] * a.g[j];
  return c;
}

/// f(a) for a scalar function with value f, derivative df, second derivative ddf at a.v.
template <int kN, int kOrder>
ESPALIER_INLINE Jet<kN, kOrder> chain(const Jet<kN, kOrder>& a, double f, double df, double ddf) {
  Jet<kN, kOrder> c;
  c.v = f;
  for (int i = 0; i < c.kVariables; ++i) c.g[i] = df * a.g[i];
  if constexpr (c.kSquares == kLargeJet)
    chain_hessian(df, &a.h[0][0], ddf, a.g, &c.h[0][0]);
  else
    for (int i = 0; i < c.kSquares; ++i)
      for (int j = 0; j < c.kSquares; ++j) c.h[i][j] = df * a.h[i][j] + ddf * a.g[i] * a.g[j];
  return c;
}
template <int kN, int kOrder>
ESPALIER_INLINE Jet<kN, kOrder> sqrt(const Jet<kN, kOrder>& a) {
  const double root = std::sqrt(a.v);
  return chain(a, root, 0.5 / root, -0.25 / (root * a.v));
}
template <int kN, int kOrder>
ESPALIER_INLINE Jet<kN, kOrder> inverse(const Jet<kN, kOrder>& a) {
  const double r = 1 / a.v;
  return chain(a, r, -r * r, 2 * r * r * r);
}

/// A 3-vector of jets.
template <int kN, int kOrder = 2>
struct Jet3 {
  Jet<kN, kOrder> x[3];
};
template <int kN, int kOrder>
ESPALIER_INLINE Jet<kN, kOrder> dot(const Jet3<kN, kOrder>& a, const Jet3<kN, kOrder>& b) {
  Jet<kN, kOrder> c = a.x[0] * b.x[0];
  c += a.x[1] * b.x[1];
  return c += a.x[2] * b.x[2];
}
template <int kN, int kOrder>
ESPALIER_INLINE Jet3<kN, kOrder> cross(const Jet3<kN, kOrder>& a, const Jet3<kN, kOrder>& b) {
  Jet3<kN, kOrder> c;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    c.x[i] = a.x[j] * b.x[k];
    c.x[i] -= a.x[k] * b.x[j];
  }
  return c;
}
template <int kN, int kOrder>
ESPALIER_INLINE Jet3<kN, kOrder> operator*(const Jet<kN, kOrder>& s, const Jet3<kN, kOrder>& a) {
  return {{s * a.x[0], s * a.x[1], s * a.x[2]}};
}
template <int kN, int kOrder>
ESPALIER_INLINE Jet3<kN, kOrder> operator*(double s, const Jet3<kN, kOrder>& a) {
  return {{s * a.x[0], s * a.x[1], s * a.x[2]}};
}
template <int kN, int kOrder>
ESPALIER_INLINE Jet3<kN, kOrder> operator-(const Jet3<kN, kOrder>& a, const Jet3<kN, kOrder>& b) {
  return {{a.x[0] - b.x[0], a.x[1] - b.x[1], a.x[2] - b.x[2]}};
}
template <int kN, int kOrder>
ESPALIER_INLINE Jet3<kN, kOrder> operator+(const Jet3<kN, kOrder>& a, const Jet3<kN, kOrder>& b) {
  return {{a.x[0] + b.x[0], a.x[1] + b.x[1], a.x[2] + b.x[2]}};
}

}  // namespace espalier::dynamics
