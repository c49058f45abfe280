#include "dynamics/joints/space_curve.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "dense/dense.hpp"
#include "dynamics/bodies/rotation.hpp"

namespace espalier::dynamics {
namespace {

constexpr int kPerPiece = 8;  // samples of a piece: of normals, and to look for the nearest place

/// Parameters along a spline, kPerPiece of each piece and its last end.
std::vector<double> samples_of(const SpaceSpline& path) {
  std::vector<double> u;
  for (std::size_t i = 0; i + 1 < path.knots().size(); ++i)
    for (int k = 0; k < kPerPiece; ++k)
      u.push_back(path.knots()[i] + (path.knots()[i + 1] - path.knots()[i]) * k / kPerPiece);
  u.push_back(path.most());
  return u;
}

/// Across the plane that the points lie in, or nearly; of a straight line any direction across it.
Vec3 across(const std::vector<Vec3>& points) {
  Vec3 mean = Vec3::Zero();
  for (const Vec3& x : points) mean += x / static_cast<double>(points.size());
  Mat3 spread = Mat3::Zero();
  for (const Vec3& x : points) spread += (x - mean) * (x - mean).transpose();
  return dense::principal_axes(spread).axes.col(0);
}

Vec3 without(const Vec3& x, const Vec3& unit) { return (x - x.dot(unit) * unit).normalized(); }

std::string points_text(std::size_t i, std::size_t count) {
  return std::to_string(i % count + 1) + " and " + std::to_string((i + 1) % count + 1);
}

SpaceSpline path_of(std::vector<Vec3> points, bool closed) {
  double size = 0;
  for (const Vec3& x : points) {
    if (!x.allFinite()) throw std::invalid_argument("the points of a curve must be finite numbers");
    size = std::max(size, (x - points.front()).norm());
  }
  constexpr double kApart = 1e-9;
  if (closed && points.size() > 1 && (points.back() - points.front()).norm() <= kApart * size) points.pop_back();
  if (points.size() < (closed ? 3U : 2U))
    throw std::invalid_argument(closed ? "a closed curve needs three different points and more"
                                       : "a curve needs two different points and more");
  const std::size_t n = points.size();
  std::vector<double> knots = {0};
  for (std::size_t i = 0; i + (closed ? 0 : 1) < n; ++i) {
    const double chord = (points[(i + 1) % n] - points[i]).norm();
    if (!(chord > kApart * size))
      throw std::invalid_argument("the points " + points_text(i, n) + " of the curve are one: leave one of them out");
    knots.push_back(knots.back() + chord);
  }
  return {std::move(knots), std::move(points), closed};
}

}  // namespace

SpaceCurve::SpaceCurve(std::vector<Vec3> points, bool closed) : path_(path_of(std::move(points), closed)) {
  check_cusps();
  make_normals();
  arcs_.push_back(0);
  for (std::size_t i = 0; i + 1 < path_.knots().size(); ++i)
    arcs_.push_back(arcs_.back() + arc_between(path_.knots()[i], path_.knots()[i + 1]));
}

// A cusp need not lie on a sample: between two of them the direction turns round.
void SpaceCurve::check_cusps() const {
  constexpr double kLeast = 1e-3;  // of the mean speed, which is near 1
  constexpr double kTurn = -0.5;   // cosine: 120 degrees within a sample's length
  const std::vector<double> u = samples_of(path_);
  Vec3 before = path_.at(u.front()).d1;
  for (std::size_t k = 0; k < u.size(); ++k) {
    const Vec3 d1 = path_.at(u[k]).d1;
    if (!(d1.norm() > kLeast) || d1.dot(before) < kTurn * d1.norm() * before.norm())
      throw std::invalid_argument(
          "the curve has a cusp between the points " +
          points_text((std::max<std::size_t>(k, 1) - 1) / kPerPiece, path_.knots().size() - (closed() ? 1 : 0)) +
          ", where it has no direction: give more points around the turn there");
    before = d1;
  }
}

// Rotation-minimising: the double reflection of Wang, Juettler, Zheng and Liu, ACM Trans. Graph. 27 (2008). What a
// closed curve is short of a round comes back evenly.
void SpaceCurve::make_normals() {
  const std::vector<double> u = samples_of(path_);
  std::vector<Vec3> places, tangents, normals;
  for (const double x : u) {
    const SplinePoint p = path_.at(x);
    places.push_back(p.x);
    tangents.push_back(p.d1.normalized());
  }
  Vec3 start = across(places);
  if (start.cross(tangents[0]).norm() < 0.1) start = tangents[0].unitOrthogonal();
  normals.push_back(without(start, tangents[0]));
  for (std::size_t k = 1; k < u.size(); ++k) {
    const auto reflected = [](const Vec3& x, const Vec3& by) {
      return by.squaredNorm() > 0 ? Vec3(x - 2 * by.dot(x) / by.squaredNorm() * by) : x;
    };
    const Vec3 chord = places[k] - places[k - 1];
    const Vec3 n = reflected(normals.back(), chord), t = reflected(tangents[k - 1], chord);
    normals.push_back(without(reflected(n, tangents[k] - t), tangents[k]));
  }
  if (!closed()) {
    normals_ = SpaceSpline(u, std::move(normals), false);
    return;
  }
  const Vec3 first = normals.front(), last = normals.back(), t = tangents.front();
  const double missing = std::atan2(t.dot(last.cross(first)), last.dot(first));
  for (std::size_t k = 0; k < u.size(); ++k)
    normals[k] = Eigen::AngleAxisd(missing * (u[k] - u[0]) / (u.back() - u[0]), tangents[k]) * normals[k];
  normals.pop_back();
  normals_ = SpaceSpline(u, std::move(normals), true);
}

SplinePoint SpaceCurve::normal(double u) const {
  if (closed() || (u >= least() && u <= most())) return normals_.at(u);
  SplinePoint p;
  p.x = normals_.at(std::clamp(u, least(), most())).x;
  return p;
}

// Gauss's formula of eight points, in each quarter.
double SpaceCurve::arc_between(double from, double to) const {
  constexpr std::array<double, 4> kPlace = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267,
                                            0.9602898564975363};
  constexpr std::array<double, 4> kWeight = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                             0.1012285362903763};
  constexpr int kParts = 4;
  const double half = (to - from) / (2 * kParts);
  double sum = 0;
  for (int part = 0; part < kParts; ++part) {
    const double middle = from + (2 * part + 1) * half;
    for (std::size_t k = 0; k < 4; ++k)
      sum +=
          kWeight[k] * (path_.at(middle - half * kPlace[k]).d1.norm() + path_.at(middle + half * kPlace[k]).d1.norm());
  }
  return half * sum;
}

