/// \file
/// One instance of an exported model: a run behind the numbers and modes of FMI. The C functions of both standards
/// (fmi2.cpp, fmi3.cpp) call it.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dynamics/model/fmu/instant.hpp"
#include "dynamics/model/run/runner.hpp"
#include "fmi/contents.hpp"
#include "fmi/types.hpp"

namespace espalier::fmu {

/// Where an instance is in its life; `running`: between steps (co-simulation), or wherever an integrator puts it.
enum class Mode { instantiated, initialization, running, terminated };

/// How a communication step ended.
struct StepEnd {
  double time = 0;          ///< that was reached
  bool terminated = false;  ///< an event of the model ends the run
};

/// Throws espalier::Error with a message for the logger.
class Instance {
 public:
  /// @param resources the folder of that name @param token that the caller knows the FMU by
  Instance(const std::string& resources, std::string_view token, bool model_exchange);

  [[nodiscard]] Mode mode() const { return mode_; }
  /// What the model has to say since the last call.
  [[nodiscard]] std::vector<std::string> take_notices();

  /// Before the initialization. @param tolerance relative, for a model whose integrator controls its error
  void set_times(std::optional<double> tolerance, double start, std::optional<double> stop);
  void enter_initialization();
  void exit_initialization();
  void terminate() { mode_ = Mode::terminated; }
  void reset();

  /// Co-simulation: a step of this length. @pre Mode::running
  [[nodiscard]] StepEnd step(double from, double length);

  [[nodiscard]] double get(fmi::ValueReference reference);
  void set(fmi::ValueReference reference, double value);

  // Model exchange: states are positions, then velocities.
  void expect_model_exchange() const;
  [[nodiscard]] std::size_t state_count() const { return states_.size(); }
  void set_time(double t);
  void set_states(std::span<const double> x);
  void get_states(std::span<double> x);
  void get_derivatives(std::span<double> dx);

  /// All that the coming calls depend on, as bytes.
  [[nodiscard]] std::string save();
  void restore(std::string_view bytes);

  /// sum over knowns of d unknown / d known * seed. While the model is initialized, of outputs and states at the start
  /// by parameters and inputs: differences of starts. Later of outputs and derivatives by inputs (and states):
  /// accelerations and reactions follow from them at once, by the linearised equations.
  void directional(std::span<const fmi::ValueReference> unknowns, std::span<const fmi::ValueReference> knowns,
                   std::span<const double> seed, std::span<double> sensitivity);

 private:
  /// A loaded model: what a run needs to stay where it is.
  struct Run {
    SimulationSummary summary;
    std::unique_ptr<dynamics::model::Runner> runner;
    std::unique_ptr<dynamics::model::Instant> instant;
    std::vector<double> loaded_with;  ///< values of the variables
  };
  [[nodiscard]] const fmi::Variable& variable(fmi::ValueReference reference) const;
  [[nodiscard]] std::unique_ptr<Run> load(const std::vector<double>& values) const;
  void need_run();
  void take_run();
  /// Outputs, states and derivatives of a run into their places among the variables.
  void read_out(const Run& run, std::vector<double>& values) const;
  void set_inputs(const std::vector<double>& values);
  /// With accelerations and reactions, where inputs, time and states have these values.
  [[nodiscard]] dynamics::State solved_state(const std::vector<double>& values);
  void respond();
  /// A change of what is known, and the step of differences along it: a part of the size of what moves.
  struct Direction {
    std::vector<double> along;  ///< of all variables
    double step = 0;
  };
  /// The seed in parts, all states in one: numbers of different size do not share a step.
  [[nodiscard]] std::vector<Direction> directions(std::span<const fmi::ValueReference> unknowns,
                                                  std::span<const fmi::ValueReference> knowns,
                                                  std::span<const double> seed) const;
  // Derivatives of all variables along a change of what is known.
  [[nodiscard]] std::vector<double> slope_of_start(const std::vector<double>& along, double step) const;
  [[nodiscard]] std::vector<double> slope_here(const std::vector<double>& along, double step);
  [[nodiscard]] dynamics::State state_of(const std::vector<double>& values) const;

  std::string folder_, text_;
  fmi::Contents contents_;
  bool model_exchange_ = false;
  Mode mode_ = Mode::instantiated;
  std::optional<double> tolerance_, stop_;
  std::vector<double> values_;                               ///< of all variables, in their order
  std::vector<std::size_t> outputs_, states_, derivatives_;  ///< where they stand
  bool current_ = false;      ///< outputs and derivatives are those of time, inputs and states
  std::unique_ptr<Run> run_;  ///< null: not loaded, or what it was loaded with has changed
};

}  // namespace espalier::fmu
