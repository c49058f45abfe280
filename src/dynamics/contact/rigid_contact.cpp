#include "dynamics/contact/rigid_contact.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/at.hpp"

namespace espalier::dynamics::contact {
namespace {

constexpr double kFlatEnough = 0.8;  // cosine of the angle by which a normal may turn while a spring moves on with it

/// A tenth of the least extent of any shape.
double chosen_margin(const std::vector<RigidSurface>& surfaces) {
  double least = std::numeric_limits<double>::infinity();
  for (const RigidSurface& s : surfaces) least = std::min(least, least_extent(s.shape));
  return std::isfinite(least) ? 0.1 * least : 1.0;
}

bool same(ConstSpan a, const std::vector<double>& b) { return std::equal(a.begin(), a.end(), b.begin(), b.end()); }

/// Whether forces along its normals have no moment about the centre of mass.
bool is_central(const RigidSurface& s) { return std::holds_alternative<SphereShape>(s.shape) && s.point.isZero(0); }

}  // namespace

RigidContact::RigidContact(std::string name, const ContactLaw& law, std::vector<RigidSurface> surfaces,
                           std::size_t against, double margin)
    : Contact(std::move(name)), law_(law), surfaces_(std::move(surfaces)), against_(against), margin_(margin) {
  law_.check();
  for (const RigidSurface& s : surfaces_) {
    check_shape(s.shape);
    auto it = std::find(bodies_.begin(), bodies_.end(), s.body);
    if (it == bodies_.end()) it = bodies_.insert(bodies_.end(), s.body);
    body_index_.push_back(static_cast<Index>(it - bodies_.begin()));
  }
  if (margin_ <= 0) margin_ = chosen_margin(surfaces_);
  for (std::size_t i = 0; i < surfaces_.size(); ++i) {
    const bool plane = std::holds_alternative<PlaneShape>(surfaces_[i].shape);
    (plane ? planes_ : bounded_).push_back(static_cast<Index>(i));
  }
  bool any = false;
  const auto count = static_cast<Index>(surfaces_.size());
  for (Index i = 0; i < count && !any; ++i)
    for (Index j = i + 1; j < count && !any; ++j) any = may_touch(i, j);
  if (!any) throw std::invalid_argument("the contact has no two surfaces on different bodies that could touch");
  reach_.assign(bodies_.size(), 3);
  for (std::size_t i = 0; i < surfaces_.size(); ++i)
    if (law_.rubs() || !is_central(surfaces_[i])) reach_[slot(body_index_[i])] = 6;
  motion_.resize(bodies_.size());
  placed_.resize(surfaces_.size());
  boxes_.resize(surfaces_.size());
}

bool RigidContact::may_touch(Index i, Index j) const {
  const bool first_i = slot(i) < against_, first_j = slot(j) < against_;
  return body_of(i) != body_of(j) && (against_ == 0 || first_i != first_j) &&
         can_touch(surfaces_[slot(i)].shape, surfaces_[slot(j)].shape);
}

// ---- Where things are

BodyMotion RigidContact::motion_of(Index body, ConstSpan q, ConstSpan v) const {
  const RigidBody* rigid = bodies_[slot(body)];
  BodyMotion m;
  if (rigid == nullptr) return m;
  m.origin = rigid->position(q);
  m.axes = rotation_matrix(rigid->quaternion(q));
  if (v.empty()) return m;
  m.velocity = rigid->velocity(v);
  m.omega = m.axes * rigid->angular(v);
  return m;
}

void RigidContact::move_to(ConstSpan q, ConstSpan v) {
  if (!widened_.empty() && same(q, moved_q_) && same(v, moved_v_)) return;
  found_active_ = false;
  moved_q_.clear();  // until all is in its place
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    motion_[b] = motion_of(static_cast<Index>(b), q, v);
    if (!motion_[b].origin.allFinite() || !motion_[b].axes.allFinite())
      throw Error(StatusCode::singular, "a body of the contact is at a place that is no number");
  }
  place_shapes();
  const auto left = [this](Index i) { return !widened_[slot(i)].holds(boxes_[slot(i)]); };
  bool moved = widened_.empty() || std::any_of(bounded_.begin(), bounded_.end(), left);
  // Planes have no box; one that moves is looked at again each time.
  moved = moved ||
          std::any_of(planes_.begin(), planes_.end(), [this](Index i) { return surfaces_[slot(i)].body != nullptr; });
  if (moved) search();
  moved_q_.assign(q.begin(), q.end());
  moved_v_.assign(v.begin(), v.end());
}

