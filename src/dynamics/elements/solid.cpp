#include "dynamics/elements/solid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <vector>

namespace espalier::dynamics {

void check_material(const Material& m) {
  if (!(m.young > 0) || !(m.poisson > -1) || !(m.poisson < 0.5) || !(m.density > 0))
    throw std::invalid_argument(fmt::format(
        "material: need young > 0, -1 < poisson < 0.5 and density > 0, got young {}, poisson {}, density {}", m.young,
        m.poisson, m.density));
}

namespace {

/// The shape functions at some points, for loops over elements before the first step.
struct SampledShapeFunctions {
  int nodes;
  std::vector<double> weight, value, gradient;  // of each point: 1, nodes and 3 * nodes numbers
  SampledShapeFunctions(ElementType type, std::span<const QuadraturePoint> points) : nodes(shape_of(type).nodes) {
    value.resize(points.size() * at(nodes));
    gradient.resize(3 * value.size());
    for (const QuadraturePoint& point : points) {
      shape_values(type, point.xi.data(), &value[weight.size() * at(nodes)]);
      shape_gradients(type, point.xi.data(), &gradient[3 * weight.size() * at(nodes)]);
      weight.push_back(point.weight);
    }
  }
  [[nodiscard]] double jacobian(std::size_t q, const double* reference) const {
    const double* dn = &gradient[3 * q * at(nodes)];
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
  const auto nodes = at(shape_of(type).nodes);
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
    const double* n = &shape.value[q * at(nodes)];
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
