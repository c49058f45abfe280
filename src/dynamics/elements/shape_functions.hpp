/// \file
/// Shape functions and quadrature rules of the solid elements and of their faces.
#pragma once

#include <array>
#include <span>

#include "base/at.hpp"
#include "dynamics/mesh/element_type.hpp"

namespace espalier::dynamics {

/// One integration point: reference coordinates (tetrahedra: volume coordinates of nodes 1, 2, 3, each in [0, 1];
/// hexahedra: each in [-1, 1]; triangles and quadrilaterals alike with two coordinates; wedges: two of a triangle and
/// one in [-1, 1]) and weight. The weights of a rule add up to the volume (area) of the reference shape.
struct QuadraturePoint {
  std::array<double, 3> xi;
  double weight;
};

/// Which rule: `stiffness` is the usual full rule of the element (tet4 1, tet10 4, hex8 8, hex20 27, wedge6 6, wedge15
/// 9 points), `reduced` is 2 x 2 x 2 for hex20 (the others: as stiffness), `mass` integrates products of two shape
/// functions exactly on elements with constant Jacobian.
enum class Rule { stiffness, reduced, mass };

/// The rule of a simulated solid. @throws std::invalid_argument for any other shape
/// Sources: tetrahedra: 1 and 4 points (Hammer, Marlowe, Stroud 1956), 14 points of degree 5 (Walkington 2000, also
/// Grundmann and Moeller's class); hexahedra: products of Gauss rules; wedges: those of triangles and lines.
std::span<const QuadraturePoint> quadrature(ElementType type, Rule rule);
/// The rule of a face (tri3, tri6, quad4, quad8): exact for pressure on faces with straight edges.
std::span<const QuadraturePoint> face_quadrature(ElementType type);

/// Values N[nodes] at a point of any solid, surface or line shape of ElementType except pyramids.
void shape_values(ElementType type, const double* xi, double* values);
/// Derivatives along the reference coordinates: dn[d * nodes + a] = dN_a / dxi_d, d < dimension.
void shape_gradients(ElementType type, const double* xi, double* dn);

/// The solids that are simulated: X(type, nodes, most points of a rule). A new one is a line here, its rules and shape
/// functions in shape_functions.cpp, and its row in mesh/element_type.
#define ESPALIER_FOR_SOLIDS(X) \
  X(tet4, 4, 4) X(tet10, 10, 14) X(hex8, 8, 8) X(hex20, 20, 27) X(wedge6, 6, 6) X(wedge15, 15, 21)

/// The points of a rule with the shape functions evaluated there; made once per type and rule.
template <int kNodes, int kMaxPoints>
struct ShapeTable {
  int points = 0;
  double weight[kMaxPoints] = {};
  double value[kMaxPoints][kNodes] = {};
  double gradient[kMaxPoints][3][kNodes] = {};
};

template <int kNodes, int kMaxPoints>
ShapeTable<kNodes, kMaxPoints> make_shape_table(ElementType type, std::span<const QuadraturePoint> rule) {
  ShapeTable<kNodes, kMaxPoints> table;
  table.points = static_cast<int>(rule.size());
  for (int q = 0; q < table.points; ++q) {
    const QuadraturePoint& point = rule[at(q)];
    table.weight[q] = point.weight;
    shape_values(type, point.xi.data(), table.value[q]);
    shape_gradients(type, point.xi.data(), &table.gradient[q][0][0]);
  }
  return table;
}

/// The table of a simulated solid and rule, made once.
template <int kNodes, int kMaxPoints>
const ShapeTable<kNodes, kMaxPoints>& solid_table(ElementType type, Rule rule) {
  static const ShapeTable<kNodes, kMaxPoints> tables[3] = {
      make_shape_table<kNodes, kMaxPoints>(type, quadrature(type, Rule::stiffness)),
      make_shape_table<kNodes, kMaxPoints>(type, quadrature(type, Rule::reduced)),
      make_shape_table<kNodes, kMaxPoints>(type, quadrature(type, Rule::mass))};
  return tables[static_cast<int>(rule)];
}

}  // namespace espalier::dynamics
