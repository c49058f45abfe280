/// \file
/// One run: from the description to the last file. Reading and building are elsewhere; here is the order of events.
#pragma once

#include <functional>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/interruption.hpp"
#include "dynamics/constraints/redundancy.hpp"
#include "dynamics/integrators/integrator.hpp"
#include "dynamics/model/fields/envelopes.hpp"
#include "dynamics/model/fields/field_path.hpp"
#include "dynamics/model/mechanism.hpp"
#include "dynamics/model/output/energy_balance.hpp"
#include "dynamics/model/output/kept_frames.hpp"
#include "dynamics/model/output/quantities.hpp"
#include "dynamics/model/run/events.hpp"
#include "dynamics/model/run/held_steps.hpp"
#include "dynamics/model/run/newton_solver.hpp"
#include "dynamics/model/run/run_files.hpp"
#include "dynamics/page/live_page.hpp"
#include "dynamics/steady/rotating_system.hpp"
#include "espalier/dynamics.hpp"
#include "espalier/model_harmonic.hpp"

namespace espalier::dynamics::model {

[[nodiscard]] inline SimulationEnergy to_public(const Energy& e) { return {e.kinetic, e.potential}; }

/// Throws espalier::Error for everything expected that goes wrong.
class Runner {
 public:
  /// Builds the mechanism and makes its initial state consistent. `summary` is kept up to date and must outlive it.
  Runner(Description model, SimulationOptions options, SimulationSummary& summary);

  /// To the end, or until the observer stops it.
  void run(const SimulationObserver& observer);
  /// See Simulation.
  void step_to(double t, const SimulationObserver& observer);
  [[nodiscard]] std::string save();
  void restore(std::string_view state);
  /// With their units, where the model states its own.
  [[nodiscard]] std::vector<SimulationQuantity> all_quantities() const;
  /// The series of the chosen quantities, or of a usual set where none was chosen and a page is kept.
  [[nodiscard]] const SimulationSeries& series();
  /// Pictures in memory: of the run, of the present state; made at the first call.
  [[nodiscard]] KeptFrames& kept_frames();
  [[nodiscard]] SimulationFrame frame();
  /// See Simulation.
  [[nodiscard]] std::string page(const Status& status);
  /// The page in the folder of the run, where there is one; what keeps it from being written becomes a notice.
  void write_page(const Status& status, bool running = false) noexcept;
  /// See Simulation.
  void write_trace(const std::string& path) const;
  /// Brings the summary up to date; called by run() too, also when it fails.
  void finish();

  /// Time, or the load factor of a statics run.
  [[nodiscard]] double time() const { return model_.statics ? load_ : current().t; }
  [[nodiscard]] double end_time() const {
    return model_.statics ? model_.statics->options.load : model_.integrator.end;
  }
  [[nodiscard]] double value(const std::string& quantity);
  /// The frequency response about the present state. What was found stands in response(), also where it throws.
  /// @pre the model has a section [harmonic]
  void respond();
  [[nodiscard]] const ModelHarmonicResult& response() const { return response_; }
  /// The chosen quantities at another state of the same mechanism; reactions that redundant constraints leave open are
  /// shared out. In the order of chosen().
  [[nodiscard]] std::vector<double> values_at(State state);
  // For those who look at the system itself.
  [[nodiscard]] const IntegratorSpec& integrator() const { return model_.integrator; }
  [[nodiscard]] Mechanism& mechanism() { return *mechanism_; }
  [[nodiscard]] Equations& equations() { return *equations_; }
  [[nodiscard]] const State& state() const { return current(); }
  [[nodiscard]] const std::vector<Quantity>& chosen() const { return quantities_; }
  /// Inputs that the program may set, and their present values.
  [[nodiscard]] std::vector<std::pair<std::string, double>> inputs() const;
  /// @throws std::invalid_argument for unknown names and numbers that are not finite
  void set_input(const std::string& name, double value);

