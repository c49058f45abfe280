/// \file
/// A robot as URDF and MJCF describe it: a tree of links with joints between them. What the two formats have in common,
/// and all that becomes a model of ours. Units: metre, kilogram, second, radian.
#pragma once

#include <array>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/named.hpp"
#include "dynamics/model/robots/pose.hpp"

namespace espalier::dynamics::model::robots {

enum class JointKind { hinge, slide, ball, free };

/// A relation q = factor * (q of `of`) + offset.
struct Mimic {
  std::string of;
  double factor = 1, offset = 0;
};

struct RobotJoint {
  std::string name;
  JointKind kind = JointKind::hinge;
  Vec3 axis = Vec3::UnitZ();    ///< in the axes of its link, of length one
  Vec3 point = Vec3::Zero();    ///< in the axes of its link
  double ref = 0;               ///< the coordinate where the link is at Link::pose
  double start = 0, speed = 0;  ///< coordinate and rate at the start
  double stiffness = 0, rest = 0, damping = 0, friction = 0, armature = 0;
  std::array<double, 2> spring_damper{};  ///< time constant and damping ratio, > 0: they set stiffness and damping
  std::optional<double> lower, upper;
  double least_force = -std::numeric_limits<double>::infinity(), largest_force = -least_force;  ///< of actuators
  bool carries_weight = false;  ///< its actuators are what compensates the weight (gravcomp)
  std::optional<Mimic> mimic;
  // ball: rotation of the link from Link::pose and angular velocity in its own axes; free: place and velocity in those
  // of the world. None: Link::pose
  std::optional<Pose> start_pose;
  Vec3 start_velocity = Vec3::Zero(), start_spin = Vec3::Zero();
};

enum class GeomKind { plane, sphere, capsule, cylinder, box, ellipsoid, mesh };
/// By the words of MJCF, which are those of our surfaces, too; these have no ellipsoids.
inline constexpr base::Named<GeomKind> kGeomKinds[] = {
    {"plane", GeomKind::plane},       {"sphere", GeomKind::sphere}, {"capsule", GeomKind::capsule},
    {"cylinder", GeomKind::cylinder}, {"box", GeomKind::box},       {"ellipsoid", GeomKind::ellipsoid},
    {"mesh", GeomKind::mesh}};

struct Geom {
  std::string name;
  GeomKind kind = GeomKind::sphere;
  Pose pose;                        ///< in the axes of its link
  Vec3 size = Vec3::Zero();         ///< radius; radius and half length; half edges; semi-axes
  std::string file;                 ///< of a mesh
  Vec3 scale = Vec3::Ones();        ///< of a mesh
  unsigned type = 1, affinity = 1;  ///< two geoms touch where a type and an affinity have a bit in common
  double friction = 1;
  int dimensions = 3;  ///< 1: without friction
};

struct Mass {
  double mass = 0;
  Vec3 centre = Vec3::Zero();   ///< in the axes of the link
  Mat3 inertia = Mat3::Zero();  ///< about the centre, in the axes of the link
};

struct Site {
  std::string name;
  Pose pose;
};

struct Link {
  std::string name, where;         ///< where: "file:line", for messages
  int parent = -1;                 ///< in Robot::links; -1: the ground
  Pose pose;                       ///< in the axes of the parent, with all joints at their `ref`
  std::vector<RobotJoint> joints;  ///< one after the other; none: welded to the parent
  Mass mass;
  double weightless = 0;  ///< part of gravity that it does not feel
  std::vector<Geom> geoms;
  std::vector<Site> sites;
};

/// One term of a length: a joint's coordinate times a factor, or pieces of a line through sites.
struct Tendon {
  std::string name;
  std::vector<std::pair<std::string, double>> joints;  ///< of a fixed tendon
  struct Piece {
    std::string from, to;  ///< sites
    double divisor = 1;    ///< of a pulley
  };
  std::vector<Piece> pieces;  ///< of a spatial tendon
  double stiffness = 0, damping = 0, friction = 0;
  std::optional<std::array<double, 2>> rest;  ///< none: the length with the springs of joints at rest
  std::optional<double> lower, upper;
};

/// force = (gain0 + gain1 length + gain2 rate) u + bias0 + bias1 length + bias2 rate, along gear times a joint's
/// coordinate, a tendon, or a site.
struct Actuator {
  std::string name, joint, tendon, site;
  std::array<double, 6> gear = {1, 0, 0, 0, 0, 0};
  std::array<double, 3> gain = {1, 0, 0};
  std::array<double, 3> bias{};
  double damping_ratio = 0;  ///< > 0: bias2 follows from it and the inertia at the joint
  double start = 0;          ///< u
  double least_control = -std::numeric_limits<double>::infinity(), largest_control = -least_control;
  double least_force = least_control, largest_force = largest_control;
};

enum class EqualityKind { connect, weld, joint };

struct Equality {
  std::string name;
  EqualityKind kind = EqualityKind::connect;
  std::string first, second;  ///< links (empty: ground), or joints
  Pose on_first, on_second;
  Mimic coupling;  ///< of joints: `first` follows `second`; second empty: it rests at the offset
  bool active = true;
};

struct Robot {
  std::string name;
  Vec3 gravity{0, 0, -9.81};
  std::vector<Link> links;  ///< parents before children
  Link ground;              ///< geoms and sites of what does not move
  std::vector<Tendon> tendons;
  std::vector<Actuator> actuators;
  std::vector<Equality> equalities;
  std::vector<std::array<std::string, 2>> excluded;  ///< links that do not touch each other
  bool contacts = true;
  bool touch_parents = false;  ///< links touch those that they are joined to
  /// Elements that <replicate> has copied, "tag name", with what stands behind the names of the copies.
  std::map<std::string, std::vector<std::string>> copied;
  std::map<std::string, int> passed_over;  ///< what is not taken, with how often
  std::vector<std::string> notices;
  void pass_over(const std::string& what, int count = 1) { passed_over[what] += count; }
};

/// What the reader of a robot may be told.
struct RobotOptions {
  std::string keyframe;                     ///< name or number of the one that the model begins with; empty: none
  bool free_base = false;                   ///< URDF: the root is not held
  bool absolute_paths = false;              ///< of meshes, for a text that goes to another folder
  bool geometry = true;                     ///< false: no shapes are read, and no contacts
  std::map<std::string, double> positions;  ///< of joints at the start
  std::map<std::string, double> velocities;
  std::map<std::string, std::string> packages;  ///< folders of package:// by name
};

}  // namespace espalier::dynamics::model::robots
