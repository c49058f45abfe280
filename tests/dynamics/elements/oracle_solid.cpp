// One displacement-based solid, point by point: the second implementation that solid_block_test.cpp compares with.
#include <fmt/format.h>

#include <stdexcept>

#include "dynamics/elements/dispatch.hpp"
#include "dynamics/elements/oracles.hpp"

namespace espalier::dynamics::oracle {
namespace {

/// Gradients G[d][a] = dN_a/dX_d at one point. @return det(dX/dxi)
template <int kN>
ESPALIER_INLINE double reference_gradients(const double (&dn)[3][kN], const double* x, double (&g)[3][kN]) {
  Mat33 jacobian = {}, inverse;
  for (int a = 0; a < kN; ++a)
    for (int i = 0; i < 3; ++i)
      for (int d = 0; d < 3; ++d) jacobian[i][d] += x[3 * a + i] * dn[d][a];
  const double det = invert(jacobian, inverse);
  for (int d = 0; d < 3; ++d)
    for (int a = 0; a < kN; ++a)
      g[d][a] = inverse[0][d] * dn[0][a] + inverse[1][d] * dn[1][a] + inverse[2][d] * dn[2][a];
  return det;
}

/// h[i][d] = sum_a u[3a + i] G[d][a]
template <int kN>
ESPALIER_INLINE void field_gradient(const double (&g)[3][kN], const double (&u)[3][kN], Mat33& h) {
  for (int i = 0; i < 3; ++i)
    for (int d = 0; d < 3; ++d) {
      double sum = 0;
      for (int a = 0; a < kN; ++a) sum += u[i][a] * g[d][a];
      h[i][d] = sum;
    }
}

/// Force accumulators f[i][a] and tangent blocks k[a][i][j][b], so that the innermost loops run over nodes.
template <int kN>
struct Accumulator {
  double f[3][kN] = {};
  double k[kN][3][3][kN] = {};
};

/// Adds scale * the tangent of one point (the formula of PointResponse). A symmetric tangent is filled only from the
/// SIMD group of the diagonal on.
template <int kN>
ESPALIER_INLINE void add_tangent(const PointResponse& r, const double (&g)[3][kN], double scale, bool symmetric,
                                 Accumulator<kN>& sum) {
  double u[3][kN], w[3][kN], hg[3][kN];
  for (int i = 0; i < 3; ++i)
    for (int a = 0; a < kN; ++a) {
      u[i][a] = r.u[i][0] * g[0][a] + r.u[i][1] * g[1][a] + r.u[i][2] * g[2][a];
      w[i][a] = r.w[i][0] * g[0][a] + r.w[i][1] * g[1][a] + r.w[i][2] * g[2][a];
      hg[i][a] = r.h[i][0] * g[0][a] + r.h[i][1] * g[1][a] + r.h[i][2] * g[2][a];
    }
  for (int a = 0; a < kN; ++a) {
    const int first = symmetric ? a & ~3 : 0;
    double dot[kN], diagonal[kN];
    for (int b = first; b < kN; ++b) {
      dot[b] = g[0][a] * g[0][b] + g[1][a] * g[1][b] + g[2][a] * g[2][b];
      diagonal[b] = scale * (g[0][a] * hg[0][b] + g[1][a] * hg[1][b] + g[2][a] * hg[2][b]);
    }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const double first_factor = scale * r.c1 * u[i][a];
        const double second_factor = scale * r.c2 * w[j][a];
        const double m = scale * r.m[i][j];
        double* row = sum.k[a][i][j];
        for (int b = first; b < kN; ++b) row[b] += first_factor * w[j][b] + second_factor * u[i][b] + m * dot[b];
        if (i == j)
          for (int b = first; b < kN; ++b) row[b] += diagonal[b];
      }
  }
}

template <int kN>
ESPALIER_INLINE void add_force(const PointResponse& r, const double (&g)[3][kN], double scale, Accumulator<kN>& sum) {
  for (int i = 0; i < 3; ++i)
    for (int a = 0; a < kN; ++a)
      sum.f[i][a] += scale * (r.p[i][0] * g[0][a] + r.p[i][1] * g[1][a] + r.p[i][2] * g[2][a]);
}

template <int kN>
ESPALIER_INLINE void write_tangent(const Accumulator<kN>& sum, bool symmetric, double* out) {
  constexpr int kDofs = 3 * kN;
  for (int b = 0; b < kN; ++b)
    for (int j = 0; j < 3; ++j)
      for (int a = 0; a < kN; ++a)
        for (int i = 0; i < 3; ++i) {
          const bool stored = !symmetric || b >= (a & ~3);
          out[(3 * b + j) * kDofs + 3 * a + i] = stored ? sum.k[a][i][j][b] : sum.k[b][j][i][a];
        }
}

template <int kN, class Table>
ESPALIER_INLINE bool evaluate(const Table& table, const Material& material, const ElementInput& in,
                              ElementOutput& out) {
  Accumulator<kN> sum;
  double u[3][kN], v[3][kN];
  for (int a = 0; a < kN; ++a)
    for (int i = 0; i < 3; ++i) {
      u[i][a] = in.position[3 * a + i] - in.reference[3 * a + i];
      v[i][a] = in.velocity == nullptr ? 0.0 : in.velocity[3 * a + i];
    }
  const double lambda = material.lambda(), mu = material.mu();
  const bool damped = in.damping != 0 && in.velocity != nullptr;
  const bool neo_hookean = material.law == SolidLaw::neo_hookean;
  const PointWeights weights{in.position_weight, in.velocity_weight, in.damping};
  double energy = 0;
  for (int q = 0; q < table.points; ++q) {
    double g[3][kN];
    Mat33 grad, rate = {};
    PointResponse response;
    const double volume = table.weight[q] * reference_gradients<kN>(table.gradient[q], in.reference, g);
    field_gradient<kN>(g, u, grad);
    if (damped) field_gradient<kN>(g, v, rate);
    if (!(volume > 0) || !(volume_change(grad) > -1)) return false;
    if (neo_hookean) {
      if (!respond_neo_hookean(grad, lambda, mu, weights, response)) return false;
    } else {
      respond_svk(grad, rate, lambda, mu, 1, weights, response);
    }
    energy += volume * response.energy;
    add_force<kN>(response, g, volume, sum);
    if (out.tangent != nullptr) add_tangent<kN>(response, g, volume, !damped, sum);
    if (neo_hookean && in.damping != 0) {
      respond_svk(grad, rate, lambda, mu, 0, weights, response);
      add_force<kN>(response, g, volume, sum);
      if (out.tangent != nullptr) add_tangent<kN>(response, g, volume, !damped, sum);
    }
  }
  for (int a = 0; a < kN; ++a)
    for (int i = 0; i < 3; ++i) out.force[3 * a + i] = sum.f[i][a];
  if (out.tangent != nullptr) write_tangent<kN>(sum, !damped, out.tangent);
  out.energy = energy;
  return true;
}

#define ESPALIER_EVALUATE(kind, nodes, points)                                                        \
  bool evaluate_##kind(const ShapeTable<nodes, points>& t, const Material& m, const ElementInput& in, \
                       ElementOutput& out) {                                                          \
    return evaluate<nodes>(t, m, in, out);                                                            \
  }
ESPALIER_FOR_SOLIDS(ESPALIER_EVALUATE)
#undef ESPALIER_EVALUATE

}  // namespace

bool evaluate_solid(ElementType type, Rule rule, const Material& material, const ElementInput& in, ElementOutput& out) {
  switch (type) {
#define ESPALIER_CASE(kind, nodes, points) \
  case ElementType::kind:                  \
    return evaluate_##kind(solid_table<nodes, points>(type, rule), material, in, out);
    ESPALIER_FOR_SOLIDS(ESPALIER_CASE)
#undef ESPALIER_CASE
    default:
      throw std::invalid_argument(fmt::format("evaluate_solid: {} is not a simulated solid", shape_of(type).name));
  }
}

}  // namespace espalier::dynamics::oracle