 private:
  void set_end(double until);
  void prepare();
  void describe_system();
  void find_equilibrium(const ConsistencyOptions& consistency);  ///< at the start of a motion
  void run_statics(const SimulationObserver& observer);
  void run_linear_statics(const SimulationObserver& observer);  ///< runner_linear.cpp
  void end_with_modes(const std::string& why);                  ///< likewise
  void begin_statics_files();
  /// What statics solves: the model's equations, or those of bodies that turn steadily, where [initial] rotation says
  /// so.
  [[nodiscard]] Equations& static_equations();
  void turn_steadily();  ///< velocities and accelerations of that rotation, in an equilibrium
  void note_statics(const StaticsResult& result);
  void set_modal_damping();
  void find_modes();
  void give_response();  ///< respond(), and its files, where the model asks for it
  /// Velocities that stand in the text are meant; those of other bodies follow from the constraints, with a notice.
  void check_velocities(const State& given, const State& consistent);
  void start_integrator();
  /// Runs `body`; where it fails, what can be saved is, and the summary is brought up to date.
  void guarded(const std::function<void()>& body);
  void go();  ///< the beginning of a motion: files, and what happens at once
  void advance(double end, const SimulationObserver& observer);
  void step(double limit);
  void begin_controllers();  ///< with the state at the start
  /// What FMUs are due for. @return false: one of them ends the run
  [[nodiscard]] bool exchange();
  [[nodiscard]] double next_exchange() const;
  void halt();  ///< the caller has interrupted a step: the state before it stands
  void begin_keeping(const Sample& s, const State& initial);
  void keep(const Sample& s);
  void begin_page(const Sample& s, const State& initial);
  void show(const Sample& s);
  void show_shapes();    ///< of modes, on the page
  void show_response();  ///< likewise
  [[nodiscard]] page::RunOfPage run_of_page(bool running) const;
  void expect_motion(const char* call) const;
  // What events do (runner_events.cpp)
  void happen();
  void act_on_events();
  struct Change {
    bool any = false, joints = false, joints_on = false;
  };
  void act(const EventSpec& event, const std::vector<double>& settings, Change& change);
  void begin_joint(const std::string& name);
  void begin_anew(const EventSpec& event, const Change& change);
  void take_up_switches();
  void meet_impacts();                           ///< runner_impacts.cpp
  [[nodiscard]] bool erode();                    ///< elements that fail; likewise. @return whether there were any
  [[nodiscard]] bool reached(double end) const;  ///< that time, or the number of steps asked for
  void choose(const std::string& request, const Place& place);
  void watch_from_here();  ///< energy and steps: at the start, and where the state jumps
  void write_table_of_paths();
  void note_erosion();   ///< runner_impacts.cpp
  void note_elements();  ///< what is known of their weaknesses, once for each body
  void note_steps();     ///< divided ones, those at rounding, unsymmetric matrices, as notices of the summary
  /// The sample of the present state; reactions that redundant constraints leave open are shared out.
  [[nodiscard]] Sample sample(const StepReport& report);
  [[nodiscard]] const State& current() const { return integrator_ ? integrator_->state() : state_; }
  /// Which joints cannot be closed, or motions not be followed, where that is what went wrong.
  [[nodiscard]] std::optional<std::string> explain_positions(const Error& error);
  [[nodiscard]] std::string explain_failure(const Error& error);
  [[nodiscard]] std::string explain_statics(const Error& error);
  [[nodiscard]] std::string loose_bodies(const State& state);

  Description model_;
  SimulationOptions options_;
  base::Interruption interruption_;  // between steps; the solver has one of its own
  SimulationSummary& summary_;
  std::unique_ptr<Mechanism> mechanism_;
  SolverRecord record_;
  std::unique_ptr<PhaseTrace> trace_;
  std::unique_ptr<Equations> equations_;
  std::unique_ptr<RotatingSystem> rotating_;  // of statics, with [initial] rotation
  std::unique_ptr<Equations> rotating_equations_;
  std::unique_ptr<RedundancyGuard> guard_;
  std::unique_ptr<Integrator> integrator_;
  std::unique_ptr<EventWatch> events_;
  std::unique_ptr<EnergyBalance> balance_;  // since the run began to move
  std::set<std::string> compressed_;        // bodies of which that was said
  HeldSteps held_;                          // of adaptive steps
  double duration_ = 0;                     // as the text has it
  bool stopped_ = false;                    // by an event
  double impact_time_ = 0;                  // of the last impact
  long impacts_there_ = 0;                  // hardly apart in time from each other
  std::unique_ptr<RunFiles> files_;
  std::vector<Quantity> quantities_;
  std::unique_ptr<Envelopes> envelopes_;
  std::vector<FieldPath> paths_;
  SimulationSeries series_;
  std::unique_ptr<KeptFrames> frames_;
  std::unique_ptr<page::LivePage> page_;
  std::vector<Quantity> usual_quantities_;  // where nobody has chosen any
  page::Rows usual_rows_;
  SimulationSeries usual_series_;       // what series() returned
  std::vector<char> dropped_at_start_;  // constraint rows, m marks
  bool going_ = false;                  // go() was called, and the files have not been ended
  State state_, shown_;
  State reference_;       // displacements in pictures count from it: a restarted run must find the same
  Options modes_solver_;  // of initial.modes
  std::vector<std::vector<double>> shapes_;  // of these modes
  ModelHarmonicResult response_;
  double load_ = 0;  // load factor of state_ in a statics run
  StepReport last_report_;
};

}  // namespace espalier::dynamics::model
