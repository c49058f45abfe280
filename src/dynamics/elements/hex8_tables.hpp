/// \file
/// Numbers of the eight-node hexahedron that host and GPU share: the enhanced modes and the shape functions at the
/// integration points.
#pragma once

#include "dynamics/elements/anywhere.hpp"

namespace espalier::dynamics::hex8 {

inline constexpr int kNodes = 8;
inline constexpr int kDofs = 24;
inline constexpr int kPoints = 8;

using Gradients = double[3][kNodes];

/// Covariant enhanced modes: (component, polynomial) pairs; polynomial 0 xi, 1 eta, 2 zeta, 3 xi zeta, 4 eta zeta,
/// 5 xi eta zeta.
struct Mode {
  int component, polynomial;
};
inline constexpr int kEnhancedModes = 9;
ESPALIER_ANYWHERE constexpr Mode enhanced_mode(int k) {
  constexpr Mode modes[kEnhancedModes] = {{0, 0}, {1, 1}, {2, 2}, {3, 0}, {3, 1}, {4, 1}, {4, 2}, {5, 0}, {5, 2}};
  return modes[k];
}

/// The modes of shells.
inline constexpr int kShellModes = 8;
ESPALIER_ANYWHERE constexpr Mode shell_mode(int k) {
  constexpr Mode modes[kShellModes] = {{0, 0}, {1, 1}, {3, 0}, {3, 1}, {2, 2}, {2, 3}, {2, 4}, {2, 5}};
  return modes[k];
}

/// The component of the strain that shells sample at tying point t: Bathe and Dvorkin's xi-zeta shear at the middle of
/// the edges eta = -1, +1; eta-zeta shear at xi = -1, +1; thickness strain on the four corner lines.
inline constexpr int kTyingPoints = 8;
ESPALIER_ANYWHERE constexpr int tying_component(int t) { return t < 2 ? 5 : t < 4 ? 4 : 2; }

ESPALIER_ANYWHERE inline double polynomial(int which, const double* xi) {
  switch (which) {
    case 0:
      return xi[0];
    case 1:
      return xi[1];
    case 2:
      return xi[2];
    case 3:
      return xi[0] * xi[2];
    case 4:
      return xi[1] * xi[2];
    default:
      return xi[0] * xi[1] * xi[2];
  }
}

/// What the kernels of hex8_block.hpp read; independent of the element.
struct BlockTables {
  Gradients gradient[kPoints];  ///< of the shape functions in local coordinates
  double weight[kPoints];
  double mode[kPoints][kEnhancedModes];  ///< polynomials of the enhanced modes
  double shell_mode[kPoints][kShellModes];
  Gradients tying[kTyingPoints];               ///< as `gradient`
  double tying_weight[kPoints][kTyingPoints];  ///< of the component sampled there
  Gradients centre;
};

}  // namespace espalier::dynamics::hex8
