/// \file
/// The tree of what moves: links without joints belong to what they are welded to, and each joint has its own body.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "dynamics/model/robots/robot.hpp"

namespace espalier::dynamics::model::robots {

/// A body of the model, with the joint that leads to it.
struct Moving {
  std::string name, where;
  int parent = -1;  ///< in RobotTree::moving; -1: the ground
  Pose pose;        ///< in the axes of the parent, with the joint at its `ref`
  RobotJoint joint;
  Mass mass;
  bool carrier = false;  ///< has no mass of its own: between two joints of one link, or a link without mass
  double weightless = 0;
  /// What links that are welded to it feel less of gravity than it does: mass times that part, and their centre.
  std::vector<std::pair<double, Vec3>> lifts;
  std::vector<Geom> geoms;
  std::vector<Site> places;  ///< sites, and links that are welded to it
  std::vector<std::string> links;
  // With all joints at `ref`, in global axes
  Pose at_ref;
  Mass composite;  ///< of all that hangs on it
  Pose at_rest;    ///< with the springs of hinges and slides at rest
  // At the start
  Pose start;
  Vec3 velocity = Vec3::Zero();  ///< of its origin
  Vec3 spin = Vec3::Zero();      ///< angular velocity; both in global axes
  /// Inertia that the joint feels, all others at rest at `ref`.
  [[nodiscard]] double felt() const;
};

struct RobotTree {
  std::vector<Moving> moving;  ///< parents before children
  Moving ground;
  /// Where a link of the robot is: number of a moving body (-1: ground) and place in its axes.
  struct Home {
    int body = -1;
    Pose pose;
  };
  std::map<std::string, Home> homes;  ///< of links
  std::map<std::string, Home> sites;  ///< of sites with names
  std::map<std::string, int> joints;  ///< body of a hinge or slide by its name
  double mass = 0;                    ///< of all
};

/// @throws Error(invalid_input) for links that move without mass, inertias that are not positive, and positions or
/// couplings of joints that nobody knows
[[nodiscard]] RobotTree make_tree(Robot& robot, const RobotOptions& options);

}  // namespace espalier::dynamics::model::robots
