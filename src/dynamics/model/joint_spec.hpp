/// \file
/// What holds on to bodies, as plain data: frames, joints, forces, supports, equations and ties.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/forces/body_load.hpp"
#include "dynamics/forces/joint_friction.hpp"
#include "dynamics/forces/stop.hpp"
#include "dynamics/joints/rolling.hpp"
#include "dynamics/model/read/section.hpp"

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

/// How a frame holds the nodes of a face: all of them as one rigid piece, or their mean position and rotation alone, so
/// that the face may still bend and warp. Automatic: rigid in fixed joints, else the mean.
enum class Attach { automatic, mean, rigid };
/// Without `automatic`, which is said by leaving the key out.
inline constexpr base::Named<Attach> kAttachments[] = {{"mean", Attach::mean}, {"rigid", Attach::rigid}};

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

/// What these are called, read and make: a row each in joint_kinds/.
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

/// What these are called, read and make: a row each in force_kinds/.
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

}  // namespace espalier::dynamics::model
