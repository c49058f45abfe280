#include "dynamics/integrators/statics/static_path.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace espalier::dynamics {

namespace {
constexpr double kSharpest = 0.5;  // cosine of the largest turn between the tangents of two steps
}  // namespace

StaticFollower::StaticFollower(StaticProblem& problem, const StaticsOptions& options, const StaticsObserver& observer)
    : problem_(problem), options_(options), observer_(observer), step_(std::min(options.first_step, 1.0)) {
  at_.x = problem.start();
}

double StaticFollower::dot(const StaticIncrement& a, const StaticIncrement& b) const {
  return problem_.dot(a, b) / (scale_ * scale_) + a.share * b.share;
}

/// The direction of the path at a point, in the sense of `along` (none: of growing load).
bool StaticFollower::find_tangent(Knot& knot, const StaticIncrement* along) {
  ++factorizations_;
  if (!problem_.evaluate(knot.x) || !problem_.factorize(knot.x)) return false;
  knot.sign = problem_.determinant_sign();
  knot.tangent = problem_.rate(knot.x);
  double length = std::sqrt(dot(knot.tangent, knot.tangent));
  if (!std::isfinite(length)) return false;
  if (along != nullptr && dot(knot.tangent, *along) < 0) length = -length;
  for (double& value : knot.tangent.x) value /= length;
  knot.tangent.share /= length;
  return true;
}

bool StaticFollower::begin() {
  // Linear deflections beyond that are those of rounded zeros, or of cables that hang.
  constexpr double kLargest = 1e3;
  if (!find_tangent(at_, nullptr) || (problem_.forget_rounding() && !find_tangent(at_, nullptr))) {
    loose_end_ = problem_.why().message;
    if (loose_end_.empty()) loose_end_ = "its linear deflection is not a finite number";
    return false;
  }
  const double deflection = problem_.norm(at_.tangent) / at_.tangent.share;
  if (deflection == 0) step_ = 1;  // no loads
  if (deflection > kLargest * problem_.size()) {
    loose_end_ = fmt::format("its linear deflection is {:.3g} times its size", deflection / problem_.size());
    return false;
  }
  // Rounding is the stiffness of a motion that nothing holds, and where loads work on it, the path is rounding, too.
  if (deflection > 0 && problem_.indifferent()) {
    constexpr double kMoved = 1e-3;
    const double along = std::abs(problem_.dot(problem_.softest(), at_.tangent)) / at_.tangent.share;
    if (along > kMoved * problem_.size()) {
      loose_end_ = "a motion without stiffness, on which the loads work";
      return false;
    }
  }
  rescale();
  return true;
}

/// The metric in which the present deflection under the whole load counts as much as the load (not that of a limit
/// point, which is infinite).
void StaticFollower::rescale() {
  constexpr double kSoftest = 10;
  const double deflection = problem_.norm(at_.tangent) / std::abs(at_.tangent.share);
  if (deflection > 0) scale_ = steps_ == 0 ? deflection : std::clamp(deflection, scale_, kSoftest * scale_);
  const double length = std::sqrt(dot(at_.tangent, at_.tangent));
  for (double& value : at_.tangent.x) value /= length;
  at_.tangent.share /= length;
  before_.reset();
}

/// x + l t + l^2 / (2 L) (t - t_before), L the length of the last step.
StaticPoint StaticFollower::predicted(double length) const {
  StaticIncrement step = at_.tangent;
  if (before_ && at_.length > 0) {
    const double bend = 0.5 * length / at_.length;
    for (std::size_t i = 0; i < step.x.size(); ++i) step.x[i] += bend * (step.x[i] - before_->x[i]);
    step.share += bend * (step.share - before_->share);
  }
  return problem_.moved(at_.x, step, length);
}

