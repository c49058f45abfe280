#include "dynamics/elements/solid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <vector>

#include "dynamics/elements/dispatch.hpp"

namespace espalier::dynamics {

void check_material(const Material& m) {
  if (!(m.young > 0) || !(m.poisson > -1) || !(m.poisson < 0.5) || !(m.density > 0))
    throw std::invalid_argument(fmt::format(
        "material: need young > 0, -1 < poisson < 0.5 and density > 0, got young {}, poisson {}, density {}", m.young,
        m.poisson, m.density));
}

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

#define ESPALIER_EVALUATE(kind, nodes, points)                                                                        \
  ESPALIER_CLONES bool evaluate_##kind(const ShapeTable<nodes, points>& t, const Material& m, const ElementInput& in, \
                                       ElementOutput& out) {                                                          \
    return evaluate<nodes>(t, m, in, out);                                                                            \
  }
ESPALIER_FOR_SOLIDS(ESPALIER_EVALUATE)
#undef ESPALIER_EVALUATE

/// The shape functions at some points, for loops over elements before the first step.
struct SampledShapeFunctions {
  int nodes;
  std::vector<double> weight, value, gradient;  // of each point: 1, nodes and 3 * nodes numbers
  SampledShapeFunctions(ElementType type, std::span<const QuadraturePoint> points) : nodes(shape_of(type).nodes) {
    value.resize(points.size() * static_cast<std::size_t>(nodes));
    gradient.resize(3 * value.size());
    for (const QuadraturePoint& point : points) {
      shape_values(type, point.xi.data(), &value[weight.size() * static_cast<std::size_t>(nodes)]);
      shape_gradients(type, point.xi.data(), &gradient[3 * weight.size() * static_cast<std::size_t>(nodes)]);
      weight.push_back(point.weight);
    }
  }
  [[nodiscard]] double jacobian(std::size_t q, const double* reference) const {
    const double* dn = &gradient[3 * q * static_cast<std::size_t>(nodes)];
    Mat33 jacobian = {};
    for (int a = 0; a < nodes; ++a)
      for (int i = 0; i < 3; ++i)
        for (int d = 0; d < 3; ++d) jacobian[i][d] += reference[3 * a + i] * dn[d * nodes + a];
    return determinant(jacobian);
  }
  /// Smallest Jacobian determinant; what is not a number wins.
  [[nodiscard]] double smallest_jacobian(const double* reference) const {
    double smallest = std::numeric_limits<double>::infinity();
    for (std::size_t q = 0; q < weight.size(); ++q)
      if (const double det = jacobian(q, reference); !(det >= smallest)) smallest = det;
    return smallest;
  }
};

/// At the points of both rules and at the corners.
struct SampledSolid {
  SampledShapeFunctions stiffness, mass, corners;
  explicit SampledSolid(ElementType type)
      : stiffness(type, quadrature(type, Rule::stiffness)),
        mass(type, quadrature(type, Rule::mass)),
        corners(type, corners_of(type)) {}

 private:
  static std::span<const QuadraturePoint> corners_of(ElementType type) {
    static constexpr QuadraturePoint kTet[] = {{{0, 0, 0}, 0}, {{1, 0, 0}, 0}, {{0, 1, 0}, 0}, {{0, 0, 1}, 0}};
    static constexpr QuadraturePoint kHex[] = {{{-1, -1, -1}, 0}, {{1, -1, -1}, 0}, {{1, 1, -1}, 0}, {{-1, 1, -1}, 0},
                                               {{-1, -1, 1}, 0},  {{1, -1, 1}, 0},  {{1, 1, 1}, 0},  {{-1, 1, 1}, 0}};
    static constexpr QuadraturePoint kWedge[] = {{{0, 0, -1}, 0}, {{1, 0, -1}, 0}, {{0, 1, -1}, 0},
                                                 {{0, 0, 1}, 0},  {{1, 0, 1}, 0},  {{0, 1, 1}, 0}};
    if (shape_of(type).corners == 6) return kWedge;
    return shape_of(type).corners == 4 ? std::span<const QuadraturePoint>(kTet) : kHex;
  }
};

const SampledSolid& sampled(ElementType type) {
#define ESPALIER_SAMPLED(kind, nodes, points)           \
  if (type == ElementType::kind) {                      \
    static const SampledSolid solid(ElementType::kind); \
    return solid;                                       \
  }
  ESPALIER_FOR_SOLIDS(ESPALIER_SAMPLED)
#undef ESPALIER_SAMPLED
  throw std::invalid_argument(fmt::format("{} is not a simulated solid", shape_of(type).name));
}

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

SamplePoints solid_samples(ElementType type) {
  if (type == ElementType::tet4) return SamplePoints::centre;
  if (shape_of(type).corners == 6) return SamplePoints::wedge;
  return type == ElementType::tet10 ? SamplePoints::tetrahedron : SamplePoints::hexahedron;
}

bool sample_solid(ElementType type, const double* reference, const double* position, ElementSamples& out) {
  constexpr int kPairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {1, 2}, {0, 2}};
  const SamplePoints where = solid_samples(type);
  const auto points = quadrature(where == SamplePoints::hexahedron ? ElementType::hex8
                                 : where == SamplePoints::wedge    ? ElementType::wedge6
                                                                   : type,
                                 Rule::stiffness);
  const auto nodes = static_cast<std::size_t>(shape_of(type).nodes);
  for (std::size_t q = 0; q < points.size(); ++q) {
    double dn[3 * kMaxElementNodes];
    shape_gradients(type, points[q].xi.data(), dn);
    Mat33 jacobian = {}, shift = {}, inverse, grad;
    for (std::size_t a = 0; a < nodes; ++a)
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t d = 0; d < 3; ++d) {
          jacobian[i][d] += reference[3 * a + i] * dn[d * nodes + a];
          shift[i][d] += (position[3 * a + i] - reference[3 * a + i]) * dn[d * nodes + a];
        }
    if (!(invert(jacobian, inverse) > 0)) return false;
    multiply(shift, inverse, grad);
    if (!(volume_change(grad) > -1)) return false;
    for (int m = 0; m < 6; ++m) {
      const auto [i, j] = kPairs[m];
      double twice = grad[i][j] + grad[j][i];
      for (int k = 0; k < 3; ++k) twice += grad[k][i] * grad[k][j];
      out.value[q][m] = m < 3 ? 0.5 * twice : twice;
    }
  }
  return true;
}

void solid_mass(ElementType type, double density, const double* reference, double* m) {
  const SampledSolid& solid = sampled(type);
  const SampledShapeFunctions& shape = solid.mass.smallest_jacobian(reference) > 0 ? solid.mass : solid.stiffness;
  const int nodes = shape.nodes;
  std::fill(m, m + nodes * nodes, 0.0);
  for (std::size_t q = 0; q < shape.weight.size(); ++q) {
    const double volume = shape.weight[q] * shape.jacobian(q, reference);
    const double* n = &shape.value[q * static_cast<std::size_t>(nodes)];
    for (int b = 0; b < nodes; ++b)
      for (int a = 0; a < nodes; ++a) m[b * nodes + a] += density * volume * n[a] * n[b];
  }
}

SmallestJacobian smallest_jacobian(ElementType type, const double* reference) {
  const SampledSolid& solid = sampled(type);
  return {solid.stiffness.smallest_jacobian(reference),
          std::min(solid.mass.smallest_jacobian(reference), solid.corners.smallest_jacobian(reference))};
}

}  // namespace espalier::dynamics
