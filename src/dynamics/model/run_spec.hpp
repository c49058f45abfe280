/// \file
/// What happens to a model, as plain data: events, controllers, the run and its output.
#pragma once

#include <complex>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "base/named.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/integrators/statics/statics.hpp"
#include "dynamics/model/joint_spec.hpp"
#include "espalier/harmonic.hpp"

namespace espalier::dynamics::model {

struct EventSpec {
  Place place;
  std::string name;
  std::optional<Formula> condition;                  ///< holds where it is >= 0; none with a contact
  std::string contact;                               ///< closes or opens; empty: none
  bool opens = false;                                ///< of the contact
  bool stop = false;                                 ///< the run ends
  bool once = false;                                 ///< only the first time
  std::vector<std::string> on, off;                  ///< joints and forces to be switched
  std::vector<std::pair<std::string, Formula>> set;  ///< inputs and their new values
  double tolerance = 0;                              ///< of the time; 0: 1e-6 of the step
  double position_tolerance = 1e-6;                  ///< largest change of positions for joints switched on
};

enum class Method { bdf, generalized_alpha };
inline constexpr base::Named<Method> kMethods[] = {{"bdf", Method::bdf},
                                                   {"generalized-alpha", Method::generalized_alpha}};

struct IntegratorSpec {
  Place place;
  Method method = Method::bdf;
  double start = 0, end = 0;  ///< end: infinite where the number of steps alone ends the run
  long steps = 0;             ///< accepted steps after which the run ends; 0: any number
  bool states_tolerances = false, states_constraints = false, states_order = false;  ///< of bdf, in the text
  double accuracy = 1e-4;  ///< of models that state no tolerances, see default_tolerances.hpp
  BdfOptions bdf;
  AlphaOptions alpha;
  bool operator==(const IntegratorSpec&) const = default;
};

/// A run of its own without motion: equilibrium, step by step along the load factor.
struct StaticsSpec {
  Place place;
  StaticsOptions options;
  double time = 0;  ///< at which functions of time are taken
  bool operator==(const StaticsSpec&) const = default;
};

/// A steady rotation that bodies begin with, in addition to their own velocities.
struct RotationSpec {
  Place place;
  Vec3 axis = Vec3::UnitZ();  ///< of length one
  Vec3 point = Vec3::Zero();  ///< on the axis
  double speed = 0;           ///< rad per unit of time
  std::vector<std::string> bodies;
  bool operator==(const RotationSpec&) const = default;
};

struct InitialSpec {
  Place place;
  std::optional<RotationSpec> rotation;
  bool statics = false;  ///< the motion begins at rest in equilibrium
  StaticsOptions statics_options;
  bool project_velocities = false;  ///< given velocities may be changed to fit the constraints
  double position_tolerance = 1e300;
  double velocity_tolerance = 1e-3;  ///< allowed change of given velocities, relative to the largest of them
  int modes = 0;                     ///< natural frequencies to be reported
  bool operator==(const InitialSpec&) const = default;
};

/// Another program's part in the model, an FMU: what it tells is held between its steps.
struct ControllerSpec {
  Place place;
  std::string name;
  std::string path;                                          ///< of the FMU
  double step = 0;                                           ///< between two exchanges
  std::vector<std::pair<std::string, Formula>> inputs;       ///< its variables, and what they are set to
  std::vector<std::pair<std::string, std::string>> outputs;  ///< names in the model, and its variables
  bool all_outputs = false;                                  ///< instead: all that it has, by their own names
  /// What it begins with: numbers or texts.
  std::vector<std::pair<std::string, std::variant<double, std::string>>> start;
};

enum class PictureFormat { vtkhdf, vtu };
inline constexpr base::Named<PictureFormat> kPictureFormats[] = {{"vtkhdf", PictureFormat::vtkhdf},
                                                                 {"vtu", PictureFormat::vtu}};

/// Points of a body's material on straight lines, and what is asked for at each.
struct PathSpec {
  Place place;
  std::string name, body;
  std::vector<Vec3> through;  ///< corners, in the coordinates of the mesh
  int points = 51;
  std::vector<std::string> quantities;  ///< "stress.xx" ...
  bool operator==(const PathSpec&) const = default;
};

struct OutputSpec {
  Place place;
  std::vector<std::string> quantities;  ///< columns of the CSV file
  std::vector<std::string> envelopes;   ///< whose extremes over the run are wanted
  double csv_interval = 0;              ///< 0: every step
  bool energies = true, constraints = true, reactions = false, step_data = false;
  double vtu_interval = -1;  ///< of pictures; 0: every step; < 0: none
  PictureFormat format = PictureFormat::vtkhdf;
  double restart_interval = -1;  ///< < 0: at the end only
  bool exact_times = false;      ///< steps end at the output times
  std::vector<PathSpec> paths;
  bool page = true;  ///< index.html, which shows the run in a browser
  bool operator==(const OutputSpec&) const = default;
};

/// Frequency response of the model, linearised at its start or in its equilibrium.
struct HarmonicSpec {
  /// amplitude cos(w t) is added to what a force is driven by (the factor of a load, the pressure, the actuator of a
  /// spring, torque or force of a motor), to the function of a motor, or to an input.
  struct Excitation {
    Place place;
    std::string of;  ///< name of the force or joint; of an input with or without "inputs."
    std::complex<double> amplitude;
  };
  struct Load {
    Place place;
    std::string name;
    std::vector<Excitation> parts;  ///< act at the same time
  };
  Place place;
  HarmonicOptions options;              ///< frequencies, tolerance, loss factor, shapes; the rest is unused
  std::vector<Load> loads;              ///< each a response of its own
  std::vector<std::string> quantities;  ///< empty: those of the output
  int phases = 8;                       ///< pictures of each shape, over a period
};

}  // namespace espalier::dynamics::model
