/// \file
/// harmonic_response() of anything that is linear in the solutions.
#pragma once

#include <span>

#include "espalier/harmonic.hpp"
#include "harmonic/observer.hpp"

namespace espalier::harmonic {

/// As harmonic_response(), whose observed unknowns the observer's numbers replace. @param observer  null: the unknowns
/// @param structural  H: the system is K (1 + i eta) + i H + i w C - w^2 M; without rows: none
HarmonicResult respond(const MatrixView& k, const MatrixView& c, const MatrixView& m, std::span<const Complex> loads,
                       Index columns, const HarmonicOptions& options, Observer* observer,
                       const MatrixView& structural = {});

}  // namespace espalier::harmonic
