// What an instance says of a state at once: derivatives of states, outputs, and how they depend on what is set.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "instance.hpp"

namespace espalier::fmu {

using Kind = fmi::Variable::Kind;

namespace {

[[noreturn]] void refuse_input(const std::string& what) { throw Error(StatusCode::invalid_input, what); }

/// The derivative at 0 of numbers that are functions of a way: a central difference of fourth order.
template <class Numbers>
std::vector<double> slope_of(const Numbers& at, double step) {
  std::vector<double> slope;
  for (const auto& [way, weight] : {std::pair{1.0, 2.0 / 3}, std::pair{2.0, -1.0 / 12}}) {
    const std::vector<double> ahead = at(way * step), behind = at(-way * step);
    slope.resize(ahead.size());
    for (std::size_t k = 0; k < ahead.size(); ++k) slope[k] += weight * (ahead[k] - behind[k]) / step;
  }
  return slope;
}

}  // namespace

dynamics::State Instance::state_of(const std::vector<double>& values) const {
  dynamics::State s = run_->runner->state();
  if (states_.empty()) return s;
  s.t = values[0];
  for (std::size_t k = 0; k < states_.size(); ++k) (k < s.q.size() ? s.q[k] : s.v[k - s.q.size()]) = values[states_[k]];
  return s;
}

void Instance::set_inputs(const std::vector<double>& values) {
  for (std::size_t k = 0; k < values.size(); ++k)
    if (contents_.variables[k].kind == Kind::input) run_->runner->set_input(contents_.variables[k].name, values[k]);
}

dynamics::State Instance::solved_state(const std::vector<double>& values) {
  set_inputs(values);
  if (!run_->instant) run_->instant = std::make_unique<dynamics::model::Instant>(*run_->runner);
  dynamics::State s = state_of(values);
  run_->instant->solve(s);
  return s;
}

void Instance::respond() {
  dynamics::State s = solved_state(values_);
  for (std::size_t k = 0; k < derivatives_.size(); ++k)
    values_[derivatives_[k]] = k < s.q.size() ? s.v[k] : s.a[k - s.q.size()];
  const std::vector<double> chosen = run_->runner->values_at(std::move(s));
  for (std::size_t k = 0; k < outputs_.size(); ++k) values_[outputs_[k]] = chosen[k];
  current_ = true;
}

void Instance::expect_model_exchange() const {
  if (!model_exchange_ || mode_ != Mode::running) refuse_input("this is for model exchange, after the initialization");
}

void Instance::set_time(double t) {
  expect_model_exchange();
  if (!std::isfinite(t)) refuse_input("the time is no number");
  current_ = current_ && t == values_[0];
  values_[0] = t;
}

void Instance::set_states(std::span<const double> x) {
  if (x.size() != states_.size()) refuse_input(fmt::format("there are {} states, not {}", states_.size(), x.size()));
  for (std::size_t k = 0; k < x.size(); ++k) set(static_cast<fmi::ValueReference>(states_[k]), x[k]);
}

void Instance::get_states(std::span<double> x) {
  if (x.size() != states_.size()) refuse_input(fmt::format("there are {} states, not {}", states_.size(), x.size()));
  for (std::size_t k = 0; k < x.size(); ++k) x[k] = get(static_cast<fmi::ValueReference>(states_[k]));
}

void Instance::get_derivatives(std::span<double> dx) {
  if (dx.size() != states_.size()) refuse_input(fmt::format("there are {} states, not {}", states_.size(), dx.size()));
  for (std::size_t k = 0; k < dx.size(); ++k) dx[k] = get(static_cast<fmi::ValueReference>(derivatives_[k]));
}

std::vector<Instance::Direction> Instance::directions(std::span<const fmi::ValueReference> unknowns,
                                                      std::span<const fmi::ValueReference> knowns,
                                                      std::span<const double> seed) const {
  const bool starting = mode_ == Mode::initialization;
  constexpr double kPart = 1e-3, kNothing = 1e-6;
  std::vector<Direction> list;
  std::optional<std::size_t> of_states;
  for (std::size_t k = 0; k < knowns.size(); ++k) {
    const fmi::Variable& v = variable(knowns[k]);
    const bool state = model_exchange_ && !starting && v.kind == Kind::state;
    if (!state && v.kind != Kind::input && !(v.kind == Kind::parameter && starting))
      refuse_input(fmt::format("'{}' is not known here: nothing is differentiated by it", v.name));
    if (seed[k] == 0) continue;
    if (!state || !of_states) {
      if (state) of_states = list.size();
      list.push_back({std::vector<double>(values_.size()), 0});
    }
    Direction& own = state ? list[*of_states] : list.back();
    own.along[knowns[k]] += seed[k];
    // What has fallen to rounding beside what it began with (sin(pi) for 0) counts as 0.
    const double value = std::abs(values_[knowns[k]]), usual = v.start == 0 ? 1 : std::abs(v.start);
    const double most = kPart * (value > kNothing * usual ? value : usual) / std::abs(seed[k]);
    own.step = own.step == 0 ? most : std::min(own.step, most);
  }
  for (const fmi::ValueReference unknown : unknowns)
    if (const Kind kind = variable(unknown).kind;
        kind != Kind::output && kind != Kind::derivative && !(kind == Kind::state && starting))
      refuse_input(fmt::format("'{}' is no output: it is not differentiated", variable(unknown).name));
  return list;
}

std::vector<double> Instance::slope_of_start(const std::vector<double>& along, double step) const {
  return slope_of(
      [&](double way) {
        std::vector<double> moved = values_;
        for (std::size_t k = 0; k < moved.size(); ++k) moved[k] += way * along[k];
        read_out(*load(moved), moved);
        return moved;
      },
      step);
}

std::vector<double> Instance::slope_here(const std::vector<double>& along, double step) {
  const dynamics::State s = solved_state(values_);
  const std::size_t n = s.v.size();
  dynamics::model::StateMove move{std::vector<double>(n), std::vector<double>(n), {}, {}};
  for (std::size_t k = 0; k < states_.size(); ++k) (k < n ? move.q[k] : move.v[k - n]) = along[states_[k]];
  const auto put_inputs = [&](double way) {
    std::vector<double> moved = values_;
    for (std::size_t k = 0; k < moved.size(); ++k) moved[k] += way * along[k];
    set_inputs(moved);
  };
  run_->instant->follow(s, run_->instant->force_slope(s, put_inputs, step), move);
  std::vector<double> slope(values_.size());
  for (std::size_t k = 0; k < derivatives_.size(); ++k) slope[derivatives_[k]] = k < n ? move.v[k] : move.a[k - n];
  const auto outputs_at = [&](double way) {
    put_inputs(way);
    dynamics::State moved = s;
    const auto add = [way](std::vector<double>& x, const std::vector<double>& dx) {
      for (std::size_t i = 0; i < dx.size(); ++i) x[i] += way * dx[i];
    };
    std::vector<double> dq(n);
    add(dq, move.q);
    run_->runner->mechanism().system.retract(s.q, dq, moved.q);
    add(moved.v, move.v);
    add(moved.a, move.a);
    add(moved.lambda, move.lambda);
    return run_->runner->values_at(std::move(moved));
  };
  const std::vector<double> of_outputs = slope_of(outputs_at, step);
  for (std::size_t k = 0; k < outputs_.size(); ++k) slope[outputs_[k]] = of_outputs[k];
  set_inputs(values_);
  return slope;
}

void Instance::directional(std::span<const fmi::ValueReference> unknowns, std::span<const fmi::ValueReference> knowns,
                           std::span<const double> seed, std::span<double> sensitivity) {
  if (mode_ == Mode::instantiated) refuse_input("there are no derivatives before the initialization");
  if (seed.size() != knowns.size() || sensitivity.size() != unknowns.size())
    refuse_input("a seed has a number for each known, a sensitivity one for each unknown");
  need_run();
  const std::vector<Direction> list = directions(unknowns, knowns, seed);
  std::fill(sensitivity.begin(), sensitivity.end(), 0.0);
  for (const Direction& d : list) {
    const std::vector<double> slope =
        mode_ == Mode::initialization ? slope_of_start(d.along, d.step) : slope_here(d.along, d.step);
    for (std::size_t k = 0; k < unknowns.size(); ++k) sensitivity[k] += slope[unknowns[k]];
  }
}

}  // namespace espalier::fmu
