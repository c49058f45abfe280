#include "dynamics/elements/pressure.hpp"

#include "dynamics/elements/shape_functions.hpp"

namespace espalier::dynamics {
namespace {

constexpr int kMaxFaceNodes = 8;

/// The tangents of a face at one point.
struct FacePoint {
  double n[kMaxFaceNodes], dn[2 * kMaxFaceNodes];
  double g[2][3] = {};

  FacePoint(ElementType face, const double* xi, const double* x) {
    const int nodes = shape_of(face).nodes;
    shape_values(face, xi, n);
    shape_gradients(face, xi, dn);
    for (int d = 0; d < 2; ++d)
      for (int a = 0; a < nodes; ++a)
        for (int i = 0; i < 3; ++i) g[d][i] += dn[d * nodes + a] * x[3 * a + i];
  }
};

}  // namespace

void add_pressure_force(ElementType face, double pressure, const double* x, double* f) {
  const int nodes = shape_of(face).nodes;
  for (const QuadraturePoint& point : face_quadrature(face)) {
    const FacePoint p(face, point.xi.data(), x);
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      const double normal = p.g[0][j] * p.g[1][k] - p.g[0][k] * p.g[1][j];
      for (int a = 0; a < nodes; ++a) f[3 * a + i] -= pressure * point.weight * p.n[a] * normal;
    }
  }
}

void add_pressure_tangent(ElementType face, double pressure, double weight, const double* x, double* k) {
  const int nodes = shape_of(face).nodes;
  for (const QuadraturePoint& point : face_quadrature(face)) {
    const FacePoint p(face, point.xi.data(), x);
    for (int b = 0; b < nodes; ++b) {
      // d(g1 x g2)/dx_b = [c]x with c = N_b,2 g1 - N_b,1 g2
      double c[3];
      for (int i = 0; i < 3; ++i) c[i] = p.dn[nodes + b] * p.g[0][i] - p.dn[b] * p.g[1][i];
      const double cross[3][3] = {{0, -c[2], c[1]}, {c[2], 0, -c[0]}, {-c[1], c[0], 0}};
      for (int j = 0; j < 3; ++j)
        for (int a = 0; a < nodes; ++a)
          for (int i = 0; i < 3; ++i)
            k[(3 * b + j) * 3 * nodes + 3 * a + i] -= weight * pressure * point.weight * p.n[a] * cross[i][j];
    }
  }
}

}  // namespace espalier::dynamics
