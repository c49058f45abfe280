#include "espalier/sensitivities.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <memory>
#include <new>
#include <stdexcept>

#include "dynamics/integrators/sensitivity.hpp"
#include "dynamics/integrators/vibrations.hpp"
#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/expand.hpp"
#include "dynamics/model/runner.hpp"
#include "dynamics/model/static_adjoint.hpp"

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

std::size_t position_of(const std::vector<std::string>& names, const std::string& name) {
  const auto it = std::find(names.begin(), names.end(), name);
  if (it == names.end()) throw std::out_of_range("there is no '" + name + "' among the sensitivities");
  return static_cast<std::size_t>(it - names.begin());
}

/// A model and what of it is to be differentiated.
class SensitivityRun {
 public:
  SensitivityRun(const std::string& text, const std::string& name, const std::vector<SensitivityParameter>& parameters,
                 const SimulationOptions& options, SensitivityMethod method, SensitivityResult& result)
      : text_(text), name_(name), options_(options), method_(method), result_(result) {
    if (!options.restart.empty())
      throw Error(StatusCode::invalid_input, "sensitivities begin with the model, not with a restart file");
    if (parameters.empty()) throw Error(StatusCode::invalid_input, "sensitivities: no parameter is given");
    const Description model = describe({});
    if (!model.events.empty())
      throw Error(StatusCode::invalid_input,
                  fmt::format("sensitivities do not pass events yet, and the model has {}", model.events.size()));
    for (const dynamics::model::ContactSpec& c : model.contacts) {
      remembers_ = remembers_ || c.law.friction > 0;
      // The copies do not take part in what these do between Newton's passes, or in jumps of the velocities.
      if (c.law.impulse || c.penetration > 0)
        dynamics::model::fail(c.place, fmt::format("sensitivities do not pass contacts with {} yet",
                                                   c.law.impulse ? "impulses (the penalty works)"
                                                                 : "a chosen penetration (stiffness alone works)"));
      if (c.law.friction > 0 && (model.statics || model.initial.statics))
        dynamics::model::fail(c.place,
                              "sensitivities of equilibria do not pass contacts with friction yet, whose forces "
                              "depend on the way there");
    }
    statics_ = model.statics.has_value();
    modes_ = model.initial.modes;
    rests_ = model.initial.statics;
    if (method_ == SensitivityMethod::adjoint && (!statics_ || modes_ > 0))
      throw Error(
          StatusCode::invalid_input,
          fmt::format("the adjoint method finds derivatives of an equilibrium ([statics]){}: take the forward one",
                      statics_ ? ", not of [initial] modes" : ", not of a motion"));
    nominal_ = std::make_unique<Runner>(model, options_, result.summary);
    for (const SensitivityParameter& p : parameters) given_.push_back(ends_of(p));
    quantities_ = nominal_->chosen();
    for (const Quantity& q : quantities_) result_.quantities.push_back(q.name);
    if (quantities_.empty() && modes_ == 0)
      throw Error(StatusCode::invalid_input,
                  "sensitivities: no quantity is chosen; name some in [output] quantities, or SimulationOptions");
  }

  void run() {
    bool at_equilibrium = false;
    if (method_ == SensitivityMethod::adjoint ||
        (method_ == SensitivityMethod::automatic && statics_ && modes_ == 0 && given_.size() > quantities_.size())) {
      nominal_->run({});
      at_equilibrium = true;
      if (differentiate_backward()) return;
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
    SimulationOptions options = options_;
    options.out.clear();
    options.dump.clear();
    options.keep_series = false;
    options.frame_interval = -1;
    options.record_timeline = false;
    for (int a = 0; a < 2; ++a) {
      with_end(ends, a,
               [&](const Description& model) { p.side[a] = std::make_unique<Runner>(model, options, p.summary[a]); });
      compare(p.side[a]->mechanism(), ends.path);
    }
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
      std::vector<double> marks, other;
      own[k]->save(marks);
      others[k]->save(other);
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
    for (std::size_t p = 0; p < given_.size(); ++p) {
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

SensitivityResult sensitivities_of_text(const std::string& text, const std::string& name,
                                        const std::vector<SensitivityParameter>& parameters,
                                        const SimulationOptions& options, SensitivityMethod method) {
  SensitivityResult result;
  try {
    SensitivityRun(text, name, parameters, options, method, result).run();
  } catch (const Error& error) {
    result.status = error.status();
  } catch (const std::bad_alloc&) {
    result.status = {StatusCode::out_of_memory, "the machine's memory is too small for this model", -1};
  }
  result.summary.status = result.status;
  return result;
}

SensitivityResult sensitivities(const std::string& path, const std::vector<SensitivityParameter>& parameters,
                                const SimulationOptions& options, SensitivityMethod method) {
  SensitivityResult result;
  std::string text;
  try {
    text = dynamics::read_whole_file(path);
  } catch (const Error& error) {
    result.status = error.status();
    return result;
  }
  return sensitivities_of_text(text, path, parameters, options, method);
}

}  // namespace espalier
