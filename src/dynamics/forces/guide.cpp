#include "dynamics/forces/guide.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "dynamics/bodies/rotation.hpp"
#include "dynamics/forces/penalty.hpp"

namespace espalier::dynamics {

GuidePath::GuidePath(Vec3 start, double direction) : end_(start.x(), start.y(), 0), end_direction_(direction) {}

Vec3 GuidePath::Segment::at(double s) const {
  if (curvature == 0) return start + s * Vec3(std::cos(direction), std::sin(direction), 0);
  const double a = turn(s);
  return start + Vec3(std::sin(a) - std::sin(direction), std::cos(direction) - std::cos(a), 0) / curvature;
}

void GuidePath::add(double length, double curvature) {
  const Segment segment{end_, end_direction_, length, curvature};
  segments_.push_back(segment);
  end_ = segment.at(length);
  end_direction_ = segment.turn(length);
}

double GuidePath::length() const {
  double sum = 0;
  for (const Segment& p : segments_) sum += p.length;
  return sum;
}

Vec3 GuidePath::point(double s) const {
  for (const Segment& p : segments_) {
    if (s <= p.length) return p.at(s);
    s -= p.length;
  }
  return end_ + s * Vec3(std::cos(end_direction_), std::sin(end_direction_), 0);
}

GuidePath::Nearest GuidePath::nearest(const Vec3& given) const {
  const Vec3 x(given.x(), given.y(), 0);
  Nearest best;
  double least = std::numeric_limits<double>::infinity();
  const auto offer = [&](const Vec3& foot, double direction, double curvature) {
    const Vec3 tangent(std::cos(direction), std::sin(direction), 0), normal(-tangent.y(), tangent.x(), 0);
    const double size = (x - foot).norm();
    if (size >= least) return;
    least = size;
    best = {normal.dot(x - foot), curvature, tangent, normal};
  };
  for (std::size_t k = 0; k < segments_.size(); ++k) {
    const Segment& p = segments_[k];
    const Vec3 tangent(std::cos(p.direction), std::sin(p.direction), 0);
    double s = tangent.dot(x - p.start);
    if (p.curvature != 0) {
      const Vec3 centre = p.start + Vec3(-tangent.y(), tangent.x(), 0) / p.curvature;
      const Vec3 from = (p.start - centre), to = (x - centre);
      // Angle from the beginning in the sense of the arc, in (-pi, pi].
      const double angle = std::atan2(from.x() * to.y() - from.y() * to.x(), from.dot(to));
      s = angle / p.curvature;
      if (s < 0 && -s > 0.5 * (2 * std::numbers::pi / std::abs(p.curvature) - p.length))
        s += 2 * std::numbers::pi / std::abs(p.curvature);
    }
    const bool first = k == 0 && p.curvature == 0, last = k + 1 == segments_.size() && p.curvature == 0;
    s = std::clamp(s, first ? -std::numeric_limits<double>::max() : 0.0,
                   last ? std::numeric_limits<double>::max() : p.length);
    offer(p.at(s), p.turn(s), p.curvature);
  }
  return best;
}

namespace {

class Guide final : public FrameForce {
 public:
  Guide(std::string name, FramePtr a, FramePtr b, GuideLaw law)
      : FrameForce(std::move(name), std::move(a), std::move(b)), law_(std::move(law)) {}

 protected:
  [[nodiscard]] PenaltyForce normal(double p) const {
    const double k = law_.stiffness;
    return law_.both_sides ? PenaltyForce{k * p, k, 0, 0.5 * k * p * p} : penalty(p, k, law_.smoothing);
  }

  struct Contact {
    Vec3 d, u;  // B from A and its rate, in axes of A
    Vec3 d_global, u_global;
    GuidePath::Nearest at;
    PenaltyForce n;
    double rate = 0, slip = 0;        // along normal and tangent
    double damping = 0;               // c N'/k
    double drag = 0, drag_slope = 0;  // tanh and its derivative by the slip
    Vec3 force;                       // on B, axes of A
  };

