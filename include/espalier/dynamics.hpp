/// \file
/// The simulator of mechanical systems: load a model (docs/guide/simulate.md), run it, get results.
///
///     espalier::Simulation simulation;
///     if (auto s = simulation.load("pendulum.toml"); !s.ok()) ...   // s.message: file, line, what to do
///     simulation.set_input("throttle", 0.5);                        // of the model's [inputs]
///     if (auto s = simulation.run(); !s.ok()) ...
///     double x = simulation.value("bob.position.x");
///
/// Who sets inputs between steps of his own (a controller, another simulator) calls step_to() again and again, and goes
/// back by restore() to what save() gave him.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "espalier/ranks.hpp"
#include "espalier/types.hpp"

namespace espalier {

/// What a search for an equilibrium is at, before each of its factorizations.
struct SimulationSearch {
  long steps = 0;          ///< of the load, accepted so far
  double load = 0;         ///< load factor of the last of them
  double trial = 0;        ///< load factor that is tried
  int factorizations = 0;  ///< so far
  double residual = 0;     ///< what the trial has out of balance, as in statics.tolerance
};

/// What the caller may choose; the model text says the rest.
struct SimulationOptions {
  std::vector<std::string> set;  ///< values of the model text to be replaced: "parameters.size=2"
  std::string out;               ///< folder for results, made if it is not there; empty: nothing is written
  std::optional<double> until;   ///< instead of integrator.end; of a statics run: instead of statics.load
  std::string restart;           ///< a restart file to go on from; empty: from the beginning
  bool accept_changes = false;   ///< go on from it although it is of another model; the notices say what differs
  std::string dump;              ///< folder for Newton matrices; empty: none
  long dump_every = 1;           ///< every N-th factorization is written ...
  long dump_count = 10;          ///< ... and at most so many
  /// Folder where analyses of Newton matrices are kept, one file for each pattern: a simulation that finds its own
  /// there orders nothing, also in other processes. Empty: none. Scalings are those of the matrix that was analyzed.
  std::string analyses;
  /// Ranks that factorize the Newton matrices and solve together, with the bits of one process. Rank 0 alone makes
  /// simulations; all others call serve_simulations(). Does not go with `analyses`.
  Ranks ranks;
  /// Quantities by name, besides those of the model's [output]: chosen ones, see SimulationSummary::values.
  std::vector<std::string> quantities;
  /// Pictures of the bodies are kept in memory at such intervals of time (of the load factor), by interpolation between
  /// the ends of steps: Simulation::frames(). 0: at the end of every step; -1: none.
  double frame_interval = -1;
  /// With `out`: the run as a page for a browser, index.html, unless the model says [output] page = false. It is
  /// renewed while the run goes on.
  bool page = true;
  bool keep_page = false;        ///< what such a page shows is kept in memory: Simulation::page(). Also without `out`
  bool record_timeline = false;  ///< keep what each step does when, for Simulation::write_trace()
  /// Chosen quantities are kept in memory, a row for every step: Simulation::series(). Where none is chosen and
  /// keep_page is set: positions and velocities of the first bodies, energies, forces of the first joints; of more than
  /// 20,000 rows every second, fourth ... one.
  bool keep_series = false;
  /// Options of the solver by name ("device", "host_memory", ...: the fields of Options), over those of the model.
  std::vector<std::pair<std::string, std::string>> solver;
  /// Statics, also at the start of a motion (in load()), may take long: called with what it is at. false: stop it; in
  /// load() that is the error `cancelled`.
  std::function<bool(const SimulationSearch&)> on_search;
  /// Whether to stop, asked between steps and in long analyses and factorizations (Options::interrupted): as if the
  /// observer had said so at the end of the step before; in load() the error `cancelled`.
  std::function<bool()> interrupted;
  double interrupted_every = 0.02;  ///< seconds between two such questions
};

/// A number that may be asked for by name.
struct SimulationQuantity {
  std::string name;  ///< "rod.position.x"
  /// In the units of the model: "length", "length/time", "force", "force*length", "angle", "energy", "1", ... Empty
  /// where the program does not know: inputs and sensors; coordinates, rates and strengths, which are lengths or
  /// angles.
  std::string dimension;
  std::string unit = {};  ///< "m/s"; empty where the model does not state its units, or there is no dimension
};

/// Chosen quantities at the beginning and at the ends of steps.
struct SimulationSeries {
  std::vector<std::string> names;
  std::vector<double> t;       ///< rising; of a statics run, the load factor, which may turn back
  std::vector<double> values;  ///< t.size() rows of names.size() numbers
};

/// The bodies as cells of VTK, which stay as they are: flexible bodies with their meshes, rigid bodies as boxes, point
/// masses as points.
struct SimulationMesh {
  std::vector<std::uint8_t> types;  ///< shapes by VTK's numbers (vtkCellType.h), one for each cell
  std::vector<std::int64_t>
      offsets;  ///< cell k has the points connectivity[offsets[k]] up to, not with, offsets[k + 1]
  std::vector<std::int64_t> connectivity;  ///< numbers of points, from 0
  std::vector<Index> body;                 ///< of each cell, its place in `bodies`
  std::vector<std::string> bodies;         ///< names, in the order of the text
};

/// Points of a SimulationMesh at one time, in the units of the model.
struct SimulationFrame {
  double t = 0;                      ///< in a statics run the load factor
  std::vector<double> points;        ///< 3 numbers per point
  std::vector<double> displacement;  ///< from the start, 3 per point
  std::vector<double> velocity;      ///< 3 per point
  std::vector<double> von_mises;     ///< of each cell: stress in the middle of solid elements, 0 elsewhere
};

/// One accepted step, of time or (statics) of the load.
struct SimulationStep {
  long index = 0;             ///< from 1
  double t = 0;               ///< time at its end; load factor
  double h = 0;               ///< its length
  int order = 0;              ///< of the formula
  int newton_iterations = 0;  ///< of the attempt that succeeded
  int factorizations = 0;     ///< of all attempts
  int failures = 0;           ///< attempts rejected, by the error test or because Newton did not converge
  double residual = 0;        ///< largest residual of the equations of motion; statics: as in statics.tolerance
  double error = 0;           ///< local error in units of the tolerance; 0 where it is not controlled
};

/// Called after every step; false: stop here, write restart file and outputs.
using SimulationObserver = std::function<bool(const SimulationStep&)>;

/// Wall time in seconds.
struct SimulationPhases {
  double setup = 0;          ///< reading, meshing, patterns
  double assembly = 0;       ///< forces, constraints, tangents
  double analysis = 0;       ///< ordering and plan of the Newton matrix
  double factorization = 0;  ///< numeric
  double solve = 0;
  double output = 0;  ///< files, and quantities computed for them
  double other = 0;   ///< what is left of total
  double total = 0;
};

/// Largest constraint violations at the three levels.
struct SimulationViolation {
  double position = 0, velocity = 0, acceleration = 0;
};

struct SimulationEnergy {
  double kinetic = 0, potential = 0;
};

/// A point on the way to an equilibrium where the structure gives way.
struct SimulationCritical {
  double load = 0;    ///< load factor
  bool limit = true;  ///< limit point, where the load turns back; false: bifurcation, where the path goes straight on
};

/// A natural frequency of the system linearised at the start: about rest, or about a steady motion.
struct SimulationMode {
  double frequency = 0;      ///< per unit of time; in a steady motion as seen from the axes that a notice names
  double damping_ratio = 0;  ///< of critical damping
  double growth = 0;         ///< amplitudes go with exp(growth t)
  /// The sense of what circles about the axis of a steady rotation: 1 with it, -1 against it, between where paths are
  /// ellipses; 0 on a line, or without such an axis. As seen from the axes of `frequency`.
  double whirl = 0;
  /// The frequency as seen from axes at rest, negative against the rotation: that of a path that is a circle, or of
  /// what does not circle at all. NaN: there are two, frequency + n and frequency - n, n the turns per unit of time.
  double standing_frequency = 0;
  /// Amplitudes of the shape with a modal mass of 1 (x^T M x = 1): its largest displacement, and the chosen quantities
  /// that are stresses, strains or forces in sections, as amplitudes.
  double displacement = 0;
  std::vector<std::pair<std::string, double>> values = {};
};

/// An extreme of a quantity over a run, at the ends of steps, and where it is.
struct SimulationExtreme {
  double value = 0;
  double t = 0;                   ///< time; load factor
  std::string body;               ///< empty: the quantity is not that of a place on a body
  std::int64_t node = 0;          ///< its label; 0: not at a node
  std::array<double, 3> place{};  ///< in the coordinates of the mesh
};
struct SimulationEnvelope {
  std::string quantity;
  SimulationExtreme largest, least;
};

/// Values along a path through a body, at the end of the run, see [output.paths] of a model.
struct SimulationPath {
  std::string name, body;
  std::vector<std::string> quantities;  ///< "stress.xx" ...
  double t = 0;                         ///< time; load factor
  std::vector<double> length;           ///< of the path up to each point
  std::vector<double> places;           ///< 3 per point, in the coordinates of the mesh
  std::vector<double> values;           ///< of all points, one quantity after the other; NaN beside the body
};

/// The highest amplitude of a quantity in the frequency response, see [harmonic] of a model.
struct SimulationPeak {
  std::string load, quantity;
  double frequency = 0;
  double amplitude = 0;
  double phase = 0;  ///< degrees, from -180 to 180
};

/// Something that happened, see [events] of a model.
struct SimulationEvent {
  std::string name;
  double t = 0;
};

/// A number that the program may set, see [inputs] of a model.
struct SimulationInput {
  std::string name;
  double value = 0;
};

/// Everything that is known of a run; filled in as far as it got.
struct SimulationSummary {
  Status status;
  bool interrupted = false;  ///< the observer stopped it
  std::string stopped_by;    ///< the event that ended the run; empty: none
  std::string title;
  std::string units;   ///< of all numbers: "SI", "mm-t-s", ..., as the model states; empty: it does not
  std::string method;  ///< "bdf", "generalized-alpha", "statics", "linear statics" or "harmonic"

