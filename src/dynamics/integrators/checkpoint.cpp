// What integrators write into restart files and read back.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"

namespace espalier::dynamics {
namespace {

double take(ConstSpan& in) {
  if (in.empty()) throw Error(StatusCode::invalid_input, "the restart file ends too early");
  const double value = in.front();
  in = in.subspan(1);
  return value;
}

/// A count: a whole number that a double holds exactly.
long take_count(ConstSpan& in, double most = 9007199254740992.0) {
  const double value = take(in);
  if (!(value >= 0 && value <= most && value == std::floor(value)))
    throw Error(StatusCode::invalid_input, "the restart file is damaged");
  return static_cast<long>(value);
}

void take(ConstSpan& in, Span out) {
  if (in.size() < out.size()) throw Error(StatusCode::invalid_input, "the restart file ends too early");
  std::copy_n(in.begin(), out.size(), out.begin());
  if (!std::all_of(out.begin(), out.end(), [](double x) { return std::isfinite(x); }))
    throw Error(StatusCode::invalid_input, "the restart file holds a state that is not finite");
  in = in.subspan(out.size());
}

void append(std::vector<double>& out, ConstSpan values) { out.insert(out.end(), values.begin(), values.end()); }

void put_state(std::vector<double>& out, const State& s) {
  out.push_back(s.t);
  for (const auto* x : {&s.q, &s.v, &s.a, &s.lambda}) append(out, *x);
}

void take_state(ConstSpan& in, State& s) {
  take(in, Span(&s.t, 1));
  for (auto* x : {&s.q, &s.v, &s.a, &s.lambda}) take(in, *x);
}

}  // namespace

void Integrator::save_counts(std::vector<double>& out) const {
  const IntegratorCounts& c = counts_;
  for (const long n : {c.steps, c.newton_iterations, c.error_failures, c.newton_failures, c.crossings, c.refactor_first,
                       c.refactor_step, c.refactor_rate, c.refactor_failed, c.divisions, c.rounded})
    out.push_back(static_cast<double>(n));
  append(out, std::array{c.largest_rounding, c.first_division, c.shortest_step, c.largest_position, c.largest_velocity,
                         c.largest_acceleration});
}

void Integrator::restore_counts(ConstSpan& in) {
  IntegratorCounts& c = counts_;
  for (long* n : {&c.steps, &c.newton_iterations, &c.error_failures, &c.newton_failures, &c.crossings,
                  &c.refactor_first, &c.refactor_step, &c.refactor_rate, &c.refactor_failed, &c.divisions, &c.rounded})
    *n = take_count(in);
  for (double* x : {&c.largest_rounding, &c.first_division, &c.shortest_step, &c.largest_position, &c.largest_velocity,
                    &c.largest_acceleration})
    *x = take(in);
}

std::unique_ptr<Integrator> BdfIntegrator::clone() const {
  auto copy = std::make_unique<BdfIntegrator>(*this);
  copy->leave_device();
  copy->factor_hp_ = 0;
  copy->reach_ = std::numeric_limits<double>::infinity();
  if (first_) copy->first_ = std::make_shared<BdfIntegrator>(*first_);
  return copy;
}

std::unique_ptr<Integrator> GeneralizedAlpha::clone() const {
  auto copy = std::make_unique<GeneralizedAlpha>(*this);
  copy->vectors_.leave();
  copy->factor_c_q_ = 0;
  return copy;
}

void BdfIntegrator::save(std::vector<double>& out) {
  save_counts(out);
  put_state(out, state_);
  out.push_back(h_);
  for (const int n : {order_, steps_at_order_, projected_left_, noisy_left_, first_left_, history_.size()})
    out.push_back(static_cast<double>(n));
  for (int j = history_.size() - 1; j >= 0; --j) {
    out.push_back(history_.time(j));
    append(out, history_.q(j));
    append(out, history_.v(j));
    append(out, history_.lambda(j));
  }
  if (const ErrorBudget& budget = options_.budget; budget.given()) {
    append(out, std::array{budget.accuracy, budget.extent, budget.duration, budget.speed});
    append(out, row_sizes_);
  }
  leave_device();
  equations_.forget_analysis();
  falling_masses_.clear();
  factor_hp_ = own_error_ = latest_error_ = floor_ = 0;
  reach_ = std::numeric_limits<double>::infinity();
  first_.reset();  // begins anew at the present state, with steps as short as they were at the start
}

void BdfIntegrator::restore(ConstSpan& in) {
  vectors_.leave();
  restore_counts(in);
  take_state(in, state_);
  trial_ = state_;
  h_ = take(in);
  int points = 0;
  for (int* n : {&order_, &steps_at_order_, &projected_left_, &noisy_left_, &first_left_, &points})
    *n = static_cast<int>(take_count(in, 2e9));
  if (!(h_ > 0) || order_ < 1 || order_ > kMaxBdfOrder || first_left_ >= kMaxBdfOrder || points < 1 ||
      points > History::kDepth)
    throw Error(StatusCode::invalid_input, "the restart file is damaged");
  history_.clear();
  State past = state_;
  for (int j = 0; j < points; ++j) {
    const double before = past.t;
    past.t = take(in);
    if (!std::isfinite(past.t) || (j > 0 && past.t <= before))
      throw Error(StatusCode::invalid_input, "the restart file is damaged");
    for (auto* x : {&past.q, &past.v, &past.lambda}) take(in, *x);
    history_.push(past.t, past.q, past.v, past.lambda, equations_.pool());
  }
  if (ErrorBudget& budget = options_.budget; budget.given()) {
    for (double* x : {&budget.accuracy, &budget.extent, &budget.duration, &budget.speed}) *x = take(in);
    take(in, row_sizes_);
    if (!(budget.accuracy > 0 && budget.extent > 0 && budget.duration > 0 && budget.speed >= 0) ||
        !std::all_of(row_sizes_.begin(), row_sizes_.end(), [](double x) { return x > 0; }))
      throw Error(StatusCode::invalid_input, "the restart file is damaged");
  }
  order_ = std::max(1, std::min(order_, history_.size() - 1));  // of a run with a higher order
  first_.reset();
  equations_.forget_analysis();
  falling_masses_.clear();
  factor_hp_ = own_error_ = latest_error_ = floor_ = 0;
  reach_ = std::numeric_limits<double>::infinity();
}

// What the predictor remembers of earlier steps is forgotten on both sides: start() does that.
void GeneralizedAlpha::save(std::vector<double>& out) {
  save_counts(out);
  put_state(out, state_);
  append(out, a_old_);
  append(out, std::array{static_cast<double>(halvings_), static_cast<double>(steps_at_length_), fitted_});
  const std::vector<double> a_old = a_old_;
  const int halvings = halvings_, steps = steps_at_length_;
  const double fitted = fitted_;
  start(State(state_));
  equations_.forget_analysis();
  a_old_ = a_old;
  fitted_ = fitted;
  halvings_ = halvings;
  steps_at_length_ = steps;
}

void GeneralizedAlpha::restore(ConstSpan& in) {
  restore_counts(in);
  State state = state_;
  take_state(in, state);
  start(state);
  equations_.forget_analysis();
  take(in, a_old_);
  constexpr double kMostHalvings = 64;
  halvings_ = static_cast<int>(take_count(in, kMostHalvings));
  steps_at_length_ = static_cast<int>(take_count(in, 2e9));
  fitted_ = take(in);
  if (!(fitted_ >= 0)) throw Error(StatusCode::invalid_input, "the restart file is damaged");
}

}  // namespace espalier::dynamics
