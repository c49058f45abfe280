/// \file
/// Forces along one relative coordinate of two frames: springs, motors, stops, friction.
#pragma once

#include "dynamics/forces/frame_force.hpp"
#include "dynamics/joints/turn_counter.hpp"

namespace espalier::dynamics {

/// Where a law is evaluated: time, the coordinate g, its rate, and the force's inputs.
struct LawPoint {
  double t = 0, g = 0, rate = 0;
  std::span<const double> inputs;
  double load = 1;  ///< load factor of statics: on what drives, not on what is elastic
};

/// s(t, g, g', inputs): the force along g, positive where it pulls g down.
class CoordinateLaw {
 public:
  struct Strength {
    double value = 0, by_g = 0, by_rate = 0;
  };
  virtual ~CoordinateLaw() = default;
  [[nodiscard]] virtual Strength strength(const LawPoint& p) const = 0;
  [[nodiscard]] virtual double by_input(const LawPoint& /*p*/, std::size_t /*i*/) const { return 0; }
  /// Energy stored; its derivative by g is the part of s that is conservative.
  [[nodiscard]] virtual double potential(double /*g*/) const { return 0; }
  /// Whether branches() appends anything.
  [[nodiscard]] virtual bool switches() const { return false; }
  virtual void branches(const LawPoint& /*p*/, Branches& /*out*/) const {}
};

/// Applies a law along a relative coordinate: wrench -c s, c = dg/dx. An angle counts its turns.
class CoordinateForce final : public FrameForce, public Remembers {
 public:
  using Coordinate = PairCoordinate;
  CoordinateForce(std::string name, FramePtr a, FramePtr b, Coordinate coordinate, std::unique_ptr<CoordinateLaw> law);

  [[nodiscard]] const Coordinate& coordinate() const { return coordinate_; }
  [[nodiscard]] const TurnCounter& turns() const { return turns_; }
  [[nodiscard]] const CoordinateLaw& strength_law() const { return *law_; }

  void add_falling(const StateView& s, std::vector<FallingForce>& out) override;
  void accept(const StateView& s) override;
  void save(std::vector<double>& out) const override;
  void restore(ConstSpan& in) override;

 protected:
  [[nodiscard]] Vec12 law(const Pair& p) const override;
  void law_derivatives(const Pair& p, Mat12& k, Mat12& d) const override;
  [[nodiscard]] Vec12 law_by_input(const Pair& p, std::size_t i) const override;
  [[nodiscard]] double potential(const Pair& p) const override;
  void law_branches(const StateView& s, Branches& out) const override;

 private:
  /// Evaluates g with its gradient. @return the point for the law
  [[nodiscard]] LawPoint point(const Pair& p, RelativeValue& g) const;

  Coordinate coordinate_;
  std::unique_ptr<CoordinateLaw> law_;
  TurnCounter turns_;
};

/// s of a force as a number of the state, 0 where it is switched off. The force must outlive it, and have its inputs.
[[nodiscard]] StateFunctionPtr strength_of(const CoordinateForce& force);
/// g or its rate.
[[nodiscard]] StateFunctionPtr coordinate_of(const CoordinateForce& force, bool rate);

/// A motor: its inputs, added up; positive pushes g up.
[[nodiscard]] std::unique_ptr<CoordinateLaw> motor_law();

}  // namespace espalier::dynamics
