// What contact of solids has to say of a step; rigid_steps.cpp has the same of rigid shapes.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "dynamics/contact/solid_contact.hpp"

namespace espalier::dynamics::contact {
namespace {

constexpr double kSolidLook = 0.25;
constexpr int kFewestSolidLooks = 8, kMostSolidLooks = 64;

Box box_of_all(const std::vector<Box>& boxes) {
  Box all;
  for (const Box& box : boxes) all.add(box);
  return all;
}

/// How far a box has moved or grown.
double way_of_box(const Box& from, const Box& to) {
  return std::max((to.low - from.low).norm(), (to.high - from.high).norm());
}

}  // namespace

double SolidContact::unseen(const StepPath& path) {
  if (!active()) return 1;
  const double share = std::min(law_.rubs() ? turning_share(path) : 1.0, passing_share(path));
  move_to(path.end().q, path.end().v, true);
  return share;
}

double SolidContact::turning_share(const StepPath& path) {
  struct Turned {
    std::size_t point;
    Vec3 force;
    double now;
  };
  std::vector<Turned> turned;
  move_to(path.end().q, path.end().v, true);
  for_acting([&](const Acting& acting, const FacePlace& /*at*/) {
    const double now = acting.friction.force.dot(acting.slip_rate);
    if (acting.friction.slips && memory_[acting.point].touched && now > 0)
      turned.push_back({acting.point, acting.friction.force, now});
  });
  double share = 1;
  if (turned.empty()) return share;
  move_to(path.begin().q, path.begin().v, true);
  std::size_t next = 0;
  for_acting([&](const Acting& acting, const FacePlace& /*at*/) {
    while (next < turned.size() && turned[next].point < acting.point) ++next;
    if (next == turned.size() || turned[next].point != acting.point) return;
    const double before = turned[next].force.dot(acting.slip_rate);
    if (before >= 0) return;
    const double turn = before / (before - turned[next].now);
    if (!path.negligible_after(turn)) share = std::min(share, turn);
  });
  return share;
}

// All points that slip as one force, along the mean of their slips: exact where they move as one.
void SolidContact::add_falling(const StateView& s, std::vector<FallingForce>& out) {
  if (!active() || !law_.falls()) return;
  move_to(s.q, s.v, true);
  std::map<Index, double> along;
  double sum = 0;
  for_acting([&](const Acting& acting, const FacePlace& at) {
    const double speed = acting.slip_rate.norm();
    if (!acting.friction.slips || speed == 0) return;
    const double slope = points_[acting.point].weight * acting.normal.force * law_.coefficient(speed).slope;
    // Slips of B against A for rigid shapes (A: the shape), of the first surface against the second between solids: the
    // first surface moves with it in both.
    const Vec3 e = slope * acting.slip_rate / speed;
    const auto add = [&](const SurfaceFace& face, const auto& value, double sign) {
      for (int a = 0; a < face.count(); ++a)
        for (int i = 0; i < 3; ++i)
          along[face.rows[static_cast<std::size_t>(a)].position + i] +=
              sign * value[static_cast<std::size_t>(a)] * e[i];
    };
    add(first_.face(points_[acting.point].spot.face), at.value, 1);
    if (second_) {
      const SurfaceFace& other = second_->face(acting.opposite->face);
      add(other, face_place(other, acting.opposite->xi.data()).value, -1);
    } else if (shape_.body != nullptr) {
      const Vec3 turn = shape_motion_.axes.transpose() * (at.x - shape_motion_.origin).cross(e);
      for (int k = 0; k < 6; ++k)
        along[shape_.body->coordinates()[static_cast<std::size_t>(k)]] -= k < 3 ? e[k] : turn[k - 3];
    }
    sum += slope;
  });
  if (sum == 0) return;
  FallingForce f{{}, {}, sum};
  for (const auto& [coordinate, value] : along) {
    f.coordinates.push_back(coordinate);
    f.direction.push_back(value / sum);
  }
  out.push_back(std::move(f));
}

bool SolidContact::touches(const State& s) {
  move_to(s.q, s.v, true);
  bool any = false;
  for_acting([&](const Acting& /*acting*/, const FacePlace& /*at*/) { any = true; });
  return any;
}

double SolidContact::passing_share(const StepPath& path) {
  if (touches(path.end())) return 1;
  const auto boxes = [&](const State& s) {
    move_to(s.q, s.v, true);
    return std::array{box_of_all(first_.boxes()), second_ ? box_of_all(second_->boxes()) : box_around(placed_)};
  };
  const auto begin = boxes(path.begin()), end = boxes(path.end());
  const double way =
      way_of_box(begin[0], end[0]) + (second_ || shape_.body != nullptr ? way_of_box(begin[1], end[1]) : 0.0);
  const bool plane = !second_ && std::holds_alternative<PlaneShape>(shape_.shape);
  Box first = begin[0];
  first.add(end[0]);
  first.widen(way);
  Box second = begin[1];
  second.add(end[1]);
  const Vec3 n = placed_.z(), middle = 0.5 * (first.low + first.high), half = 0.5 * (first.high - first.low);
  const bool apart = plane ? n.dot(middle - placed_.origin) > n.cwiseAbs().dot(half) : !first.meets(second);
  if (!(way > 0) || apart || touches(path.begin())) return 1;
  const double thin = second_ ? second_->mean_size() : least_extent(shape_.shape);
  const double looks = std::clamp(std::ceil(way / (kSolidLook * std::min(thin, first_.mean_size()))),
                                  1.0 * kFewestSolidLooks, 1.0 * kMostSolidLooks);
  for (int k = 1; k < static_cast<int>(looks); ++k)
    if (touches(path.at(k / looks))) return k / looks;
  return 1;
}

}  // namespace espalier::dynamics::contact
