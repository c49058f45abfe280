// The N-four-bar mechanism (IFToMM A02): N loops of 2N + 1 thin rods of 1 kg and 1 m, upright at rest but for a tip
// speed of 1 m/s along x. Singular every time the links are horizontal: the degrees of freedom jump from 1 to N + 1
// there. Exact reduction: theta'' = k sin theta, k = 3 g (3N + 1) / (2 (4N + 1)), theta(0) = 0, theta'(0) = 1; the tip
// of the first rod stands at (sin theta, cos theta).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/joints/joint.hpp"

namespace espalier::dynamics {

struct FourBar {
  AssembledSystem system;
  RigidBody* first = nullptr;
};

[[nodiscard]] inline std::unique_ptr<FourBar> four_bar(int loops) {
  auto model = std::make_unique<FourBar>();
  std::vector<RigidBody*> up, across;
  RigidBodyData data;
  data.gravity = {0, -9.81, 0};
  for (int i = 0; i <= loops; ++i) {  // thin rods; the moment about the own axis plays no part in the plane
    data.inertia = Vec3(1.0 / 12, 1e-3, 1.0 / 12).asDiagonal();
    data.position = Vec3(i, 0.5, 0);
    data.velocity = Vec3(0.5, 0, 0);
    data.angular_velocity = Vec3(0, 0, -1);
    up.push_back(&model->system.add(std::make_unique<RigidBody>("up " + std::to_string(i), data)));
    if (i == loops) break;
    data.inertia = Vec3(1e-3, 1.0 / 12, 1.0 / 12).asDiagonal();
    data.position = Vec3(i + 0.5, 1, 0);
    data.velocity = Vec3(1, 0, 0);
    data.angular_velocity.setZero();
    across.push_back(&model->system.add(std::make_unique<RigidBody>("across " + std::to_string(i), data)));
  }
  for (int i = 0; i <= loops; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const std::string name = std::to_string(i);
    model->system.add(
        revolute_joint("foot " + name, std::make_unique<GroundFrame>(Vec3(i, 0, 0)), frame_at(*up[at], Vec3(i, 0, 0))));
    if (i > 0) {
      model->system.add(revolute_joint("left of " + name, frame_at(*across[at - 1], Vec3(i, 1, 0)),
                                       frame_at(*up[at], Vec3(i, 1, 0))));
    }
    if (i < loops) {
      model->system.add(
          revolute_joint("right of " + name, frame_at(*up[at], Vec3(i, 1, 0)), frame_at(*across[at], Vec3(i, 1, 0))));
    }
  }
  model->first = up[0];
  model->system.finish();
  return model;
}

/// Position of the upper end of the first rod.
[[nodiscard]] inline Vec3 four_bar_tip(const FourBar& model, ConstSpan q) {
  return model.first->position(q) + rotation_matrix(model.first->quaternion(q)) * Vec3(0, 0.5, 0);
}

}  // namespace espalier::dynamics