  // The system
  Index bodies = 0, joints = 0, forces = 0;
  Index velocities = 0;                ///< n, velocity coordinates
  Index constraints = 0;               ///< m, constraint equations
  Index degrees_of_freedom = 0;        ///< n - rank
  std::vector<std::string> redundant;  ///< one notice per constraint left out
  std::vector<std::string> notices;    ///< what was passed over in meshes; divided steps

  // The start
  double position_change = 0;  ///< of the given initial configuration to satisfy the constraints
  double velocity_change = 0;
  // Equilibrium, at the start of a motion or as a run of its own; all 0 without
  long statics_steps = 0;             ///< of the load
  int statics_iterations = 0;         ///< of Newton
  double statics_residual = 0;        ///< largest entry of what is out of balance
  bool statics_relaxed = false;       ///< found by relaxation: nothing held the unloaded system
  double statics_backward_error = 0;  ///< of linear statics, by components: 1e-16 is the best
  std::vector<SimulationCritical> critical;
  std::vector<SimulationMode> modes;
  std::vector<SimulationPeak> peaks;  ///< of the frequency response, load after load
  Index harmonic_points = 0;          ///< frequencies of it
  Index harmonic_solves = 0;          ///< of these and beside them: frequencies that were solved

  // The run
  double t_begin = 0, t_end = 0;  ///< t_end: time reached
  long steps = 0, newton_iterations = 0, error_failures = 0, newton_failures = 0, crossings = 0;
  long divisions = 0;           ///< halvings of a constant step in which Newton did not converge
  long rounded = 0;             ///< constant steps in which rounding ended Newton's iteration
  double largest_rounding = 0;  ///< its last change of accelerations and multipliers there, in units of the largest
  long residuals = 0, tangents = 0, analyses = 0, factorizations = 0, solves = 0;
  long followed = 0;  ///< of the analyses: those that kept what a change of the pattern did not touch
  long turned = 0;    ///< times that a factor went on serving when bodies had turned
  /// Why factorizations of the integrator were made.
  long refactor_first = 0, refactor_step = 0, refactor_rate = 0, refactor_failed = 0;
  std::vector<SimulationEvent> events;  ///< in their order; of very many the first 10,000
  long event_count = 0;
  SimulationEnergy energy_begin, energy_end;
  /// The balance of a motion: work of what is in no potential (dampers, friction, motors, supports), and what the
  /// energy changed beside it, by the steps of the integration themselves. From states at the ends of steps.
  double energy_work = 0, energy_gain = 0;
  SimulationViolation largest_violation;  ///< over all steps
  SimulationPhases phases;

