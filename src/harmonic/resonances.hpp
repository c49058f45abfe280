/// \file
/// Where the response may have peaks that are narrower than any spacing of frequencies.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "espalier/harmonic.hpp"
#include "harmonic/sweep.hpp"

namespace espalier::harmonic {

struct Resonance {
  double frequency = 0, half_width = 0;
  Eigen::MatrixXd peak;  ///< observed x loads: height of the peak, were the mode alone
};

struct Resonances {
  std::vector<Resonance> all;  ///< rising
  bool complete = false;
  std::string completeness;
};

/// The modes of (K, M) up to `to`, symmetric parts of both, by find_modes(). Damping: eigenvalues of the quadratic
/// problem that Z becomes in the space of these modes (dense). A mode without damping gets a half width of 1e-9 of its
/// frequency. Where modes cannot be found, `completeness` says why, and there are none.
/// @throws Error where memory or devices fail, or the caller interrupts
Resonances find_resonances(const DynamicStiffness& z, std::span<const Complex> loads, Index columns, const Sweep& sweep,
                           double from, double to, const HarmonicOptions& options);

}  // namespace espalier::harmonic
