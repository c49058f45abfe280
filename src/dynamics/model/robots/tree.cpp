#include "dynamics/model/robots/tree.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "dense/dense.hpp"
#include "dynamics/model/read/value.hpp"
#include "dynamics/model/robots/geom_mass.hpp"
#include "dynamics/model/robots/spring_damper.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics::model::robots {
namespace {

class TreeMaker {
 public:
  TreeMaker(Robot& robot, const RobotOptions& options) : robot_(robot), options_(options) {}

  RobotTree run() {
    add_places(robot_.ground, -1, {});
    for (Link& link : robot_.links) add(link);
    find_joints();
    set_positions();
    follow_couplings();
    add_up();
    check_masses();
    set_spring_dampers(tree_);
    place();
    return std::move(tree_);
  }

 private:
  Moving& body(int k) { return k < 0 ? tree_.ground : tree_.moving[static_cast<std::size_t>(k)]; }

  void add_places(const Link& link, int at, const Pose& pose) {
    for (Geom g : link.geoms) {
      g.pose = pose * g.pose;
      body(at).geoms.push_back(std::move(g));
    }
    for (const Site& s : link.sites) {
      if (s.name.empty()) continue;
      tree_.sites[s.name] = {at, pose * s.pose};
      body(at).places.push_back({s.name, pose * s.pose});
    }
  }

  void add(Link& link) {
    const RobotTree::Home above =
        link.parent < 0 ? RobotTree::Home{} : tree_.homes.at(robot_.links[static_cast<std::size_t>(link.parent)].name);
    RobotTree::Home here{above.body, above.pose * link.pose};
    if (link.joints.empty()) {
      if (here.body >= 0) {
        Moving& m = body(here.body);
        if (link.mass.mass > 0 && link.weightless != m.weightless)
          m.lifts.emplace_back(link.mass.mass * (link.weightless - m.weightless), here.pose * link.mass.centre);
        m.mass = sum_of({m.mass, moved(link.mass, here.pose)});
        m.carrier = m.carrier && !(link.mass.mass > 0);
      }
      body(here.body).places.push_back({link.name, here.pose});
      body(here.body).links.push_back(link.name);
    } else {
      for (std::size_t k = 0; k < link.joints.size(); ++k) {
        const bool last = k + 1 == link.joints.size();
        Moving m;
        m.name = last ? link.name : link.name + "_" + link.joints[k].name;
        m.where = link.where;
        m.parent = here.body;
        m.pose = here.pose;
        m.joint = link.joints[k];
        m.carrier = !last || !(link.mass.mass > 0);
        m.weightless = link.weightless;
        if (last) m.mass = link.mass, m.links = {link.name};
        if (m.joint.kind == JointKind::free) add_armature(m);
        here = {static_cast<int>(tree_.moving.size()), {}};
        tree_.moving.push_back(std::move(m));
      }
    }
    tree_.homes[link.name] = here;
    add_places(link, here.body, here.pose);
  }

  /// The armature of a free body: a ball at its origin that nothing pulls down, whose mass and moment of inertia it is.
  static void add_armature(Moving& m) {
    const double a = m.joint.armature;
    if (!(a > 0)) return;
    m.mass = sum_of({m.mass, {a, Vec3::Zero(), a * Mat3::Identity()}});
    m.lifts.emplace_back(a * (1 - m.weightless), Vec3::Zero());
    m.carrier = false;
  }

  void find_joints() {
    for (std::size_t k = 0; k < tree_.moving.size(); ++k)
      if (const RobotJoint& j = tree_.moving[k].joint; j.kind == JointKind::hinge || j.kind == JointKind::slide)
        tree_.joints[j.name] = static_cast<int>(k);
  }

  void set_positions() {
    std::vector<std::string> known;
    for (const auto& [name, at] : tree_.joints) known.push_back(name);
    const auto set = [&](const std::map<std::string, double>& given, const char* what, double RobotJoint::*field) {
      for (const auto& [name, value] : given) {
        const auto it = tree_.joints.find(name);
        if (it == tree_.joints.end())
          throw Error(StatusCode::invalid_input,
                      std::string(what) + ": there is no hinge or slide '" + name + "'" + suggestion(name, known));
        body(it->second).joint.*field = value;
      }
    };
    set(options_.positions, "positions", &RobotJoint::start);
    set(options_.velocities, "velocities", &RobotJoint::speed);
  }

  /// A joint that follows another one begins where that has it.
  void follow(const std::string& name, const Mimic& mimic, std::vector<std::string>& way) {
    const auto it = tree_.joints.find(name);
    if (it == tree_.joints.end()) return;
    RobotJoint& j = body(it->second).joint;
    const std::string where = body(it->second).where + ": joint '" + name + "'";
    if (std::find(way.begin(), way.end(), name) != way.end())
      throw Error(StatusCode::invalid_input, where + " follows itself");
    double of = 0, rate = 0;
    if (!mimic.of.empty()) {
      const auto other = tree_.joints.find(mimic.of);
      if (other == tree_.joints.end())
        throw Error(StatusCode::invalid_input, where + ": there is no joint '" + mimic.of + "' that it could follow");
      way.push_back(name);
      if (const auto next = leaders_.find(mimic.of); next != leaders_.end()) follow(mimic.of, next->second, way);
      way.pop_back();
      of = body(other->second).joint.start;
      rate = body(other->second).joint.speed;
    }
    j.start = mimic.factor * of + mimic.offset;
    j.speed = mimic.factor * rate;
  }

