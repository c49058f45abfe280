#include "dynamics/contact/face_touch.hpp"

namespace espalier::dynamics::contact {

FaceTouch::FaceTouch(const FacePlace& point, int point_nodes, const SurfaceFace& second,
                     const std::array<double, 2>& xi)
    : point_(point),
      face_(second),
      xi_(xi),
      first_(point_nodes),
      second_(second.count()),
      tangents_(second.is_line() ? 1 : 2),
      opposite_(face_place(second, xi.data())),
      normal_(second.is_line() ? (point.x - opposite_.x).normalized() : opposite_.normal_area().normalized()),
      distance_(normal_.dot(point.x - opposite_.x)),
      gap_(distance_ - second.radius) {}

VecX FaceTouch::share(const Vec3& force) const {
  VecX f(coordinates());
  for (int a = 0; a < first_; ++a) f.segment<3>(3 * a) = point_.value[static_cast<std::size_t>(a)] * force;
  for (int a = 0; a < second_; ++a)
    f.segment<3>(3 * (first_ + a)) = -opposite_.value[static_cast<std::size_t>(a)] * force;
  return f;
}

void FaceTouch::differentiate() {
  const auto& t = opposite_.tangent;
  const auto bends = face_bends(face_, xi_.data());
  bend_ << normal_.dot(bends[0]), normal_.dot(bends[1]), normal_.dot(bends[1]), normal_.dot(bends[2]);
  Eigen::Matrix2d metric;
  metric << t[0].dot(t[0]), t[0].dot(t[1]), t[0].dot(t[1]), t[1].dot(t[1]);
  gap_by_ = share(normal_);
  if (tangents_ == 1) {
    metric(1, 1) = 1;  // the second tangent is none: everything that it multiplies is zero
    across_ = normal_.cross(t[0]).normalized();
    sideways_ = share(across_);
  }
  raised_ = metric.inverse();
  for (std::size_t d = 0; d < 2; ++d) {
    along_[d] = share(t[d]);
    turn_[d] = VecX::Zero(coordinates());
    for (int a = 0; a < second_; ++a)
      turn_[d].segment<3>(3 * (first_ + a)) = opposite_.slope[d][static_cast<std::size_t>(a)] * normal_;
  }
  const Eigen::Matrix2d inverse = (metric - distance_ * bend_).inverse();
  for (int d = 0; d < 2; ++d)
    place_by_[static_cast<std::size_t>(d)] =
        inverse(d, 0) * (along_[0] + distance_ * turn_[0]) + inverse(d, 1) * (along_[1] + distance_ * turn_[1]);
  for (int d = 0; d < 2; ++d)
    bent_[static_cast<std::size_t>(d)] =
        turn_[static_cast<std::size_t>(d)] + bend_(d, 0) * place_by_[0] + bend_(d, 1) * place_by_[1];
}

MatX FaceTouch::gap_by_twice() const {
  MatX h = MatX::Zero(coordinates(), coordinates());
  for (int d = 0; d < tangents_; ++d) {
    const auto at = static_cast<std::size_t>(d);
    h.noalias() -= (raised_(d, 0) * along_[0] + raised_(d, 1) * along_[1]) * bent_[at].transpose();
    h.noalias() -= turn_[at] * place_by_[at].transpose();
  }
  if (tangents_ == 1) h.noalias() += sideways_ * sideways_.transpose() / distance_;
  return h;
}

// n stays normal to the tangents: dn = -t^a (n . dt_a + k_ab dxi^b).
Mat3X FaceTouch::normal_by() const {
  Mat3X n = Mat3X::Zero(3, coordinates());
  for (int d = 0; d < tangents_; ++d) {
    const Vec3 dual = raised_(d, 0) * opposite_.tangent[0] + raised_(d, 1) * opposite_.tangent[1];
    n.noalias() -= dual * bent_[static_cast<std::size_t>(d)].transpose();
  }
  if (tangents_ == 1) n.noalias() += across_ * sideways_.transpose() / distance_;
  return n;
}

Mat3X FaceTouch::slip_by() const {
  Mat3X s = Mat3X::Zero(3, coordinates());
  for (int a = 0; a < first_; ++a)
    s.block<3, 3>(0, 3 * a).diagonal().array() = point_.value[static_cast<std::size_t>(a)];
  for (int a = 0; a < second_; ++a)
    s.block<3, 3>(0, 3 * (first_ + a)).diagonal().array() = -opposite_.value[static_cast<std::size_t>(a)];
  return s;
}

Mat3X FaceTouch::lever_by() const {
  Mat3X x = slip_by();
  add_shift(opposite_.tangent, 1, x);
  return x;
}

Mat3X FaceTouch::slope_by() const {
  Mat3X t = Mat3X::Zero(3, coordinates());
  for (int a = 0; a < second_; ++a)
    t.block<3, 3>(0, 3 * (first_ + a)).diagonal().array() = opposite_.slope[0][static_cast<std::size_t>(a)];
  return t;
}

Mat3X FaceTouch::tangent_by() const {
  const auto bends = face_bends(face_, xi_.data());
  Mat3X t = slope_by();
  add_shift({bends[0], bends[1]}, -1, t);
  return t;
}

void FaceTouch::add_shift(const std::array<Vec3, 2>& w, double factor, Mat3X& out) const {
  for (std::size_t d = 0; d < 2; ++d) out.noalias() -= factor * w[d] * place_by_[d].transpose();
}

MatX FaceTouch::share_by(const Vec3& force) const {
  MatX k = MatX::Zero(coordinates(), coordinates());
  for (int a = 0; a < second_; ++a)
    for (std::size_t d = 0; d < 2; ++d)
      k.middleRows<3>(3 * (first_ + a)).noalias() -=
          opposite_.slope[d][static_cast<std::size_t>(a)] * force * place_by_[d].transpose();
  return k;
}

}  // namespace espalier::dynamics::contact
