// Impacts of rigid shapes: when something strikes, where, and what rests afterwards.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/contact/rigid_contact.hpp"

namespace espalier::dynamics::contact {
namespace {

// A share of the least extent: nearer than that, shapes touch as far as an impact goes.
constexpr double kTouching = 1e-9;
// A share of the least extent: so far bodies may go before it is looked whether they strike.
constexpr double kLeap = 0.2;

double least_of(const std::vector<RigidSurface>& surfaces) {
  double least = std::numeric_limits<double>::infinity();
  for (const RigidSurface& s : surfaces) least = std::min(least, least_extent(s.shape));
  return std::isfinite(least) ? least : 1.0;
}

}  // namespace

ImpactPoint RigidContact::impact_point(const Active& active) const {
  ImpactPoint p;
  p.surfaces = fmt::format("'{}' and '{}'", surfaces_[slot(active.pair[0])].name, surfaces_[slot(active.pair[1])].name);
  p.law = law_;
  p.closed = active.touch.gap <= 0;
  p.held = active.memory != nullptr;
  const BodyMotion &a = motion_[slot(body_of(active.pair[0]))], &b = motion_[slot(body_of(active.pair[1]))];
  const TouchMotion motion = touch_motion(active.touch, a, b);
  const Vec12& by = motion.gap;
  const Mat3x12 slip = slip_of(motion.point, a, b);
  const Vec3 along = motion.normal.unitOrthogonal(), across = motion.normal.cross(along);
  for (const int side : {0, 1}) {
    const RigidBody* body = bodies_[slot(body_of(active.pair[at(side)]))];
    if (body == nullptr) continue;
    const Mat3& axes = (side == 0 ? a : b).axes;
    const auto append = [&](const Vec12& row, std::vector<double>& out) {
      const Vec3 turn = axes.transpose() * row.segment<3>(6 * side + 3);
      for (int k = 0; k < 6; ++k) out.push_back(k < 3 ? row[6 * side + k] : turn[k - 3]);
    };
    p.coordinates.insert(p.coordinates.end(), body->coordinates().begin(), body->coordinates().end());
    append(by, p.gap_by);
    if (law_.friction == 0) continue;
    append(slip.transpose() * along, p.slip_by[0]);
    append(slip.transpose() * across, p.slip_by[1]);
  }
  return p;
}

double RigidContact::closing(const StateView& s) {
  double most = -margin_;
  if (!active()) return most;
  const double touching = kTouching * least_of(surfaces_);
  move_to(s.q, s.v);
  for (const Active& active : find_touching(margin_)) {
    const double gap = active.touch.gap;
    if (gap >= 0) {
      most = std::max(most, -std::max(gap, std::numeric_limits<double>::min()));
      continue;
    }
    if (active.memory != nullptr) continue;
    const ImpactPoint p = impact_point(active);
    double rate = 0, gross = 0;
    for (std::size_t k = 0; k < p.gap_by.size(); ++k) {
      const double part = p.gap_by[k] * s.v[slot(p.coordinates[k])];
      rate += part;
      gross += std::abs(part);
    }
    const bool meets = gap < -touching ? rate <= 0 : rate < -kRateRounding * gross;
    most = std::max(most, meets ? -gap : gap);
  }
  return most;
}

// Half spaces cannot be passed through.
double RigidContact::safe_time(const StateView& s) {
  const double forever = std::numeric_limits<double>::infinity();
  if (!active() || bounded_.size() < 2) return forever;
  move_to(s.q, s.v);
  double fastest = 0;
  for (const Index i : bounded_) {
    const BodyMotion& m = motion_[slot(body_of(i))];
    const Vec3 half = 0.5 * (boxes_[slot(i)].high - boxes_[slot(i)].low),
               arm = 0.5 * (boxes_[slot(i)].high + boxes_[slot(i)].low) - m.origin;
    fastest = std::max(fastest, m.velocity.norm() + m.omega.norm() * (half.norm() + arm.norm()));
  }
  return fastest > 0 ? kLeap * least_of(surfaces_) / fastest : forever;
}

void RigidContact::add_impact_points(const StateView& s, std::vector<ImpactPoint>& points) {
  struck_.clear();
  if (!active()) return;
  move_to(s.q, s.v);
  struck_ = find_touching(kTouching * least_of(surfaces_));
  for (const Active& active : struck_) points.push_back(impact_point(active));
}

void RigidContact::take_impact(std::span<const ImpactPoint> points) {
  const double touching = kTouching * least_of(surfaces_);
  std::vector<Memory> next;
  bool any = false;
  for (std::size_t k = 0; k < struck_.size(); ++k) {
    const Active& active = struck_[k];
    const BodyMotion &a = motion_[slot(body_of(active.pair[0]))], &b = motion_[slot(body_of(active.pair[1]))];
    impulse_ += points[k].impulse;
    any = any || points[k].impulse > 0;
    if (active.memory == nullptr && !points[k].rests) continue;
    const bool known = active.memory != nullptr;
    next.push_back({active.pair, active.touch.id, a.axes.transpose() * active.touch.normal,
                    known ? active.memory->ends : spring_ends(active.touch, a, b, Vec3::Zero()),
                    known ? active.memory->damping : points[k].damping,
                    known ? active.memory->begin : std::clamp(-active.touch.gap, 0.0, touching)});
  }
  impacts_ += any ? 1 : 0;
  memory_ = std::move(next);
  found_active_ = false;
  struck_.clear();
}

}  // namespace espalier::dynamics::contact