  [[nodiscard]] Contact contact(const Pair& p) const {
    Contact c;
    c.d_global = p.b.r - p.a.r;
    c.u_global = p.b.vel - p.a.vel - p.a.omega.cross(c.d_global);
    c.d = p.a.rot.transpose() * c.d_global;
    c.u = p.a.rot.transpose() * c.u_global;
    c.at = law_.path.nearest(c.d);
    c.n = normal(-c.at.distance);
    c.rate = c.at.normal.dot(c.u);
    c.slip = c.at.tangent.dot(c.u);
    c.damping = law_.damping * c.n.slope / law_.stiffness;
    c.drag = std::tanh(c.slip / law_.slip_speed);
    c.drag_slope = (1 - c.drag * c.drag) / law_.slip_speed;
    c.force =
        (c.n.force - c.damping * c.rate) * c.at.normal - law_.friction * std::abs(c.n.force) * c.drag * c.at.tangent;
    return c;
  }

  [[nodiscard]] Vec12 law(const Pair& p) const override {
    const Contact c = contact(p);
    const Vec3 f = p.a.rot * c.force;
    Vec12 w;
    w << -f, -c.d_global.cross(f), f, Vec3::Zero();
    return w;
  }

  /// dF/dd and dF/du in axes of A. Along the path tangent and normal turn by kappa / (1 - kappa g).
  void local_derivatives(const Contact& c, Mat3& by_d, Mat3& by_u) const {
    const Vec3 &t = c.at.tangent, &n = c.at.normal;
    const double turn = c.at.curvature / (1 - c.at.curvature * c.at.distance);
    const double normal_force = c.n.force - c.damping * c.rate;
    const double mu = law_.friction, size = std::abs(c.n.force), side = c.n.force < 0 ? -1.0 : 1.0;
    const double damping_slope = law_.damping * c.n.bend / law_.stiffness;
    by_d = n * ((-c.n.slope + damping_slope * c.rate) * n + c.damping * turn * c.slip * t).transpose();
    by_d -= normal_force * turn * t * t.transpose();
    by_d += mu * side * c.n.slope * c.drag * t * n.transpose();
    by_d -= mu * size * (c.drag_slope * turn * c.rate * t + c.drag * turn * n) * t.transpose();
    by_u = -c.damping * n * n.transpose() - mu * size * c.drag_slope * t * t.transpose();
  }

  void law_derivatives(const Pair& p, Mat12& k, Mat12& d) const override {
    const Contact c = contact(p);
    Mat3 by_d, by_u;
    local_derivatives(c, by_d, by_u);
    const Mat3 &r = p.a.rot, back = r.transpose();
    using Wide = Eigen::Matrix<double, 3, 12>;
    Wide dd, dl, ul;  // of d in global axes, of d and u in axes of A
    dd << -Mat3::Identity(), Mat3::Zero(), Mat3::Identity(), Mat3::Zero();
    dl << -back, back * skew(c.d_global), back, Mat3::Zero();
    ul << back * skew(p.a.omega), back * skew(c.u_global), -back * skew(p.a.omega), Mat3::Zero();
    const Vec3 f = r * c.force;
    Wide df = r * (by_d * dl + by_u * ul);
    df.block<3, 3>(0, 3) -= skew(f);
    const Wide dfu = r * by_u * dl;  // u depends on the twists as d on the increments
    k.topRows<3>() = -df;
    k.middleRows<3>(3) = skew(f) * dd - skew(c.d_global) * df;
    k.middleRows<3>(6) = df;
    d.topRows<3>() = -dfu;
    d.middleRows<3>(3) = -skew(c.d_global) * dfu;
    d.middleRows<3>(6) = dfu;
  }

  [[nodiscard]] double potential(const Pair& p) const override { return contact(p).n.energy; }

  void law_branches(const StateView& s, Branches& out) const override {
    if (law_.both_sides && law_.friction == 0) return;
    const Contact c = contact(pair(s));
    if (!law_.both_sides) out.push_back({.value = c.at.distance, .dead = 1e-9 * law_.smoothing});
    if (law_.friction > 0) out.push_back({.value = c.n.force == 0 ? 0 : c.slip, .dead = 0.1 * law_.slip_speed});
  }

 private:
  GuideLaw law_;
};

}  // namespace

std::unique_ptr<FrameForce> guide(std::string name, FramePtr a, FramePtr b, GuideLaw law) {
  if (!(law.stiffness > 0 && law.smoothing > 0 && law.slip_speed > 0))
    throw std::invalid_argument("guide '" + name + "': stiffness, smoothing and slip_speed must be positive");
  return std::make_unique<Guide>(std::move(name), std::move(a), std::move(b), std::move(law));
}

}  // namespace espalier::dynamics
