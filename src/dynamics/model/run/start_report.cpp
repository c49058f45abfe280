#include "dynamics/model/run/start_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace espalier::dynamics::model {
namespace {

constexpr double kRoundOff = 1e-9;

/// The size of the largest coordinate.
double extent(const State& s) { return std::max(max_norm(s.q), 1e-300); }

/// Strain energy alone: the load factor takes the weight out of the potential energy.
double strain_energy(FlexibleBody& body, const State& s) {
  body.set_load_factor(0);
  StateView at = s.view();
  at.v = {};
  const double energy = body.energy(at).potential;
  body.set_load_factor(1);
  return energy;
}

/// The angle of two attitudes: their chord is 2 sin(angle / 4).
double angle_between(const Quat& a, const Quat& b) {
  return 4 * std::asin(0.5 * std::min((a - b).norm(), (a + b).norm()));
}

double largest_way(const ReducedBody& body, const State& given, const State& now) {
  std::vector<double> from, to, none;
  body.nodal_motion(given.q, {}, from, none);
  body.nodal_motion(now.q, {}, to, none);
  double most = 0;
  for (std::size_t i = 0; i < to.size(); i += 3 * static_cast<std::size_t>(body.nodal().vertices_per_node()))
    most = std::max(most, std::hypot(to[i] - from[i], to[i + 1] - from[i + 1], to[i + 2] - from[i + 2]));
  return most;
}

double largest_way(const FlexibleBody& body, const State& given, const State& now) {
  double most = 0;
  for (Index k = 0; k < body.vertices(); k += body.vertices_per_node()) {
    const auto at = static_cast<std::size_t>(body.configuration(k));
    most = std::max(
        most, std::hypot(now.q[at] - given.q[at], now.q[at + 1] - given.q[at + 1], now.q[at + 2] - given.q[at + 2]));
  }
  return most;
}

}  // namespace

std::vector<std::string> open_joints(Mechanism& mechanism, const State& given) {
  std::vector<double> phi(given.lambda.size());
  mechanism.system.constraints(given.t, given.q, {}, {phi, {}, {}, {}});
  std::vector<std::string> lines;
  for (const Joint* joint : mechanism.joints) {
    const auto first = static_cast<std::size_t>(joint->placement().c);
    std::size_t worst = first;
    for (std::size_t i = first; i < first + static_cast<std::size_t>(joint->sizes().constraints); ++i)
      if (std::abs(phi[i]) > std::abs(phi[worst])) worst = i;
    if (joint->sizes().constraints == 0 || !(std::abs(phi[worst]) > kRoundOff * extent(given))) continue;
    lines.push_back(fmt::format("{} is open by {:.3g} in the given positions",
                                mechanism.system.constraint_name(static_cast<Index>(worst)), std::abs(phi[worst])));
  }
  return lines;
}

std::vector<std::string> moved_bodies(Mechanism& mechanism, const State& given, const State& now) {
  std::vector<std::string> lines;
  const double least = kRoundOff * extent(given);
  for (const BuiltBody& body : mechanism.bodies) {
    if (body.rigid != nullptr) {
      const double way = (body.rigid->position(now.q) - body.rigid->position(given.q)).norm();
      const double turn = angle_between(body.rigid->quaternion(now.q), body.rigid->quaternion(given.q));
      if (way > least || turn > kRoundOff)
        lines.push_back(fmt::format("{}: the joints moved it by {:.3g} and turned it by {:.3g} rad at the start",
                                    body.spec.name, way, turn));
      continue;
    }
    if (body.flexible == nullptr) continue;  // a point mass
    const bool reduced = body.reduced != nullptr;
    const double way = reduced ? largest_way(*body.reduced, given, now) : largest_way(*body.flexible, given, now);
    const double energy = reduced ? body.reduced->strain_energy(now.q) - body.reduced->strain_energy(given.q)
                                  : strain_energy(*body.flexible, now) - strain_energy(*body.flexible, given);
    if (way > least)
      lines.push_back(
          fmt::format("{}: the joints moved its nodes by up to {:.3g} at the start, which takes {:.4g} of "
                      "strain energy",
                      body.spec.name, way, energy));
  }
  return lines;
}

std::vector<char> given_velocities(const Mechanism& mechanism) {
  std::vector<char> marks(static_cast<std::size_t>(mechanism.system.sizes().velocity), 0);
  bool any = false;
  for (const BuiltBody& body : mechanism.bodies) {
    if (!body.spec.any_velocity_given()) continue;
    any = true;
    const Component& component = body.component();
    const auto first = marks.begin() + component.placement().v;
    if (body.rigid == nullptr && body.reduced == nullptr) {
      std::fill_n(first, component.sizes().velocity, 1);
      continue;
    }
    if (body.spec.velocity_given) std::fill_n(first, 3, 1);
    if (body.spec.angular_velocity_given) std::fill_n(first + 3, 3, 1);
  }
  return any ? marks : std::vector<char>{};
}

std::optional<MovedVelocity> changed_velocity(const Mechanism& mechanism, const State& given, const State& found,
                                              double least, bool of_given) {
  const std::vector<char> marks = given_velocities(mechanism);
  std::optional<MovedVelocity> worst;
  for (const BuiltBody& body : mechanism.bodies) {
    const Component& component = body.component();
    const auto first = static_cast<std::size_t>(component.placement().v);
    for (std::size_t i = first; i < first + static_cast<std::size_t>(component.sizes().velocity); ++i) {
      if ((!marks.empty() && marks[i] != 0) != of_given) continue;
      const double change = std::abs(given.v[i] - found.v[i]);
      if (!(change > least) || (worst && change <= std::abs(worst->given - worst->found))) continue;
      worst = MovedVelocity{&body, static_cast<Index>(i), given.v[i], found.v[i]};
    }
  }
  return worst;
}

std::vector<std::string> velocity_notices(const Mechanism& mechanism, const State& given, const State& found,
                                          double least) {
  std::vector<std::string> lines;
  if (given_velocities(mechanism).empty()) return lines;
  const auto text = [&](const MovedVelocity& m) {
    return fmt::format("that of {} from {:g} to {:g}", mechanism.system.coordinate_name(m.coordinate), m.given,
                       m.found);
  };
  if (const auto changed = changed_velocity(mechanism, given, found, least, true))
    lines.push_back(fmt::format("initial velocities that were given do not fit the joints and were changed, most {}",
                                text(*changed)));
  if (const auto follows = changed_velocity(mechanism, given, found, least, false))
    lines.push_back(fmt::format("initial velocities that were not given follow from the others by the joints, most {}",
                                text(*follows)));
  return lines;
}

}  // namespace espalier::dynamics::model
