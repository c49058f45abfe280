#include "dynamics/contact/solid_contact.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "dynamics/contact/geometry/narrow.hpp"

namespace espalier::dynamics::contact {
namespace {

std::vector<Box> widened(std::vector<Box> boxes, double by) {
  for (Box& box : boxes) box.widen(by);
  return boxes;
}

bool any_left(const std::vector<Box>& wide, const std::vector<Box>& boxes) {
  for (std::size_t k = 0; k < boxes.size(); ++k)
    if (!wide[k].holds(boxes[k])) return true;
  return false;
}

constexpr double kNoRadius = std::numeric_limits<double>::infinity();

/// The radius of shapes that are round to all sides where they touch; others have none.
double round_radius(const Shape& shape) {
  if (const auto* sphere = std::get_if<SphereShape>(&shape)) return sphere->radius;
  if (const auto* capsule = std::get_if<CapsuleShape>(&shape)) return capsule->radius;
  if (const auto* cylinder = std::get_if<CylinderShape>(&shape)) return cylinder->radius;
  return kNoRadius;
}

}  // namespace

SolidContact::SolidContact(std::string name, const ContactLaw& law, FaceSurface first, RigidSurface second,
                           double allowed)
    : Contact(std::move(name)), law_(law), first_(std::move(first)), shape_(std::move(second)), allowed_(allowed) {
  check_shape(shape_.shape);
  begin();
  check_points();
}

void SolidContact::check_points() const {
  constexpr double kMost = 2e6;
  if (first_.is_line()) return;
  double sum = 0, largest = 0;
  for (Index f = 0; f < static_cast<Index>(first_.faces().size()); ++f) {
    sum += count_of_points(first_, f, round_radius(shape_.shape));
    largest = std::max(largest, first_.face(f).size);
  }
  if (sum <= kMost) return;
  throw std::invalid_argument(fmt::format(
      "'{}': the shape is too small for its faces, which would need {:.3g} points of integration so that it "
      "does not pass between them: its radius is {:g}, faces are up to {:g} long; divide the mesh where it "
      "touches",
      first_.name(), sum, round_radius(shape_.shape), largest));
}

SolidContact::SolidContact(std::string name, const ContactLaw& law, FaceSurface first, FaceSurface second,
                           double allowed, double reach)
    : Contact(std::move(name)),
      law_(law),
      first_(std::move(first)),
      second_(std::move(second)),
      allowed_(allowed),
      reach_(reach) {
  begin();
}

std::unique_ptr<SolidContact> SolidContact::with_itself(std::string name, ContactLaw law, const FaceSurface& surface,
                                                        double allowed, double reach) {
  if (surface.is_line()) throw std::invalid_argument("a line does not touch itself; only faces do");
  for (double* each : {&law.stiffness, &law.tangential_stiffness, &law.tangential_damping}) *each *= 0.5;
  auto contact = std::make_unique<SolidContact>(std::move(name), law, surface, surface, allowed, reach);
  contact->with_itself_ = true;
  return contact;
}

void SolidContact::begin() {
  law_.check();
  if (second_ && first_.is_line() && second_->is_line() && one_body())
    throw std::invalid_argument("a line does not touch itself, nor another one of its body");
  if (second_ && second_->is_line() && !first_.is_line())
    throw std::invalid_argument("of a line and faces the line must be the first surface");
  if (one_body()) second_->limit_depths(first_);
  if (law_.impulse)
    throw std::invalid_argument("law = \"impulse\" is of rigid shapes; what is flexible has the penalty");
  if (law_.restitution < 1) throw std::invalid_argument("restitution is of rigid bodies; solids have damping");
  if (allowed_ > 0 && (law_.exponent != 1 || law_.smoothing != 0))
    throw std::invalid_argument("a chosen penetration goes with the exponent 1 and without smoothing");
  if (reach_ <= 0) reach_ = 0.5 * std::max(first_.mean_size(), second_ ? second_->mean_size() : 0.0);
}

// ---- Where things are

void SolidContact::move_to(ConstSpan q, ConstSpan v, bool look_only) {
  first_.move_to(q, v);
  if (second_) {
    second_->move_to(q, v);
  } else if (shape_.body != nullptr) {
    const RigidBody& body = *shape_.body;
    shape_motion_.origin = body.position(q);
    shape_motion_.axes = rotation_matrix(body.quaternion(q));
    if (!shape_motion_.origin.allFinite() || !shape_motion_.axes.allFinite())
      throw Error(StatusCode::singular, "the body '" + body.name() + "' is at a place that is no number");
    if (!v.empty()) {
      shape_motion_.velocity = body.velocity(v);
      shape_motion_.omega = shape_motion_.axes * body.angular(v);
    }
  }
  placed_ = {&shape_.shape, shape_motion_.to_global(shape_.point), shape_motion_.axes * shape_.axes};
  const bool come_near = second_ && !first_.is_line() && !points_stale_ && !look_only &&
                         (any_left(widened_first_, first_.boxes()) || any_left(widened_second_, second_->boxes()));
  // Looking on after a step sees the points with which it found its balance.
  const bool stale = points_stale_ && (!look_only || points_.empty());
  if (stale || come_near) make_points();
}

void SolidContact::make_points() {
  const std::vector<ContactPoint> old_points = std::move(points_);
  const std::vector<Memory> old_memory = std::move(memory_);
  points_.clear();
  for (Index f = 0; f < static_cast<Index>(first_.faces().size()); ++f) {
    if (second_ && !first_.is_line())
      points_of_segments(first_, f, *second_, reach_, points_);
    else
      points_of_face(first_, f, second_ ? kNoRadius : round_radius(shape_.shape), points_);
  }
  memory_.assign(points_.size(), {});
  transfer(old_points, old_memory);
  points_stale_ = false;
  made_at_.assign(points_.size(), {});
  if (!second_ || first_.is_line()) return;
  for (std::size_t k = 0; k < points_.size(); ++k)
    made_at_[k] = project_on_face(second_->face(points_[k].opposite), place_of_point(k).x).xi;
  widened_first_ = widened(first_.boxes(), 0.25 * reach_);
  widened_second_ = widened(second_->boxes(), 0.25 * reach_);
}

// Each new point takes over what the nearest old one on its face knows. @pre both are ordered by faces
void SolidContact::transfer(const std::vector<ContactPoint>& old_points, const std::vector<Memory>& old_memory) {
  std::size_t begin = 0;
  for (std::size_t k = 0; k < points_.size(); ++k) {
    const FaceSpot& spot = points_[k].spot;
    while (begin < old_points.size() && old_points[begin].spot.face < spot.face) ++begin;
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t i = begin; i < old_points.size() && old_points[i].spot.face == spot.face; ++i) {
      const auto& xi = old_points[i].spot.xi;
      const double distance = std::hypot(xi[0] - spot.xi[0], xi[1] - spot.xi[1]);
      if (distance < nearest) {
        nearest = distance;
        memory_[k] = old_memory[i];
      }
    }
  }
}