std::optional<StaticFollower::Knot> StaticFollower::attempt(double step) {
  const double length = arc_ ? step : step / at_.tangent.share;
  Knot next;
  next.x = predicted(length);
  if (!arc_) next.x.share = at_.x.share + step > 1 - 1e-9 ? 1.0 : at_.x.share + step;
  next.length = length;
  const StaticPoint foreseen = next.x;
  const StaticPlane plane{at_.tangent, scale_};
  next.newton = correct(problem_, next.x, arc_ ? &plane : nullptr, options_.tolerance, options_.max_iterations);
  factorizations_ += next.newton.factorizations;
  failure_ = next.newton.outcome;
  last_try_ = step * (arc_ ? 1 : options_.load);
  if (failure_ != StaticOutcome::converged) {
    where_ = problem_.worst(next.x);
    return std::nullopt;
  }
  next.correction = problem_.norm(problem_.between(foreseen, next.x)) / scale_;
  if (!find_tangent(next, &at_.tangent) || !acceptable(next, length)) return std::nullopt;
  return next;
}

/// Far corrections and sharp turns lead to other branches.
bool StaticFollower::acceptable(const Knot& knot, double length) const {
  const double farthest = arc_ ? 0.3 : 0.7;
  const double first = arc_ ? knot.newton.first : knot.newton.first / scale_;
  if (!arc_ && !(knot.tangent.share > 0)) return false;
  return std::max(first, knot.correction) <= farthest * length && dot(knot.tangent, at_.tangent) > kSharpest;
}

void StaticFollower::take(const StaticPoint& x, StaticsStep step) {
  step.index = ++steps_;
  iterations_ += step.iterations;
  at_.x = x;
  if (!observer_) return;
  static_cast<void>(problem_.evaluate(at_.x));  // whoever looks on sees the loads of this point
  if (!observer_(step, at_.x.state)) stopped_ = true;
}

void StaticFollower::accept(Knot knot) {
  problem_.settle(knot.x);
  StaticsStep step;
  step.load = problem_.load(knot.x);
  step.change = step.load - problem_.load(at_.x);
  step.iterations = knot.newton.iterations;
  step.factorizations = factorizations_;
  step.failures = failures_;
  step.residual = problem_.residual(knot.x) / std::max(problem_.reference(), 1e-300);
  step.arc = arc_;
  failures_ = factorizations_ = 0;
  before_ = std::move(at_.tangent);
  at_ = std::move(knot);
  take(at_.x, step);
}

bool StaticFollower::follow() {
  constexpr int kPatience = 4;
  constexpr double kCreeping = 0.02;  // load steps this far below the first creep towards a limit point
  while (at_.x.share < 1) {
    if (stopped_ || steps_ == options_.max_steps || at_.x.share < -options_.largest_turnback) return false;
    const double step = arc_ ? step_ : std::min(step_, 1 - at_.x.share);
    std::optional<Knot> next = attempt(step);
    if (next && arc_ && next->x.share >= 1) next = land();
    if (next && !note_critical(*next, arc_ ? next->length : step)) {
      if (turn_back(step)) continue;
      next.reset();
    }
    if (!next) {
      ++failures_;
      step_ = 0.4 * step;
      const bool stuck = failures_ >= kPatience || step_ < kCreeping * options_.first_step;
      if (!arc_ && stuck && options_.path == StaticPath::automatic) start_arc();
      if (step_ < options_.smallest_step) return false;
      continue;
    }
    lengthen(*next);
    accept(std::move(*next));
  }
  return true;
}

void StaticFollower::lengthen(const Knot& knot) {
  const int k = knot.newton.factorizations;
  step_ *= k <= 3 ? 2.0 : k <= 6 ? 1.4 : k <= 9 ? 1.0 : 0.6;
  step_ = std::min(step_, longest());
}

/// Arcs may be longer than load steps where the load hardly changes, as long as they are short beside the system.
double StaticFollower::longest() const {
  constexpr double kPartOfSystem = 0.4;
  const double largest = options_.largest_step;
  if (!arc_) return largest;
  return std::max(largest, std::min(largest / std::max(std::abs(at_.tangent.share), 1e-300),
                                    kPartOfSystem * largest * problem_.size() / scale_));
}

/// After a step that ended on another branch: takes the last point of the own one, and from there shorter steps, by arc
/// length. @return false if there is no such point
bool StaticFollower::turn_back(double step) {
  failure_ = StaticOutcome::other_branch;
  if (!edge_) return false;
  step_ = 0.4 * step;
  accept(*std::exchange(edge_, std::nullopt));
  if (!arc_ && options_.path == StaticPath::automatic) start_arc();
  return true;
}

