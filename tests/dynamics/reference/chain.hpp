// The chain of rigid bars that Exudyn was measured with: N bars of 0.1 m, 0.02 m square, 1000 kg/m^3, N revolute
// joints, axes alternately z and y, the first one to the ground, gravity -9.81 along y, laid out along x and at rest.
#pragma once

#include <memory>
#include <vector>

#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/joints/joint.hpp"

namespace espalier::dynamics {

struct Chain {
  AssembledSystem system;
  std::vector<RigidBody*> bars;
  std::vector<Joint*> joints;
};

[[nodiscard]] inline std::unique_ptr<Chain> make_chain(int count, Vec3 gravity = {0, -9.81, 0}) {
  auto chain = std::make_unique<Chain>();
  constexpr double kLength = 0.1, kSide = 0.02, kDensity = 1000;
  const double mass = kLength * kSide * kSide * kDensity;
  Mat3 axis_y;  // z of the joint frame along the global y
  axis_y << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  for (int i = 0; i < count; ++i) {
    RigidBodyData data;
    data.mass = mass;
    const double along = mass / 6 * kSide * kSide, across = mass / 12 * (kLength * kLength + kSide * kSide);
    data.inertia = Vec3(along, across, across).asDiagonal();
    data.position = {(i + 0.5) * kLength, 0, 0};
    data.gravity = gravity;
    chain->bars.push_back(&chain->system.add(std::make_unique<RigidBody>("bar " + std::to_string(i), data)));
    const Mat3 axes = i % 2 == 0 ? Mat3(Mat3::Identity()) : axis_y;
    const Vec3 place(i * kLength, 0, 0);
    FramePtr before = std::make_unique<GroundFrame>(place, axes);
    if (i > 0) before = frame_at(*chain->bars[static_cast<std::size_t>(i) - 1], place, axes);
    chain->joints.push_back(&chain->system.add(
        revolute_joint("hinge " + std::to_string(i), std::move(before), frame_at(*chain->bars.back(), place, axes))));
  }
  chain->system.finish();
  return chain;
}

}  // namespace espalier::dynamics
