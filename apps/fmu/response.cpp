// What an instance says of a state at once: derivatives of states, outputs, and how they depend on what is set.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "instance.hpp"

namespace espalier::fmu {

using Kind = fmi::Variable::Kind;

namespace {

[[noreturn]] void refuse(const std::string& what) { throw Error(StatusCode::invalid_input, what); }

}  // namespace

dynamics::State Instance::state_of(const std::vector<double>& values) const {
  dynamics::State s = run_->runner->state();
  if (states_.empty()) return s;
  s.t = values[0];
  for (std::size_t k = 0; k < states_.size(); ++k) (k < s.q.size() ? s.q[k] : s.v[k - s.q.size()]) = values[states_[k]];
  return s;
}

std::vector<double> Instance::response(const std::vector<double>& values) {
  dynamics::model::Runner& runner = *run_->runner;
  for (std::size_t k = 0; k < values.size(); ++k)
    if (contents_.variables[k].kind == Kind::input) runner.set_input(contents_.variables[k].name, values[k]);
  if (!run_->instant) run_->instant = std::make_unique<dynamics::model::Instant>(runner);
  dynamics::State s = state_of(values);
  run_->instant->solve(s);
  std::vector<double> out = values;
  for (std::size_t k = 0; k < derivatives_.size(); ++k)
    out[derivatives_[k]] = k < s.q.size() ? s.v[k] : s.a[k - s.q.size()];
  const std::vector<double> chosen = runner.values_at(std::move(s));
  for (std::size_t k = 0; k < outputs_.size(); ++k) out[outputs_[k]] = chosen[k];
  return out;
}

void Instance::respond() {
  values_ = response(values_);
  current_ = true;
}

void Instance::expect_model_exchange() const {
  if (!model_exchange_ || mode_ != Mode::running) refuse("this is for model exchange, after the initialization");
}

void Instance::set_time(double t) {
  expect_model_exchange();
  if (!std::isfinite(t)) refuse("the time is no number");
  current_ = current_ && t == values_[0];
  values_[0] = t;
}

void Instance::set_states(std::span<const double> x) {
  if (x.size() != states_.size()) refuse(fmt::format("there are {} states, not {}", states_.size(), x.size()));
  for (std::size_t k = 0; k < x.size(); ++k) set(static_cast<fmi::ValueReference>(states_[k]), x[k]);
}

void Instance::get_states(std::span<double> x) {
  if (x.size() != states_.size()) refuse(fmt::format("there are {} states, not {}", states_.size(), x.size()));
  for (std::size_t k = 0; k < x.size(); ++k) x[k] = get(static_cast<fmi::ValueReference>(states_[k]));
}

void Instance::get_derivatives(std::span<double> dx) {
  if (dx.size() != states_.size()) refuse(fmt::format("there are {} states, not {}", states_.size(), dx.size()));
  for (std::size_t k = 0; k < dx.size(); ++k) dx[k] = get(static_cast<fmi::ValueReference>(derivatives_[k]));
}

// Central differences of fourth order along the seed. What depends on inputs and velocities is mostly linear or
// quadratic in them, where these have rounding errors alone.
void Instance::directional(std::span<const fmi::ValueReference> unknowns, std::span<const fmi::ValueReference> knowns,
                           std::span<const double> seed, std::span<double> sensitivity) {
  if (mode_ == Mode::instantiated) refuse("there are no derivatives before the initialization");
  if (seed.size() != knowns.size() || sensitivity.size() != unknowns.size())
    refuse("a seed has a number for each known, a sensitivity one for each unknown");
  need_run();
  const bool starting = mode_ == Mode::initialization;
  double step = 0;  // of the seed: the largest for which no variable moves by more than a part of its size
  constexpr double kPart = 1e-3;
  for (std::size_t k = 0; k < knowns.size(); ++k) {
    const fmi::Variable& v = variable(knowns[k]);
    const bool input = v.kind == Kind::input || (v.kind == Kind::parameter && starting) ||
                       (model_exchange_ && !starting && v.kind == Kind::state);
    if (!input) refuse(fmt::format("'{}' is not known here: nothing is differentiated by it", v.name));
    if (seed[k] == 0) continue;
    const double size = std::abs(values_[knowns[k]]);
    const double most = kPart * (size > 0 ? size : 1) / std::abs(seed[k]);
    step = step == 0 ? most : std::min(step, most);
  }
  for (const fmi::ValueReference unknown : unknowns)
    if (const Kind kind = variable(unknown).kind; kind != Kind::output && kind != Kind::derivative)
      refuse(fmt::format("'{}' is no output: it is not differentiated", variable(unknown).name));
  std::fill(sensitivity.begin(), sensitivity.end(), 0.0);
  if (step == 0) return;
  const auto at = [&](double way) {
    std::vector<double> moved = values_;
    for (std::size_t k = 0; k < knowns.size(); ++k) moved[knowns[k]] += way * step * seed[k];
    if (!starting) return response(moved);
    const std::unique_ptr<Run> run = load(moved);
    for (std::size_t k = 0; k < outputs_.size(); ++k) moved[outputs_[k]] = run->summary.values[k].second;
    return moved;
  };
  for (const auto& [way, weight] : {std::pair{1.0, 2.0 / 3}, std::pair{2.0, -1.0 / 12}}) {
    const std::vector<double> ahead = at(way), behind = at(-way);
    for (std::size_t k = 0; k < unknowns.size(); ++k)
      sensitivity[k] += weight * (ahead[unknowns[k]] - behind[unknowns[k]]) / step;
  }
  if (starting) return;
  for (std::size_t k = 0; k < values_.size(); ++k)  // as they were
    if (contents_.variables[k].kind == Kind::input) run_->runner->set_input(contents_.variables[k].name, values_[k]);
}

}  // namespace espalier::fmu
