#include "dynamics/integrators/derivatives/sensitivity.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/at.hpp"
#include "dense/dense.hpp"
#include "dynamics/dae/products.hpp"
#include "dynamics/integrators/history.hpp"

namespace espalier::dynamics {
namespace {

constexpr int kMostPasses = 60;
constexpr double kLastChange = 1e-10;     // change of a pass over the largest derivative
constexpr double kShrinks = 0.7;          // passes that gain less are at the rounding of the differences
constexpr double kRoundingShare = 1e-13;  // change of a state by a whole step that is none, over its size
constexpr int kFirstPasses = 4;           // before that is looked at
constexpr double kNoise = 1e-7;           // changes below this that do not shrink are rounding
constexpr int kMostPoor = 15;             // passes in a row that gain nothing
constexpr double kHelped = 0.3;           // passes that shrink less are helped
// Changes that are rounding, over those that move no state: of a pass, and of the last passes of a whole run.
constexpr double kPassRounding = 0.004, kLeftRounding = 0.1;
constexpr int kTurns = 3;  // poor passes, after which the tangent of a side is taken

void add_to(std::vector<double>& x, double factor, const std::vector<double>& y) {
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += factor * y[i];
}

/// Anderson's mixing of passes x -> g(x): the combination of the last ones whose change is least (Walker, Ni, SIAM J.
/// Numer. Anal. 49 (2011)). Of a linear g whose matrix differs from the exact one in few directions it is exact after
/// as many passes.
class PassMemory {
 public:
  void begin() { begun_ = true; }
  [[nodiscard]] bool begun() const { return begun_; }
  /// @param x  where a pass began @param g  what it made of it @return where the next one should begin
  [[nodiscard]] Variation next(const Variation& x, const Variation& g) {
    if (scale_.size() == 0) scale_ = scales(g);
    const Eigen::VectorXd from = packed(x), to = packed(g);
    g_.push_back(to);
    change_.push_back(scale_.cwiseProduct(to - from));
    if (g_.size() > kMost) {
      g_.pop_front();
      change_.pop_front();
    }
    if (g_.size() < 2) return g;
    const auto columns = static_cast<Eigen::Index>(g_.size()) - 1;
    Eigen::MatrixXd of_change(to.size(), columns), of_g(to.size(), columns);
    for (Eigen::Index j = 0; j < columns; ++j) {
      const auto k = static_cast<std::size_t>(j);
      of_change.col(j) = change_[k + 1] - change_[k];
      of_g.col(j) = g_[k + 1] - g_[k];
    }
    const Eigen::VectorXd mix = dense::least_squares(of_change, change_.back());
    const Eigen::VectorXd mixed = to - of_g * mix;
    return mixed.allFinite() ? unpacked(mixed, g) : g;
  }

 private:
  static constexpr std::size_t kMost = 20;
  static Eigen::VectorXd packed(const Variation& x) {
    Eigen::VectorXd all(static_cast<Eigen::Index>(x.dq.size() + x.dv.size() + x.da.size() + x.dlambda.size()));
    Eigen::Index at = 0;
    for (const auto* part : {&x.dq, &x.dv, &x.da, &x.dlambda})
      for (const double y : *part) all[at++] = y;
    return all;
  }
  static Variation unpacked(const Eigen::VectorXd& all, Variation x) {
    Eigen::Index at = 0;
    for (auto* part : {&x.dq, &x.dv, &x.da, &x.dlambda})
      for (double& y : *part) y = all[at++];
    return x;
  }
  /// One over the largest number of each of the four parts.
  static Eigen::VectorXd scales(Variation x) {
    for (auto* part : {&x.dq, &x.dv, &x.da, &x.dlambda}) {
      const double size = max_norm(*part);
      std::fill(part->begin(), part->end(), size > 0 ? 1 / size : 1.0);
    }
    return packed(x);
  }

