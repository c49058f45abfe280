// What contact of rigid shapes has to say of a step: friction that drives, surfaces that passed through each other or
// touched on the way, and the speed with which they met.
#include <algorithm>
#include <cmath>

#include "dynamics/contact/rigid_contact.hpp"

namespace espalier::dynamics::contact {
namespace {

// Two surfaces are looked at so often that they move on by this share of their least extent in between, but at least
// four times, which finds the nearest place by a parabola.
constexpr double kRigidLook = 0.25;
constexpr int kFewestRigidLooks = 4, kMostRigidLooks = 256;

Vec3 tangential(const Vec3& x, const Vec3& n) { return x - n * n.dot(x); }

}  // namespace

double RigidContact::unseen(const StepPath& path) {
  if (!active()) return 1;
  move_to(path.end().q, path.end().v);
  const double turning = law_.rubs() ? turning_share(path) : 1;
  return std::min(turning, passing_share(path));
}

RigidContact::Meeting RigidContact::meeting(const Pair& pair, const State& s, double reach) const {
  Meeting m{motion_of(body_of(pair[0]), s.q, s.v), motion_of(body_of(pair[1]), s.q, s.v), {}};
  const auto placed = [&](Index surface, const BodyMotion& body) {
    const RigidSurface& of = surfaces_[slot(surface)];
    return PlacedShape{&of.shape, body.to_global(of.point), body.axes * of.axes};
  };
  const PlacedShape a = placed(pair[0], m.a), b = placed(pair[1], m.b);
  Box first = box_around(a);
  const Box second = box_around(b);
  const bool boxed = first.low[0] <= first.high[0] && second.low[0] <= second.high[0];  // planes have none
  first.widen(reach);
  if (!boxed || first.meets(second)) find_touches(a, b, reach, m.touches);
  return m;
}

double RigidContact::Meeting::gap(double reach) const {
  double least = reach;
  for (const Touch& touch : touches) least = std::min(least, touch.gap);
  return least;
}

// The tangential spring is stretched by the way of a whole step: if the slip turned round on that way the force still
// points against where it went, and drives. (Where the normal force falls faster than the spring gives way it drives as
// well, rightly, but then it has done so from the beginning.) The step should end where the slip was zero.
double RigidContact::turning_share(const StepPath& path) {
  double share = 1;
  for (const Active& active : find_active()) {
    if (active.memory == nullptr) continue;
    const TouchForce force = force_of(active, nullptr);
    const double now = force.friction.force.dot(force.slip_rate);
    if (!force.friction.slips || now <= 0) continue;
    const Meeting then = meeting(active.pair, path.begin(), 0);
    const auto same = [&](const Touch& t) { return touch_group(t.id) == touch_group(active.touch.id); };
    const auto touch = std::find_if(then.touches.begin(), then.touches.end(), same);
    if (touch == then.touches.end()) continue;
    const Vec3 x = touch->second.point - touch->behind() * touch->normal;
    const double before =
        force.friction.force.dot(tangential(then.b.velocity_at(x) - then.a.velocity_at(x), touch->normal));
    if (before >= 0) continue;
    const double turn = before / (before - now);
    if (!path.negligible_after(turn)) share = std::min(share, turn);
  }
  return share;
}

double RigidContact::fastest_point(const Pair& pair, const StepPath& path) const {
  double sum = 0;
  for (const Index surface : pair) {
    const Box& box = boxes_[slot(surface)];
    const bool boxed = box.low[0] <= box.high[0];
    double fastest = 0;
    for (const State* s : {&path.begin(), &path.end()}) {
      const BodyMotion m = motion_of(body_of(surface), s->q, s->v);
      const RigidSurface& of = surfaces_[slot(surface)];
      const double arm = of.point.norm() + (boxed ? 0.5 * (box.high - box.low).norm() : 0.0);
      fastest = std::max(fastest, m.velocity.norm() + m.omega.norm() * arm);
    }
    sum += fastest;
  }
  return sum;
}

double RigidContact::passing_share(const StepPath& path) {
  double way = 0;  // of any two surfaces, towards each other
  for (const Index i : bounded_)
    for (const Index other : {i, planes_.empty() ? i : planes_.front()})
      way = std::max(way, fastest_point({i, other}, path) * path.length());
  double share = 1;
  for (const Pair& pair : way < margin_ ? pairs_ : near_pairs(way)) share = std::min(share, passing_share(pair, path));
  return share;
}

// The share of the step at which two surfaces pass each other that touch at neither end of the step.
double RigidContact::passing_share(const Pair& pair, const StepPath& path) const {
  const double way = fastest_point(pair, path) * path.length();
  if (way == 0) return 1;
  const auto gap = [&](const State& s) { return meeting(pair, s, way).gap(way); };
  const double at_end = gap(path.end());
  if (at_end <= 0 || at_end >= way) return 1;
  const double at_begin = gap(path.begin());
  if (at_begin <= 0 || at_begin + at_end > way) return 1;
  const double least =
      std::min(least_extent(surfaces_[slot(pair[0])].shape), least_extent(surfaces_[slot(pair[1])].shape));
  const int looks = static_cast<int>(
      std::clamp(std::ceil(way / (kRigidLook * least)), 1.0 * kFewestRigidLooks, 1.0 * kMostRigidLooks));
  double before = at_begin, last = at_begin;
  for (int k = 1; k <= looks; ++k) {
    const double share = static_cast<double>(k) / looks, here = k == looks ? at_end : gap(path.at(share));
    if (here < 0) return share;
    // The parabola through three of them turns round between the first and the last: look there.
    const double bend = before - 2 * last + here, slope = 0.5 * (here - before);
    if (k > 1 && bend > 0 && std::abs(slope) < bend) {
      const double nearest = (k - 1 - slope / bend) / looks;
      if (gap(path.at(nearest)) < -path.absolute()) return nearest;
    }
    before = last;
    last = here;
  }
  return 1;
}

void RigidContact::add_falling(const StateView& s, std::vector<FallingForce>& out) {
  if (!active() || !law_.falls()) return;
  move_to(s.q, s.v);
  for (const Active& active : find_active()) {
    const TouchForce force = force_of(active, nullptr);
    const double speed = force.slip_rate.norm();
    if (!force.friction.slips || speed == 0) continue;
    const BodyMotion &a = motion_[slot(body_of(active.pair[0]))], &b = motion_[slot(body_of(active.pair[1]))];
    const Vec12 along = slip_of(touch_motion(active.touch, a, b).point, a, b).transpose() * (force.slip_rate / speed);
    FallingForce f{{}, {}, force.normal.force * law_.coefficient(speed).slope};
    for (const int side : {0, 1}) {
      const RigidBody* body = bodies_[slot(body_of(active.pair[at(side)]))];
      if (body == nullptr) continue;
      const Vec3 turn = (side == 0 ? a : b).axes.transpose() * along.segment<3>(6 * side + 3);
      f.coordinates.insert(f.coordinates.end(), body->coordinates().begin(), body->coordinates().end());
      for (int k = 0; k < 6; ++k) f.direction.push_back(k < 3 ? along[6 * side + k] : turn[k - 3]);
    }
    out.push_back(std::move(f));
  }
}

// Where the law has restitution, the speed of the last state before is that of the impact only after a short step: of
// an even acceleration v^2 is linear in the way.
double RigidContact::landing_damping(const Active& active) const {
  if (law_.impulse || law_.restitution >= 1 || last_q_.empty()) return active.damping;
  const Touch& touch = active.touch;
  const Vec3 x = touch.second.point - touch.second.radius * touch.normal;
  const Vec3 n = touch.flipped ? Vec3(-touch.normal) : touch.normal;
  Vec3 way = Vec3::Zero(), rate_before = Vec3::Zero(), rate = Vec3::Zero();  // of the point of B from that of A
  for (const int side : {0, 1}) {
    const Index body = body_of(active.pair[at(side)]);
    const double sign = side == 0 ? -1 : 1;
    const BodyMotion &now = motion_[slot(body)], then = motion_of(body, last_q_, last_v_);
    const Vec3 from = then.to_global(now.to_own(x));
    way += sign * (x - from);
    rate_before += sign * then.velocity_at(from);
    rate += sign * now.velocity_at(x);
  }
  const double before = std::max(0.0, -n.dot(rate_before)), after = std::max(0.0, -n.dot(rate));
  const double gone = -n.dot(way), open = gone + touch.gap;  // gap before: gone = open - gap
  if (!(gone > 0 && open > 0)) return active.damping;
  const double speed = std::sqrt(before * before + std::max(0.0, after * after - before * before) * open / gone);
  return speed > 0 ? damping_number(law_.restitution) / speed : 0;
}

}  // namespace espalier::dynamics::contact
