#include "dynamics/forces/sliding_friction.hpp"

#include "dynamics/bodies/rotation.hpp"

namespace espalier::dynamics {
namespace {

using Mat3x12 = Eigen::Matrix<double, 3, 12>;

class SlidingFriction final : public FrameForce {
 public:
  SlidingFriction(std::string name, FramePtr a, FramePtr b, std::shared_ptr<const PointFunction> surface,
                  const FrictionCurve& curve, double viscous)
      : FrameForce(std::move(name), std::move(a), std::move(b)),
        surface_(std::move(surface)),
        curve_(checked_curve(curve)),
        viscous_(viscous) {}

 protected:
  [[nodiscard]] Vec12 law(const Pair& p) const override {
    const Slip s(*this, p);
    return wrench(s, -(p.inputs[0] * s.mu.phi + viscous_) * s.along);
  }

  [[nodiscard]] Vec12 law_by_input(const Pair& p, std::size_t /*i*/) const override {
    const Slip s(*this, p);
    return wrench(s, -s.mu.phi * s.along);
  }

  // dv = dv_B - dv_A + d~ dw_A - w_A~ dd,  dn = G dd + (G d~ - n~) dphi_A,  dv_t = (1 - n n^T) dv - (n.v + n v^T) dn
  void law_derivatives(const Pair& p, Mat12& k, Mat12& d) const override {
    const Slip s(*this, p);
    const double load = p.inputs[0];
    const Mat3 by_along =
        -(load * s.mu.phi + viscous_) * Mat3::Identity() - load * s.mu.slope * s.along * s.along.transpose();
    const Mat3 tangential = Mat3::Identity() - s.n * s.n.transpose(), arm = skew(s.d);
    const Mat3 by_n = s.n.dot(s.v) * Mat3::Identity() + s.n * s.v.transpose();
    const Mat3 by_place = -tangential * skew(p.a.omega) - by_n * s.bend;
    Mat3x12 by_motion = Mat3x12::Zero(), by_twist = Mat3x12::Zero();
    by_motion.block<3, 3>(0, 0) = -by_place;
    by_motion.block<3, 3>(0, 3) = -by_n * (s.bend * arm - skew(s.n));
    by_motion.block<3, 3>(0, 6) = by_place;
    by_twist.block<3, 3>(0, 0) = -tangential;
    by_twist.block<3, 3>(0, 3) = tangential * arm;
    by_twist.block<3, 3>(0, 6) = tangential;
    add(by_along * by_motion, arm, k);
    add(by_along * by_twist, arm, d);
    const Mat3 force = skew(-(load * s.mu.phi + viscous_) * s.along);  // moment on A: -d x F
    k.block<3, 3>(3, 0) -= force;
    k.block<3, 3>(3, 6) += force;
  }

 private:
  struct Slip {
    Vec3 d, n, v, along;
    Mat3 bend;  // of the normal by the place
    FrictionQuotient mu;
    Slip(const SlidingFriction& own, const Pair& p) : d(p.b.r - p.a.r) {
      const Mat3& axes = p.a.rot;
      const PointFunction::At at = own.surface_->at(axes.transpose() * d);
      const double size = at.gradient.norm();
      const Vec3 g = at.gradient / size;
      n = axes * g;
      bend = axes * (Mat3::Identity() - g * g.transpose()) * at.hessian * axes.transpose() / size;
      v = p.b.vel - p.a.vel - p.a.omega.cross(d);
      along = v - n.dot(v) * n;
      mu = friction_quotient(own.curve_, along.norm());
    }
  };

  static Vec12 wrench(const Slip& s, const Vec3& force) {
    Vec12 w;
    w << -force, -s.d.cross(force), force, Vec3::Zero();
    return w;
  }
  static void add(const Mat3x12& force, const Mat3& arm, Mat12& to) {
    to.middleRows<3>(0) -= force;
    to.middleRows<3>(3) -= arm * force;
    to.middleRows<3>(6) += force;
  }

  std::shared_ptr<const PointFunction> surface_;
  FrictionCurve curve_;
  double viscous_;
};

}  // namespace

std::unique_ptr<FrameForce> sliding_friction(std::string name, FramePtr a, FramePtr b,
                                             std::shared_ptr<const PointFunction> surface, const FrictionCurve& curve,
                                             double viscous) {
  return std::make_unique<SlidingFriction>(std::move(name), std::move(a), std::move(b), std::move(surface), curve,
                                           viscous);
}

}  // namespace espalier::dynamics
