// Forces of contact of solids, and their tangents.
#include <algorithm>

#include "dynamics/contact/solid_contact.hpp"

namespace espalier::dynamics::contact {

std::vector<NodeRows> SolidContact::rigid_rows() const {
  if (shape_.body == nullptr) return {};
  const auto& c = shape_.body->coordinates();
  return {{c[0]}, {c[3]}};
}

SolidContact::Local SolidContact::local_rigid(const Acting& acting, const FacePlace& at,
                                              const TangentWeights* weights) const {
  const std::size_t k = acting.point;
  const double w = points_[k].weight;
  const SurfaceFace& face = first_.face(points_[k].spot.face);
  BodyMotion point;
  point.origin = at.x;
  point.velocity = velocity_of_point(k, at);
  TouchTangent tangent;
  const TouchForce force = touch_force(law_, law_.damping, acting.touch, shape_motion_, point,
                                       memory_[k].touched ? &memory_[k].ends : nullptr, weights ? &tangent : nullptr);
  Local local;
  local.rows = face.rows;
  const Eigen::Index of_face = 3 * face.count();
  for (const NodeRows& r : rigid_rows()) local.rows.push_back(r);
  // [6 coordinates of the shape's body; 3 of the point] from all of them
  MatX spread = MatX::Zero(9, 3 * static_cast<Eigen::Index>(local.rows.size()));
  for (int a = 0; a < face.count(); ++a)
    spread.block<3, 3>(6, 3 * a).diagonal().array() = at.value[static_cast<std::size_t>(a)];
  if (shape_.body != nullptr) spread.block<6, 6>(0, of_face).setIdentity();
  Eigen::Matrix<double, 9, 1> f;
  f << force.wrench.head<3>(), shape_motion_.axes.transpose() * force.wrench.segment<3>(3), force.wrench.segment<3>(6);
  local.f = -w * (spread.transpose() * f);
  if (weights != nullptr) {
    const Mat12 full = coordinate_tangent(force, tangent, weights->q, weights->v, shape_motion_, point);
    local.k = w * (spread.transpose() * full.topLeftCorner<9, 9>() * spread);
  }
  return local;
}

SolidContact::Local SolidContact::local_solid(const Acting& acting, const FacePlace& at,
                                              const TangentWeights* weights) const {
  const std::size_t k = acting.point;
  const SurfaceFace &own = first_.face(points_[k].spot.face), &other = second_->face(acting.opposite->face);
  FaceTouch touch(at, own.count(), other, acting.opposite->xi);
  Local local;
  const auto append = [&](const SurfaceFace& face) {
    local.rows.insert(local.rows.end(), face.rows.begin(), face.rows.end());
  };
  append(own);
  append(other);
  const bool anchored = law_.rubs() && memory_[k].touched;
  if (anchored) append(second_->face(memory_[k].anchor.face));
  const double w = points_[k].weight;
  local.f = VecX::Zero(3 * static_cast<Eigen::Index>(local.rows.size()));
  local.f.head(touch.coordinates()) = -w * touch.share(acting.normal.force * touch.normal() + acting.friction.force);
  if (weights != nullptr)
    local.k =
        -w * tangent_solid(acting, at, touch, *weights, anchored ? second_->face(memory_[k].anchor.face).count() : 0);
  return local;
}

/// Derivative of the share of the forces: weights.q by places, weights.v by velocities.
MatX SolidContact::tangent_solid(const Acting& acting, const FacePlace& at, FaceTouch& touch,
                                 const TangentWeights& weights, int anchor_nodes) const {
  touch.differentiate();
  const SurfaceFace& other = second_->face(acting.opposite->face);
  const int nz = touch.coordinates(), all = nz + 3 * anchor_nodes;
  const Vec3& n = touch.normal();
  const VecX& gap_by = touch.gap_by();
  const Mat3X slip_by = touch.slip_by(), normal_by = touch.normal_by();
  Vec3 relative = velocity_of_point(acting.point, at);
  std::array<Vec3, 2> rate_of_tangent = {Vec3::Zero(), Vec3::Zero()};
  for (std::size_t a = 0; a < other.v.size(); ++a) {
    relative -= touch.opposite().value[a] * other.v[a];
    for (std::size_t d = 0; d < 2; ++d) rate_of_tangent[d] += touch.opposite().slope[d][a] * other.v[a];
  }
  Mat3X relative_by = Mat3X::Zero(3, nz);
  touch.add_shift(rate_of_tangent, 1, relative_by);
  const NormalForce& normal = acting.normal;
  VecX normal_q = VecX::Zero(all), normal_v = VecX::Zero(all);
  normal_q.head(nz) = -normal.by_penetration * gap_by -
                      normal.by_rate * (normal_by.transpose() * relative + relative_by.transpose() * n);
  normal_v.head(nz) = -normal.by_rate * gap_by;
  MatX k = MatX::Zero(all, all);
  k.topRows(nz) += gap_by * (weights.q * normal_q + weights.v * normal_v).transpose();
  if (weights.q != 0) k.topLeftCorner(nz, nz) += weights.q * normal.force * touch.gap_by_twice();
  if (!law_.rubs()) return k;

  const FrictionForce& f = acting.friction;
  const Mat3 in_plane = Mat3::Identity() - n * n.transpose();
  const auto projected = [&](const Vec3& y, const Mat3X& y_by) {
    Mat3X out = in_plane * y_by;
    out.leftCols(nz) -= n.dot(y) * normal_by + n * (y.transpose() * normal_by);
    return out;
  };
  Mat3X rate_by = Mat3X::Zero(3, all), rate_v = Mat3X::Zero(3, all);
  rate_by.leftCols(nz) = relative_by;
  rate_v.leftCols(nz) = in_plane * slip_by;
  if (other.is_line()) {
    const Vec3 bend = face_bends(other, other.v, acting.opposite->xi.data())[0];
    const LineTurn turn = line_turn(touch.opposite().tangent[0], rate_of_tangent[0], at.x - touch.opposite().x);
    relative += turn.gain;
    rate_by.leftCols(nz) += turn.by_tangent * touch.tangent_by() +
                            turn.by_rate * bend * touch.place_by()[0].transpose() + turn.by_lever * touch.lever_by();
    rate_v.leftCols(nz) += turn.by_rate * touch.slope_by();
  }
  const Mat3X rate_q = projected(relative, rate_by);
  Mat3X trial = law_.tangential_damping * rate_q;
  if (anchor_nodes > 0) {
    const FaceSpot& anchor = memory_[acting.point].anchor;
    const SurfaceFace& held = second_->face(anchor.face);
    const FacePlace hold = face_place(held, anchor.xi.data());
    Mat3X between_by = Mat3X::Zero(3, all);
    const int own = first_.face(points_[acting.point].spot.face).count();
    between_by.leftCols(3 * own) = slip_by.leftCols(3 * own);
    const Mat3 arm_by = held.is_line() ? memory_[acting.point].hold.arm_by(hold.tangent[0]) : Mat3(Mat3::Zero());
    for (int a = 0; a < anchor_nodes; ++a) {
      const auto node = static_cast<std::size_t>(a);
      between_by.block<3, 3>(0, nz + 3 * a) = -hold.value[node] * Mat3::Identity() - hold.slope[0][node] * arm_by;
    }
    trial += law_.tangential_stiffness * projected(from_spring_end(acting.point, at), between_by);
  }
  const Mat3X force_by = f.by_trial * (weights.q * trial + weights.v * law_.tangential_damping * rate_v) +
                         f.by_rate * (weights.q * rate_q + weights.v * rate_v) +
                         f.by_normal * (weights.q * normal_q + weights.v * normal_v).transpose();
  k.topRows(nz) += slip_by.transpose() * force_by;
  if (weights.q != 0) k.topLeftCorner(nz, nz) += weights.q * touch.share_by(f.force);
  return k;
}

void SolidContact::residual(const StateView& s, Span f) {
  move_to(s.q, s.v);
  for_acting([&](const Acting& acting, const FacePlace& at) {
    const Local local = second_ ? local_solid(acting, at, nullptr) : local_rigid(acting, at, nullptr);
    for (std::size_t n = 0; n < local.rows.size(); ++n)
      for (std::size_t i = 0; i < 3; ++i) {
        const NodeRows& node = local.rows[n];
        const double part = local.f[static_cast<Eigen::Index>(3 * n + i)];
        f[static_cast<std::size_t>(node.position) + i] += part;
        if (node.director >= 0) f[static_cast<std::size_t>(node.director) + i] += node.lift * part;
      }
  });
}

void SolidContact::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  if (weights.v == 0 && weights.q == 0) return;
  move_to(s.q, s.v);
  // Points of one pair of faces follow each other: their tangents are summed up before they are put in their places.
  Local sum;
  for_acting([&](const Acting& acting, const FacePlace& at) {
    Local local = second_ ? local_solid(acting, at, &weights) : local_rigid(acting, at, &weights);
    if (local.rows == sum.rows) {
      sum.k += local.k;
      return;
    }
    add_local(sum, w_values);
    sum = std::move(local);
  });
  add_local(sum, w_values);
}

