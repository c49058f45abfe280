/// \file
/// Two rigid bodies with one shape each, for the tests of contact.
#pragma once

#include <memory>
#include <random>
#include <string>

#include "dynamics/contact/rigid_contact.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/dae/check.hpp"

namespace espalier::dynamics {

/// A body with a shape: at `position`, turned by the rotation vector `turn`.
struct ShapedBody {
  contact::Shape shape;
  Vec3 position = Vec3::Zero(), turn = Vec3::Zero();
};

/// A system of shapes that touch each other.
struct ShapeSystem {
  AssembledSystem system;
  std::vector<RigidBody*> bodies;
  contact::RigidContact* contact = nullptr;

  /// @param point  of each shape's origin, from the centre of mass
  ShapeSystem(const std::vector<ShapedBody>& shaped, const contact::ContactLaw& law,
              const Vec3& point = {0.01, -0.02, 0.015}) {
    std::vector<contact::RigidSurface> surfaces;
    for (const ShapedBody& s : shaped) {
      RigidBodyData data;
      data.mass = 2;
      data.inertia << 0.5, 0.1, -0.05, 0.1, 0.7, 0.02, -0.05, 0.02, 0.9;
      data.position = s.position;
      data.rotation = quaternion_exp(s.turn);
      const std::string name = "body " + std::to_string(bodies.size());
      bodies.push_back(&system.add(std::make_unique<RigidBody>(name, data)));
      surfaces.push_back({name, bodies.back(), s.shape, point, rotation_exp({0.1, 0.2, -0.1})});
    }
    contact = &system.add(std::make_unique<contact::RigidContact>("contact", law, std::move(surfaces)));
    system.finish();
    const State s = initial();
    system.update_pattern(s.q);
  }

  [[nodiscard]] State initial() const {
    State s(system.sizes());
    system.initial(s.q, s.v);
    return s;
  }

  /// Moved by up to `size` in every coordinate, with velocities up to one.
  [[nodiscard]] State anywhere(unsigned seed, double size) const {
    std::mt19937 engine(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    State s = initial();
    std::vector<double> step(s.v.size());
    for (double& x : step) x = size * uniform(engine);
    system.retract(s.q, step, s.q);
    for (auto* part : {&s.v, &s.a})
      for (double& x : *part) x = uniform(engine);
    return s;
  }
};

/// A box of twelve triangles.
inline std::shared_ptr<const contact::TriangleSurface> box_of_triangles(const Vec3& half) {
  std::vector<Vec3> p;
  for (int k = 0; k < 8; ++k)
    p.emplace_back((k & 1) != 0 ? half[0] : -half[0], (k & 2) != 0 ? half[1] : -half[1],
                   (k & 4) != 0 ? half[2] : -half[2]);
  return std::make_shared<contact::TriangleSurface>(std::move(p),
                                                    std::vector<std::array<Index, 3>>{{0, 2, 1},
                                                                                      {1, 2, 3},
                                                                                      {4, 5, 6},
                                                                                      {5, 7, 6},
                                                                                      {0, 1, 4},
                                                                                      {1, 5, 4},
                                                                                      {2, 6, 3},
                                                                                      {3, 6, 7},
                                                                                      {0, 4, 2},
                                                                                      {2, 4, 6},
                                                                                      {1, 3, 5},
                                                                                      {3, 7, 5}});
}

}  // namespace espalier::dynamics
