/// \file
/// When a new factor costs less than the passes of Newton's iteration that an old one takes in addition.
#pragma once

#include "dynamics/dae/linear_solver.hpp"

namespace espalier::dynamics {

/// What a system counts: the sizes that the times of a pass and of a new factor grow with.
struct NewtonWork {
  FactorWork factor;        ///< zeros: K is dense
  Index unknowns = 0;       ///< n + m
  Offset entries_of_w = 0;  ///< of the tangent
  Offset entries_of_k = 0;
  bool on_gpu = false;  ///< where the factor is
};

/// So many passes of Newton's iteration (forces, constraints, a solve, vectors) take as long as a new factor with its
/// tangent: a power of two from 1 to 64. It follows from counts and from rates that were measured once
/// (factor_renewal.cpp), never from a clock, so that runs repeat to the bit on any machine and with any threads.
[[nodiscard]] double passes_of_factor(const NewtonWork& work);

/// The steps that one factor serves. As it ages, steps take more passes. The average cost of a step, with the factor's
/// own cost in it, is least when the factor is replaced as soon as a step costs more than that average (the rule for
/// the replacement of what wears out; J. S. Taylor, J. Am. Stat. Assoc. 18, 1923).
class FactorLife {
 public:
  /// There is a new factor.
  void begin() { steps_ = passes_ = 0; }
  /// A step was accepted after so many passes with the factor. @param cost  passes_of_factor()
  /// @return whether the next step should have a new factor
  [[nodiscard]] bool spent_by(int passes, double cost) {
    ++steps_;
    passes_ += passes;
    return static_cast<double>(passes) * static_cast<double>(steps_) > static_cast<double>(passes_) + cost;
  }

 private:
  long steps_ = 0, passes_ = 0;
};

}  // namespace espalier::dynamics
