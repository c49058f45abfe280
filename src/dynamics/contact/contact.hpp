/// \file
/// What all kinds of contact have in common: a component that forces come from, and what can be asked of it.
#pragma once

#include <string>
#include <vector>

#include "dynamics/contact/law.hpp"
#include "dynamics/dae/capabilities.hpp"
#include "dynamics/dae/switching.hpp"

namespace espalier::dynamics::contact {

/// A contact at one state.
struct ContactReport {
  Vec3 force = Vec3::Zero();   ///< sum of the forces on the second surfaces (B of each pair), global axes
  Vec3 moment = Vec3::Zero();  ///< of them about the origin
  double normal_force = 0;     ///< sum of the magnitudes of normal forces
  double friction_force = 0;   ///< sum of the magnitudes of friction
  double penetration = 0;      ///< the largest one, 0 where nothing touches
  double pressure = 0;         ///< the largest mean at a node; 0 between rigid shapes
  double area = 0;             ///< under pressure; 0 between rigid shapes
  double slip_speed = 0;       ///< the largest one among touching points
  double points = 0;           ///< touching points
  double slipping = 0;         ///< those of them that slip
  double energy = 0;           ///< stored in normal and tangential springs
  double impulse = 0;          ///< sum of the impulses along the normals so far (law `impulse`)
  double impacts = 0;          ///< instants at which some acted
};

/// Two surfaces that overlap at a configuration.
struct Overlap {
  std::string a, b;   ///< their names
  double depth = 0;   ///< of the overlap
  double extent = 0;  ///< the least extent of the smaller one
};

/// Adds forces between surfaces. Has no unknowns of its own.
class Contact : public Component, public Switching, public ChangesPattern, public Remembers {
 public:
  using Component::Component;
  [[nodiscard]] Sizes sizes() const override { return {}; }
  /// A contact that is switched off does nothing and forgets what it remembered; it keeps its places in the tangent.
  void set_active(bool active) { active_ = active; }
  [[nodiscard]] bool active() const { return active_; }
  [[nodiscard]] virtual ContactReport report(const StateView& s) = 0;
  /// How far the surfaces are from touching: negative where they overlap or touch, at most the margin of the search
  /// (rigid shapes), which stands for all that is not near. Faces and lines, whose gaps are not looked for, say 1 where
  /// they are open and -1 where not.
  [[nodiscard]] virtual double gap(const StateView& s) { return report(s).points > 0 ? -1 : 1; }
  /// All overlaps at a configuration.
  [[nodiscard]] virtual std::vector<Overlap> overlaps(ConstSpan q) = 0;

 private:
  bool active_ = true;
};

}  // namespace espalier::dynamics::contact
