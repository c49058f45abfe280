/// \file
/// What follows from the mass matrix of a solid.
#pragma once

#include <array>
#include <numeric>
#include <vector>

#include "dynamics/elements/solid.hpp"

namespace espalier::dynamics {

/// Sum of the mass matrix at density 1.
inline double solid_volume(ElementType type, const double* reference) {
  std::array<double, kMaxElementNodes * kMaxElementNodes> m{};
  solid_mass(type, 1, reference, m.data());
  return std::accumulate(m.begin(), m.end(), 0.0);
}

/// One number per node: the diagonal of the mass matrix, scaled to the element's mass (Hinton, Rock, Zienkiewicz 1976).
inline std::vector<double> lumped_mass(ElementType type, double density, const double* reference) {
  std::array<double, kMaxElementNodes * kMaxElementNodes> m{};
  solid_mass(type, density, reference, m.data());
  const auto nodes = static_cast<std::size_t>(shape_of(type).nodes);
  std::vector<double> diagonal(nodes);
  for (std::size_t a = 0; a < nodes; ++a) diagonal[a] = m[a * nodes + a];
  const double share = density * solid_volume(type, reference) / std::accumulate(diagonal.begin(), diagonal.end(), 0.0);
  for (double& x : diagonal) x *= share;
  return diagonal;
}

}  // namespace espalier::dynamics
