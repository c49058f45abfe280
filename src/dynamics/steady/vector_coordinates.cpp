#include "dynamics/steady/vector_coordinates.hpp"

#include <Eigen/Core>

#include "base/at.hpp"
#include "dense/dense.hpp"
#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/bodies/point_mass.hpp"
#include "dynamics/bodies/reduced_body.hpp"
#include "dynamics/bodies/rigid_body.hpp"

namespace espalier::dynamics {

Mat3 VectorCoordinates::axes(ConstSpan configuration) const {
  if (kind != Kind::turn) return Mat3::Identity();
  return rotation_matrix(Quat(Eigen::Map<const Quat>(&configuration[at(q)])));
}

Vec3 VectorCoordinates::value(ConstSpan configuration) const { return Eigen::Map<const Vec3>(&configuration[at(q)]); }

std::vector<VectorCoordinates> vector_coordinates(const AssembledSystem& system) {
  using Kind = VectorCoordinates::Kind;
  std::vector<VectorCoordinates> all;
  for (const auto& component : system.components()) {
    const Placement& at = component->placement();
    if (const auto* flexible = dynamic_cast<const FlexibleBody*>(component.get())) {
      for (Index k = 0; k < flexible->vertices(); ++k)
        all.push_back({k % flexible->vertices_per_node() == 0 ? Kind::place : Kind::direction, flexible->coordinate(k),
                       flexible->configuration(k), flexible});
    } else if (dynamic_cast<const PointMass*>(component.get()) != nullptr) {
      all.push_back({Kind::place, at.v, at.q, component.get()});
    } else if (dynamic_cast<const RigidBody*>(component.get()) != nullptr ||
               dynamic_cast<const ReducedBody*>(component.get()) != nullptr) {
      all.push_back({Kind::place, at.v, at.q, component.get()});
      all.push_back({Kind::turn, at.v + 3, at.q + 3, component.get()});
    }
  }
  return all;
}

// Least squares of x' - x_c' = w x (x - x_c) over nodes and of x' = w x x over directions.
Vec3 angular_velocity(std::span<const VectorCoordinates> all, ConstSpan q, ConstSpan v) {
  using Kind = VectorCoordinates::Kind;
  const auto rate = [&](const VectorCoordinates& x) { return Vec3(Eigen::Map<const Vec3>(&v[at(x.v)])); };
  Vec3 centre = Vec3::Zero(), mean = Vec3::Zero();
  double places = 0;
  for (const VectorCoordinates& x : all) {
    if (x.kind == Kind::turn) return x.axes(q) * rate(x);
    if (x.kind != Kind::place) continue;
    centre += x.value(q);
    mean += rate(x);
    ++places;
  }
  if (places > 0) centre /= places, mean /= places;
  Mat3 square = Mat3::Zero();
  Vec3 moment = Vec3::Zero();
  for (const VectorCoordinates& x : all) {
    const bool place = x.kind == Kind::place;
    const Vec3 arm = place ? Vec3(x.value(q) - centre) : x.value(q), change = place ? Vec3(rate(x) - mean) : rate(x);
    square += arm.squaredNorm() * Mat3::Identity() - arm * arm.transpose();
    moment += arm.cross(change);
  }
  if (!(square.norm() > 0)) return Vec3::Zero();
  return dense::least_squares(Eigen::MatrixXd(square), Eigen::MatrixXd(moment));
}

}  // namespace espalier::dynamics
