#include "espalier/sensitivities.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <memory>
#include <new>
#include <stdexcept>

#include "base/stage.hpp"
#include "dynamics/contact/contact.hpp"
#include "dynamics/integrators/sensitivity.hpp"
#include "dynamics/integrators/vibrations.hpp"
#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/build/default_tolerances.hpp"
#include "dynamics/model/derivatives/motion_adjoint.hpp"
#include "dynamics/model/derivatives/run_differences.hpp"
#include "dynamics/model/derivatives/static_adjoint.hpp"
#include "dynamics/model/read/expand.hpp"
#include "dynamics/model/run/runner.hpp"

namespace espalier {

namespace {

using dynamics::Equations;
using dynamics::ForwardSensitivity;
using dynamics::ParameterSides;
using dynamics::State;
using dynamics::model::Description;
using dynamics::model::Mechanism;
using dynamics::model::Quantity;
using dynamics::model::Runner;
using dynamics::model::Sample;
using dynamics::model::Value;

// Stiff directions magnify both errors of a central difference, the square of the step and rounding over it, alike.
constexpr double kRelativeStep = 5e-6;
constexpr double kStepOfStatics = 1e-4;  // the two starts are equilibria, to their tolerance
constexpr double kMostDefect = 1e-6;     // of derivatives that are given
constexpr double kWay = 5e-3;            // of a parameter, to a run that checks derivatives

std::size_t position_of(const std::vector<std::string>& names, const std::string& name) {
  const auto it = std::find(names.begin(), names.end(), name);
  if (it == names.end()) throw std::out_of_range("there is no '" + name + "' among the sensitivities");
  return static_cast<std::size_t>(it - names.begin());
}

/// A model and what of it is to be differentiated.
class SensitivityRun {
 public:
  SensitivityRun(const std::string& text, const std::string& name, const std::vector<SensitivityParameter>& parameters,
                 const SimulationOptions& options, SensitivityMethod method, const SensitivityObjective& objective,
                 SensitivityResult& result)
      : text_(text), name_(name), options_(options), method_(method), objective_(objective), result_(result) {
    if (!options.restart.empty())
      throw Error(StatusCode::invalid_input, "sensitivities begin with the model, not with a restart file");
    if (parameters.empty()) throw Error(StatusCode::invalid_input, "sensitivities: no parameter is given");
    const Description model = describe({});
    if (!model.controllers.empty())
      throw Error(
          StatusCode::invalid_input,
          fmt::format("sensitivities, also adjoint ones, do not pass FMUs, which do not tell how they depend on "
                      "parameters and states, and the model has '{}'",
                      model.controllers.front().name));
    if (!model.events.empty())
      throw Error(StatusCode::invalid_input,
                  fmt::format("sensitivities do not pass events yet, and the model has {}", model.events.size()));
    for (const dynamics::model::BodySpec& body : model.bodies)
      if (body.erosion() != nullptr)
        dynamics::model::fail(
            body.erosion()->place,
            "sensitivities, also adjoint ones, do not pass elements that fail: whether one does is no "
            "smooth function of a parameter");
    for (const dynamics::model::ContactSpec& c : model.contacts) {
      remembers_ = remembers_ || c.law.rubs();
      // The copies do not take part in what these do between Newton's passes, or in jumps of the velocities.
      if (c.law.impulse || c.penetration > 0)
        dynamics::model::fail(c.place, fmt::format("sensitivities do not pass contacts with {} yet",
                                                   c.law.impulse ? "impulses (the penalty works)"
                                                                 : "a chosen penetration (stiffness alone works)"));
      if (c.law.rubs() && (model.statics || model.initial.statics))
        dynamics::model::fail(c.place,
                              "sensitivities of equilibria do not pass contacts with friction yet, whose forces "
                              "depend on the way there");
    }
    if (model.linear())
      dynamics::model::fail(model.statics->place,
                            "sensitivities do not know linear statics yet: take linear out, and loads that are small");
    statics_ = model.statics.has_value();
    modes_ = model.initial.modes;
    for (const dynamics::model::JointSpec& j : model.joints) {
      using dynamics::model::JointType;
      if (j.type != JointType::rolling && j.type != JointType::skate) continue;
      if (method_ == SensitivityMethod::adjoint)
        dynamics::model::fail(j.place, "the adjoint method does not pass rolling yet: take the forward one");
      if (model.statics || model.initial.statics)
        dynamics::model::fail(j.place,
                              "sensitivities of equilibria do not pass rolling, where the place of rest depends on the "
                              "way there");
    }
    rests_ = model.initial.statics;
    if (method_ == SensitivityMethod::adjoint && modes_ > 0)
      throw Error(StatusCode::invalid_input,
                  "the adjoint method finds derivatives of quantities, not of [initial] modes: take the forward one");
    if (method_ == SensitivityMethod::adjoint && !statics_)
      for (const dynamics::model::BodySpec& body : model.bodies)
        if (body.modal_damping > 0)
          dynamics::model::fail(
              body.place,
              "the adjoint method does not pass damping by ratio of modes yet: take the forward one, "
              "or give the ratio at two frequencies (damping = { ratio = ..., frequencies = [...] })");
    nominal_ = std::make_unique<Runner>(model, options_, result.summary);
    if (method_ == SensitivityMethod::adjoint && !statics_) refuse_memory(model);
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

  void run() {
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
    Equations own(mechanism.system, dynamics::make_linear_solver(sizes.velocity + sizes.constraints), &mechanism.pool);
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

 private:
  /// A parameter below and above its value.
  struct Ends {
    std::string path;
    double below = 0, above = 0;
    [[nodiscard]] double step() const { return (above - below) / 2; }
  };
  struct Parameter {
    double step = 0;
    SimulationSummary summary[2];
    std::unique_ptr<Runner> side[2];
    std::vector<Quantity> quantities[2];
  };

  /// Derivatives are those of one run: its times, tolerances, loads, outputs and solver do not move with a parameter.
  static void refuse_other_run(const Description& model, const Description& side, const std::string& path) {
    const std::string fixed = fmt::format(
        "depends on {}; derivatives hold times, tolerances, outputs, the solver and the load factor of a run fixed, so "
        "give numbers that do not depend on it",
        path);
    const auto refuse = [&](const dynamics::model::Place& place) {
      dynamics::model::fail(place, "something here " + fixed);
    };
    if (!model.statics && !(side.integrator == model.integrator)) refuse(model.integrator.place);
    if (!(side.statics == model.statics)) refuse(model.statics->place);
    if (!(side.initial == model.initial)) refuse(model.initial.place);
    if (!(side.output == model.output)) refuse(model.output.place);
    if (side.solver != model.solver) throw Error(StatusCode::invalid_input, "solver: something here " + fixed);
  }

  /// What remembers something from step to step that the state does not tell.
  void refuse_memory(const Description& model) const {
    for (const dynamics::model::ContactSpec& c : model.contacts) {
      bool solid = false;
      for (const dynamics::model::BuiltContact& built : nominal_->mechanism().surface_contacts)
        for (const dynamics::contact::Contact* part : built.parts)
          solid =
              solid || (built.name == c.name && dynamic_cast<const dynamics::contact::RigidContact*>(part) == nullptr);
      if (c.law.rubs() || c.law.restitution < 1 || solid)
        dynamics::model::fail(c.place,
                              "the adjoint method does not pass contacts with friction or restitution, or of "
                              "deformable bodies, which remember something from step to step: take the forward one");
    }
  }

  /// Whether anything of the model has kinks or jumps.
  [[nodiscard]] bool switches() const {
    for (const dynamics::Switching* law : dynamics::switching_laws(nominal_->mechanism().system)) {
      dynamics::Branches branches;
      law->branches(nominal_->state().view(), branches);
      if (!branches.empty() || dynamic_cast<const dynamics::contact::Contact*>(law) != nullptr) return true;
    }
    return false;
  }

  /// The derivatives at the end beside whole runs, where the model switches: those of the steps that were taken do not
  /// know that the times of switches move with the parameters.
  void check_by_other_runs() {
    if (statics_ || result_.summary.interrupted || !switches()) return;
    const std::size_t np = given_.size();
    const dynamics::model::IntegratorSpec fine = of_check(nominal_->integrator());
    const double extent = nominal_->integrator().bdf.budget.extent;
    const bool adaptive =
        nominal_->integrator().method == dynamics::model::Method::bdf && !(nominal_->integrator().bdf.fixed_step > 0);
    dynamics::model::DerivativesToCheck what;
    what.numbers = result_.quantities;
    what.parameters = result_.parameters;
    what.values = result_.parameter_values;
    for (std::size_t p = 0; p < np; ++p)
      what.ways.push_back(what.values[p] != 0 ? kWay * std::abs(what.values[p])
                                              : kWay / kRelativeStep * given_[p].step());
    // How far two adaptive runs may be apart.
    what.noise = [fine, adaptive, extent](double x) {
      constexpr double kTolerances = 100, kAccuracies = 3;
      if (!adaptive) return 1e-12 * std::abs(x);
      if (dynamics::model::wants_default_tolerances(fine)) return kAccuracies * fine.accuracy * (std::abs(x) + extent);
      return kTolerances * (fine.bdf.relative * std::abs(x) + fine.bdf.absolute);
    };
    what.replace = !objective_;  // sums over the times of a run change with them
    const std::size_t rows = result_.quantities.size() * np;
    try {
      const std::string wrong = dynamics::model::check_by_runs(
          what, [this](const dynamics::model::MovedParameters& moved) { return end_of_run(moved); },
          std::span<double>(result_.derivatives).last(rows));
      if (!wrong.empty())
        result_.summary.notices.push_back(
            "derivatives: something switches at another time, or another way, where a "
            "parameter is another: " +
            wrong);
    } catch (const Error& error) {
      if (error.status().code == StatusCode::cancelled) throw;
      result_.summary.notices.push_back(
          fmt::format("derivatives: the model switches, and they could not be compared with runs beside this one: {}",
                      error.status().message));
    }
  }

  /// As the run, but to its very end and with a hundredth of its tolerances.
  [[nodiscard]] dynamics::model::IntegratorSpec of_check(dynamics::model::IntegratorSpec spec) const {
    constexpr double kFiner = 0.01, kFinest = 1e-12;
    for (double* tolerance : {&spec.bdf.relative, &spec.bdf.absolute, &spec.bdf.absolute_velocity})
      *tolerance = std::max(kFiner * *tolerance, std::min(kFinest, *tolerance));
    spec.accuracy *= kFiner;
    spec.steps = 0;
    spec.end = nominal_->time();
    return spec;
  }

  /// The quantities, or the objective, at the end of a run with some parameters moved.
  [[nodiscard]] std::vector<double> end_of_run(const dynamics::model::MovedParameters& moved) const {
    std::vector<std::string> set;
    for (const auto& [p, value] : moved) set.push_back(fmt::format("{}={:.17e}", given_[p].path, value));
    Description model = describe(set);
    model.integrator = of_check(model.integrator);
    SimulationOptions options = quiet_options();
    options.until.reset();
    SimulationSummary summary;
    Runner run(model, options, summary);
    const std::vector<Quantity> quantities = run.chosen();
    std::vector<double> t, values;
    const auto sample = [&] {
      t.push_back(run.time());
      for (const Quantity& q : quantities) values.push_back(q.value(Sample{&run.state(), {}}));
    };
    sample();
    run.run([&](const SimulationStep&) {
      if (!objective_) t.clear(), values.clear();
      sample();
      return true;
    });
    if (summary.interrupted) throw Error(StatusCode::cancelled, "the derivatives were interrupted");
    if (!objective_) return values;
    std::vector<double> slopes(values.size(), 0.0);
    return {objective_(t, values, slopes)};
  }

  [[nodiscard]] SimulationOptions quiet_options() const {
    SimulationOptions options = options_;
    options.out.clear();
    options.dump.clear();
    options.keep_series = false;
    options.frame_interval = -1;
    options.record_timeline = false;
    return options;
  }

  [[nodiscard]] Value tree() const { return dynamics::model::parse_toml(text_, name_); }
  [[nodiscard]] Description describe(const std::vector<std::string>& more) const {
    Value root = tree();
    std::vector<std::string> set = options_.set;
    set.insert(set.end(), more.begin(), more.end());
    dynamics::model::expand(root, set);
    return dynamics::model::read_description(root, name_);
  }

  Ends ends_of(const SensitivityParameter& given) {
    const double value = dynamics::model::number_at(tree(), options_.set, given.path);
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

  /// The model with one number replaced; what is wrong with it is told with that number.
  template <class Use>
  void with_end(const Ends& ends, int above, const Use& use) const {
    const double value = above != 0 ? ends.above : ends.below;
    try {
      use(describe({fmt::format("{}={:.17e}", ends.path, value)}));
    } catch (const Error& error) {
      throw Error(error.status().code,
                  fmt::format("with {} = {}, beside its value: {}", ends.path, value, error.what()));
    }
  }

  void add(const Ends& ends) {
    parameters_.emplace_back();
    Parameter& p = parameters_.back();
    p.step = ends.step();  // what the numbers beside it differ by to the last bit
    for (int a = 0; a < 2; ++a) p.side[a] = beside_nominal(ends, a, p.summary[a]);
  }

  /// The model with the number below or above its value, brought to its start.
  std::unique_ptr<Runner> beside_nominal(const Ends& ends, int above, SimulationSummary& summary) const {
    std::unique_ptr<Runner> side;
    with_end(ends, above,
             [&](const Description& model) { side = std::make_unique<Runner>(model, quiet_options(), summary); });
    compare(side->mechanism(), ends.path);
    return side;
  }

  /// What a side counts and remembers must be like the nominal model's.
  void compare(const Mechanism& side, const std::string& path) const {
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
      const std::vector<double> marks = dynamics::memory_of(*own[k]), other = dynamics::memory_of(*others[k]);
      if (marks.size() != other.size()) jump(fmt::format("what '{}' remembers", own[k]->name()));
      const double size = dynamics::max_norm(marks);
      for (std::size_t i = 0; i < marks.size(); ++i)
        if (std::abs(marks[i] - other[i]) > kAlike * size)
          jump(fmt::format("number {} of '{}' (a shape, where it is a reduced body)", i + 1, own[k]->name()));
    }
  }

  void choose() {
    for (Parameter& p : parameters_)
      for (int a = 0; a < 2; ++a) p.quantities[a] = p.side[a]->chosen();
  }

  void keep(const ForwardSensitivity& forward) {
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

  /// The adjoint method at the equilibrium that was found. @return false: the tangent is not exact enough for what may
  /// be found another way
  bool differentiate_backward() {
    constexpr double kExact = 1e-4;
    Mechanism& mechanism = nominal_->mechanism();
    Options solver;
    solver.threads = mechanism.pool.size();
    const double load = nominal_->time();
    dynamics::model::StaticAdjoint adjoint(mechanism, nominal_->equations(), nominal_->state(), quantities_, load,
                                           solver);
    if (method_ == SensitivityMethod::automatic && !(adjoint.defect() <= kExact)) return false;
    result_.t = {load};
    result_.values = adjoint.values(quantities_);
    result_.adjoint = true;
    result_.defect = adjoint.defect();
    result_.derivatives.assign(quantities_.size() * given_.size(), 0.0);
    base::Stage stage("derivatives", static_cast<double>(given_.size()), "parameters");
    for (std::size_t p = 0; p < given_.size(); ++p, stage.add(1)) {
      std::vector<double> residual[2], values[2];
      for (int a = 0; a < 2; ++a)
        with_end(given_[p], a, [&](const Description& model) {
          const std::unique_ptr<Mechanism> side = dynamics::model::build(model, mechanism.pool.size());
          compare(*side, given_[p].path);
          State start(side->system.sizes());
          side->system.initial(start.q, start.v);
          side->system.set_load_factor(load);
          std::vector<Quantity> quantities;
          for (const Quantity& q : quantities_)
            for (Quantity& found : dynamics::model::find_quantities(*side, q.name, {}))
              quantities.push_back(std::move(found));
          residual[a] = adjoint.residual(*side);
          values[a] = adjoint.values(quantities);
        });
      const double over = 1 / (2 * given_[p].step());
      for (std::size_t i = 0; i < residual[0].size(); ++i) residual[1][i] = over * (residual[1][i] - residual[0][i]);
      const std::vector<double> through = adjoint.along(residual[1]);
      for (std::size_t q = 0; q < quantities_.size(); ++q)
        result_.derivatives[q * given_.size() + p] = over * (values[1][q] - values[0][q]) - through[q];
    }
    return true;
  }

  /// The adjoint method back through the steps of the run: of each quantity at the end, or of the objective.
  void differentiate_motion_backward() {
    Mechanism& mechanism = nominal_->mechanism();
    dynamics::model::MotionRecord record(mechanism);
    std::vector<double> t, values;
    const auto add = [&](int order) {
      const State& state = nominal_->state();
      record.add(state, order);
      t.push_back(state.t);
      for (const Quantity& q : quantities_) values.push_back(q.value(Sample{&state, {}}));
    };
    add(0);
    nominal_->run([&](const SimulationStep& step) {
      add(step.order);
      return true;
    });
    const std::size_t last = record.size() - 1, nq = quantities_.size();
    std::vector<double> slopes;
    if (objective_) slopes = slopes_of_objective(t, values);
    const std::size_t targets = objective_ ? 1 : nq;
    dynamics::model::MotionAdjoint adjoint(mechanism, nominal_->equations().dropped(), record, quantities_);
    const auto weight = [&](std::size_t target, std::size_t step, std::size_t q) {
      return objective_ ? slopes[step * nq + q] : target == q && step == last ? 1.0 : 0.0;
    };
    const auto go_on = [this] {
      if (options_.interrupted && options_.interrupted())
        throw Error(StatusCode::cancelled, "the derivatives were interrupted on the way back");
    };
    adjoint.go_back(targets, weight, go_on);
    result_.t = {t.back()};
    if (!objective_) result_.values.assign(values.end() - static_cast<std::ptrdiff_t>(nq), values.end());
    result_.adjoint = true;
    result_.defect = adjoint.defect();
    result_.derivatives.assign(targets * given_.size(), 0.0);
    base::Stage stage("derivatives", static_cast<double>(given_.size()), "parameters");
    for (std::size_t p = 0; p < given_.size(); ++p, stage.add(1)) {
      go_on();
      std::vector<double> beside[2];
      for (int a = 0; a < 2; ++a) {
        SimulationSummary summary;
        const std::unique_ptr<Runner> side = beside_nominal(given_[p], a, summary);
        beside[a] = adjoint.lagrangian(side->mechanism(), side->state(), side->chosen());
      }
      for (std::size_t k = 0; k < targets; ++k)
        result_.derivatives[k * given_.size() + p] = (beside[1][k] - beside[0][k]) / (2 * given_[p].step());
    }
    check_by_other_runs();
  }

  /// J, which becomes the only quantity of the result. @return dJ/dvalues
  std::vector<double> slopes_of_objective(const std::vector<double>& t, const std::vector<double>& values) {
    std::vector<double> slopes(values.size(), 0.0);
    const double value = objective_(t, values, slopes);
    if (slopes.size() != values.size())
      throw Error(StatusCode::invalid_input,
                  fmt::format("the objective gave {} slopes for {} values", slopes.size(), values.size()));
    if (!std::isfinite(value) || !std::all_of(slopes.begin(), slopes.end(), [](double x) { return std::isfinite(x); }))
      throw Error(StatusCode::invalid_input, "the objective, or one of its slopes, is no finite number");
    result_.quantities = {"objective"};
    result_.values = {value};
    return slopes;
  }

  /// The derivatives of an equilibrium: the objective instead of the quantities.
  void take_objective() {
    if (!objective_) return;
    const std::vector<double> of_quantities = std::move(result_.derivatives);
    const std::vector<double> slopes = slopes_of_objective(result_.t, std::vector<double>(result_.values));
    const std::size_t np = given_.size();
    result_.derivatives.assign(np, 0.0);
    for (std::size_t q = 0; q < slopes.size(); ++q)
      for (std::size_t p = 0; p < np; ++p) result_.derivatives[p] += slopes[q] * of_quantities[q * np + p];
  }

  void differentiate_modes(Equations& own) {
    std::vector<dynamics::PencilSides> sides;
    for (Parameter& p : parameters_)
      sides.push_back(
          {p.step, {&p.side[0]->equations(), &p.side[1]->equations()}, {&p.side[0]->state(), &p.side[1]->state()}});
    Options solver;
    solver.threads = nominal_->mechanism().pool.size();
    const dynamics::FrequencySlopes slopes =
        dynamics::frequency_slopes(own, nominal_->state(), static_cast<Index>(modes_), sides, solver);
    result_.modes.frequencies = slopes.frequencies;
    result_.modes.derivatives = slopes.derivatives;
  }

  static constexpr double kAlike = 0.05;

  const std::string& text_;
  const std::string& name_;
  SimulationOptions options_;
  SensitivityMethod method_;
  const SensitivityObjective& objective_;  // empty: none
  SensitivityResult& result_;
  bool statics_ = false, rests_ = false;
  bool remembers_ = false;  // contacts with friction
  int modes_ = 0;
  std::unique_ptr<Runner> nominal_;
  std::vector<Ends> given_;
  std::deque<Parameter> parameters_;  // of the forward method; summaries are pointed to
  std::vector<Quantity> quantities_;
};

}  // namespace

double SensitivityResult::value(const std::string& quantity) const {
  return values[values.size() - quantities.size() + position_of(quantities, quantity)];
}

double SensitivityResult::derivative(const std::string& quantity, const std::string& parameter) const {
  const std::size_t rows = quantities.size() * parameters.size();
  return derivatives[derivatives.size() - rows + position_of(quantities, quantity) * parameters.size() +
                     position_of(parameters, parameter)];
}

namespace {

SensitivityResult differentiated(const std::string& text, const std::string& name,
                                 const std::vector<SensitivityParameter>& parameters, const SimulationOptions& options,
                                 SensitivityMethod method, const SensitivityObjective& objective) {
  SensitivityResult result;
  try {
    SensitivityRun(text, name, parameters, options, method, objective, result).run();
  } catch (const Error& error) {
    result.status = error.status();
  } catch (const std::bad_alloc&) {
    result.status = {StatusCode::out_of_memory, "the machine's memory is too small for this model", -1};
  }
  result.summary.status = result.status;
  return result;
}

/// `use` of the file's text, unless it cannot be read.
template <class Use>
SensitivityResult of_file(const std::string& path, const Use& use) {
  std::string text;
  try {
    text = dynamics::read_whole_file(path);
  } catch (const Error& error) {
    SensitivityResult result;
    result.status = error.status();
    return result;
  }
  return use(text);
}

}  // namespace

SensitivityResult sensitivities_of_text(const std::string& text, const std::string& name,
                                        const std::vector<SensitivityParameter>& parameters,
                                        const SimulationOptions& options, SensitivityMethod method) {
  return differentiated(text, name, parameters, options, method, nullptr);
}

SensitivityResult sensitivities(const std::string& path, const std::vector<SensitivityParameter>& parameters,
                                const SimulationOptions& options, SensitivityMethod method) {
  return of_file(
      path, [&](const std::string& text) { return sensitivities_of_text(text, path, parameters, options, method); });
}

SensitivityResult objective_gradient_of_text(const std::string& text, const std::string& name,
                                             const std::vector<SensitivityParameter>& parameters,
                                             const SensitivityObjective& objective, const SimulationOptions& options) {
  if (!objective) throw std::invalid_argument("objective_gradient: no objective is given");
  return differentiated(text, name, parameters, options, SensitivityMethod::adjoint, objective);
}

SensitivityResult objective_gradient(const std::string& path, const std::vector<SensitivityParameter>& parameters,
                                     const SensitivityObjective& objective, const SimulationOptions& options) {
  return of_file(path, [&](const std::string& text) {
    return objective_gradient_of_text(text, path, parameters, objective, options);
  });
}

}  // namespace espalier