void SolidContact::add_local(const Local& local, Span w_values) const {
  // factor times three entries of a column of the tangent
  const auto add = [&](Index column, Index first, double factor, const double* k) {
    const auto begin = w_->ind.begin() + w_->ptr[static_cast<std::size_t>(column)],
               end = w_->ind.begin() + w_->ptr[static_cast<std::size_t>(column) + 1];
    const auto it = std::lower_bound(begin, end, first);
    if (it == end || *it != first) return;  // not in the pattern yet
    double* values = &w_values[static_cast<std::size_t>(it - w_->ind.begin())];
    for (int i = 0; i < 3; ++i) values[i] += factor * k[i];
  };
  const auto add_rows = [&](Index column, double factor, Eigen::Index c) {
    for (std::size_t r = 0; r < local.rows.size(); ++r) {
      const NodeRows& node = local.rows[r];
      const double* k = &local.k(static_cast<Eigen::Index>(3 * r), c);
      add(column, node.position, factor, k);
      if (node.director >= 0) add(column, node.director, factor * node.lift, k);
    }
  };
  for (std::size_t n = 0; n < local.rows.size(); ++n)
    for (Index i = 0; i < 3; ++i) {
      const NodeRows& node = local.rows[n];
      const auto c = static_cast<Eigen::Index>(3 * n) + i;
      add_rows(node.position + i, 1, c);
      if (node.director >= 0) add_rows(node.director + i, node.lift, c);
    }
}

}  // namespace espalier::dynamics::contact
