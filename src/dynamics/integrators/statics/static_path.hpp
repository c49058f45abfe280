/// \file
/// Follows the equilibria of a StaticProblem from share 0 to share 1.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynamics/integrators/statics/static_newton.hpp"
#include "dynamics/integrators/statics/statics.hpp"

namespace espalier::dynamics {

/// Predictor along the tangent (of second order from the second step on), corrector at a given load or, once that
/// fails, on the plane normal to the tangent.
class StaticFollower {
 public:
  /// All three must outlive it.
  StaticFollower(StaticProblem& problem, const StaticsOptions& options, const StaticsObserver& observer);

  /// Takes the start and its tangent. @return false where nothing holds the unloaded system: loose_end() says what
  [[nodiscard]] bool begin();
  /// @return true at share 1; false: stopped(), or failure() says why and point() how far it got
  [[nodiscard]] bool follow();
  /// Takes a point as the next step, from whatever method.
  void take(const StaticPoint& x, StaticsStep step);

  [[nodiscard]] const StaticPoint& point() const { return at_.x; }
  [[nodiscard]] bool stopped() const { return stopped_; }
  [[nodiscard]] long steps() const { return steps_; }
  [[nodiscard]] int iterations() const { return iterations_; }
  [[nodiscard]] const std::vector<CriticalPoint>& critical() const { return critical_; }
  [[nodiscard]] const std::string& loose_end() const { return loose_end_; }
  // The outcome of the last attempt that failed.
  [[nodiscard]] StaticOutcome failure() const { return failure_; }
  [[nodiscard]] double last_try() const { return last_try_; }        ///< change of the load factor, or length of arc
  [[nodiscard]] const std::string& where() const { return where_; }  ///< coordinate or constraint

 private:
  /// A point on the path with its direction.
  struct Knot {
    StaticPoint x;
    StaticIncrement tangent;  // of length one in the metric
    double length = 0;        // of the step that led here
    double correction = 0;    // how far Newton went from what the step foresaw, in the metric
    int sign = 0;             // of the determinant of K
    StaticNewtonResult newton;
  };

  [[nodiscard]] bool find_tangent(Knot& knot, const StaticIncrement* along);
  [[nodiscard]] double dot(const StaticIncrement& a, const StaticIncrement& b) const;
  [[nodiscard]] StaticPoint predicted(double length) const;
  /// One step of the path: by the share of the load, or by arc length.
  [[nodiscard]] std::optional<Knot> attempt(double step);
  [[nodiscard]] std::optional<Knot> land();
  [[nodiscard]] bool acceptable(const Knot& knot, double length) const;
  void accept(Knot knot);
  void lengthen(const Knot& knot);
  [[nodiscard]] double longest() const;
  [[nodiscard]] bool turn_back(double step);
  [[nodiscard]] double distance(const Knot& a, const Knot& b) const;
  void rescale();
  void start_arc();
  [[nodiscard]] bool note_critical(Knot& next, double step);
  [[nodiscard]] double locate_limit(const Knot& next, double step);
  [[nodiscard]] std::optional<double> locate_bifurcation(const Knot& next, double step);

  StaticProblem& problem_;
  const StaticsOptions& options_;
  const StaticsObserver& observer_;
  Knot at_;
  std::optional<Knot> edge_;               // the last point before a jump to another branch
  std::optional<StaticIncrement> before_;  // tangent at the last but one point, for the predictor
  double scale_ = 1;                       // of the metric
  double step_ = 0;
  bool arc_ = false, stopped_ = false;
  int failures_ = 0, factorizations_ = 0;  // since the last accepted step
  long steps_ = 0;
  int iterations_ = 0;
  std::vector<CriticalPoint> critical_;
  StaticOutcome failure_ = StaticOutcome::converged;
  double last_try_ = 0;
  std::string where_, loose_end_;
};

}  // namespace espalier::dynamics
