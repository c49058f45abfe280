/// \file
/// A model and what of it is to be differentiated: the run itself, and the same models a little beside it.
#pragma once

#include <fmt/format.h>

#include <deque>
#include <memory>

#include "dynamics/integrators/derivatives/sensitivity.hpp"
#include "dynamics/model/derivatives/run_differences.hpp"
#include "dynamics/model/run/runner.hpp"
#include "espalier/sensitivities.hpp"

namespace espalier::dynamics::model {

// Stiff directions magnify both errors of a central difference, the square of the step and rounding over it, alike.
inline constexpr double kRelativeStep = 5e-6;

class SensitivityRun {
 public:
  /// All outlive this. @param objective  empty: none @throws Error for models and parameters that cannot be taken
  SensitivityRun(const std::string& text, const std::string& name, const std::vector<SensitivityParameter>& parameters,
                 const SimulationOptions& options, SensitivityMethod method, const SensitivityObjective& objective,
                 SensitivityResult& result);
  void run();

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

  /// Whether anything of the model has kinks or jumps.
  [[nodiscard]] bool switches() const;
  /// The derivatives at the end beside whole runs, where the model switches: those of the steps that were taken do not
  /// know that the times of switches move with the parameters.
  void check_by_other_runs();
  /// As the run, but to its very end and with a hundredth of its tolerances.
  [[nodiscard]] IntegratorSpec of_check(IntegratorSpec spec) const;
  /// The quantities, or the objective, at the end of a run with some parameters moved.
  [[nodiscard]] std::vector<double> end_of_run(const MovedParameters& moved) const;
  /// The adjoint method at the equilibrium that was found. @return false: the tangent is not exact enough for what may
  /// be found another way
  bool differentiate_backward();
  /// The adjoint method back through the steps of the run: of each quantity at the end, or of the objective.
  void differentiate_motion_backward();
  /// J, which becomes the only quantity of the result. @return dJ/dvalues
  std::vector<double> slopes_of_objective(const std::vector<double>& t, const std::vector<double>& values);
  /// The derivatives of an equilibrium: the objective instead of the quantities.
  void take_objective();
  Ends ends_of(const SensitivityParameter& given);
  void add(const Ends& ends);
  /// The model with the number below or above its value, brought to its start.
  std::unique_ptr<Runner> beside_nominal(const Ends& ends, int above, SimulationSummary& summary) const;
  /// What a side counts and remembers must be like the nominal model's.
  void compare(const Mechanism& side, const std::string& path) const;
  void choose();
  void keep(const ForwardSensitivity& forward);
  void differentiate_modes(Equations& own);
  [[nodiscard]] SimulationOptions quiet_options() const;
  [[nodiscard]] Value tree() const;
  [[nodiscard]] Description describe(const std::vector<std::string>& more) const;
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

/// Models whose derivatives nobody has.
void refuse_what_does_not_pass(const Description& model, SensitivityMethod method);
/// What remembers something from step to step that the state does not tell.
void refuse_memory(const Description& model, const Mechanism& mechanism);
/// Derivatives are those of one run: its times, tolerances, loads, outputs and solver do not move with a parameter.
void refuse_other_run(const Description& model, const Description& side, const std::string& path);

}  // namespace espalier::dynamics::model
