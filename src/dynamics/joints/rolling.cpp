#include "dynamics/joints/rolling.hpp"

#include "base/at.hpp"

namespace espalier::dynamics {

namespace {

// With the normal n and the axis a (of a wheel z_B; of an edge the direction that it glides along, x_B), s = n . a and
// w = sqrt(1 - s^2): the wheel's upward radius u = (n - s a) / w, the place of contact P = r_B - radius u - rim n, and
//   wheel: longitudinal l = a x n / w    edge: l = (a - s n) / w    ball: l = x_A    lateral = n x l.
class Contact {
 public:
  Contact(const RollingShape& shape, const FrameMotion& a, const FrameMotion& b)
      : shape_(shape), a_(a), b_(b), n_(a.rot.col(2)), axis_(b.rot.col(shape.edge ? 0 : 2)), l_(a.rot.col(0)) {
    arm_ = -shape.rim * n_;
    if (shape.directed()) {
      constexpr double kFlat = 1e-6;
      s_ = n_.dot(axis_);
      w_ = n_.cross(axis_).norm();
      if (!(w_ > kFlat))
        throw Error(StatusCode::singular,
                    shape.edge
                        ? "a skate stands upright on its plane and has no direction to glide to: x of frame b must "
                          "not be the normal of the plane, z of frame a"
                        : "a wheel lies flat on its plane and touches it everywhere: its axle, z of frame b, must "
                          "not be the normal of the plane, z of frame a");
      l_ = shape.edge ? Vec3((axis_ - s_ * n_) / w_) : Vec3(axis_.cross(n_) / w_);
      up_ = (n_ - s_ * axis_) / w_;
      if (!shape.edge) arm_ -= shape.radius * up_;
    }
  }

  [[nodiscard]] Vec3 direction(RollingDirection d) const {
    if (d == RollingDirection::normal) return n_;
    return d == RollingDirection::longitudinal ? l_ : Vec3(n_.cross(l_));
  }
  [[nodiscard]] Vec3 place() const { return b_.r + arm_; }
  [[nodiscard]] Row12 gradient(RollingDirection d) const {
    const Vec3 e = direction(d);
    return row(-e, -(place() - a_.r).cross(e), e, arm_.cross(e));
  }
  /// Change of the gradient with the twists of the frames.
  [[nodiscard]] Row12 change(RollingDirection d, const Vec3& va, const Vec3& wa, const Vec3& vb, const Vec3& wb) const {
    const Vec3 dn = wa.cross(n_), da = wb.cross(axis_);
    Vec3 dl = wa.cross(l_), darm = -shape_.rim * dn;
    if (shape_.directed()) {
      const double ds = dn.dot(axis_) + n_.dot(da), dw = -s_ * ds / w_;
      dl = shape_.edge ? Vec3((da - ds * n_ - s_ * dn - dw * l_) / w_)
                       : Vec3((da.cross(n_) + axis_.cross(dn) - dw * l_) / w_);
      if (!shape_.edge) darm -= shape_.radius / w_ * (dn - ds * axis_ - s_ * da - dw * up_);
    }
    const Vec3 e = direction(d), to_a = place() - a_.r, dto_a = vb + darm - va;
    const Vec3 de = d == RollingDirection::normal         ? dn
                    : d == RollingDirection::longitudinal ? dl
                                                          : Vec3(dn.cross(l_) + n_.cross(dl));
    return row(-de, -dto_a.cross(e) - to_a.cross(de), de, darm.cross(e) + arm_.cross(de));
  }

 private:
  static Row12 row(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    return {a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2], d[0], d[1], d[2]};
  }

  const RollingShape& shape_;
  const FrameMotion &a_, &b_;
  Vec3 n_, axis_, l_, up_ = Vec3::Zero(), arm_;
  double s_ = 0, w_ = 1;
};

}  // namespace

void evaluate(const RollingShape& shape, RollingDirection direction, const FrameMotion& a, const FrameMotion& b,
              bool rates, RelativeValue& out) {
  const Contact contact(shape, a, b);
  out.value = direction == RollingDirection::normal ? (contact.place() - a.r).dot(a.rot.col(2)) : 0;
  out.c = contact.gradient(direction);
  out.curvature = 0;
  if (!rates) return;
  const Row12 c = contact.change(direction, a.vel, a.omega, b.vel, b.omega);
  const Eigen::Map<const Eigen::Matrix<double, 4, 3, Eigen::RowMajor>> rate(c.data());
  out.curvature = rate.row(0).dot(a.vel) + rate.row(1).dot(a.omega) + rate.row(2).dot(b.vel) + rate.row(3).dot(b.omega);
}

void add_curvature(const RollingShape& shape, RollingDirection direction, const FrameMotion& a, const FrameMotion& b,
                   double factor, Mat12& k) {
  const Contact contact(shape, a, b);
  for (Eigen::Index e = 0; e < 12; ++e) {
    const auto part = [e](Eigen::Index block) { return e / 3 == block ? Vec3::Unit(e % 3) : Vec3(Vec3::Zero()); };
    const Row12 c = contact.change(direction, part(0), part(1), part(2), part(3));
    for (Eigen::Index i = 0; i < 12; ++i) k(i, e) += factor * c[at(i)];
  }
}

Vec3 rolling_contact(const RollingShape& shape, const FrameMotion& a, const FrameMotion& b) {
  return Contact(shape, a, b).place();
}

}  // namespace espalier::dynamics