  bool begun_ = false;
  Eigen::VectorXd scale_;
  std::deque<Eigen::VectorXd> g_, change_;
};

}  // namespace

ForwardSensitivity::ForwardSensitivity(Equations& nominal, const std::vector<ParameterSides>& parameters,
                                       bool remembers)
    : nominal_(nominal), usual_(remembers ? parameters.front().above : &nominal), linear_(usual_) {
  for (const ParameterSides& p : parameters) {
    Side side;
    side.of = p;
    for (Equations* e : {p.below, p.above}) e->set_dropped(nominal_.dropped());
    sides_.push_back(std::move(side));
  }
}

void ForwardSensitivity::start(const State& nominal, const std::vector<std::array<const State*, 2>>& states) {
  past_.assign(1, {nominal.t, nominal.q, nominal.v});
  const std::size_t n = nominal.v.size();
  for (std::size_t k = 0; k < sides_.size(); ++k) {
    Side& side = sides_[k];
    const double over = 1 / (2 * side.of.step);
    std::vector<double> theta[2] = {std::vector<double>(n), std::vector<double>(n)};
    for (int a = 0; a < 2; ++a) nominal_.system().local(nominal.q, states[k][static_cast<std::size_t>(a)]->q, theta[a]);
    const auto change = [&](const std::vector<double>& below, const std::vector<double>& above) {
      std::vector<double> x(below.size());
      for (std::size_t i = 0; i < x.size(); ++i) x[i] = over * (above[i] - below[i]);
      return x;
    };
    const State &below = *states[k][0], &above = *states[k][1];
    side.s = {change(theta[0], theta[1]), change(below.v, above.v), change(below.a, above.a),
              change(below.lambda, above.lambda)};
    side.past.assign(1, side.s);
    side.size_q = max_norm(side.s.dq);
    side.size_v = max_norm(side.s.dv);
    place(side, nominal);
  }
}

// The states to both sides: q (+) +-step dq and so on.
void ForwardSensitivity::place(Side& side, const State& now) const {
  std::vector<double> step(now.v.size());
  for (int a = 0; a < 2; ++a) {
    const double way = a == 0 ? -side.of.step : side.of.step;
    State& s = side.state[a];
    s = now;
    for (std::size_t i = 0; i < step.size(); ++i) step[i] = way * side.s.dq[i];
    nominal_.system().retract(now.q, step, s.q);
    add_to(s.v, way, side.s.dv);
    add_to(s.a, way, side.s.da);
    add_to(s.lambda, way, side.s.dlambda);
  }
}

ForwardSensitivity::SidePast ForwardSensitivity::past_of(const Side& side, int above) const {
  SidePast result;
  const double way = above ? side.of.step : -side.of.step;
  const std::size_t n = side.s.dq.size();
  for (std::size_t j = 0; j + 1 < weights_.size(); ++j) {
    std::vector<double> step(n), q(past_[j].q.size()), v = past_[j].v;
    for (std::size_t i = 0; i < n; ++i) step[i] = way * side.past[j].dq[i];
    nominal_.system().retract(past_[j].q, step, q);
    add_to(v, way, side.past[j].dv);
    if (j == 0) result.base = q;
    result.theta.emplace_back(n);
    nominal_.system().local(result.base, q, result.theta.back());
    result.v.push_back(std::move(v));
  }
  return result;
}

void ForwardSensitivity::measure(Side& side, const SidePast past[2], Defects& out) {
  const std::size_t n = side.s.dq.size(), m = side.s.dlambda.size();
  const double over = 1 / (2 * side.of.step);
  for (auto* x : {&out.motion, &out.chart, &out.rate}) x->assign(n, 0.0);
  for (auto* x : {&out.position, &out.velocity, &out.acceleration}) x->assign(m, 0.0);
  std::vector<double> row(m), f(n), theta(n);
  const std::vector<char>& dropped = nominal_.dropped();
  for (int a = 0; a < 2; ++a) {
    const double sign = a == 0 ? -over : over;
    const State& s = side.state[a];
    Equations& e = equations(side, a);
    e.evaluate_constraints(s.t, s.q, s.v);
    for (std::size_t i = 0; i < m; ++i)
      if (dropped.empty() || dropped[i] == 0) out.position[i] += sign * e.phi()[i];
    e.level(s.v, e.nu(), row);
    add_to(out.velocity, sign, row);
    e.level(s.a, e.gamma(), row);
    add_to(out.acceleration, sign, row);
    e.motion(s.view(), f);
    add_to(out.motion, sign, f);
    if (hp_ == 0) continue;
    nominal_.system().local(past[a].base, s.q, theta);
    std::vector<double> rate(n);
    for (std::size_t i = 0; i < n; ++i) {
      rate[i] = weights_[0] * theta[i];
      double acceleration = weights_[0] * s.v[i];
      for (std::size_t j = 0; j + 1 < weights_.size(); ++j) {
        rate[i] += weights_[j + 1] * past[a].theta[j][i];
        acceleration += weights_[j + 1] * past[a].v[j][i];
      }
      out.rate[i] += sign * (s.a[i] - acceleration);
    }
    nominal_.system().velocity_of_rate(theta, rate, rate);
    for (std::size_t i = 0; i < n; ++i) out.chart[i] += sign * (s.v[i] - rate[i]);
    e.set_slip(rate, hp_);
    for (const Index i : e.system().non_holonomic()) out.position[at(i)] += sign * e.phi()[at(i)];
  }
}

std::vector<double> ForwardSensitivity::times_w(const std::vector<double>& x) const {
  std::vector<double> y(x.size(), 0.0);
  KktSolver& kkt = linear_->kkt();
  add_transposed(kkt.w_pattern(), kkt.w_of_factor(), x, y);
  return y;
}

void ForwardSensitivity::solve(const std::vector<double>& upper, const std::vector<double>& lower,
                               std::vector<double>& x, std::vector<double>& multipliers) {
  std::vector<double> b = upper;
  for (const double y : lower) b.push_back(-y);
  linear_->solve(b);
  x.assign(b.begin(), b.begin() + static_cast<std::ptrdiff_t>(upper.size()));
  multipliers.assign(b.begin() + static_cast<std::ptrdiff_t>(upper.size()), b.end());
}

// As Newton's passes: q on its level, then v at the new q, then a and lambda; the largest change, relative.
ForwardSensitivity::Change ForwardSensitivity::pass(Side& side, const SidePast past[2], const State& now) {
  Defects d;
  std::vector<double> x, multipliers;
  double change_q = 0, change_v = 0;
  if (hp_ > 0) {
    measure(side, past, d);
    for (double& y : d.chart) y *= hp_;
    solve(times_w(d.chart), d.position, x, multipliers);
    add_to(side.s.dq, 1, x);
    change_q = max_norm(x);
    place(side, now);
    measure(side, past, d);
    for (double& y : d.rate) y *= hp_;
    solve(times_w(d.rate), d.velocity, x, multipliers);
    add_to(side.s.dv, 1, x);
    change_v = max_norm(x);
    place(side, now);
  }
  measure(side, past, d);
  for (double& y : d.motion) y = -y;
  solve(d.motion, hp_ > 0 ? d.acceleration : d.position, x, multipliers);
  add_to(side.s.dlambda, 1, multipliers);
  if (hp_ > 0) {
    add_to(side.s.da, 1, x);
    add_to(side.s.dv, hp_, x);
    add_to(side.s.dq, hp_ * hp_, x);
    change_v = std::max(change_v, hp_ * max_norm(x));
    change_q = std::max(change_q, hp_ * hp_ * max_norm(x));
  } else {
    add_to(side.s.dq, 1, x);
    change_q = max_norm(x);
  }
  place(side, now);
  side.size_q = std::max(side.size_q, max_norm(side.s.dq));
  side.size_v = std::max(side.size_v, max_norm(side.s.dv));
  return {change_q, change_v};
}

double ForwardSensitivity::relative(const Side& side, const Change& change, double rounding) {
  const auto over = [rounding](double x, double size, double nothing) {
    return x <= rounding * nothing ? 0 : x / std::max(size, nothing);
  };
  return std::max(over(change.q, side.size_q, side.nothing_q), over(change.v, side.size_v, side.nothing_v));
}

double ForwardSensitivity::defect() const {
  double worst = 0;
  for (const Side& side : sides_) worst = std::max(worst, relative(side, side.left, kLeftRounding));
  return worst;
}

// Where friction sticks on one side and slips on the other, no tangent at the nominal state is that of their
// difference. Each side's own is at least as stiff as that of the mean on one of them.
void ForwardSensitivity::take_tangent_of(const Side& side, int above) {
  linear_ = &equations(side, above);
  const State& s = side.state[static_cast<std::size_t>(above)];
  linear_->evaluate_constraints(s.t, s.q, s.v);
  linear_->factorize(s.view(), {1, hp_, hp_ * hp_});
}

// With what a side remembers (where its springs hold on) its tangent at the nominal state may be that of a slip.
void ForwardSensitivity::take_tangent(const State& now) {
  if (usual_ != &nominal_) return take_tangent_of(sides_.front(), 1);
  linear_ = usual_;
  linear_->evaluate_constraints(now.t, now.q, now.v);
  linear_->factorize(now.view(), {1, hp_, hp_ * hp_});
}

void ForwardSensitivity::settle(Side& side, const State& now, const SidePast past[2]) {
  place(side, now);
  side.nothing_q = std::max(side.nothing_q, kRoundingShare * max_norm(now.q) / side.of.step);
  side.nothing_v = std::max(side.nothing_v, kRoundingShare * max_norm(now.v) / side.of.step);
  Change change;
  double size = 0, least = std::numeric_limits<double>::infinity();
  int poor = 0, turns = 0;
  PassMemory memory;
  for (int k = 0; k < kMostPasses; ++k) {
    const double before = size;
    const Variation from = side.s;
    change = pass(side, past, now);
    size = relative(side, change, kPassRounding);
    if (!std::isfinite(size))
      throw Error(StatusCode::accuracy_not_reached, fmt::format("the sensitivities at t = {:g} are no numbers", now.t));
    const bool stands = size > kShrinks * std::min(before, least);
    // A change of a state that is none: the sides do not see it.
    const bool nothing = size < kNoise || (change.q <= side.nothing_q && change.v <= side.nothing_v);
    poor = stands ? poor + 1 : 0;
    if (size <= kLastChange || (k >= kFirstPasses && stands && (nothing || poor > kMostPoor))) break;
    least = std::min(least, size);
    if (stands && poor % kTurns == 0 && !nothing && hp_ > 0) {
      take_tangent_of(side, turns++ % 2 == 0 ? 1 : 0);
      memory = {};
      continue;
    }
    if (k > 0 && !nothing && size > kHelped * before) memory.begin();
    if (!memory.begun()) continue;
    side.s = memory.next(from, side.s);
    place(side, now);
  }
  if (turns > 0) take_tangent(now);
  side.left = {std::max(side.left.q, change.q), std::max(side.left.v, change.v)};
}

// By one step of Euler's method: where the step is a good one, that is nearly it.
void ForwardSensitivity::predict(Side& side) const { add_to(side.s.dq, hp_, side.past[0].dv); }

void ForwardSensitivity::step(const State& now, int order) {
  const auto points = std::min<std::size_t>(past_.size(), static_cast<std::size_t>(std::max(order, 1)));
  std::vector<double> times;
  for (std::size_t j = 0; j < points; ++j) times.push_back(past_[j].t);
  weights_.assign(points + 1, 0.0);
  derivative_weights(now.t, times, weights_);
  hp_ = 1 / weights_[0];
  for (Side& side : sides_) {
    predict(side);
    place(side, now);
  }
  take_tangent(now);
  for (Side& side : sides_) {
    const SidePast past[2] = {past_of(side, 0), past_of(side, 1)};
    settle(side, now, past);
    side.past.push_front(side.s);
    if (side.past.size() > kMaxBdfOrder) side.past.pop_back();
    for (int a = 0; a < 2; ++a) equations(side, a).system().accept(side.state[a].view());
  }
  past_.push_front({now.t, now.q, now.v});
  if (past_.size() > kMaxBdfOrder) past_.pop_back();
}

void ForwardSensitivity::statics(const State& now) {
  hp_ = 0;
  weights_.clear();
  linear_->evaluate_constraints(now.t, now.q, now.v);
  linear_->factorize(now.view(), {0, 0, 1});
  const SidePast none[2];
  for (Side& side : sides_) {
    const std::size_t n = now.v.size();
    side.s = {std::vector<double>(n), std::vector<double>(n), std::vector<double>(n),
              std::vector<double>(now.lambda.size())};
    settle(side, now, none);
  }
}

}  // namespace espalier::dynamics