  // The solver
  std::string device;  ///< where it works, in words
  std::string kind;    ///< "lu", "ldlt", "llt", or "dense" for small systems
  std::string precision;
  Offset nonzeros_factor = 0;
  double factor_flops = 0;
  Offset predicted_bytes = 0, peak_bytes = 0;

  // Results
  std::vector<std::pair<std::string, double>> values;  ///< the chosen quantities at the end
  std::vector<SimulationEnvelope> envelopes;           ///< of [output] envelopes
  /// The peak of each solid: the largest von Mises stress at the nodes of its surface, in the pictures of the run's
  /// page.
  std::vector<SimulationExtreme> stress_peaks;
  std::vector<SimulationPath> paths;  ///< of [output.paths]
  std::vector<std::string> files;     ///< written: csv, pictures, restart
  long dumped = 0;                    ///< matrices written
};

/// One run of one model. Not safe for concurrent calls.
class Simulation {
 public:
  /// @throws std::invalid_argument for options that make no sense
  explicit Simulation(SimulationOptions options = {});
  ~Simulation();
  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;

  /// Reads a model file, builds the system and makes its initial state consistent.
  Status load(const std::string& path);
  /// The same of a text; `name` stands for the file in messages, mesh files are looked for beside it.
  Status load_text(const std::string& text, const std::string& name);
  /// Runs to the end (or until the observer says stop; that is ok, see SimulationSummary::interrupted).
  /// @pre load() succeeded
  Status run(const SimulationObserver& observer = {});

