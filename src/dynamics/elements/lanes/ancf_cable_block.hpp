/// \file
/// Cables of ancf_cable.hpp side by side. The formulas stand once for a lane type (ancf_cable_block-inl.hpp);
/// evaluate_cable() is that of one lane.
#pragma once

#include "dynamics/elements/ancf_cable.hpp"
#include "dynamics/elements/lanes/lane_kernel.hpp"

namespace espalier::dynamics {

/// What a kernel needs to know of cables.
struct CableLaw {
  CableSection section;
  double length = 0;  ///< of every element, not deformed
};

using CableKernel = LaneKernel<CableLaw>;

inline constexpr int kCableParts =
    3;  ///< chord r2 - r1, slopes r1_x and r2_x: positions count by their difference alone
inline constexpr int kCableVertices = 4;

/// Shape functions of the parts on an element of length 1 and their second derivatives, at the points of a rule.
template <int kPoints>
struct CableShapeFunctions {
  double d[kPoints][kCableParts], dd[kPoints][kCableParts], weight[kPoints];
};
struct CableTables {
  CableShapeFunctions<5> axial;
  CableShapeFunctions<3> bending;
};

/// The numbers that the kernels read.
extern const CableTables kCableTables;

/// One element at a time.
[[nodiscard]] CableKernel scalar_cable_kernel();
/// As many lanes as the vectors of this processor have.
[[nodiscard]] CableKernel vector_cable_kernel();

}  // namespace espalier::dynamics