double SpaceCurve::arc(double u) const {
  if (!closed() && u <= least()) return (u - least()) * path_.at(least()).d1.norm();
  if (!closed() && u >= most()) return length() + (u - most()) * path_.at(most()).d1.norm();
  const double inside = closed() ? path_.wrapped(u) : u;
  const std::vector<double>& knots = path_.knots();
  const auto i =
      static_cast<std::size_t>(std::upper_bound(knots.begin() + 1, knots.end() - 1, inside) - knots.begin()) - 1;
  const double rounds = closed() ? std::round((u - inside) / (most() - least())) : 0;
  return rounds * length() + arcs_[i] + arc_between(knots[i], inside);
}

// Newton's method on E(u) = |p - c(u)|^2 / 2, downhill.
double SpaceCurve::foot(const Vec3& p, double guess) const {
  constexpr int kMost = 200;
  const double span = most() - least(), longest = span / static_cast<double>(path_.knots().size() - 1);
  double u = guess;
  for (int k = 0; k < kMost; ++k) {
    const SplinePoint c = at(u);
    const Vec3 d = p - c.x;
    const double slope = d.dot(c.d1), square = c.d1.squaredNorm(), bend = square - d.dot(c.d2);
    double step = std::clamp(slope / (bend > 1e-3 * square ? bend : square), -longest, longest);
    if (std::abs(step) <= 1e-16 * span) break;
    for (int half = 0; std::abs(step) > 1e-6 * span && half < 50 && (p - at(u + step).x).norm() > d.norm(); ++half)
      step /= 2;
    const double before = u;
    u += step;
    if (u == before) break;
  }
  return u;
}

double SpaceCurve::nearest(const Vec3& p) const {
  double best = least(), distance = (p - at(best).x).norm();
  for (const double u : samples_of(path_)) {
    const double d = (p - at(u).x).norm();
    if (d < distance) best = u, distance = d;
  }
  return foot(p, best);
}

void CurveFollower::accept(const FrameMotion& a, const FrameMotion& b) {
  u_ = foot(a.rot.transpose() * (b.r - a.r));
  known_ = true;
}

void CurveFollower::save(std::vector<double>& out) const { out.insert(out.end(), {known_ ? 1.0 : 0.0, u_}); }

void CurveFollower::restore(ConstSpan& in) {
  if (in.size() < 2) throw Error(StatusCode::invalid_input, "the restart file ends too early");
  known_ = in[0] != 0, u_ = in[1];
  in = in.subspan(2);
}

