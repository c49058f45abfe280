#include "dynamics/model/derivatives/sensitivity_run.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "dynamics/integrators/vibrations.hpp"
#include "dynamics/model/read/expand.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr double kStepOfStatics = 1e-4;  // the two starts are equilibria, to their tolerance
constexpr double kMostDefect = 1e-6;     // of derivatives that are given

}  // namespace

SensitivityRun::SensitivityRun(const std::string& text, const std::string& name,
                               const std::vector<SensitivityParameter>& parameters, const SimulationOptions& options,
                               SensitivityMethod method, const SensitivityObjective& objective,
                               SensitivityResult& result)
    : text_(text), name_(name), options_(options), method_(method), objective_(objective), result_(result) {
  if (!options.restart.empty())
    throw Error(StatusCode::invalid_input, "sensitivities begin with the model, not with a restart file");
  if (parameters.empty()) throw Error(StatusCode::invalid_input, "sensitivities: no parameter is given");
  const Description model = describe({});
  refuse_what_does_not_pass(model, method);
  for (const ContactSpec& c : model.contacts) remembers_ = remembers_ || c.law.rubs();
  statics_ = model.statics.has_value();
  modes_ = model.initial.modes;
  rests_ = model.initial.statics;
  nominal_ = std::make_unique<Runner>(model, options_, result.summary);
  if (method_ == SensitivityMethod::adjoint && !statics_) refuse_memory(model, nominal_->mechanism());
  for (const SensitivityParameter& p : parameters) {
    given_.push_back(ends_of(p));
    for (int above = 0; above < 2; ++above)
      with_end(given_.back(), above, [&](const Description& side) { refuse_other_run(model, side, p.path); });
  }
  quantities_ = nominal_->chosen();
  for (const Quantity& q : quantities_) result_.quantities.push_back(q.name);
  if (quantities_.empty() && modes_ == 0)
    throw Error(StatusCode::invalid_input,
                "sensitivities: no quantity is chosen; name some in [output] quantities, or SimulationOptions");
}

void SensitivityRun::run() {
  if (method_ == SensitivityMethod::adjoint && !statics_) return differentiate_motion_backward();
  bool at_equilibrium = false;
  if (method_ == SensitivityMethod::adjoint ||
      (method_ == SensitivityMethod::automatic && statics_ && modes_ == 0 && given_.size() > quantities_.size())) {
    nominal_->run({});
    at_equilibrium = true;
    if (differentiate_backward()) return take_objective();
  }
  for (const Ends& ends : given_) add(ends);
  Mechanism& mechanism = nominal_->mechanism();
  const auto sizes = mechanism.system.sizes();
  Equations own(mechanism.system, make_linear_solver(sizes.velocity + sizes.constraints), &mechanism.pool);
  own.set_dropped(nominal_->equations().dropped());
  std::vector<ParameterSides> sides;
  for (Parameter& p : parameters_) sides.push_back({p.step, &p.side[0]->equations(), &p.side[1]->equations()});
  ForwardSensitivity forward(own, sides, remembers_);
  choose();
  if (modes_ > 0) differentiate_modes(own);
  if (statics_) {
    if (!at_equilibrium) nominal_->run({});
    for (Parameter& p : parameters_)
      for (auto& side : p.side) side->mechanism().system.set_load_factor(nominal_->time());
    forward.statics(nominal_->state());
    keep(forward);
  } else {
    std::vector<std::array<const State*, 2>> states;
    for (const Parameter& p : parameters_) states.push_back({&p.side[0]->state(), &p.side[1]->state()});
    forward.start(nominal_->state(), states);
    keep(forward);
    nominal_->run([&](const SimulationStep& step) {
      forward.step(nominal_->state(), step.order);
      keep(forward);
      return true;
    });
  }
  result_.defect = forward.defect();
  if (!(result_.defect <= kMostDefect))
    throw Error(StatusCode::accuracy_not_reached,
                fmt::format("the equations of the derivatives are solved to {:.1e} of the largest only, more than "
                            "{:g}: the model may have a kink or a jump (contact that opens or closes, friction that "
                            "sticks or slips) within the step of a parameter; take smaller "
                            "SensitivityParameter::step, or tighter tolerances of the run",
                            result_.defect, kMostDefect));
  check_by_other_runs();
}