  void follow_couplings() {
    for (const Moving& m : tree_.moving)
      if (m.joint.mimic) leaders_.emplace(m.joint.name, *m.joint.mimic);
    for (const Equality& q : robot_.equalities)
      if (q.kind == EqualityKind::joint && q.active) leaders_.emplace(q.first, q.coupling);
    std::vector<std::string> way;
    for (const auto& [name, mimic] : leaders_) follow(name, mimic, way);
  }

  void add_up() {
    for (Moving& m : tree_.moving) {
      m.at_ref = body(m.parent).at_ref * m.pose;
      m.at_rest = body(m.parent).at_rest * m.pose;
      const RobotJoint& j = m.joint;
      if (j.kind == JointKind::slide) m.at_rest = m.at_rest * Pose{(j.rest - j.ref) * j.axis, Mat3::Identity()};
      if (j.kind == JointKind::hinge) {
        const Mat3 turn = about(j.axis, j.rest - j.ref);
        m.at_rest = m.at_rest * Pose{j.point - turn * j.point, turn};
      }
      m.composite = moved(m.mass, m.at_ref);
    }
    for (std::size_t k = tree_.moving.size(); k-- > 0;) {
      const Moving& m = tree_.moving[k];
      if (m.parent >= 0 && m.joint.kind != JointKind::free)
        body(m.parent).composite = sum_of({body(m.parent).composite, m.composite});
      tree_.mass += m.mass.mass;
    }
  }

  /// What has no mass gets so little that nothing feels it: the equations then hold it by its joints.
  void check_masses() {
    constexpr double kUnfelt = 1e-12;
    int without = 0;
    for (Moving& m : tree_.moving) {
      const std::string who = m.where + ": link '" + m.name + "' ";
      if (!(m.mass.mass > 0)) {
        if (!(m.composite.mass > 0))
          throw Error(StatusCode::invalid_input,
                      who + "moves by the joint '" + m.joint.name +
                          "' and has no mass, nor has anything that hangs on it: give it one, or make the joint fixed");
        const double size = m.composite.inertia.trace();
        if (!m.links.empty()) ++without;
        m.mass.mass = kUnfelt * m.composite.mass;
        m.mass.centre = m.joint.point;
        m.mass.inertia = kUnfelt * (size > 0 ? size : m.composite.mass) * Mat3::Identity();
        m.carrier = true;
        continue;
      }
      const Vec3 principal = dense::principal_values(m.mass.inertia);
      if (!(principal[0] > 1e-15 * principal[2]) || !std::isfinite(principal[2]))
        throw Error(
            StatusCode::invalid_input,
            fmt::format("{}has a mass and an inertia that is not positive (principal moments {:f}, {:f}, {:f}): "
                        "give it that of its shape",
                        who, principal[0], principal[1], principal[2]));
      if (principal[0] + principal[1] < principal[2] * (1 - 1e-6))
        robot_.notices.push_back(who +
                                 "has an inertia that no body has: the largest principal moment exceeds the sum "
                                 "of the others; it is taken as it is");
    }
    if (without > 0)
      robot_.notices.push_back(std::to_string(without) +
                               " links between joints have no mass; they carry what hangs on them");
  }

  void place() {
    for (Moving& m : tree_.moving) {
      const Moving& above = body(m.parent);
      const RobotJoint& j = m.joint;
      m.start = above.start * m.pose;
      m.spin = above.spin;
      m.velocity = above.velocity + above.spin.cross(m.start.p - above.start.p);
      const double moved_by = j.start - j.ref;
      const Vec3 axis = m.start.r * j.axis;
      if (j.kind == JointKind::free) {
        m.start = j.start_pose.value_or(m.start);
        m.velocity = j.start_velocity;
        m.spin = m.start.r * j.start_spin;
      } else if (j.kind == JointKind::slide) {
        m.velocity += m.spin.cross(moved_by * axis) + j.speed * axis;
        m.start.p += moved_by * axis;
      } else {
        const Vec3 anchor = m.start * j.point;
        m.velocity += m.spin.cross(anchor - m.start.p);
        m.start.r = m.start.r * (j.kind == JointKind::ball ? j.start_pose.value_or(Pose{}).r : about(j.axis, moved_by));
        m.start.p = anchor - m.start.r * j.point;
        m.spin += j.kind == JointKind::ball ? Vec3(m.start.r * j.start_spin) : Vec3(j.speed * axis);
        m.velocity += m.spin.cross(m.start.p - anchor);
      }
    }
  }

  Robot& robot_;
  const RobotOptions& options_;
  RobotTree tree_;
  std::map<std::string, Mimic> leaders_;  // what joints follow
};

}  // namespace

double Moving::felt() const {
  if (joint.kind != JointKind::hinge) return composite.mass + joint.armature;
  const Vec3 axis = at_ref.r * joint.axis, arm = composite.centre - at_ref * joint.point;
  return axis.dot(composite.inertia * axis) + composite.mass * axis.cross(arm).squaredNorm() + joint.armature;
}

RobotTree make_tree(Robot& robot, const RobotOptions& options) { return TreeMaker(robot, options).run(); }

}  // namespace espalier::dynamics::model::robots
