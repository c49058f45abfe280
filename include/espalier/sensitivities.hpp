/// \file
/// Derivatives of what a simulation comes to by parameters of its model.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "espalier/dynamics.hpp"

namespace espalier {

/// A number of the model text by its path, as in SimulationOptions::set: "parameters.length",
/// "forces.spring.stiffness", "bodies.arm.position.0".
struct SensitivityParameter {
  std::string path;
  /// So far the equations are looked at to both sides of the value, in the units of the parameter. The derivatives'
  /// error is about its square (over the square of the value) plus 1e-16 over it, both times the ratio of the largest
  /// stiffness to the smallest. 0: 5e-6 of the value (1e-4 where the start is an equilibrium, known to its tolerance);
  /// of a value of zero it has to be given.
  double step = 0;
};

/// How the derivatives of an equilibrium ([statics]) are found. They are the same but for what `defect` says.
enum class SensitivityMethod {
  /// adjoint for an equilibrium with more parameters than quantities and no modes, where the tangent stands the test
  /// that `defect` describes; else forward.
  automatic,
  forward,  ///< some solves for each parameter, and two models that live as long as the run
  /// For an equilibrium one solve with the transposed stiffness for each quantity; of each parameter two models, one
  /// after the other, at which the equations are looked at once. Of a motion: quantities at its end alone, by one way
  /// back through its steps, with a factor and some solves for each quantity in each of them; of each parameter two
  /// models, one after the other, at which the equations of all steps are looked at. Keeps all states in memory.
  adjoint,
};

/// Natural frequencies of the model at its start ([initial] modes), without damping.
struct SensitivityModes {
  std::vector<double> frequencies;  ///< per unit of time, rising
  /// d frequency / d parameter: frequencies.size() rows of parameters. Those of one frequency that several modes share
  /// are the slopes of its branches, rising; 0 for a mode without stiffness.
  std::vector<double> derivatives;
};

struct SensitivityResult {
  Status status;
  std::vector<std::string> parameters;   ///< paths
  std::vector<double> parameter_values;  ///< present values
  std::vector<std::string> quantities;   ///< names
  /// Start and ends of steps; statics: the last load factor alone; the adjoint method: the end alone.
  std::vector<double> t;
  std::vector<double> values;  ///< t.size() rows of quantities
  /// d quantity / d parameter: t.size() blocks of quantities.size() rows of parameters.size() numbers.
  std::vector<double> derivatives;
  SensitivityModes modes;
  bool adjoint = false;  ///< found by SensitivityMethod::adjoint
  /// How well the linear equations of the derivatives are solved: the largest last change of an iteration over the
  /// largest derivative; more than 1e-6 is an error (Status accuracy_not_reached). Of the adjoint method: by how much
  /// the tangent and differences of the equations differ along the answer to random forces, over the largest force; a
  /// tangent that is not exact shows there, and in derivatives. In a motion at the last step and up to eight others,
  /// with the levels of the constraints.
  double defect = 0;
  SimulationSummary summary;

  /// The last value of a quantity and its derivative. @throws std::out_of_range for unknown names
  [[nodiscard]] double value(const std::string& quantity) const;
  [[nodiscard]] double derivative(const std::string& quantity, const std::string& parameter) const;
};

/// Runs a model (a file, or its text with a name for messages) and differentiates its quantities, those of
/// options.quantities and of the model's [output], by the parameters: statics at its equilibrium, motions forward
/// through the steps that the run takes. Those steps do not depend on the parameters: the derivatives are those of the
/// computed motion, and as exact as it is. One run and, for each step, one factorization and a few solves for each
/// parameter; for each parameter the model is built and brought to its start twice more.
///
/// Where something of a model in motion switches (contact, friction, limits, corners and jumps of functions), the
/// derivatives at the end are compared with runs in which parameters are moved by half a percent. Those that such runs
/// contradict are replaced by differences of whole runs where two ways agree; a notice in the summary says so.
///
/// Status invalid_input, beside what a simulation reports: a path that names no number, a parameter by which the
/// number of unknowns or the shapes of a reduced body jump, models with events, restart files; the adjoint method with
/// [initial] modes, and for motions with contacts that remember (friction, restitution) or of deformable bodies.
SensitivityResult sensitivities(const std::string& path, const std::vector<SensitivityParameter>& parameters,
                                const SimulationOptions& options = {},
                                SensitivityMethod method = SensitivityMethod::automatic);
SensitivityResult sensitivities_of_text(const std::string& text, const std::string& name,
                                        const std::vector<SensitivityParameter>& parameters,
                                        const SimulationOptions& options = {},
                                        SensitivityMethod method = SensitivityMethod::automatic);

/// A number J that a run comes to as a whole: an integral over time, a distance from measurements. Called when the run
/// has ended (and where the model switches, after each run that checks the gradient) with its times (start and ends of
/// steps; statics: the last load factor) and values: for each time a row of quantities. Writes dJ/dvalues into slopes,
/// which are as many, and zeros before. Must not throw Error.
using SensitivityObjective =
    std::function<double(const std::vector<double>& t, const std::vector<double>& values, std::vector<double>& slopes)>;

/// J and its gradient by the adjoint method, at the cost of one quantity however many parameters and times there are:
/// the result has the one quantity "objective", of the end. Quantities as for sensitivities(), in that order; Status
/// invalid_input also for slopes that are not finite, or not as many as values. Throws std::invalid_argument for an
/// empty function.
SensitivityResult objective_gradient(const std::string& path, const std::vector<SensitivityParameter>& parameters,
                                     const SensitivityObjective& objective, const SimulationOptions& options = {});
SensitivityResult objective_gradient_of_text(const std::string& text, const std::string& name,
                                             const std::vector<SensitivityParameter>& parameters,
                                             const SensitivityObjective& objective,
                                             const SimulationOptions& options = {});

}  // namespace espalier