SensitivityRun::Ends SensitivityRun::ends_of(const SensitivityParameter& given) {
  const double value = number_at(tree(), options_.set, given.path);
  const double step = given.step != 0 ? given.step : (rests_ ? kStepOfStatics : kRelativeStep) * std::abs(value);
  if (!(step > 0) || !std::isfinite(step))
    throw Error(StatusCode::invalid_input,
                given.step != 0 ? fmt::format("{}: the step {} must be greater than 0", given.path, given.step)
                                : fmt::format("{} is 0, which says nothing of its size: give a step for it "
                                              "(SensitivityParameter::step)",
                                              given.path));
  result_.parameters.push_back(given.path);
  result_.parameter_values.push_back(value);
  return {given.path, value - step, value + step};
}

void SensitivityRun::add(const Ends& ends) {
  parameters_.emplace_back();
  Parameter& p = parameters_.back();
  p.step = ends.step();  // what the numbers beside it differ by to the last bit
  for (int a = 0; a < 2; ++a) p.side[a] = beside_nominal(ends, a, p.summary[a]);
}

std::unique_ptr<Runner> SensitivityRun::beside_nominal(const Ends& ends, int above, SimulationSummary& summary) const {
  std::unique_ptr<Runner> side;
  with_end(ends, above,
           [&](const Description& model) { side = std::make_unique<Runner>(model, quiet_options(), summary); });
  compare(side->mechanism(), ends.path);
  return side;
}

void SensitivityRun::compare(const Mechanism& side, const std::string& path) const {
  constexpr double kSamePlace = 0.05;
  const auto jump = [&](const std::string& what) {
    throw Error(StatusCode::invalid_input,
                fmt::format("{} jumps with {}, so it has no derivative; choose another parameter, or a smaller step",
                            what, path));
  };
  const auto& own = nominal_->mechanism().system.components();
  const auto& others = side.system.components();
  if (own.size() != others.size()) jump("the number of components");
  for (std::size_t k = 0; k < own.size(); ++k) {
    const auto a = own[k]->sizes(), b = others[k]->sizes();
    if (a.velocity != b.velocity || a.constraints != b.constraints || a.configuration != b.configuration)
      jump(fmt::format("the number of unknowns of '{}'", own[k]->name()));
    const std::vector<double> marks = memory_of(*own[k]), other = memory_of(*others[k]);
    if (marks.size() != other.size()) jump(fmt::format("what '{}' remembers", own[k]->name()));
    const double size = max_norm(marks);
    for (std::size_t i = 0; i < marks.size(); ++i)
      if (std::abs(marks[i] - other[i]) > kSamePlace * size)
        jump(fmt::format("number {} of '{}' (a shape, where it is a reduced body)", i + 1, own[k]->name()));
  }
}

void SensitivityRun::choose() {
  for (Parameter& p : parameters_)
    for (int a = 0; a < 2; ++a) p.quantities[a] = p.side[a]->chosen();
}

void SensitivityRun::keep(const ForwardSensitivity& forward) {
  result_.t.push_back(nominal_->time());
  const auto sample = [&](const State& state) {
    Sample s{&state, {}};
    if (statics_) s.load = nominal_->time();
    return s;
  };
  for (std::size_t q = 0; q < quantities_.size(); ++q) {
    result_.values.push_back(quantities_[q].value(sample(nominal_->state())));
    for (std::size_t p = 0; p < parameters_.size(); ++p) {
      const double below = parameters_[p].quantities[0][q].value(sample(forward.side(p, 0)));
      const double above = parameters_[p].quantities[1][q].value(sample(forward.side(p, 1)));
      result_.derivatives.push_back((above - below) / (2 * parameters_[p].step));
    }
  }
}

void SensitivityRun::differentiate_modes(Equations& own) {
  std::vector<PencilSides> sides;
  for (Parameter& p : parameters_)
    sides.push_back(
        {p.step, {&p.side[0]->equations(), &p.side[1]->equations()}, {&p.side[0]->state(), &p.side[1]->state()}});
  Options solver;
  solver.threads = nominal_->mechanism().pool.size();
  const FrequencySlopes slopes = frequency_slopes(own, nominal_->state(), static_cast<Index>(modes_), sides, solver);
  result_.modes.frequencies = slopes.frequencies;
  result_.modes.derivatives = slopes.derivatives;
}

SimulationOptions SensitivityRun::quiet_options() const {
  SimulationOptions options = options_;
  options.out.clear();
  options.dump.clear();
  options.keep_series = false;
  options.frame_interval = -1;
  options.record_timeline = false;
  return options;
}

Value SensitivityRun::tree() const { return parse_toml(text_, name_); }

Description SensitivityRun::describe(const std::vector<std::string>& more) const {
  Value root = tree();
  std::vector<std::string> set = options_.set;
  set.insert(set.end(), more.begin(), more.end());
  expand(root, set);
  return read_description(root, name_);
}

}  // namespace espalier::dynamics::model
