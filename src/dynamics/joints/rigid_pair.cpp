#include "dynamics/joints/rigid_pair.hpp"

#include <utility>

#include "base/at.hpp"
#include "dynamics/elements/dispatch.hpp"

namespace espalier::dynamics {

namespace {

struct Pose {
  Mat3 rot;  // body axes to global axes
  Vec3 x;    // origin of the body
  Vec3 r;    // the point
};

ESPALIER_INLINE Vec3 vec3(const double* x) { return {x[0], x[1], x[2]}; }

ESPALIER_INLINE Pose pose_of(const RigidPair::Side& side, const double* q) {
  if (side.q < 0) return {Mat3::Identity(), Vec3::Zero(), side.point};
  const double* own = q + side.q;
  Pose p{rotation_matrix({own[3], own[4], own[5], own[6]}), vec3(own), {}};
  p.r = p.x + p.rot * side.point;
  return p;
}

// Velocities of a side and the acceleration of its point while all accelerations are zero, in global axes.
struct Rates {
  Vec3 vel, omega, acc;
};

ESPALIER_INLINE Rates rates_of(const RigidPair::Side& side, const Pose& pose, const double* v) {
  if (side.v < 0) return {Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
  const Vec3 omega = pose.rot * vec3(v + side.v + 3);
  const Vec3 turning = omega.cross(pose.r - pose.x);
  return {vec3(v + side.v) + turning, omega, omega.cross(turning)};
}

// Second derivative of a unit vector fixed to a side that turns at a constant rate.
ESPALIER_INLINE Vec3 second(const Vec3& omega, const Vec3& axis) { return omega.cross(omega.cross(axis)); }

// Second derivative of the value while all accelerations are zero, which is (d/dt gradient) v.
ESPALIER_INLINE double curvature_of(const RigidPair::Row& row, const Pose& a, const Pose& b, const Rates& va,
                                    const Rates& vb) {
  if (row.kind == Relative::global) return vb.acc[row.axis] - va.acc[row.axis];
  const Vec3 axis = a.rot * row.a, rate = va.omega.cross(axis);
  if (row.kind == Relative::along) {
    return second(va.omega, axis).dot(b.r - a.r) + 2 * rate.dot(vb.vel - va.vel) + axis.dot(vb.acc - va.acc);
  }
  const Vec3 other = b.rot * row.b;
  return second(va.omega, axis).dot(other) + 2 * rate.dot(vb.omega.cross(other)) + axis.dot(second(vb.omega, other));
}

ESPALIER_INLINE void set_gradient(double* to, const Vec3& translation, const Vec3& rotation) {
  for (int k = 0; k < 3; ++k) {
    to[k] = translation[k];
    to[3 + k] = rotation[k];
  }
}

ESPALIER_CLONES void evaluate_rows(const RigidPair::Side& side_a, const RigidPair::Side& side_b,
                                   const std::vector<RigidPair::Row>& rows, bool axes, const double* q, const double* v,
                                   std::size_t width, const RigidPair::Results& out) {
  const Pose a = pose_of(side_a, q), b = pose_of(side_b, q);
  const Vec3 d = b.r - a.r;
  Mat3 c = Mat3::Identity();
  Vec3 seen = Vec3::Zero();  // of A: R_A^T (r_B - x_A)
  if (axes) {
    c.noalias() = a.rot.transpose() * b.rot;
    seen.noalias() = a.rot.transpose() * Vec3(b.r - a.x);
  }
  const bool free_a = side_a.v >= 0, free_b = side_b.v >= 0;
  double* ga = out.gradient;
  for (std::size_t r = 0; r < rows.size(); ++r, ga += out.gradient == nullptr ? 0 : width) {
    const RigidPair::Row& row = rows[r];
    double* gb = free_a && ga != nullptr ? ga + 6 : ga;
    double value = 0;
    if (row.kind == Relative::global) {
      value = d[row.axis];
      if (out.gradient != nullptr) {
        Vec3 e = Vec3::Zero();
        e[row.axis] = 1;
        if (free_a) set_gradient(ga, -e, Vec3(a.rot.row(row.axis)).cross(side_a.point));
        if (free_b) set_gradient(gb, e, side_b.point.cross(Vec3(b.rot.row(row.axis))));
      }
    } else if (row.kind == Relative::along) {
      const Vec3 axis = a.rot * row.a;
      value = axis.dot(d);
      if (out.gradient != nullptr) {
        if (free_a) set_gradient(ga, -axis, row.a.cross(seen));
        if (free_b) set_gradient(gb, axis, side_b.point.cross(Vec3(c.transpose() * row.a)));
      }
    } else {
      const Vec3 turned = c * row.b;
      value = row.a.dot(turned);
      if (out.gradient != nullptr) {
        if (free_a) set_gradient(ga, Vec3::Zero(), row.a.cross(turned));
        if (free_b) set_gradient(gb, Vec3::Zero(), row.b.cross(Vec3(c.transpose() * row.a)));
      }
    }
    if (out.value != nullptr) out.value[r] = value;
  }
  if (out.curvature == nullptr) return;
  const Rates va = rates_of(side_a, a, v), vb = rates_of(side_b, b, v);
  for (std::size_t r = 0; r < rows.size(); ++r) out.curvature[r] = curvature_of(rows[r], a, b, va, vb);
}

// K(row .. row + 2, col .. col + 2) += factor * m, K 12 x 12 column by column.
ESPALIER_INLINE void add(double* k, int row, int col, double factor, const Mat3& m) {
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) k[12 * (col + j) + row + i] += factor * m(i, j);
  }
}

// x~ y~ = y x^T - (x . y) 1
ESPALIER_INLINE Mat3 twice(const Vec3& x, const Vec3& y) {
  Mat3 m = y * x.transpose();
  m.diagonal().array() -= x.dot(y);
  return m;
}

// x~ M
ESPALIER_INLINE Mat3 cross_columns(const Vec3& x, const Mat3& m) {
  Mat3 result;
  for (int j = 0; j < 3; ++j) result.col(j) = x.cross(Vec3(m.col(j)));
  return result;
}

// M x~ = -(x~ M^T)^T
ESPALIER_INLINE Mat3 columns_cross(const Mat3& m, const Vec3& x) {
  return -cross_columns(x, m.transpose()).transpose();
}

constexpr int kTurnA = 3, kPlaceB = 6, kTurnB = 9;

// Derivatives of the gradients, for d/dt C = C w_B~ - w_A~ C:
//   dot:    d(a x C b) = a~ (C b)~ dA - a~ C b~ dB,  d(b x C^T a) = b~ (C^T a)~ dB - b~ C^T a~ dA
ESPALIER_INLINE void stiffness_of_dot(const RigidPair::Row& row, const Mat3& c, double lambda, double* k) {
  const Mat3 mixed = cross_columns(row.a, columns_cross(c, row.b));
  add(k, kTurnA, kTurnA, lambda, twice(row.a, c * row.b));
  add(k, kTurnA, kTurnB, -lambda, mixed);
  add(k, kTurnB, kTurnA, -lambda, mixed.transpose());
  add(k, kTurnB, kTurnB, lambda, twice(row.b, c.transpose() * row.a));
}

//   along, with p = R_A^T (r_B - x_A):
//   d(R_A a)     = -R_A a~ dA
//   d(a x p)     = a~ (p~ dA + R_A^T (dx_B - dx_A) - C s_B~ dB)
//   d(s_B x C^T a) = s_B~ ((C^T a)~ dB - C^T a~ dA)
ESPALIER_INLINE void stiffness_of_along(const RigidPair::Row& row, const Pose& a, const Mat3& c, const Vec3& p,
                                        const Vec3& s_b, double lambda, double* k) {
  const Mat3 turn = cross_columns(row.a, a.rot.transpose());  // a~ R_A^T = (-R_A a~)^T
  const Mat3 mixed = cross_columns(row.a, columns_cross(c, s_b));
  add(k, 0, kTurnA, -lambda, turn.transpose());
  add(k, kPlaceB, kTurnA, lambda, turn.transpose());
  add(k, kTurnA, 0, -lambda, turn);
  add(k, kTurnA, kPlaceB, lambda, turn);
  add(k, kTurnA, kTurnA, lambda, twice(row.a, p));
  add(k, kTurnA, kTurnB, -lambda, mixed);
  add(k, kTurnB, kTurnA, -lambda, mixed.transpose());
  add(k, kTurnB, kTurnB, lambda, twice(s_b, c.transpose() * row.a));
}

ESPALIER_CLONES void local_stiffness_of(const RigidPair::Side& side_a, const RigidPair::Side& side_b,
                                        const std::vector<RigidPair::Row>& rows, const double* q, const double* lambda,
                                        double* k) {
  const Pose a = pose_of(side_a, q), b = pose_of(side_b, q);
  const Mat3 c = a.rot.transpose() * b.rot;
  const Vec3 seen = a.rot.transpose() * Vec3(b.r - a.x);
  Vec3 force = Vec3::Zero();  // of all `global` rows, on side B
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const RigidPair::Row& row = rows[r];
    if (row.kind == Relative::global) force[row.axis] += lambda[r];
    if (row.kind == Relative::dot) stiffness_of_dot(row, c, lambda[r], k);
    if (row.kind == Relative::along) stiffness_of_along(row, a, c, seen, side_b.point, lambda[r], k);
  }
  // global: d(s x R^T f) = s~ (R^T f)~ dtheta, with f on B and -f on A
  add(k, kTurnA, kTurnA, -1, twice(side_a.point, a.rot.transpose() * force));
  add(k, kTurnB, kTurnB, 1, twice(side_b.point, b.rot.transpose() * force));
}

}  // namespace

