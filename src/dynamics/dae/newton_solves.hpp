/// \file
/// Solves of Newton's iteration with factors whose precision the solver chooses (Precision::automatic).
#pragma once

#include <span>

#include "espalier/solver.hpp"

namespace espalier::dynamics {

/// Newton's iteration corrects what a solve leaves, so that solves are not refined, whether the factor is of FP64 or of
/// FP32. A factor of FP32 must earn that: its first solve is refined by one step. Where that leaves a backward error
/// above kMostError, the factor contracts too slowly for Newton's iteration, too, and the solver goes to FP64 by itself
/// (Options::required_backward_error), in the same call.
class NewtonSolves {
 public:
  /// An unrefined solution has a backward error of about 1e-7; so the factor contracts by less than a hundredth.
  static constexpr double kMostError = 1e-9;

  /// After each factorization.
  void take(const Solver& solver, const FactorResult& factor);
  /// Solver::solve().
  Status solve(Solver& solver, std::span<const double> b, std::span<double> x, Index columns);

 private:
  bool to_check_ = false;
};

}  // namespace espalier::dynamics
