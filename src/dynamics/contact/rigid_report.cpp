// What can be asked of rigid shapes in contact.
#include <algorithm>

#include "dynamics/contact/rigid_contact.hpp"

namespace espalier::dynamics::contact {

Energy RigidContact::energy(const StateView& s) {
  Energy sum;
  move_to(s.q, s.v);
  for (const Active& active : find_active()) {
    const TouchForce force = force_of(active, nullptr);
    sum.potential += force.normal.energy;
    if (law_.rubs())
      sum.potential += 0.5 * law_.tangential_stiffness *
                       kept_stretch(law_, force.normal.force, force.stretch, force.slip_rate).squaredNorm();
  }
  return sum;
}

ContactReport RigidContact::report(const StateView& s) {
  ContactReport r;
  r.impulse = impulse_;
  r.impacts = impacts_;
  move_to(s.q, s.v);
  for (const Active& active : find_active()) {
    const TouchForce f = force_of(active, nullptr);
    const Vec3 force = f.wrench.segment<3>(6);
    const Vec3 origin = motion_[slot(body_of(active.pair[1]))].origin;
    r.force += force;
    r.moment += f.wrench.segment<3>(9) + origin.cross(force);
    r.normal_force += f.normal.force;
    r.friction_force += f.friction.force.norm();
    r.penetration = std::max(r.penetration, -active.touch.gap);
    r.slip_speed = std::max(r.slip_speed, f.slip_rate.norm());
    r.points += 1;
    r.slipping += f.friction.slips ? 1 : 0;
    r.energy += f.normal.energy;
  }
  return r;
}

double RigidContact::gap(const StateView& s) {
  if (!active()) return margin_;
  move_to(s.q, s.v);
  double least = margin_;
  for (const Pair& pair : pairs_) {
    found_.clear();
    find_touches(placed_[slot(pair[0])], placed_[slot(pair[1])], margin_, found_);
    for (const Touch& touch : found_) least = std::min(least, touch.gap);
  }
  return least;
}

std::vector<Overlap> RigidContact::overlaps(ConstSpan q) {
  move_to(q, {});
  std::map<Pair, double> deepest;
  for (const Active& active : find_touching(0)) {
    double& depth = deepest[active.pair];
    depth = std::max(depth, -active.touch.gap);
  }
  std::vector<Overlap> all;
  for (const auto& [pair, depth] : deepest) {
    const RigidSurface &a = surfaces_[slot(pair[0])], &b = surfaces_[slot(pair[1])];
    all.push_back({a.name, b.name, depth, std::min(least_extent(a.shape), least_extent(b.shape))});
  }
  return all;
}

}  // namespace espalier::dynamics::contact
