// The formulas of variable step and order: history parts, predictor, local error, choice of step and order.
#include <algorithm>
#include <array>
#include <cmath>

#include "dynamics/integrators/bdf.hpp"

namespace espalier::dynamics {

void BdfIntegrator::set_formula(double h, int order) {
  formula_.order = order;
  formula_.h = h;
  formula_.t = state_.t + h;
  std::array<double, kMaxBdfOrder + 1> w{};
  derivative_weights(formula_.t, history_.times(order), w);
  formula_.hp = 1 / w[0];
  for (double& weight : w) weight *= -formula_.hp;
  combine_past({.to_theta = &MotionArrays::theta_hat, .to_v = &MotionArrays::v_hat},
               ConstSpan(w).subspan(1, at(order)));
}

// The weights belong to the newest points.
void BdfIntegrator::combine_past(PastSums sums, ConstSpan weights) {
  std::copy(weights.begin(), weights.end(), sums.weights);
  sums.count = static_cast<int>(weights.size());
  if (on_device()) return run(sums);
  // As the loop says, but point by point: vectors of a processor want that.
  const MotionArrays here = arrays();
  double *const theta = here.*sums.to_theta, *const v = here.*sums.to_v;
  const double* const from_theta = sums.from_theta == nullptr ? nullptr : here.*sums.from_theta;
  const double* const from_v = sums.from_v == nullptr ? nullptr : here.*sums.from_v;
  for_each_block(equations_.pool(), theta_.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) theta[i] = from_theta == nullptr ? 0.0 : from_theta[i];
    for (std::size_t i = begin; i < end; ++i) v[i] = from_v == nullptr ? 0.0 : from_v[i];
    for (std::size_t j = 0; j < weights.size(); ++j) {
      const double weight = weights[j];
      const double *const theta_j = here.past_theta[j], *const v_j = here.past_v[j];
      for (std::size_t i = begin; i < end; ++i) theta[i] += weight * theta_j[i];
      for (std::size_t i = begin; i < end; ++i) v[i] += weight * v_j[i];
    }
  });
}

void BdfIntegrator::predict() {
  std::array<double, kMaxBdfOrder + 2> w{};
  const int points = std::min(formula_.order + 1, history_.size());
  value_weights(formula_.t, history_.times(points), w);
  combine_past({.to_theta = &MotionArrays::theta, .to_v = &MotionArrays::v}, ConstSpan(w).first(at(points)));
  const int lambda_points = std::min(points, 3);
  value_weights(formula_.t, history_.times(lambda_points), w);
  std::fill(trial_.lambda.begin(), trial_.lambda.end(), 0.0);
  for (int j = 0; j < lambda_points; ++j) {
    const ConstSpan lambda = history_.lambda(j);
    for (std::size_t i = 0; i < lambda.size(); ++i) trial_.lambda[i] += w[at(j)] * lambda[i];
  }
  trial_.t = formula_.t;
  run(FormulaAcceleration{formula_.hp});
  predict_position();
  fetch_for_host({&MotionArrays::q, &MotionArrays::v, &MotionArrays::a});
}

// The numbers of a budget were found on the models of bench/dynamics/default_settings.py, so that their errors stay at
// the accuracy: in a step places may have so many times its share of it. Where damping ends
// stiff vibrations no long run of small steps is expected.
double BdfIntegrator::tolerance_of_position(std::size_t i, double size) const {
  constexpr double kOfOrderFive = 3;
  const ErrorBudget& budget = options_.budget;
  if (!budget.given()) return options_.relative * size + options_.absolute;
  return (options_.max_order <= 2 ? 1 : kOfOrderFive) * budget.accuracy * budget.size(i);
}

// The speed's tolerance of a budget, over the size of a coordinate.
double BdfIntegrator::tolerance_of_speed() const {
  constexpr double kOfSpeed = 3e-3, kOfDuration = 5;
  const ErrorBudget& budget = options_.budget;
  return budget.stiff() ? kOfSpeed * budget.speed / budget.extent : kOfDuration * budget.accuracy / budget.duration;
}

double BdfIntegrator::tolerance_of_velocity(std::size_t i) const {
  const ErrorBudget& budget = options_.budget;
  if (!budget.given()) return options_.relative * std::abs(state_.v[i]) + options_.absolute_velocity;
  return tolerance_of_speed() * budget.size(i);
}

void BdfIntegrator::take_share() {
  constexpr double kLeast = 5e-4, kLeastOfStiff = 2e-3, kLeastOfDamped = 0.01, kMost = 0.05;
  const ErrorBudget& budget = options_.budget;
  if (budget.given()) {
    const double least = !budget.stiff() ? kLeast : options_.max_order <= 2 ? kLeastOfStiff : kLeastOfDamped;
    share_q_ = std::clamp(h_ / budget.duration, least, kMost);
    share_v_ = budget.stiff() ? 1 : share_q_;
  }
  // Newton's iteration leaves newton_tolerance, a hundredth, of what v may be off by.
  constexpr double kOfSlip = 10;
  const double tolerance = budget.given() ? tolerance_of_speed() * budget.extent : options_.absolute_velocity;
  newton_share_v_ = std::min(share_v_, kOfSlip * options_.slip_speed / tolerance);
}

