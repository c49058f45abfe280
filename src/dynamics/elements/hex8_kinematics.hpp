/// \file
/// Where the eight-node hexahedron is sampled, and its shape functions there, in the order of its nodes.
#pragma once

#include <algorithm>

#include "dynamics/elements/hex8_tables.hpp"
#include "dynamics/elements/shape_functions.hpp"

namespace espalier::dynamics::hex8 {

/// Where strain components are sampled: integration points, and for shells the tying points.
struct Tying {
  double xi[3];
  int component;
};
// All on the middle surface.
inline constexpr Tying kTying[kTyingPoints] = {{{0, -1, 0}, tying_component(0)},  {{0, 1, 0}, tying_component(1)},
                                               {{-1, 0, 0}, tying_component(2)},  {{1, 0, 0}, tying_component(3)},
                                               {{-1, -1, 0}, tying_component(4)}, {{1, -1, 0}, tying_component(5)},
                                               {{1, 1, 0}, tying_component(6)},   {{-1, 1, 0}, tying_component(7)}};

/// Weight of tying point t at xi (0 for the components that are not tied).
inline double tying_weight(int t, const double* xi) {
  const double* at = kTying[t].xi;
  if (kTying[t].component == 5) return 0.5 * (1 + at[1] * xi[1]);
  if (kTying[t].component == 4) return 0.5 * (1 + at[0] * xi[0]);
  return 0.25 * (1 + at[0] * xi[0]) * (1 + at[1] * xi[1]);
}

/// Shape functions at the integration and tying points; independent of the element.
struct Tables {
  ShapeTable<kNodes, kPoints> points =
      make_shape_table<kNodes, kPoints>(ElementType::hex8, quadrature(ElementType::hex8, Rule::stiffness));
  double xi[kPoints][3];
  Gradients tying[8];
  double weight[kPoints][8];
  Gradients centre;
  Tables() {
    const auto rule = quadrature(ElementType::hex8, Rule::stiffness);
    const double origin[3] = {0, 0, 0};
    shape_gradients(ElementType::hex8, origin, &centre[0][0]);
    for (int t = 0; t < 8; ++t) shape_gradients(ElementType::hex8, kTying[t].xi, &tying[t][0][0]);
    for (int q = 0; q < kPoints; ++q) {
      std::copy_n(rule[static_cast<std::size_t>(q)].xi.data(), 3, xi[q]);
      for (int t = 0; t < 8; ++t) weight[q][t] = tying_weight(t, xi[q]);
    }
  }
};

inline const Tables& tables() {
  static const Tables kTables;
  return kTables;
}

}  // namespace espalier::dynamics::hex8
