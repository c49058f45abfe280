#include "dynamics/model/fields/sampling.hpp"

#include <Eigen/Dense>

#include "dynamics/bodies/rotation.hpp"

namespace espalier::dynamics::model {

std::span<const QuadraturePoint> points_of(SamplePoints where) {
  // Simpson's rule: sums over a line are those of the quadratic function through the points.
  static constexpr QuadraturePoint kLine[3] = {{{-1, 0, 0}, 1.0 / 3}, {{0, 0, 0}, 4.0 / 3}, {{1, 0, 0}, 1.0 / 3}};
  switch (where) {
    case SamplePoints::centre:
      return quadrature(ElementType::tet4, Rule::stiffness);
    case SamplePoints::tetrahedron:
      return quadrature(ElementType::tet10, Rule::stiffness);
    case SamplePoints::hexahedron:
      return quadrature(ElementType::hex8, Rule::stiffness);
    case SamplePoints::wedge:
      return quadrature(ElementType::wedge6, Rule::stiffness);
    case SamplePoints::line:
      return kLine;
    default:
      return {};
  }
}

SampleWeights weights_at(SamplePoints where, const double* xi) {
  SampleWeights w{};
  const auto points = points_of(where);
  if (where == SamplePoints::centre) w[0] = 1;
  if (where == SamplePoints::line) w = {0.5 * xi[0] * (xi[0] - 1), 1 - xi[0] * xi[0], 0.5 * xi[0] * (xi[0] + 1)};
  if (where == SamplePoints::hexahedron)
    for (std::size_t q = 0; q < points.size(); ++q) {
      w[q] = 1;  // the points are at -+ 1 / sqrt 3
      for (std::size_t d = 0; d < 3; ++d) w[q] *= 0.5 * (1 + 3 * points[q].xi[d] * xi[d]);
    }
  if (where == SamplePoints::wedge)
    for (std::size_t q = 0; q < points.size(); ++q) {  // volume coordinates are 2/3 and 1/6 there
      const double l[3] = {1 - xi[0] - xi[1], xi[0], xi[1]};
      w[q] = 2 * (l[q % 3] - 1.0 / 6) * 0.5 * (1 + 3 * points[q].xi[2] * xi[2]);
    }
  if (where == SamplePoints::tetrahedron) {
    Eigen::Matrix4d a;  // the linear functions 1, xi at the points
    for (int q = 0; q < 4; ++q) {
      const auto& at = points[static_cast<std::size_t>(q)].xi;
      a.col(q) << 1, at[0], at[1], at[2];
    }
    const Eigen::Vector4d found = a.partialPivLu().solve(Eigen::Vector4d(1, xi[0], xi[1], xi[2]));
    for (int q = 0; q < 4; ++q) w[static_cast<std::size_t>(q)] = found[q];
  }
  return w;
}

std::array<double, 3> middle_of(ElementType type) {
  const int corners = shape_of(type).corners;
  if (corners == 4) return {0.25, 0.25, 0.25};
  return corners == 6 ? std::array<double, 3>{1.0 / 3, 1.0 / 3, 0} : std::array<double, 3>{};
}

std::vector<std::array<double, 3>> node_coordinates(ElementType type) {
  using Coordinates = std::vector<std::array<double, 3>>;
  const Coordinates hexahedron = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}, {-1, -1, 1},
                                  {1, -1, 1},   {1, 1, 1},   {-1, 1, 1}, {0, -1, -1}, {1, 0, -1},
                                  {0, 1, -1},   {-1, 0, -1}, {0, -1, 1}, {1, 0, 1},   {0, 1, 1},
                                  {-1, 0, 1},   {-1, -1, 0}, {1, -1, 0}, {1, 1, 0},   {-1, 1, 0}};
  const Coordinates tetrahedron = {{0, 0, 0},     {1, 0, 0},   {0, 1, 0},   {0, 0, 1},     {0.5, 0, 0},
                                   {0.5, 0.5, 0}, {0, 0.5, 0}, {0, 0, 0.5}, {0.5, 0, 0.5}, {0, 0.5, 0.5}};
  const Coordinates wedge = {{0, 0, -1},    {1, 0, -1},   {0, 1, -1},     {0, 0, 1},    {1, 0, 1},
                             {0, 1, 1},     {0.5, 0, -1}, {0.5, 0.5, -1}, {0, 0.5, -1}, {0.5, 0, 1},
                             {0.5, 0.5, 1}, {0, 0.5, 1},  {0, 0, 0},      {1, 0, 0},    {0, 1, 0}};
  if (type == ElementType::line2) return {{-1, 0, 0}, {1, 0, 0}};
  const bool tet = type == ElementType::tet4 || type == ElementType::tet10;
  const Coordinates& all = tet ? tetrahedron : shape_of(type).corners == 6 ? wedge : hexahedron;
  return {all.begin(), all.begin() + shape_of(type).nodes};
}

double volume_ratio(ElementType type, const double* xi, const double* reference) {
  const auto nodes = static_cast<std::size_t>(shape_of(type).nodes);
  double dn[3 * kMaxElementNodes];
  shape_gradients(type, xi, dn);
  Mat3 jacobian = Mat3::Zero();
  for (std::size_t a = 0; a < nodes; ++a)
    for (int i = 0; i < 3; ++i)
      for (std::size_t d = 0; d < 3; ++d)
        jacobian(i, static_cast<int>(d)) += reference[3 * a + static_cast<std::size_t>(i)] * dn[d * nodes + a];
  return jacobian.determinant();
}

}  // namespace espalier::dynamics::model