  /// Steps until exactly t, or until the observer or an event says stop; may go beyond end_time(). Files of the model's
  /// [output] are written on the way, and ended by run(). At the present time there is nothing to do.
  /// @throws std::invalid_argument for a time in the past or one that is not finite; std::logic_error for statics
  /// @pre load() succeeded
  Status step_to(double t, const SimulationObserver& observer = {});
  /// The present state as bytes, those of a restart file: all that the coming steps depend on, inputs and switches,
  /// too. Costs an analysis of Newton's matrix, which the run that goes on makes anew, so that it takes the same steps
  /// as one that is restored. @throws std::logic_error for statics @pre load() succeeded
  [[nodiscard]] std::string save();
  /// Goes (back) to a state that save() gave, of this object or another one with the same model; the series ends there.
  /// On failure (status invalid_input: bytes that are damaged, or of another model) nothing has changed.
  /// @throws std::logic_error for statics @pre load() succeeded
  Status restore(std::string_view state);

  /// All that value() knows, in the order of the model; sorted by objects. @pre load() succeeded
  [[nodiscard]] std::vector<SimulationQuantity> quantities() const;
  /// SimulationOptions::keep_series; empty without. @pre load() succeeded
  [[nodiscard]] const SimulationSeries& series() const;
  /// What frames are pictures of. @pre load() succeeded
  [[nodiscard]] SimulationMesh mesh() const;
  /// The present state. @pre load() succeeded
  [[nodiscard]] SimulationFrame frame() const;
  /// SimulationOptions::frame_interval; empty without. restore() drops those of later times. @pre load() succeeded
  [[nodiscard]] const std::vector<SimulationFrame>& frames() const;
  /// A page for a browser (HTML) of what is known so far: with SimulationOptions::keep_page, or a page in `out`, the
  /// motion; else the present state. Needs nothing beside itself, and no network. @pre load() succeeded
  [[nodiscard]] std::string page() const;
  [[nodiscard]] const SimulationSummary& summary() const;
  /// Writes the phases of all steps so far, on the host and on a device, as a Chrome trace that Perfetto opens; of very
  /// many the first two million. @throws std::logic_error without SimulationOptions::record_timeline
  /// @pre load() succeeded
  Status write_trace(const std::string& path) const;
  [[nodiscard]] double time() const;      ///< present time. @pre load() succeeded
  [[nodiscard]] double end_time() const;  ///< @pre load() succeeded
  /// A quantity of the present state by its name (docs/guide/simulate.md), for instance "rod.position.x".
  /// @throws std::invalid_argument if there is no such scalar quantity @pre load() succeeded
  [[nodiscard]] double value(const std::string& quantity) const;
  /// The inputs of the model with their present values. @pre load() succeeded
  [[nodiscard]] std::vector<SimulationInput> inputs() const;
  /// Sets an input; expressions see it from the next step on. May be called before run() and from its observer. A jump
  /// is followed like any other steep function; the integrator does not begin anew.
  /// @throws std::invalid_argument if there is no such input, or the number is not finite @pre load() succeeded
  void set_input(const std::string& name, double value);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// What the ranks beside rank 0 do while that one makes simulations with SimulationOptions::ranks: they take part in
/// every analysis, factorization and solve, until rank 0 calls end_simulations(). Both calls are collective. Between
/// two factorizations rank 0 may take as long as Ranks' patience.
/// @returns what keeps them from it: a rank is lost (device_error), then rank 0 hears the same
/// @throws std::logic_error on the wrong rank
Status serve_simulations(const Ranks& ranks);
/// On rank 0, also after a failure. Without other ranks nothing happens.
Status end_simulations(const Ranks& ranks);

}  // namespace espalier