RigidPair::RigidPair(const Side& a, const Side& b, std::vector<Row> rows) : sides_{a, b}, rows_(std::move(rows)) {
  for (const Row& row : rows_) {
    has_axes_ = has_axes_ || row.kind != Relative::global;
    has_along_ = has_along_ || row.kind == Relative::along;
  }
}

void RigidPair::evaluate(ConstSpan q, ConstSpan v, const Results& out) const {
  evaluate_rows(sides_[0], sides_[1], rows_, has_axes_, q.data(), v.data(), width(), out);
}

void RigidPair::bind(const SparsePattern& w) {
  targets_.clear();
  for (int col = 0; col < 12; ++col) {
    for (int row = 0; row < 12; ++row) {
      const Side &of_row = sides_[row < 6 ? 0 : 1], &of_col = sides_[col < 6 ? 0 : 1];
      if (of_row.v < 0 || of_col.v < 0) continue;
      const bool turns_both = row % 6 >= 3 && col % 6 >= 3, turns_one = row % 6 >= 3 || col % 6 >= 3;
      const bool used = turns_both ? has_axes_ || of_row.v == of_col.v : has_along_ && turns_one;
      if (!used) continue;
      const Offset entry = find_entry(w, of_col.v + col % 6, of_row.v + row % 6);
      targets_.push_back({static_cast<std::uint8_t>(12 * col + row), at(entry)});
    }
  }
}

void RigidPair::add_stiffness(ConstSpan q, const double* lambda, double scale, Span w_values) const {
  std::array<double, 144> k{};
  local_stiffness_of(sides_[0], sides_[1], rows_, q.data(), lambda, k.data());
  for (const Target& t : targets_) w_values[t.w] += scale * k[t.local];
}

}  // namespace espalier::dynamics
