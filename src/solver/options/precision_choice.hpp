/// \file
/// Precision::automatic: whether a factor of FP32 with refinement pays, before and while it is used.
#pragma once

#include "device/backend.hpp"
#include "espalier/solver.hpp"

namespace espalier::solver {

/// How many times as long a factorization takes in FP64 as in FP32, by the model of the devices; 1 where it is short
/// in any case.
double gain_of_single(const device::Backend& backend, const analysis::AssemblyTree& tree, device::PlanWish wish,
                      int devices);

/// A gain below this is spent by the first refined solve.
inline constexpr double kLeastGain = 1.2;

/// Adds up what factors of FP32 and the solves with them take, and what the same would take in FP64: a factorization
/// `gain` times as long, then solves with one step of refinement and substitutions that take twice as long, because
/// they read twice as much.
class PrecisionWatch {
 public:
  explicit PrecisionWatch(double gain) : gain_(gain) {}

  void add_factorization(double seconds);
  void add_solve(const SolveResult& solve);
  /// A new factorization begins. @returns whether the last two factors, each with its solves, were slower than FP64
  bool next_factor();

  [[nodiscard]] double seconds() const { return single_; }        ///< of the last factor and its solves
  [[nodiscard]] double seconds_in_fp64() const { return fp64_; }  ///< what they would have taken

 private:
  double gain_;
  double single_ = 0, fp64_ = 0;
  bool solved_ = false;
  int losses_ = 0;  // in a row
};

}  // namespace espalier::solver