FacePlace SolidContact::place_of_point(std::size_t k) const {
  const FaceSpot& spot = points_[k].spot;
  const SurfaceFace& face = first_.face(spot.face);
  return face_place(face, spot.xi.data());
}

Vec3 SolidContact::from_spring_end(std::size_t k, const FacePlace& at) const {
  const Memory& memory = memory_[k];
  const SurfaceFace& held = second_->face(memory.anchor.face);
  const FacePlace hold = face_place(held, memory.anchor.xi.data());
  Vec3 between = at.x - hold.x;
  if (held.is_line()) between -= memory.hold.arm_at(hold.tangent[0]);
  return between;
}

Vec3 SolidContact::velocity_of_point(std::size_t k, const FacePlace& at) const {
  const SurfaceFace& face = first_.face(points_[k].spot.face);
  Vec3 v = Vec3::Zero();
  for (std::size_t a = 0; a < face.v.size(); ++a) v += at.value[a] * face.v[a];
  return v;
}

// ---- Pattern

bool SolidContact::update_pattern(ConstSpan q) {
  move_to(q, {});
  bool outgrown = false;
  const auto need = [&](Index face, Index other) { outgrown = outgrown || pattern_.count({face, other}) == 0; };
  for_acting([&](const Acting& acting, const FacePlace& /*at*/) {
    const Index face = points_[acting.point].spot.face;
    need(face, second_ ? acting.opposite->face : -1);
    if (second_ && law_.rubs() && memory_[acting.point].touched) need(face, memory_[acting.point].anchor.face);
  });
  if (outgrown) {
    const double wide = 2 * reach_;
    const bool bounded = !second_ && !std::holds_alternative<PlaneShape>(shape_.shape);
    const Box around = bounded ? box_around(placed_) : Box{};
    pattern_.clear();
    for (std::size_t f = 0; f < first_.faces().size(); ++f) {
      Box box = first_.boxes()[f];
      box.widen(wide);
      const auto face = static_cast<Index>(f);
      if (second_) {
        second_->tree().query(box, [&](Index other) { pattern_.insert({face, other}); });
      } else if (bounded) {
        if (box.meets(around)) pattern_.insert({face, -1});
      } else {
        const Vec3 n = placed_.z(), middle = 0.5 * (box.low + box.high), half = 0.5 * (box.high - box.low);
        if (n.dot(middle - placed_.origin) <= n.cwiseAbs().dot(half)) pattern_.insert({face, -1});
      }
    }
  }
  return outgrown || std::exchange(pattern_stale_, false);
}