void BdfIntegrator::error_weights() {
  take_share();
  if (on_device()) return error_weights_there();
  equations_.system().magnitude(state_.q, weight_q_);
  size_q_ = largest_of(equations_.pool(), weight_q_.size(), [&](std::size_t i) {
    const double size = weight_q_[i];
    weight_q_[i] = 1 / tolerance_of_position(i, size);
    weight_v_[i] = 1 / tolerance_of_velocity(i);
    return size;
  });
}

// The sizes of the constraint equations: what each of them changes by where every coordinate changes by its size.
void BdfIntegrator::measure_constraints() {
  if (!options_.scaled_constraints || level_.empty() || !row_sizes_.empty()) return;
  equations_.evaluate_constraints(state_.t, state_.q, {});
  const SparsePattern& p = equations_.system().constraint_pattern();
  row_sizes_.assign(level_.size(), 0);
  for (std::size_t i = 0; i < row_sizes_.size(); ++i) {
    for (auto k = at(p.ptr[i]); k < at(p.ptr[i + 1]); ++k)
      row_sizes_[i] += std::abs(equations_.phi_q()[k]) * options_.budget.size(at(p.ind[k]));
    if (!(row_sizes_[i] > 0)) row_sizes_[i] = 1;
  }
}

double BdfIntegrator::largest_level(ConstSpan level) const {
  if (row_sizes_.empty()) return max_norm(level);
  LargestValue largest;
  for (std::size_t i = 0; i < level.size(); ++i) largest.include(level[i] / row_sizes_[i]);
  return largest.value();
}

double BdfIntegrator::norm_of_change() const {
  return std::max(norm(dq_, weight_q_) / share_q_, norm(dv_, weight_v_) / newton_share_v_);
}

double BdfIntegrator::norm(ConstSpan x, ConstSpan weight) const {
  const double sum =
      sum_of(equations_.pool(), x.size(), [&](std::size_t i) { return x[i] * x[i] * weight[i] * weight[i]; });
  return x.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(x.size()));
}

double BdfIntegrator::error_estimate(int order) {
  // Local error of the formula of this order: h'/(t - t_{n-k}) (y - y_pred), y_pred through k + 1 past points. It
  // follows from the error of interpolation, y^(k+1)/(k+1)! prod(t - t_j), in the value of the predictor and in the
  // derivative.
  const int points = order + 1;
  if (history_.size() < points) return 0;
  std::array<double, kMaxBdfOrder + 2> w{}, d{};
  value_weights(formula_.t, history_.times(points), w);
  derivative_weights(formula_.t, history_.times(order), d);
  const double factor = 1 / (d[0] * (formula_.t - history_.time(order)));
  for (double& weight : w) weight = -weight;
  combine_past({&MotionArrays::theta, &MotionArrays::v, &MotionArrays::dq, &MotionArrays::dv},
               ConstSpan(w).first(at(points)));
  if (noisy_left_ > 0 || formula_is_projected_) remove_weak_parts();
  if (on_device()) {
    const MotionRecord record =
        measure({.largest = {},
                 .sums = {{&MotionArrays::dq, &MotionArrays::weight_q}, {&MotionArrays::dv, &MotionArrays::weight_v}}});
    const double of_q = record.sum[0] / (share_q_ * share_q_), of_v = record.sum[1] / (share_v_ * share_v_);
    const double square = options_.test_velocity ? std::max(of_q, of_v) : of_q;
    return factor * std::sqrt(square / static_cast<double>(dq_.size()));
  }
  const double error = norm(dq_, weight_q_) / share_q_;
  return factor * (options_.test_velocity ? std::max(error, norm(dv_, weight_v_) / share_v_) : error);
}

void BdfIntegrator::choose_step(double error) {
  // Order and step for the next step, after the logic of CVODE: candidates k - 1, k, k + 1, each with its own estimate,
  // with the safety factors 6, 6, 10 on the error; a change must pay (ratio 1.2 for the step, orders are left alone for
  // k + 1 steps after a change). Ratios below 1.2 keep the step, so that the factor stays good.
  ++steps_at_order_;
  const auto ratio = [](double e, double bias, int k) { return 1 / (std::pow(bias * e, 1.0 / (k + 1)) + 1e-6); };
  double best = ratio(error, 6, order_);
  int order = order_;
  const int top = options_.fixed_order > 0 ? options_.fixed_order : options_.max_order;
  if (options_.fixed_order == 0 && steps_at_order_ > order_) {
    if (order_ > 1) {
      const double lower = ratio(error_estimate(order_ - 1), 6, order_ - 1);
      if (lower > best) best = lower, order = order_ - 1;
    }
    if (order_ < top && history_.size() >= order_ + 2) {
      const double higher = ratio(error_estimate(order_ + 1), 10, order_ + 1);
      if (higher > best) best = higher, order = order_ + 1;
    }
  }
  const double largest = counts_.steps < 10 ? 10.0 : 4.0;
  if (best < 1) {
    best = std::max(0.5, best);
  } else if (best < 1.2) {
    best = 1;
    order = std::min(order, order_);
  } else {
    best = std::min(best, largest);
  }
  if (order != order_) steps_at_order_ = 0;
  order_ = order;
  h_ *= best;
}

}  // namespace espalier::dynamics
