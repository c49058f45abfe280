#include "dynamics/model/robots/spring_damper.hpp"

#include <algorithm>

#include "dense/dense.hpp"

namespace espalier::dynamics::model::robots {
namespace {

/// A unit of one rate of a joint: angular velocity, and velocity of what lies at the origin of the ground.
struct Twist {
  int body;
  Vec3 spin, velocity;
};

void add_twists(const RobotTree& tree, int k, std::vector<Twist>& list) {
  const Moving& m = tree.moving[static_cast<std::size_t>(k)];
  const Vec3 at = m.at_ref * m.joint.point;
  const auto turn = [&](const Vec3& axis) { list.push_back({k, axis, at.cross(axis)}); };
  if (m.joint.kind == JointKind::hinge) return turn(m.at_ref.r * m.joint.axis);
  if (m.joint.kind == JointKind::slide) return list.push_back({k, Vec3::Zero(), m.at_ref.r * m.joint.axis});
  if (m.joint.kind == JointKind::free)
    for (int i = 0; i < 3; ++i) list.push_back({k, Vec3::Zero(), Vec3::Unit(i)});
  for (int i = 0; i < 3; ++i) turn(m.at_ref.r.col(i));
}

/// The mass matrix by composite bodies (R. Featherstone, Rigid Body Dynamics Algorithms, 2008, section 6.2).
Eigen::MatrixXd mass_matrix(const RobotTree& tree, const std::vector<Twist>& twists) {
  const auto n = static_cast<Eigen::Index>(twists.size());
  Eigen::MatrixXd mass = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Twist& one = twists[static_cast<std::size_t>(i)];
    const Moving& m = tree.moving[static_cast<std::size_t>(one.body)];
    const Vec3 impulse = m.composite.mass * (one.velocity + one.spin.cross(m.composite.centre));
    const Vec3 moment = m.composite.inertia * one.spin + m.composite.centre.cross(impulse);
    for (int above = one.body; above >= 0; above = tree.moving[static_cast<std::size_t>(above)].parent)
      for (Eigen::Index j = 0; j <= i; ++j)
        if (const Twist& other = twists[static_cast<std::size_t>(j)]; other.body == above)
          mass(i, j) = mass(j, i) = other.velocity.dot(impulse) + other.spin.dot(moment);
    if (m.joint.kind != JointKind::free) mass(i, i) += m.joint.armature;  // a free body has it already
  }
  return mass;
}

}  // namespace

void set_spring_dampers(RobotTree& tree) {
  const auto wanted = [](const Moving& m) { return m.joint.spring_damper[0] > 0 && m.joint.spring_damper[1] > 0; };
  if (std::none_of(tree.moving.begin(), tree.moving.end(), wanted)) return;
  std::vector<Twist> twists;
  for (std::size_t k = 0; k < tree.moving.size(); ++k) add_twists(tree, static_cast<int>(k), twists);
  const dense::Spectrum spectrum = dense::symmetric_eigen(mass_matrix(tree, twists));
  for (std::size_t k = 0; k < tree.moving.size(); ++k) {
    RobotJoint& joint = tree.moving[k].joint;
    if (!wanted(tree.moving[k])) continue;
    double count = 0, mobility = 0;
    for (std::size_t i = 0; i < twists.size(); ++i) {
      if (twists[i].body != static_cast<int>(k)) continue;
      ++count;
      mobility +=
          (spectrum.vectors.row(static_cast<Eigen::Index>(i)).array().square() / spectrum.values.transpose().array())
              .sum();
    }
    const double inertia = count / mobility, time = joint.spring_damper[0], ratio = joint.spring_damper[1];
    joint.stiffness = inertia / (time * time * ratio * ratio);
    joint.damping = 2 * inertia / time;
  }
}

}  // namespace espalier::dynamics::model::robots
