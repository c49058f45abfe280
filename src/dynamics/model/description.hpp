/// \file
/// A model as plain data: what the text says, checked in itself, before anything is built. All quantities in one
/// consistent system of units of the author's choice.
#pragma once

#include <array>
#include <complex>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/bodies/point_mass.hpp"
#include "dynamics/bodies/reduction.hpp"
#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/contact/geometry/shape.hpp"
#include "dynamics/contact/geometry/sprocket.hpp"
#include "dynamics/contact/law.hpp"
#include "dynamics/forces/body_load.hpp"
#include "dynamics/forces/joint_friction.hpp"
#include "dynamics/forces/stop.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/integrators/statics/statics.hpp"
#include "dynamics/joints/rolling.hpp"
#include "dynamics/mesh/line_mesh.hpp"
#include "dynamics/meshers/tyre.hpp"
#include "dynamics/model/read/identity.hpp"
#include "dynamics/model/read/section.hpp"
#include "dynamics/substructure/substructure.hpp"
#include "espalier/harmonic.hpp"

namespace espalier::dynamics {
class PointFunction;
class SpaceCurve;
}  // namespace espalier::dynamics

namespace espalier::dynamics::model {

/// A function of quantities of the state, with its place in the text.
struct Formula {
  Place place;
  Expression expression;
};

// Bodies -------------------------------------------------------------------------------------------------------------

struct RigidSpec {
  RigidBodyData data;       ///< gravity is filled in by the builder
  std::optional<Vec3> box;  ///< edge lengths of the box that stands for it in pictures; none: from its inertia
};

struct PointSpec {
  PointMassData data;  ///< gravity is filled in by the builder
};

/// A mesh from a file.
struct MeshFile {
  std::string path;
  double scale = 1;               ///< factor on all coordinates
  std::vector<std::string> take;  ///< what else of the deck, see decks/take.hpp; empty: nothing
  int step = 0;                   ///< of the deck; 0: the first
  std::string owner{};            ///< the body that takes the deck, of which this one is a part; empty: itself
};
/// A block with given divisions.
struct BlockMesh {
  BlockShape shape;
  int divisions[3] = {0, 0, 0};  ///< all 0: by the wished number of unknowns
};
/// A gear with given divisions.
struct GearMesh {
  GearShape shape;
  int divisions[3] = {0, 0, 0};  ///< along the flank, across the tooth, along the width; all 0: by unknowns
};
/// A tyre with given divisions.
struct TyreMesh {
  TyreShape shape;
  int divisions[3] = {0, 0, 0};  ///< around, across, through the thickness; all 0: by unknowns
};
/// A mesh from one of our meshers.
struct MesherSpec {
  std::variant<BlockMesh, RodShape, LinkShape, CrankShape, GuideShape, RotorShape, GearMesh, TyreMesh> shape;
  MeshSize size;
};

/// When elements of a solid fail: where one of the limits is passed at a point of integration. 0: there is none.
struct ErosionSpec {
  Place place;
  double strain = 0;            ///< largest principal strain, logarithmic
  double stress = 0;            ///< von Mises, of Cauchy's stress, as the next
  double principal_stress = 0;  ///< the largest
};

struct SolidSpec {
  std::variant<MeshFile, MesherSpec> mesh;
  std::string element_set;           ///< empty: all elements
  std::optional<Material> material;  ///< none: what the mesh file states
  SolidOptions options;
  std::vector<std::pair<std::string, Material>> set_materials{};  ///< of element sets; what is in none has `material`
  std::optional<ErosionSpec> erosion{};                           ///< none: elements hold whatever they bear
};
/// What stresses in a section need beside its stiffness.
struct SectionOutline {
  double young = 0;
  double radius = 0;             ///< of a circle; 0: a rectangle
  double height = 0, width = 0;  ///< along y and z
};
/// Beams or bars of a mesh file. The builder makes chains of them, which it joins where nodes of the file are one.
struct LineFile {
  MeshFile file;
  std::string element_set;             ///< empty: all lines
  std::optional<Material> material;    ///< none: that of the file
  bool section_given = false;          ///< by the text, for all elements; else that of the file
  bool y_given = false;                ///< likewise the direction of the sections' y axes
  std::shared_ptr<const Mesh> mesh{};  ///< set by the builder: line2, nodes and elements in the order of the body's
  std::vector<LineChain> chains{};
  std::vector<std::array<Index, 2>> joined{};  ///< nodes of chains that are one node of the file
};
struct CableSpec {
  Vec3 start, end;
  Index elements = 10;
  CableSection section;
  std::optional<SectionOutline> outline{};  ///< none: the section is given by its constants
  std::optional<LineFile> file{};           ///< instead of start, end and elements
  std::vector<CableSection> sections{};     ///< of the chains of the file
};
struct BeamSpec {
  std::shared_ptr<const AxisShape> axis;  ///< null: of a file
  Vec3 y;
  Index elements = 10;
  BeamSection section;
  std::optional<SectionOutline> outline{};  ///< none: the section is given by its constants
  struct ChainSection {
    BeamSection section;
    std::optional<SectionOutline> outline;
  };
  std::optional<LineFile> file{};        ///< instead of axis and elements
  std::vector<ChainSection> sections{};  ///< of the chains of the file
};
/// A plate of nx x ny shells: origin + s x + t y, s and t in [0, 1]; flat, or with x bent to an arc of the same length
/// that leaves the origin along x and turns towards the normal, x cross y.
struct ShellSpec {
  Vec3 origin, x, y;
  double curvature = 0;  ///< of the arc, 1 / radius
  Index nx = 1, ny = 1;
  Material material;
  double thickness = 0;  ///< of a mesh, or where it varies, the mean
  /// At the corners (0, 0), (1, 0), (1, 1), (0, 1) of the grid, bilinear between them; empty: even.
  std::vector<double> corners{};
  double offset = 0;               ///< from the nodes to the middle of the thickness, along the normal; of the mean
  std::optional<MeshFile> file{};  ///< instead of the grid: surface elements of a mesh file
  std::string element_set{};       ///< of the file; empty: all
  bool material_of_file = false;   ///< the text gives none
  bool offset_given = false;       ///< else that of the file
  /// Set by the builder: quad4, labels and node sets; of grids x0, x1, y0, y1, all.
  std::shared_ptr<const Mesh> mesh{};
};

/// Matrices from files instead of elements.
struct SubstructureSpec {
  struct Matrix {
    Place place;
    std::string path, name;  ///< name: empty where the file has one matrix
  };
  Matrix mass, stiffness;
  std::string nodes_path;                          ///< a file of GRID cards; empty: `nodes` are given
  std::vector<SubstructureNode> nodes;             ///< in the order of the rows, where matrices have no labels
  std::vector<std::array<std::int64_t, 2>> lines;  ///< between nodes, by label, for pictures
  /// Number of a node by its label.
  [[nodiscard]] std::optional<Index> find(std::int64_t label) const {
    for (std::size_t k = 0; k < nodes.size(); ++k)
      if (nodes[k].label == label) return static_cast<Index>(k);
    return std::nullopt;
  }
};

struct BodySpec {
  Place place;
  std::string name;
  std::variant<RigidSpec, SolidSpec, CableSpec, BeamSpec, ShellSpec, PointSpec, SubstructureSpec> shape;
  std::optional<Vec3> gravity;                                  ///< instead of the model's
  bool massless = false;                                        ///< no density is given: that of the parts is 1
  bool velocity_given = false, angular_velocity_given = false;  ///< whether they stand in the text
  [[nodiscard]] bool any_velocity_given() const { return velocity_given || angular_velocity_given; }
  // Flexible bodies; a rigid body keeps its own in RigidBodyData.
  Mat3 rotation = Mat3::Identity();
  Vec3 position = Vec3::Zero(), velocity = Vec3::Zero(), angular_velocity = Vec3::Zero();
  RayleighDamping damping;
  double modal_damping = 0;  ///< ratio of critical damping in the modes of the supported model
  /// Structural damping: stiffness times (1 + i loss_factor). Motions take the viscous damping that is the same at
  /// loss_frequency (cycles per unit of time; 0: none given).
  double loss_factor = 0, loss_frequency = 0;
  std::optional<ReductionOptions> reduction;  ///< of flexible bodies; none: all nodes move
  [[nodiscard]] bool rigid() const { return std::holds_alternative<RigidSpec>(shape); }
  /// Null: no element fails.
  [[nodiscard]] const ErosionSpec* erosion() const {
    const auto* solid = std::get_if<SolidSpec>(&shape);
    return solid != nullptr && solid->erosion ? &*solid->erosion : nullptr;
  }
};

// Frames -------------------------------------------------------------------------------------------------------------

/// How a frame holds the nodes of a face: all of them as one rigid piece, or their mean position and rotation alone, so
/// that the face may still bend and warp. Automatic: rigid in fixed joints, else the mean.
enum class Attach { automatic, mean, rigid };

/// A place on a body (or the ground) with axes: what joints and forces hold on to.
struct MarkerSpec {
  Place place;
  std::string name;           ///< empty: written in line
  std::string reference;      ///< name of another marker that this one stands for; the rest is then unused
  std::string body;           ///< "ground": none
  Vec3 point = Vec3::Zero();  ///< rigid: from the centre of mass, body axes; ground: global; face: to be its mean
  bool point_given = false;
  bool global = false;           ///< point and axes are given in global axes at the initial state
  Mat3 axes = Mat3::Identity();  ///< columns: axes of the frame in body axes (flexible: those of the mesh)
  bool axis_given = false;       ///< `axis` or `rotation` stands in the text
  // Where on a flexible body; exactly one of them.
  std::optional<std::int64_t>
      node;  ///< label in the mesh or substructure; of cables, beams and shells: counted from 1, -1 the last
  std::optional<Vec3> near;          ///< the nearest node (in mesh coordinates), or, with a face set, see radius
  std::string face;                  ///< face set: averaged
  std::string nodes;                 ///< node set: averaged position, and axes where `attach` is given
  std::vector<std::int64_t> labels;  ///< the same by the labels of the nodes
  std::vector<double> weights;       ///< of each label, in the mean; empty: all alike
  std::vector<std::string> edge;     ///< what faces of a solid have in common; edges of a shell
  std::vector<double> along;         ///< of a beam or cable: the node at this share of its length, or those between two
  double radius = 0;                 ///< > 0: only the faces of the set within this distance of `near`
  /// Outer faces of the mesh that lie on a cylinder: for meshes without face sets.
  struct Bore {
    Vec3 point, axis;  ///< mesh coordinates; the frame's origin is `point` unless another one is given
    double radius = 0;
    double length = 0;  ///< > 0: only faces within half of it from `point` along the axis
  };
  std::optional<Bore> bore;
  Attach attach = Attach::automatic;  ///< of faces and bores
  [[nodiscard]] bool by_nodes() const { return !nodes.empty() || !labels.empty(); }
  int most_nodes = 0;  ///< faces are thinned out evenly until about this many nodes are left; 0: never
};

// Joints and forces --------------------------------------------------------------------------------------------------

enum class JointType {
  fixed,
  revolute,
  spherical,
  universal,
  cylindrical,
  prismatic,
  planar,
  point_on_line,
  distance,
  revolute_spherical,
  rotation_motor,
  translation_motor,
  prescribed,
  gear,
  rack_and_pinion,
  coupled_slides,
  rolling,
  skate,
  // What these read and make: a row each in joint_kinds/kinds.cpp.
  screw,
  constant_velocity,
  parallel_axes,
  in_plane,
  in_line,
  point_on_curve,
  point_on_surface,
  gear_pair,
  rack_pair,
  worm,
  cable
};
[[nodiscard]] const std::vector<std::string>& joint_type_names();

/// Friction of a joint, see forces/joint_friction.hpp.
struct FrictionSpec {
  Place place;
  FrictionCurve curve;
  FrictionLoad load;
  double radius = 1;  ///< of the pin; 1 where nothing turns
  double viscous = 0, angular_viscous = 0;
};

struct JointSpec {
  Place place;
  std::string name;
  bool active = true;                       ///< at the start
  std::optional<StopLaw> stop, angle_stop;  ///< of displacement along and angle about z
  std::optional<FrictionSpec> friction;
  double armature = 0;  ///< inertia of a rotor that turns or slides with the joint's coordinate; 0: none
  JointType type = JointType::fixed;
  std::vector<MarkerSpec> frames;                ///< two, or four of gear and rack-and-pinion, or those of a cable
  double parameter = 0;                          ///< length, ratio, radius or lead
  double radius = 0;                             ///< of a worm's wheel
  std::array<double, 2> teeth{};                 ///< of a gear pair
  int inner = -1;                                ///< which of its wheels, 0 or 1, has inner teeth; -1: none
  double pressure_angle = 0;                     ///< of the teeth of a gear pair or a rack pair
  std::shared_ptr<const SpaceCurve> curve;       ///< of point-on-curve
  std::shared_ptr<const PointFunction> surface;  ///< of point-on-surface
  RollingShape rolling;                          ///< of rolling and skate
  bool measured = false;                         ///< the length is the initial distance
  int axis = 0;                                  ///< of prescribed
  std::optional<Expression> function;            ///< of motors
  bool relative = false;                         ///< the function is added to the initial value
  bool pull = false;                             ///< frames that do not fit at the start are brought together
  Attach attach = Attach::automatic;             ///< of its frames that do not say it themselves
};

enum class ForceType {
  spring,
  axial_spring,
  rotational_spring,
  bushing,
  load,
  pressure,
  guide,
  torque_motor,
  force_motor,
  cable,
  line_load
};
[[nodiscard]] const std::vector<std::string>& force_type_names();

/// A path in the x-y plane of a frame: straight pieces and arcs, one after the other (see forces/guide.hpp).
struct GuideSegment {
  double length = 0;
  double curvature = 0;  ///< to the left is positive; 0: straight
};

struct ForceSpec {
  Place place;
  std::string name;
  bool active = true;  ///< at the start
  ForceType type = ForceType::spring;
  std::vector<MarkerSpec> frames;  ///< two; one of a load; those of a cable
  // Springs; guide: stiffness and damping of the contact
  double stiffness = 0, damping = 0, rest = 0, preload = 0;
  bool measured = false;           ///< rest is the initial value
  std::optional<Formula> formula;  ///< actuator of springs, factor of loads, torque or force of motors, pressure
  std::array<std::optional<Formula>, 6> components;  ///< of force and moment of a load, instead of linear and angular
  // Bushing: stiffness and damping; load: force and moment
  Vec3 linear = Vec3::Zero(), linear_damping = Vec3::Zero(), angular = Vec3::Zero(), angular_damping = Vec3::Zero();
  bool follower = false;
  std::string body, face;  ///< face: of pressure
  // Load on the material of a body
  std::optional<BodyLoadLaw> material;
  std::string element_set;  ///< empty: all
  MarkerSpec where;         ///< of a load per length: the line; linear and angular are force and moment per length
  // Guide
  std::vector<GuideSegment> segments;
  Vec3 start = Vec3::Zero();
  double direction = 0, friction = 0, slip_speed = 0, smoothing = 0;
  bool both_sides = false;
};

/// Nodes of a flexible body that are held or moved one by one.
struct SupportSpec {
  Place place;
  std::string name;
  MarkerSpec where;                                 ///< its axes are the directions
  std::array<bool, 3> held{};                       ///< along them, at rest or with `motion`
  std::array<std::optional<Expression>, 3> motion;  ///< displacements from the start, functions of time
  bool slopes = false;                              ///< directors of shells and slopes of cables are held, too
  bool symmetry = false;                            ///< about the plane across the first direction: slopes stay in it
  std::array<bool, 3> rotations{};                  ///< of nodes of shells and beams, about the directions
};

/// A linear equation between displacements of nodes of solids from the start: exact, or held by a spring and a dashpot.
struct EquationSpec {
  struct Term {
    MarkerSpec where;  ///< one node
    int direction = 0;
    double factor = 1;
  };
  Place place;
  std::string name;
  std::vector<Term> terms;
  double value = 0;
  bool elastic = false;
  double stiffness = 0, damping = 0;
};
/// Nodes of a solid, shell or cable that stay where they are on faces of a solid, on a shell, a beam or a cable.
struct TieSpec {
  Place place, to_place;
  std::string name;
  MarkerSpec where;
  std::string to_body, to_face;  ///< to_face: of solids alone
  double tolerance = 0;          ///< nodes farther away are left free; 0: a twentieth of the face's extent
};

// Contact ------------------------------------------------------------------------------------------------------------

/// A triangle mesh from a file; see contact/triangles.hpp.
struct SurfaceFile {
  std::string path;
  Vec3 scale = Vec3::Ones();  ///< factors on the coordinates
};
/// Faces of a solid body, or sides of a shell.
struct SolidFaces {
  std::string set;    ///< of faces; empty: all outer faces. Of a shell: "top", "bottom", or both where empty
  int divisions = 1;  ///< of each face in each direction, for integration against rigid shapes
};
/// The axis of a cable or beam with what is around it.
struct LineSurface {
  double radius = 0;
  int divisions = 1;  ///< of each element, for integration
};

/// What may touch other surfaces: a shape on a rigid body or the ground, faces of a solid or shell, or a line.
struct SurfaceSpec {
  Place place;
  std::string name, body;
  std::variant<contact::Shape, SurfaceFile, SolidFaces, contact::SprocketShape, LineSurface> shape;
  Vec3 point = Vec3::Zero();     ///< of the shape's origin, from the centre of mass, in body axes (ground: global)
  Mat3 axes = Mat3::Identity();  ///< columns: axes of the shape in body axes
};

struct ContactSpec {
  Place place;
  std::string name;
  bool active = true;                 ///< at the start
  std::vector<std::string> surfaces;  ///< names, with * for any letters
  std::vector<std::string> against;   ///< empty: each of `surfaces` may touch each other one
  bool self = false;                  ///< faces among `surfaces` touch themselves, too
  contact::ContactLaw law;
  double margin = 0;              ///< of the search for near pairs; 0: chosen
  std::optional<double> overlap;  ///< allowed at the start
  double penetration = 0;         ///< of solids: augmented Lagrangian to at most so much; 0: penalty alone
};

// Sensors and events -------------------------------------------------------------------------------------------------

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

// The run ------------------------------------------------------------------------------------------------------------

enum class Method { bdf, generalized_alpha };

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
