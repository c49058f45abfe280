/// \file
/// The system solved at one frequency after another, and what is made of the solutions.
#pragma once

#include <span>
#include <vector>

#include "espalier/harmonic.hpp"
#include "harmonic/observer.hpp"
#include "harmonic/teams.hpp"

namespace espalier::harmonic {

/// What a solve at one frequency gave.
struct Solved {
  HarmonicPoint point;
  std::vector<Complex> outputs;  ///< loads x observed
};

class Sweep {
 public:
  /// All outlive the object.
  Sweep(const DynamicStiffness& z, std::span<const Complex> loads, Index columns, const HarmonicOptions& options,
        modes::Resources& shop, HarmonicResult& result, Observer& observer);
  /// In the order of the frequencies. @param keep  whether all unknowns go into result.shapes, of each frequency
  /// @throws Error where memory or devices fail, the caller interrupts, or Z has no analysis
  std::vector<Solved> solve(std::span<const double> frequencies, const std::vector<char>& keep);
  /// Columns of f in the observed numbers.
  [[nodiscard]] std::size_t outputs() const { return static_cast<std::size_t>(columns_) * observed(); }
  [[nodiscard]] std::size_t observed() const { return static_cast<std::size_t>(observer_.outputs()); }
  [[nodiscard]] Observer& observer() const { return observer_; }
  [[nodiscard]] Index columns() const { return columns_; }
  /// See Teams.
  [[nodiscard]] std::size_t at_a_time() const { return teams_.at_a_time(); }

 private:
  Solved judged(double frequency, Answer answer, bool keep);

  Index n_, columns_;
  HarmonicResult& result_;
  Observer& observer_;
  Teams teams_;
};

}  // namespace espalier::harmonic