void SolidContact::declare(PatternBuilder& w, PatternBuilder& /*phi_q*/) const {
  for (const auto& [face, other] : pattern_) {
    std::vector<Index> rows = first_.face(face).all_rows();
    if (other >= 0)
      for (const Index r : second_->face(other).all_rows()) rows.push_back(r);
    else if (shape_.body != nullptr)
      for (const Index r : shape_.body->coordinates()) rows.push_back(r);
    w.add_block(rows, rows);
  }
}

void SolidContact::bind(const SparsePattern& w, const SparsePattern& /*phi_q*/) {
  w_ = &w;
  pattern_stale_ = false;
}

// ---- Steps

SolidContact::Memory SolidContact::remembered(const Acting& acting, const FacePlace& at) const {
  Memory memory = memory_[acting.point];
  memory.touched = true;
  if (!law_.rubs()) return memory;
  const Vec3 kept = kept_stretch(law_, acting.normal.force, acting.stretch, acting.slip_rate);
  if (!second_) {
    BodyMotion point;
    point.origin = at.x;
    memory.ends = spring_ends(acting.touch, shape_motion_, point, kept);
    return memory;
  }
  const SurfaceFace& other = second_->face(acting.opposite->face);
  const FacePlace there = face_place(other, acting.opposite->xi.data());
  if (other.is_line()) {
    hold_on(memory, *acting.opposite, at.x - kept);
    return memory;
  }
  Eigen::Matrix2d metric;
  const auto& t = there.tangent;
  metric << t[0].dot(t[0]), t[0].dot(t[1]), t[0].dot(t[1]), t[1].dot(t[1]);
  const Eigen::Vector2d back = metric.inverse() * Eigen::Vector2d(t[0].dot(kept), t[1].dot(kept));
  memory.anchor = {acting.opposite->face, {acting.opposite->xi[0] - back[0], acting.opposite->xi[1] - back[1]}};
  return memory;
}

void SolidContact::hold_on(Memory& memory, const FaceSpot& line, const Vec3& end) const {
  const FacePlace there = face_place(second_->face(line.face), line.xi.data());
  memory.touched = true;
  memory.anchor = line;
  memory.hold = {end - there.x, there.tangent[0].normalized()};
}

// Whether points between solids have moved on by more than a hundredth of a face since they were made.
bool SolidContact::slid() const {
  constexpr double kFar = 0.01;
  for (std::size_t k = 0; k < points_.size(); ++k) {
    const auto xi = project_on_face(second_->face(points_[k].opposite), place_of_point(k).x, &made_at_[k]).xi;
    if (std::abs(xi[0] - made_at_[k][0]) > kFar || std::abs(xi[1] - made_at_[k][1]) > kFar) return true;
  }
  return false;
}

void SolidContact::accept(const StateView& s) {
  move_to(s.q, s.v);
  std::vector<Memory> next(points_.size());
  for (std::size_t k = 0; k < next.size(); ++k) next[k].layer = active() ? memory_[k].layer : 0;
  for_acting([&](const Acting& acting, const FacePlace& at) { next[acting.point] = remembered(acting, at); });
  if (active() && law_.rubs() && second_ && second_->is_line()) {
    for (std::size_t k = 0; k < next.size(); ++k) {
      if (next[k].touched) continue;
      const FacePlace at = place_of_point(k);
      const double radius = first_.face(points_[k].spot.face).radius;
      if (const auto spot = spot_opposite(k, at, next[k].layer + radius + reach_)) hold_on(next[k], *spot, at.x);
    }
  }
  memory_ = std::move(next);
  // Made anew when the next step begins: see update_pattern().
  points_stale_ = second_ && !first_.is_line() && slid();
}

bool SolidContact::augment(const StateView& s) {
  if (allowed_ == 0 || !active()) return false;
  move_to(s.q, s.v);
  double worst = 0;
  std::vector<double> layers(points_.size(), 0.0);
  for_acting([&](const Acting& acting, const FacePlace& /*at*/) {
    layers[acting.point] = std::max(0.0, memory_[acting.point].layer - acting.gap);
    const bool lifted = acting.gap > 0;
    worst = std::max(worst, lifted ? std::min(acting.gap, memory_[acting.point].layer) : -acting.gap);
  });
  if (worst <= allowed_) return false;
  for (std::size_t k = 0; k < points_.size(); ++k) memory_[k].layer = layers[k];
  return true;
}

}  // namespace espalier::dynamics::contact