namespace {

/// The foot u(p) of a point: (p - c) . c' = 0, with two derivatives.
struct Foot {
  double u;
  SplinePoint c;
  Vec3 off, slope;  // p - c, du/dp
  Mat3 bend;        // d2u/dp2
  Foot(const CurveFollower& follower, const Vec3& p) : u(follower.foot(p)), c(follower.curve().at(u)), off(p - c.x) {
    // As far off as its radius of curvature no place of the curve is the nearest any more. There only joints come that
    // are switched off, and searches for a start: they get finite numbers.
    constexpr double kLeast = 1e-3;
    const double square = c.d1.squaredNorm(), denominator = std::max(square - off.dot(c.d2), kLeast * square);
    slope = c.d1 / denominator;
    bend = (c.d2 * slope.transpose() + slope * c.d2.transpose() -
            (3 * c.d1.dot(c.d2) - off.dot(c.d3)) * slope * slope.transpose()) /
           denominator;
  }
};

class BesideCurve final : public PointFunction {
 public:
  BesideCurve(CurveFollowerPtr follower, bool second) : follower_(std::move(follower)), second_(second) {}

  // value = off . n(u(p)); with g = off . n' - c' . n:  gradient n + g u_p,
  // hessian n' u_p^T + u_p n'^T + (off . n'' - 2 c' . n' - c'' . n) u_p u_p^T + g u_pp
  [[nodiscard]] At at(const Vec3& p) const override {
    const Foot f(*follower_, p);
    const SplinePoint n = direction(f);
    const double g = f.off.dot(n.d1) - f.c.d1.dot(n.x);
    const double gg = f.off.dot(n.d2) - 2 * f.c.d1.dot(n.d1) - f.c.d2.dot(n.x);
    return {f.off.dot(n.x), n.x + g * f.slope,
            n.d1 * f.slope.transpose() + f.slope * n.d1.transpose() + gg * f.slope * f.slope.transpose() + g * f.bend};
  }

 private:
  [[nodiscard]] SplinePoint direction(const Foot& f) const {
    SplinePoint m = follower_->curve().normal(f.u);
    if (!second_) return m;
    SplinePoint n;
    n.x = m.x.cross(f.c.d1);
    n.d1 = m.d1.cross(f.c.d1) + m.x.cross(f.c.d2);
    n.d2 = m.d2.cross(f.c.d1) + 2 * m.d1.cross(f.c.d2) + m.x.cross(f.c.d3);
    return n;
  }
  CurveFollowerPtr follower_;
  bool second_;
};

class AlongCurve final : public PointFunction {
 public:
  explicit AlongCurve(CurveFollowerPtr follower) : follower_(std::move(follower)) {}
  [[nodiscard]] At at(const Vec3& p) const override {
    const Foot f(*follower_, p);
    const double speed = f.c.d1.norm();
    return {follower_->curve().arc(f.u), speed * f.slope,
            f.c.d1.dot(f.c.d2) / speed * f.slope * f.slope.transpose() + speed * f.bend};
  }

 private:
  CurveFollowerPtr follower_;
};

}  // namespace

PairFunctionPtr beside_curve(CurveFollowerPtr follower, bool second) {
  return std::make_shared<BesideCurve>(std::move(follower), second);
}

PairFunctionPtr along_curve(CurveFollowerPtr follower) { return std::make_shared<AlongCurve>(std::move(follower)); }

std::unique_ptr<Joint> point_on_curve(std::string name, FramePtr a, FramePtr b, SpaceCurvePtr curve,
                                      std::optional<TimeFunction> motion) {
  const auto follower = std::make_shared<CurveFollower>(std::move(curve));
  const auto row = [](const char* label, PairFunctionPtr function) {
    JointRow r;
    r.label = label;
    JointRow::Term term;
    term.function = std::move(function);
    r.terms = {std::move(term)};
    return r;
  };
  const PairFunctionPtr along = along_curve(follower);
  std::vector<JointRow> rows = {row("first direction across the curve", beside_curve(follower, false)),
                                row("second direction across the curve", beside_curve(follower, true))};
  if (motion) {
    rows.push_back(row("arc length", along));
    rows.back().function = std::move(*motion);
    rows.back().driven = true;
  }
  std::vector<FramePtr> frames;
  frames.push_back(std::move(a));
  frames.push_back(std::move(b));
  auto joint = std::make_unique<Joint>("point on curve", std::move(name), std::move(frames), std::move(rows));
  joint->remember(follower);
  joint->add_motion({"displacement", "speed", {.function = along}});
  return joint;
}

}  // namespace espalier::dynamics
