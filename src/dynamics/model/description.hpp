/// \file
/// A model as plain data: what the text says, checked in itself, before anything is built. All quantities in one
/// consistent system of units of the author's choice.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/model/body_spec.hpp"
#include "dynamics/model/contact_spec.hpp"
#include "dynamics/model/joint_spec.hpp"
#include "dynamics/model/read/identity.hpp"
#include "dynamics/model/run_spec.hpp"

namespace espalier::dynamics::model {

/// The whole model.
struct Description {
  std::string file;    ///< name of the text
  std::string folder;  ///< where mesh files are looked for
  std::string title;
  std::string units;  ///< "SI", "mm-t-s", ..., see units/unit_system.hpp; empty: the text does not say
  std::string text;   ///< that this was read from, for pages; empty: it is not shown
  Vec3 gravity = Vec3::Zero();
  std::vector<BodySpec> bodies;
  std::map<std::string, MarkerSpec> markers;
  std::vector<JointSpec> joints;
  std::vector<ForceSpec> forces;
  std::vector<SupportSpec> supports;
  std::vector<EquationSpec> equations;
  std::vector<TieSpec> ties;
  std::vector<SurfaceSpec> surfaces;
  std::vector<ContactSpec> contacts;
  std::map<std::string, CurvePtr> splines;
  std::vector<std::pair<std::string, double>> inputs;  ///< with their values at the start
  std::vector<std::pair<std::string, Formula>> sensors;
  std::vector<EventSpec> events;
  std::vector<ControllerSpec> controllers;
  bool moves = true;                   ///< false: there is neither [integrator] nor [statics]
  IntegratorSpec integrator;           ///< unused where `statics` is set
  std::optional<StaticsSpec> statics;  ///< instead of a motion
  InitialSpec initial;
  std::optional<HarmonicSpec> harmonic;  ///< alone, without an integrator and statics, it is a run of its own
  OutputSpec output;
  std::vector<std::pair<std::string, std::string>> solver;  ///< options by name, see solver/options/option_text.hpp
  ModelKeys keys;                                           ///< of the text that this was read from
  [[nodiscard]] bool linear() const { return statics && statics->options.path == StaticPath::linear; }
};

/// Gives bodies the velocities of [initial] rotation.
void set_rotation(Description& model);
/// Reads an expanded text (see expand()). @throws Error(invalid_input) "file:line: path: what to do"
[[nodiscard]] Description read_description(const Value& root, const std::string& file);

/// A frame of a joint or force: a name (frames/names.hpp) or a table.
[[nodiscard]] MarkerSpec read_marker(const Value& value, const std::string& name);
void read_bodies(Section& root, Description& model);
[[nodiscard]] ErosionSpec read_erosion(Section s);
/// What bodies whose elements fail do not go with. @throws Error(invalid_input) with the place
void check_erosion(const Description& model);
void read_joints(Section& root, Description& model);
void read_forces(Section& root, Description& model);
void read_supports(Section& root, Description& model);
/// [equations] and [ties].
void read_equations(Section& root, Description& model);
/// Whether the text asks for linear statics, which needs no densities; without a word to what is wrong in it.
[[nodiscard]] bool asks_for_linear_statics(const Value& root);
/// The keys of a marker that say where on a body it is.
void read_where(Section& s, MarkerSpec& out);
/// [surfaces] and [contacts].
void read_surfaces(Section& root, Description& model);
/// The keys limits, angle_limits and friction of a joint.
void read_joint_contacts(Section& joint, JointSpec& out);
/// [splines]: from CSV files (looked for in model.folder) or points.
void read_splines(Section& root, Description& model);
/// [inputs], [sensors] and [events].
void read_events(Section& root, Description& model);
/// [controllers].
void read_controllers(Section& root, Description& model);
/// [harmonic], when forces, joints and inputs are known.
[[nodiscard]] HarmonicSpec read_harmonic(Section s, const Description& model);
/// Gives every expression the splines that it names. @throws Error(invalid_input) for functions that nobody knows
void bind_curves(Description& model);

}  // namespace espalier::dynamics::model
