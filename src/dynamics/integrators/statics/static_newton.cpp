#include "dynamics/integrators/statics/static_newton.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "dynamics/integrators/newton_limits.hpp"

namespace espalier::dynamics {
namespace {

class Corrector {
 public:
  Corrector(StaticProblem& problem, const StaticPlane* plane, double tolerance)
      : problem_(problem), plane_(plane), tolerance_(tolerance) {}

  StaticNewtonResult run(StaticPoint& x, int most_iterations) {
    if (!problem_.evaluate(x)) return end(StaticOutcome::not_finite);
    std::optional<StaticIncrement> next;  // the coming step, where the old factor still serves
    while (!problem_.balanced(x, tolerance_)) {
      if (slow_ && problem_.at_rounding(x)) break;
      if (result_.iterations == most_iterations) return end(StaticOutcome::too_many);
      if (!next) {
        if (!factorize(x)) return end(problem_.at_rounding(x) ? StaticOutcome::converged : StaticOutcome::singular);
        next = direction(x);
      }
      const double length = this->length(*next);
      if (result_.iterations++ == 0) result_.first = length;
      if (!std::isfinite(length)) return end(StaticOutcome::singular);
      const StaticIncrement d = *std::exchange(next, std::nullopt);
      next = search(x, d, length);
      if (!moved_ && problem_.at_rounding(x)) break;
      if (!moved_ && !leap(x, d, length)) return end(StaticOutcome::no_progress);
    }
    return end(StaticOutcome::converged);
  }

 private:
  StaticNewtonResult end(StaticOutcome outcome) {
    result_.outcome = outcome;
    return result_;
  }

  bool factorize(const StaticPoint& x) {
    ++result_.factorizations;
    if (!problem_.factorize(x)) return false;
    if (plane_ != nullptr) rate_ = problem_.rate(x);
    return true;
  }

  /// With the last factor; on a plane the change of the share keeps the step in it.
  StaticIncrement direction(const StaticPoint& x) {
    StaticIncrement d = problem_.correction(x);
    if (plane_ == nullptr) return d;
    const double square = plane_->scale * plane_->scale;
    const double slope = problem_.dot(plane_->normal, rate_) / square + plane_->normal.share;
    d.share = -problem_.dot(plane_->normal, d) / square / slope;
    for (std::size_t i = 0; i < d.x.size(); ++i) d.x[i] += d.share * rate_.x[i];
    return d;
  }

  [[nodiscard]] double length(const StaticIncrement& d) const {
    return plane_ == nullptr ? problem_.norm(d) : std::hypot(problem_.norm(d) / plane_->scale, d.share);
  }

  /// Moves x along d as far as the natural level falls. @return the next step, if the factor is to be kept
  std::optional<StaticIncrement> search(StaticPoint& x, const StaticIncrement& d, double length) {
    constexpr double kShortest = 1.0 / 64, kFast = 0.1;
    moved_ = false;
    for (double part = 1; part >= kShortest; part *= 0.5) {
      StaticPoint trial = problem_.moved(x, d, part);
      if (!problem_.evaluate(trial)) continue;
      StaticIncrement after = direction(trial);
      const double ratio = this->length(after) / length;
      if (!(ratio <= 1 - 0.25 * part) && !problem_.balanced(trial, tolerance_)) continue;
      x = std::move(trial);
      moved_ = true;
      slow_ = ratio > 0.5;
      if (part == 1 && ratio < kFast) return after;
      return std::nullopt;
    }
    static_cast<void>(problem_.evaluate(x));  // the constraints of the last trial are gone
    return std::nullopt;
  }

  /// The whole step, though the level rises: where a slender member has been stretched by its turn, Newton takes the
  /// stretch out first and bends it later, and no shorter step is any better. As long as the steps stay small beside
  /// what the caller allows for the first one.
  bool leap(StaticPoint& x, const StaticIncrement& d, double length) {
    constexpr int kMostLeaps = 6;
    StaticPoint trial = problem_.moved(x, d, 1);
    if (++leaps_ > kMostLeaps || !problem_.evaluate(trial)) return false;
    result_.first = std::max(result_.first, length);
    x = std::move(trial);
    return true;
  }

  StaticProblem& problem_;
  const StaticPlane* plane_;
  double tolerance_;
  int leaps_ = 0;
  StaticIncrement rate_;
  bool moved_ = false, slow_ = false;  // the last step: was one found, did it gain little
  StaticNewtonResult result_;
};

}  // namespace

StaticNewtonResult correct(StaticProblem& problem, StaticPoint& x, const StaticPlane* plane, double tolerance,
                           int most_iterations) {
  StaticNewtonResult result = Corrector(problem, plane, tolerance).run(x, most_iterations);
  System& system = problem.equations().system();
  for (int round = 0; result.outcome == StaticOutcome::converged && system.augment(x.state.view()); ++round) {
    const StaticNewtonResult next = Corrector(problem, plane, tolerance).run(x, most_iterations);
    result.outcome = round < kMostAugmentations ? next.outcome : StaticOutcome::no_progress;
    result.iterations += next.iterations;
    result.factorizations += next.factorizations;
  }
  return result;
}

}  // namespace espalier::dynamics
