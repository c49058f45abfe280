#include "dynamics/integrators/statics/relaxation.hpp"

#include <algorithm>

#include "dynamics/integrators/newton_limits.hpp"

namespace espalier::dynamics {
namespace {

class Relaxation {
 public:
  Relaxation(StaticProblem& problem, const StaticsOptions& options) : problem_(problem), options_(options) {}

  RelaxationResult run(StaticPoint& x) {
    x.share = 1;
    if (!problem_.evaluate(x)) return result_;
    begin(x);
    constexpr int kStagnant = 100;  // steps without a halving of the residual
    double previous = problem_.residual(x), travelled = 0, best = previous;
    int since_best = 0;
    while (unfinished(x)) {
      if (result_.iterations == options_.max_steps) return result_;
      const double length = step(x);
      if (!(length > 0)) return result_;
      travelled += length;
      const double now = problem_.residual(x);
      if (result_.iterations > 1 && now > 0.5 * previous && problem_.at_rounding(x)) break;
      since_best = now < 0.5 * best ? 0 : since_best + 1;
      if (since_best == 0) best = now;
      if (since_best >= kStagnant && problem_.near_rounding(x)) break;
      // The first residual is one without reactions.
      if (result_.iterations > 1 && previous > 0) stiffening_ *= std::clamp(now / previous, 0.05, 4.0);
      previous = now;
      if (travelled > kRunsAway * problem_.size()) {
        result_.runs_away = true;
        return result_;
      }
    }
    result_.converged = true;
    return result_;
  }

 private:
  static constexpr double kRunsAway = 30, kLongest = 0.33, kFirst = 0.1;

  /// Out of balance, or the system has changed multipliers of its own (augmented Lagrangian).
  [[nodiscard]] bool unfinished(StaticPoint& x) {
    if (!problem_.balanced(x, options_.tolerance)) return true;
    if (augmentations_ == kMostAugmentations || !problem_.equations().system().augment(x.state.view())) return false;
    ++augmentations_;
    return problem_.evaluate(x);
  }

  /// The first step covers a tenth of the system, M^-1 r / stiffening, unless the options say how long it is.
  void begin(const StaticPoint& x) {
    const double tau = options_.pseudo_time;
    stiffening_ = tau > 0 ? 1 / (tau * tau) : problem_.residual(x) / (kFirst * problem_.size());
  }

  /// @return its length; 0: none was possible
  double step(StaticPoint& x) {
    constexpr int kTrials = 60;
    for (int k = 0; k < kTrials; ++k, stiffening_ = std::max(4 * stiffening_, smallest(x)), ++result_.failures) {
      ++result_.factorizations;
      if (!problem_.factorize(x, stiffening_)) continue;
      StaticIncrement d = problem_.correction(x);
      const double length = problem_.norm(d);
      if (!(length <= kLongest * problem_.size())) continue;
      StaticPoint trial = problem_.moved(x, d, 1);
      if (!problem_.evaluate(trial)) {
        static_cast<void>(problem_.evaluate(x));  // the constraints of the trial are gone
        continue;
      }
      x = std::move(trial);
      ++result_.iterations;
      result_.last = std::move(d);
      return std::max(length, 1e-300);
    }
    return 0;
  }

  // Far below what holds the first step to its length.
  [[nodiscard]] double smallest(const StaticPoint& x) const { return 1e-9 * problem_.residual(x) / problem_.size(); }

  StaticProblem& problem_;
  const StaticsOptions& options_;
  double stiffening_ = 0;
  int augmentations_ = 0;
  RelaxationResult result_;
};

}  // namespace

RelaxationResult relax(StaticProblem& problem, StaticPoint& x, const StaticsOptions& options) {
  return Relaxation(problem, options).run(x);
}

}  // namespace espalier::dynamics
