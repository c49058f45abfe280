/// \file
/// Laws with a switch (contact that opens and closes, friction that turns round, limits, corners of tables, abs(t -
/// 1)), and steps that must not pass one unseen.
///
/// An implicit step sees forces at its end alone. What has switched once in a step is different there, and the error
/// test meets it. What has switched twice (a short blow, a stop that was touched and left, a body that has passed
/// through another one) is over by then: the step has to end in between.
#pragma once

#include <algorithm>
#include <functional>
#include <memory>
#include <vector>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

/// A number that tells the branch of a law: the law changes where it passes zero or, of `levels`, any whole number.
struct Branch {
  double value = 0;
  bool levels = false;
  bool timed = false;  ///< a function of time alone, not of the state
  double dead = 0;     ///< about zero the law is as good as the same on both sides: |value| up to this. Not of levels
};
using Branches = std::vector<Branch>;
/// Appends the branches at a state; of one law always as many, in the same order.
using BranchesOf = std::function<void(const StateView&, Branches&)>;

/// The branch of what is constant below 0 and beyond 1: its level, a Branch that switches at both.
[[nodiscard]] inline double level_of_step(double x) { return std::clamp(x, -0.5, 1.5); }

/// A step that the error test has found good, before it is accepted.
class StepPath {
 public:
  /// @param between the state at a time within the step; both ends outlive the object
  /// @param change of the velocities over the step, in units of the error test
  /// @param absolute tolerance: what the state does below it is not resolved
  StepPath(const State& begin, const State& end, std::function<State(double t)> between, double change, double absolute)
      : begin_(begin), end_(end), between_(std::move(between)), change_(change), absolute_(absolute) {}
  [[nodiscard]] const State& begin() const { return begin_; }
  [[nodiscard]] const State& end() const { return end_; }
  /// The state after a share of the step, in [0, 1]; kept, so that several laws may ask for the same.
  [[nodiscard]] const State& at(double share) const;
  [[nodiscard]] double length() const { return end_.t - begin_.t; }
  [[nodiscard]] double absolute() const { return absolute_; }
  /// Whether the velocities change by less than the tolerance in what follows that share.
  [[nodiscard]] bool negligible_after(double share) const { return (1 - share) * change_ <= 1; }

 private:
  const State &begin_, &end_;
  std::function<State(double)> between_;
  double change_, absolute_;
  struct Sample {
    double share;
    State state;
  };
  mutable std::vector<std::unique_ptr<Sample>> samples_;
};

/// The share of a step at which it should end, so that a branch is seen that its end does not show: between the first
/// two switches. 1: there are less than two.
[[nodiscard]] double first_unseen(const StepPath& path, const BranchesOf& branches);

/// A force that falls with the speed: F_v contains slope d d^T, slope < 0. What moves along d grows with the rate
/// -slope / m, m the mass that the system has for d. Implicit steps that are long beside that damp what should grow.
struct FallingForce {
  std::vector<Index> coordinates;
  std::vector<double> direction;  ///< d, of these coordinates
  double slope = 0;
};

/// A component with a law that switches.
class Switching {
 public:
  virtual ~Switching() = default;
  /// See BranchesOf.
  virtual void branches(const StateView& /*s*/, Branches& /*out*/) const {}
  /// first_unseen() of its branches, or what else its law has to say of a step.
  [[nodiscard]] virtual double unseen(const StepPath& path);
  /// Appends forces that fall with the speed at a state.
  virtual void add_falling(const StateView& /*s*/, std::vector<FallingForce>& /*out*/) {}
};

/// The laws of an AssembledSystem; they live as long as it.
[[nodiscard]] std::vector<Switching*> switching_laws(const System& system);

}  // namespace espalier::dynamics