void RigidContact::place_shapes() {
  for (std::size_t i = 0; i < surfaces_.size(); ++i) {
    const RigidSurface& s = surfaces_[i];
    const BodyMotion& m = motion_[slot(body_index_[i])];
    placed_[i] = {&s.shape, m.to_global(s.point), m.axes * s.axes};
    boxes_[i] = box_around(placed_[i]);
  }
}

// ---- Broad phase

std::vector<RigidContact::Pair> RigidContact::near_pairs(double margin) {
  std::vector<Box> boxes;
  for (const Index i : bounded_) {
    boxes.push_back(boxes_[slot(i)]);
    boxes.back().widen(margin);
  }
  tree_.refit(boxes);
  std::vector<Pair> pairs;
  for (std::size_t k = 0; k < bounded_.size(); ++k) {
    const Index i = bounded_[k];
    tree_.query(boxes[k], [&](Index other) {
      const Index j = bounded_[slot(other)];
      if (i < j && may_touch(i, j)) pairs.push_back({i, j});
    });
    for (const Index p : planes_) {
      if (!may_touch(i, p)) continue;
      // the lowest corner of the box over the plane
      const Vec3 n = placed_[slot(p)].z();
      const Vec3 middle = 0.5 * (boxes[k].low + boxes[k].high), half = 0.5 * (boxes[k].high - boxes[k].low);
      if (n.dot(middle - placed_[slot(p)].origin) <= n.cwiseAbs().dot(half))
        pairs.push_back({std::min(i, p), std::max(i, p)});
    }
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

void RigidContact::search() {
  pairs_ = near_pairs(margin_);
  widened_ = boxes_;
  for (Box& box : widened_) box.widen(margin_);
}

// ---- Pattern

bool RigidContact::update_pattern(ConstSpan q) {
  if (!same(q, moved_q_)) move_to(q, {});
  const auto bodies_of = [this](const Pair& pair) {
    const std::array<Index, 2> bodies = {body_of(pair[0]), body_of(pair[1])};
    return std::array{std::min(bodies[0], bodies[1]), std::max(bodies[0], bodies[1])};
  };
  const auto needs_block = [this](const std::array<Index, 2>& bodies) {
    return bodies_[slot(bodies[0])] != nullptr && bodies_[slot(bodies[1])] != nullptr;
  };
  const auto missing = [&](const Pair& pair) {
    const auto bodies = bodies_of(pair);
    return needs_block(bodies) && !std::binary_search(pattern_.begin(), pattern_.end(), bodies);
  };
  const bool outgrown = std::any_of(pairs_.begin(), pairs_.end(), missing);
  if (outgrown) {
    pattern_.clear();
    for (const Pair& pair : near_pairs(2 * margin_))
      if (const auto bodies = bodies_of(pair); needs_block(bodies)) pattern_.push_back(bodies);
    std::sort(pattern_.begin(), pattern_.end());
    pattern_.erase(std::unique(pattern_.begin(), pattern_.end()), pattern_.end());
    ++patterns_;
  }
  return outgrown || std::exchange(pattern_stale_, false);
}

void RigidContact::declare(PatternBuilder& w, PatternBuilder& /*phi_q*/) const {
  const auto reached = [this](Index body) {
    return std::span(bodies_[slot(body)]->coordinates()).first(slot(reach_[slot(body)]));
  };
  for (std::size_t b = 0; b < bodies_.size(); ++b)
    if (bodies_[b] != nullptr) w.add_block(reached(static_cast<Index>(b)), reached(static_cast<Index>(b)));
  for (const auto& [a, b] : pattern_) {
    w.add_block(reached(a), reached(b));
    w.add_block(reached(b), reached(a));
  }
}

void RigidContact::bind(const SparsePattern& w, const SparsePattern& /*phi_q*/) {
  places_.clear();
  const auto note = [&](Index row, Index column) {
    std::array<Offset, 6>& starts = places_[{row, column}];
    for (std::size_t c = 0; c < slot(reach_[slot(column)]); ++c)
      starts[c] = find_entry(w, bodies_[slot(column)]->coordinates()[c], bodies_[slot(row)]->coordinates().front());
  };
  for (std::size_t b = 0; b < bodies_.size(); ++b)
    if (bodies_[b] != nullptr) note(static_cast<Index>(b), static_cast<Index>(b));
  for (const auto& [a, b] : pattern_) {
    note(a, b);
    note(b, a);
  }
  pattern_stale_ = false;
}

// ---- Touches and what they remember

const RigidContact::Memory* RigidContact::memory_of(const Pair& pair, const Touch& touch,
                                                    std::vector<char>& taken) const {
  const auto first =
      std::lower_bound(memory_.begin(), memory_.end(), pair, [](const Memory& m, const Pair& p) { return m.pair < p; });
  const Memory* same_corner = nullptr;
  for (auto it = first; it != memory_.end() && it->pair == pair; ++it) {
    if (taken[at(it - memory_.begin())] != 0) continue;
    if (it->id == touch.id) {
      same_corner = &*it;
      break;
    }
    const Vec3 normal = motion_[slot(body_of(pair[0]))].axes.transpose() * touch.normal;
    if (same_corner == nullptr && touch_group(it->id) == touch_group(touch.id) && it->normal.dot(normal) > kFlatEnough)
      same_corner = &*it;
  }
  if (same_corner != nullptr) taken[at(same_corner - memory_.data())] = 1;
  return same_corner;
}

// The damping of a touch that was open at the last accepted state: by the speed with which its points approached each
// other there.
double RigidContact::first_damping(const Pair& pair, const Touch& touch) const {
  if (law_.impulse || law_.restitution >= 1) return law_.damping;
  if (last_q_.empty()) return 0;
  const Vec3 x = touch.second.point - touch.second.radius * touch.normal;
  const auto before = [&](Index surface) {
    const Index body = body_of(surface);
    const BodyMotion then = motion_of(body, last_q_, last_v_);
    return then.velocity_at(then.to_global(motion_[slot(body)].to_own(x)));
  };
  const Vec3 n = touch.flipped ? Vec3(-touch.normal) : touch.normal;
  const double speed = -n.dot(before(pair[1]) - before(pair[0]));
  return speed > 0 ? damping_number(law_.restitution) / speed : 0;
}

const std::vector<RigidContact::Active>& RigidContact::find_active() {
  if (active() && found_active_) return active_touches_;
  find_touching(0);
  if (law_.impulse) std::erase_if(active_touches_, [](const Active& a) { return a.memory == nullptr; });
  found_active_ = active();
  return active_touches_;
}

const std::vector<RigidContact::Active>& RigidContact::find_touching(double reach) {
  found_active_ = false;
  active_touches_.clear();
  if (!active()) return active_touches_;
  std::vector<char> taken(memory_.size(), 0);
  for (const Pair& pair : pairs_) {
    const Box &a = boxes_[slot(pair[0])], &b = boxes_[slot(pair[1])];
    const bool boxed = a.low[0] <= a.high[0] && b.low[0] <= b.high[0];
    if (reach <= 0 && boxed && !a.meets(b)) continue;
    found_.clear();
    find_touches(placed_[slot(pair[0])], placed_[slot(pair[1])], reach, found_);
    for (const Touch& touch : found_) active_touches_.push_back({pair, touch, nullptr, 0});
  }
  // The same features first; others take what is left.
  for (Active& active : active_touches_) {
    active.memory = memory_of(active.pair, active.touch, taken);
    active.damping = active.memory != nullptr ? active.memory->damping : first_damping(active.pair, active.touch);
  }
  return active_touches_;
}

TouchForce RigidContact::force_of(const Active& active, TouchTangent* tangent) const {
  const BodyMotion &a = motion_[slot(body_of(active.pair[0]))], &b = motion_[slot(body_of(active.pair[1]))];
  Touch touch = active.touch;
  if (active.memory != nullptr) touch.gap += active.memory->begin;
  return touch_force(law_, active.damping, touch, a, b, active.memory != nullptr ? &active.memory->ends : nullptr,
                     tangent);
}

void RigidContact::accept(const StateView& s) {
  if (!active()) {
    memory_.clear();
    found_active_ = false;
    return;
  }
  move_to(s.q, s.v);
  std::vector<Memory> next;
  for (const Active& active : find_active()) {
    const BodyMotion &a = motion_[slot(body_of(active.pair[0]))], &b = motion_[slot(body_of(active.pair[1]))];
    const TouchForce force = force_of(active, nullptr);
    const Touch& t = active.touch;
    const Vec3 kept =
        law_.rubs() ? kept_stretch(law_, force.normal.force, force.stretch, force.slip_rate) : Vec3(Vec3::Zero());
    next.push_back({active.pair, t.id, a.axes.transpose() * t.normal, spring_ends(t, a, b, kept),
                    active.memory != nullptr ? active.damping : landing_damping(active),
                    active.memory != nullptr ? active.memory->begin : 0});
  }
  memory_ = std::move(next);
  found_active_ = false;
  last_q_.assign(s.q.begin(), s.q.end());
  last_v_.assign(s.v.begin(), s.v.end());
}

// ---- Forces

void RigidContact::residual(const StateView& s, Span f) {
  move_to(s.q, s.v);
  for (const Active& active : find_active()) {
    const TouchForce force = force_of(active, nullptr);
    for (const int side : {0, 1}) {
      const Index body = body_of(active.pair[at(side)]);
      if (bodies_[slot(body)] == nullptr) continue;
      const auto& coordinates = bodies_[slot(body)]->coordinates();
      const Vec3 moment = motion_[slot(body)].axes.transpose() * force.wrench.segment<3>(6 * side + 3);
      for (int k = 0; k < 3; ++k) {
        f[slot(coordinates[at(k)])] -= force.wrench[6 * side + k];
        f[slot(coordinates[at(3 + k)])] -= moment[k];
      }
    }
  }
}

void RigidContact::add_block(const Mat12& k, Index body_row, Index body_column, int row, int column,
                             Span w_values) const {
  const auto it = places_.find({body_row, body_column});
  if (it == places_.end()) return;  // not in the pattern yet: Newton does without
  const int rows = reach_[slot(body_row)], columns = reach_[slot(body_column)];
  for (int c = 0; c < columns; ++c) {
    double* values = &w_values[at(it->second[at(c)])];
    for (int r = 0; r < rows; ++r) values[r] += k(6 * row + r, 6 * column + c);
  }
}

void RigidContact::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  if (weights.v == 0 && weights.q == 0) return;
  move_to(s.q, s.v);
  for (const Active& active : find_active()) {
    TouchTangent t;
    const TouchForce force = force_of(active, &t);
    const std::array<Index, 2> bodies = {body_of(active.pair[0]), body_of(active.pair[1])};
    const Mat12 k =
        coordinate_tangent(force, t, weights.q, weights.v, motion_[slot(bodies[0])], motion_[slot(bodies[1])]);
    for (const int row : {0, 1})
      for (const int column : {0, 1})
        if (bodies_[slot(bodies[at(row)])] != nullptr && bodies_[slot(bodies[at(column)])] != nullptr)
          add_block(k, bodies[at(row)], bodies[at(column)], row, column, w_values);
  }
}

}  // namespace espalier::dynamics::contact
