/// \file
/// The system solved at one frequency after another, on one analysis.
#pragma once

#include <span>
#include <vector>

#include "espalier/complex_solver.hpp"
#include "espalier/harmonic.hpp"
#include "harmonic/dynamic_stiffness.hpp"
#include "modes/workshop.hpp"

namespace espalier::harmonic {

/// What a solve at one frequency gave.
struct Solved {
  HarmonicPoint point;
  std::vector<Complex> outputs;  ///< loads x observed
};

class Sweep {
 public:
  /// All outlive the object.
  Sweep(DynamicStiffness& z, std::span<const Complex> loads, Index columns, const HarmonicOptions& options,
        modes::Workshop& shop, HarmonicResult& result);
  /// @param keep  whether all unknowns go into result.shapes
  /// @throws Error where memory or devices fail, the caller interrupts, or Z has no analysis
  Solved solve(double frequency, bool keep = false);
  /// Columns of f in the observed unknowns.
  [[nodiscard]] std::size_t outputs() const { return static_cast<std::size_t>(columns_) * observed(); }
  [[nodiscard]] std::size_t observed() const;
  [[nodiscard]] std::size_t unknown(std::size_t output) const;

 private:
  void analyze(double frequency);
  /// The largest relative change of a solution that rounding of the entries of Z may cause, to its order of magnitude.
  double rounding_of(double w, const std::vector<Complex>& x, double z_norm);

  DynamicStiffness& z_;
  std::span<const Complex> loads_;
  Index columns_;
  const HarmonicOptions& options_;
  modes::Workshop& shop_;
  HarmonicResult& result_;
  ComplexSolver solver_;
};

}  // namespace espalier::harmonic
