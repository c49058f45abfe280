// What can be asked of a solid in contact.
#include <algorithm>

#include "dynamics/contact/solid_contact.hpp"

namespace espalier::dynamics::contact {

Energy SolidContact::energy(const StateView& s) {
  Energy sum;
  move_to(s.q, s.v, true);
  for_acting([&](const Acting& acting, const FacePlace& /*at*/) {
    double e = acting.normal.energy;
    if (law_.rubs())
      e += 0.5 * law_.tangential_stiffness *
           kept_stretch(law_, acting.normal.force, acting.stretch, acting.slip_rate).squaredNorm();
    sum.potential += points_[acting.point].weight * e;
  });
  return sum;
}

ContactReport SolidContact::report(const StateView& s) {
  ContactReport r;
  move_to(s.q, s.v, true);
  const double sign = reversed_ ? 1 : -1;
  for_acting([&](const Acting& acting, const FacePlace& at) {
    const double w = points_[acting.point].weight;
    const Vec3 force = sign * w * (acting.normal.force * acting.direction + acting.friction.force);
    r.force += force;
    r.moment += at.x.cross(force);
    r.normal_force += w * acting.normal.force;
    r.friction_force += w * acting.friction.force.norm();
    r.penetration = std::max(r.penetration, -acting.gap);
    r.area += side_share() * w;
    r.slip_speed = std::max(r.slip_speed, acting.slip_rate.norm());
    r.points += 1;
    r.slipping += acting.friction.slips ? 1 : 0;
    r.energy += w * acting.normal.energy;
  });
  if (with_itself_) r.force = r.moment = Vec3::Zero();  // each side's is the other one's
  if (r.points > 0)
    for (const double p : node_pressures(s)) r.pressure = std::max(r.pressure, p);
  return r;
}

std::vector<double> SolidContact::node_pressures(const StateView& s) {
  const std::vector<Index>& nodes = first_.nodes();
  std::vector<double> force(nodes.size(), 0.0), area(nodes.size(), 0.0);
  move_to(s.q, s.v, true);
  const auto place = [&](Index node) {
    return static_cast<std::size_t>(std::lower_bound(nodes.begin(), nodes.end(), node) - nodes.begin());
  };
  // Squares of the shape functions: never negative, as those of mid-side nodes are not.
  const auto spread = [&](std::size_t k, const FacePlace& at, double value, std::vector<double>& out) {
    const SurfaceFace& face = first_.face(points_[k].spot.face);
    for (std::size_t a = 0; a < face.names.size(); ++a)
      if (face.names[a] >= 0) out[place(face.names[a])] += points_[k].weight * at.value[a] * at.value[a] * value;
  };
  for (std::size_t k = 0; k < points_.size(); ++k) spread(k, place_of_point(k), 1, area);
  for_acting([&](const Acting& acting, const FacePlace& at) { spread(acting.point, at, acting.normal.force, force); });
  for (std::size_t i = 0; i < force.size(); ++i) force[i] = area[i] > 0 ? force[i] / (side_share() * area[i]) : 0;
  return force;
}

std::vector<Overlap> SolidContact::overlaps(ConstSpan q) {
  move_to(q, {});
  double depth = 0;
  for_acting([&](const Acting& acting, const FacePlace& /*at*/) { depth = std::max(depth, -acting.gap); });
  if (depth == 0) return {};
  return {{first_.name(), second_ ? second_->name() : shape_.name, depth, first_.mean_size()}};
}

}  // namespace espalier::dynamics::contact
