#include "dynamics/contact/law.hpp"

#include <cmath>
#include <stdexcept>

#include "dynamics/forces/penalty.hpp"

namespace espalier::dynamics::contact {

void ContactLaw::check() const {
  const auto need = [](bool good, const char* what) {
    if (!good) throw std::invalid_argument(what);
  };
  need(stiffness > 0 && std::isfinite(stiffness), "the stiffness of a contact must be greater than 0");
  need(exponent >= 1 && exponent <= 4, "the exponent of a contact must lie between 1 and 4");
  need(smoothing >= 0 && (smoothing == 0 || exponent == 1), "smoothing goes with the exponent 1 and is not negative");
  need(damping >= 0, "the damping of a contact must not be negative");
  need((impulse ? restitution >= 0 : restitution > 0) && restitution <= 1,
       impulse ? "the restitution of a contact with impulses must lie in [0, 1]"
               : "the restitution of a contact must lie in (0, 1]");
  need(!impulse || damping == 0, "a contact with impulses has no damping: what rests is damped critically");
  need(damping == 0 || restitution == 1, "a contact has damping or restitution, not both");
  need(friction >= 0, "the friction of a contact must not be negative");
  need(static_friction == 0 || static_friction >= friction,
       "the static friction of a contact must not be below that of sliding");
  need(!falls() || stribeck_speed > 0, "static friction needs a Stribeck speed greater than 0");
  need(!rubs() || tangential_stiffness > 0, "friction needs a tangential stiffness greater than 0");
  need(tangential_damping >= 0, "the tangential damping of a contact must not be negative");
}

ContactLaw::Coefficient ContactLaw::coefficient(double slip_speed) const {
  if (!falls()) return {friction, 0};
  const double x = slip_speed / stribeck_speed, more = (static_friction - friction) * std::exp(-x * x);
  return {friction + more, -2 * x / stribeck_speed * more};
}

NormalForce normal_force(const ContactLaw& law, double p, double rate, double damping) {
  if (!(p > 0)) return {};
  PenaltyForce e;
  if (law.exponent == 1) {
    e = penalty(p, law.stiffness, law.smoothing);
  } else {
    const double power = law.stiffness * std::pow(p, law.exponent - 1);
    e = {power * p, law.exponent * power, 0, power * p * p / (law.exponent + 1)};
  }
  if (law.impulse) {
    const double force = e.force + damping * rate;
    return force > 0 ? NormalForce{force, e.slope, damping, e.energy} : NormalForce{0, 0, 0, e.energy};
  }
  const double factor = 1 + damping * rate;
  if (factor <= 0) return {0, 0, 0, e.energy};
  return {e.force * factor, e.slope * factor, e.force * damping, e.energy};
}

double damping_number(double restitution) {
  if (restitution >= 1) return 0;
  // ln((1 + X) / (1 - r X)) - (1 + r) X is negative up to its root and grows without bound towards 1 / r.
  const double r = restitution;
  double low = 0, high = 1 / r;
  for (int k = 0; k < 200 && high - low > 1e-16 * high; ++k) {
    const double x = 0.5 * (low + high);
    const double value = std::log1p(x) - std::log1p(-r * x) - (1 + r) * x;
    (value < 0 ? low : high) = x;
  }
  return 0.5 * (low + high);
}

FrictionForce friction_force(const ContactLaw& law, double normal, const Vec3& stretch, const Vec3& rate) {
  FrictionForce result;
  const Vec3 trial = law.tangential_stiffness * stretch + law.tangential_damping * rate;
  const double speed = rate.norm();
  const auto [mu, slope] = law.coefficient(speed);
  const double size = trial.norm(), limit = mu * normal;
  if (size <= limit) {
    result.force = -trial;
    result.by_trial = -Mat3::Identity();
    return result;
  }
  const Vec3 e = trial / size;
  result.slips = true;
  result.force = -limit * e;
  result.by_trial = -limit / size * (Mat3::Identity() - e * e.transpose());
  result.by_normal = -mu * e;
  if (slope != 0) result.by_rate = -slope * normal / speed * e * rate.transpose();
  return result;
}

Vec3 kept_stretch(const ContactLaw& law, double normal, const Vec3& stretch, const Vec3& rate) {
  const double size = law.tangential_stiffness * stretch.norm(), limit = law.coefficient(rate.norm()).mu * normal;
  return size <= limit ? stretch : Vec3(limit / size * stretch);
}

}  // namespace espalier::dynamics::contact
