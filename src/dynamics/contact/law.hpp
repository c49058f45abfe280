/// \file
/// The force between surfaces that touch.
#pragma once

#include "dynamics/contact/geometry/box_tree.hpp"

namespace espalier::dynamics::contact {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

/// Normal force of a penetration p > 0 and its rate p': N = E(p) max(0, 1 + a p'), E(p) = k p^e with, for e = 1, a
/// slope that builds up over `smoothing` (forces/penalty.hpp). Damping after Hunt and Crossley, J. Appl. Mech. 42
/// (1975): the force begins and ends with zero and never pulls. With `restitution`, a = X / v: v is the speed with
/// which the surfaces met and X solves
///   (1 + r) X = ln((1 + X) / (1 - r X)),
/// so that what meets with v parts with r v, whatever E(p) is (integrate m p' dp' / (1 + a p') = -E dp to and fro).
/// With `impulse` what meets is turned round at once (contact/impact.hpp), and E(p) + c p' >= 0 holds what stays
/// closed. Friction: Coulomb's, |T| <= mu(u) N at the slip speed u,
///   mu(u) = friction + (static_friction - friction) exp(-(u / stribeck_speed)^2).
/// A tangential spring k_t (with a damper c_t) holds as long as it can;
/// beyond that its end slips (return mapping; Simo and Laursen, Comput. Struct. 42 (1992)). Slip is remembered from
/// step to step.
struct ContactLaw {
  double stiffness = 0;             ///< k: force / length^e; of surfaces of solids: pressure / length^e
  double exponent = 1;              ///< e: 1, or 1.5 for spheres after Hertz; at least 1
  double smoothing = 0;             ///< length, for e = 1
  double damping = 0;               ///< a, time / length
  double restitution = 1;           ///< r in (0, 1]; below 1 instead of a. With `impulse`: in [0, 1]
  bool impulse = false;             ///< impacts take no time; without damping
  double friction = 0;              ///< mu of what slides
  double static_friction = 0;       ///< mu of what rests; 0: the same
  double stribeck_speed = 0;        ///< needed where static_friction is greater than friction
  double tangential_stiffness = 0;  ///< k_t, force / length (solids: / area); needed where mu > 0
  double tangential_damping = 0;    ///< c_t, force time / length (solids: / area)
  /// @throws std::invalid_argument where one of them makes no sense
  void check() const;
  [[nodiscard]] bool rubs() const { return friction > 0 || static_friction > 0; }
  [[nodiscard]] bool falls() const { return static_friction > friction; }  ///< friction with the speed
  struct Coefficient {
    double mu = 0, slope = 0;  ///< at the speed, and by it
  };
  [[nodiscard]] Coefficient coefficient(double slip_speed) const;
};

/// N and its derivatives, and the energy stored.
struct NormalForce {
  double force = 0;
  double by_penetration = 0;
  double by_rate = 0;
  double energy = 0;
};
/// @param rate of the penetration @param damping  a; with `impulse` c, force time / length
[[nodiscard]] NormalForce normal_force(const ContactLaw& law, double penetration, double rate, double damping);

/// X of a restitution in (0, 1].
[[nodiscard]] double damping_number(double restitution);

/// Force of friction on the surface that moves by `stretch` (with the speed `rate`) in the tangent plane.
struct FrictionForce {
  Vec3 force = Vec3::Zero();
  bool slips = false;
  /// Derivatives: dforce = by_trial (k_t dstretch + c_t drate) + by_rate drate + by_normal dN.
  Mat3 by_trial = Mat3::Zero(), by_rate = Mat3::Zero();
  Vec3 by_normal = Vec3::Zero();
};
[[nodiscard]] FrictionForce friction_force(const ContactLaw& law, double normal, const Vec3& stretch, const Vec3& rate);
/// What is left of the stretch of the spring when its end has slipped.
[[nodiscard]] Vec3 kept_stretch(const ContactLaw& law, double normal, const Vec3& stretch, const Vec3& rate);

}  // namespace espalier::dynamics::contact