/// From now on by arc length. The first arc is as long as the first load step that failed.
void StaticFollower::start_arc() {
  rescale();
  arc_ = true;
  step_ = std::min(longest(), step_ * 8 / at_.tangent.share);
}

/// The point at the whole load, where the last arc went past it.
std::optional<StaticFollower::Knot> StaticFollower::land() {
  if (!(at_.tangent.share > 0)) return std::nullopt;  // the path turned on the way: in smaller steps
  Knot next;
  next.length = (1 - at_.x.share) / at_.tangent.share;
  next.x = predicted(next.length);
  next.x.share = 1;
  next.newton = correct(problem_, next.x, nullptr, options_.tolerance, options_.max_iterations);
  factorizations_ += next.newton.factorizations;
  failure_ = next.newton.outcome;
  if (failure_ == StaticOutcome::converged && find_tangent(next, &at_.tangent) &&
      dot(next.tangent, at_.tangent) > kSharpest)
    return next;
  where_ = problem_.worst(next.x);
  return std::nullopt;
}

/// Looks for limit points and bifurcations on the way to `next`. @pre the last factor is that of `next`
/// @return false if `next` lies on another branch
bool StaticFollower::note_critical(Knot& next, double step) {
  const bool turns = next.tangent.share * at_.tangent.share < 0;
  if (!turns && next.sign * at_.sign >= 0) return true;
  if (turns) {
    critical_.push_back({locate_limit(next, step) * options_.load, true});
  } else if (problem_.indifferent()) {
    next.sign = 0;  // nobody knows it
  } else if (const auto share = locate_bifurcation(next, step)) {
    critical_.push_back({*share * options_.load, false});
  } else {
    return false;
  }
  return true;
}

/// Where the tangent has no part of the load: regula falsi (Illinois) on the length of the arc.
double StaticFollower::locate_limit(const Knot& next, double step) {
  constexpr int kMost = 20;
  double left = 0, right = step, at_left = at_.tangent.share, at_right = next.tangent.share;
  double best = std::abs(at_left) < std::abs(at_right) ? at_.x.share : next.x.share;
  double smallest = std::min(std::abs(at_left), std::abs(at_right));
  for (int k = 0, side = 0; k < kMost && smallest > 1e-6; ++k) {
    const double middle = (left * at_right - right * at_left) / (at_right - at_left);
    const auto found = attempt(middle);
    if (!found) break;
    const double value = found->tangent.share;
    if (std::abs(value) < smallest) {
      smallest = std::abs(value);
      best = found->x.share;
    }
    if (value * at_right > 0) {
      right = middle, at_right = value;
      if (side == 1) at_left *= 0.5;
      side = 1;
    } else {
      left = middle, at_left = value;
      if (side == -1) at_right *= 0.5;
      side = -1;
    }
  }
  return best;
}

/// Where the determinant changes its sign: by halving. Points on both sides of a bifurcation come together; where they
/// do not, the step has jumped to another branch. @return none then; edge_ is the last point of this branch, if any
std::optional<double> StaticFollower::locate_bifurcation(const Knot& next, double step) {
  constexpr double kNarrow = 1e-7;
  constexpr int kLook = 6;    // halvings after which the two sides are compared,
  constexpr double kFar = 8;  // and how far apart they may be, in lengths of the interval that is left
  double left = 0, right = step, share = 0.5 * (at_.x.share + next.x.share);
  edge_.reset();
  Knot beyond = next;
  const double length = arc_ ? 1 : 1 / std::abs(at_.tangent.share);
  for (int k = 1; right - left > kNarrow * step; ++k) {
    const double middle = 0.5 * (left + right);
    auto found = attempt(middle);
    if (!found && k <= kLook) return std::nullopt;  // a path that goes straight on has no such place
    if (!found) break;
    share = found->x.share;
    if (found->sign == at_.sign) {
      left = middle;
      edge_ = std::move(found);
    } else {
      right = middle;
      beyond = std::move(*found);
    }
    if (k == kLook && distance(edge_ ? *edge_ : at_, beyond) > kFar * (right - left) * length) return std::nullopt;
  }
  return share;
}

double StaticFollower::distance(const Knot& a, const Knot& b) const {
  StaticIncrement d = problem_.between(a.x, b.x);
  return std::sqrt(dot(d, d));
}

}  // namespace espalier::dynamics
