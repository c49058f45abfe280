// Springs, bushings and loads.
#include <stdexcept>

#include "dynamics/bodies/rotation.hpp"
#include "dynamics/forces/frame_force.hpp"

namespace espalier::dynamics {

namespace {

Vec12 twist(const FrameMotion& a, const FrameMotion& b) {
  Vec12 w;
  w << a.vel, a.omega, b.vel, b.omega;
  return w;
}

// Wrench -c s(g, g'), c = dg/dx.
class CoordinateForce final : public FrameForce {
 public:
  CoordinateForce(std::string name, FramePtr a, FramePtr b, Relative kind, int axis, SpringLaw law)
      : FrameForce(std::move(name), std::move(a), std::move(b)), kind_(kind), axis_(axis), law_(std::move(law)) {}

 protected:
  [[nodiscard]] Vec12 law(const Pair& p) const override {
    RelativeValue g;
    evaluate(kind_, axis_, 0, p.a, p.b, false, g);
    const Eigen::Map<const Vec12> c(g.c.data());
    return -strength(p, g.value, c.dot(twist(p.a, p.b))) * c;
  }

  void law_derivatives(const Pair& p, Mat12& k, Mat12& d) const override {
    RelativeValue g;
    evaluate(kind_, axis_, 0, p.a, p.b, false, g);
    const Eigen::Map<const Vec12> c(g.c.data());
    const Vec12 w = twist(p.a, p.b);
    Mat12 curvature = Mat12::Zero();
    add_curvature(kind_, axis_, 0, p.a, p.b, 1.0, curvature);
    k = -strength(p, g.value, c.dot(w)) * curvature;
    k -= c * (law_.stiffness * c.transpose() + law_.damping * (w.transpose() * curvature));
    d = -law_.damping * c * c.transpose();
  }

  [[nodiscard]] double potential(const Pair& p) const override {
    RelativeValue g;
    evaluate(kind_, axis_, 0, p.a, p.b, false, g);
    const double stretch = g.value - law_.rest;
    return 0.5 * law_.stiffness * stretch * stretch + law_.preload * stretch;
  }

 private:
  [[nodiscard]] double strength(const Pair& p, double g, double rate) const {
    return law_.stiffness * (g - law_.rest) + law_.damping * rate + law_.preload +
           (law_.active ? law_.actuator.value(p.t) : 0.0);
  }

  Relative kind_;
  int axis_;
  SpringLaw law_;
};

// Force on B: -R_A (K d_l + D d_l'), d_l = R_A^T (r_B - r_A); moment on B: -R_A (A^T(psi) K_r psi + D_r w_l).
class Bushing final : public FrameForce {
 public:
  Bushing(std::string name, FramePtr a, FramePtr b, BushingLaw law)
      : FrameForce(std::move(name), std::move(a), std::move(b)), law_(std::move(law)) {}

 protected:
  struct Parts {
    Vec3 d, f, psi, m;                            // global offset, force on A, rotation vector, moment on A (global)
    Mat3 stiffness, damping, rotational_damping;  // in global axes
  };

  [[nodiscard]] Parts parts(const Pair& p) const {
    Parts x;
    const Mat3& r = p.a.rot;
    x.stiffness = r * law_.stiffness.asDiagonal() * r.transpose();
    x.damping = r * law_.damping.asDiagonal() * r.transpose();
    x.rotational_damping = r * law_.angular_damping.asDiagonal() * r.transpose();
    x.d = p.b.r - p.a.r;
    x.f = x.stiffness * x.d + x.damping * (p.b.vel - p.a.vel - p.a.omega.cross(x.d));
    x.psi = rotation_log(r.transpose() * p.b.rot);
    x.m = r * inverse_tangent_transposed_times(x.psi, law_.angular_stiffness.cwiseProduct(x.psi)) +
          x.rotational_damping * (p.b.omega - p.a.omega);
    return x;
  }

  [[nodiscard]] Vec12 law(const Pair& p) const override {
    const Parts x = parts(p);
    Vec12 w;  // the force acts at the origin of B; A gets the opposite force and its moment about A's origin
    w << x.f, x.m + x.d.cross(x.f), -x.f, -x.m;
    return w;
  }

  void law_derivatives(const Pair& p, Mat12& k, Mat12& d) const override {
    const Parts x = parts(p);
    const Mat3& r = p.a.rot;
    const Vec3 rate = p.b.vel - p.a.vel - p.a.omega.cross(x.d);
    // df: f = R g(R^T ...): turning A turns f, and turns d and the rate the other way; the rate contains omega_A x d
    Eigen::Matrix<double, 3, 12> df = Eigen::Matrix<double, 3, 12>::Zero(), dm = df, df_rate = df, dm_rate = df;
    const Mat3 by_d = x.stiffness - x.damping * skew(p.a.omega);
    df.leftCols<3>() = -by_d;
    df.block<3, 3>(0, 6) = by_d;
    df.block<3, 3>(0, 3) = -skew(x.f) + x.stiffness * skew(x.d) + x.damping * skew(rate);
    df_rate.leftCols<3>() = -x.damping;
    df_rate.block<3, 3>(0, 3) = x.damping * skew(x.d);
    df_rate.block<3, 3>(0, 6) = x.damping;
    // dm: delta psi = A(psi) R^T (dphi_B - dphi_A)
    const Vec3 u = law_.angular_stiffness.cwiseProduct(x.psi);
    const Mat3 left = inverse_left_tangent(x.psi);
    const Mat3 elastic =
        r * (inverse_tangent_transposed_derivative(x.psi, u) + left.transpose() * law_.angular_stiffness.asDiagonal()) *
        left * r.transpose();
    const Vec3 spin = p.b.omega - p.a.omega;
    dm.block<3, 3>(0, 3) = -elastic - skew(x.m) + x.rotational_damping * skew(spin);
    dm.block<3, 3>(0, 9) = elastic;
    dm_rate.block<3, 3>(0, 3) = -x.rotational_damping;
    dm_rate.block<3, 3>(0, 9) = x.rotational_damping;
    fill(k, df, dm, skew(x.d));
    k.block<3, 3>(3, 0) += skew(x.f);  // d(d x f) = d~ df - f~ (dr_B - dr_A)
    k.block<3, 3>(3, 6) -= skew(x.f);
    fill(d, df_rate, dm_rate, skew(x.d));
  }

  [[nodiscard]] double potential(const Pair& p) const override {
    const Vec3 d = p.a.rot.transpose() * (p.b.r - p.a.r), psi = rotation_log(p.a.rot.transpose() * p.b.rot);
    return 0.5 * (d.dot(law_.stiffness.cwiseProduct(d)) + psi.dot(law_.angular_stiffness.cwiseProduct(psi)));
  }

 private:
  static void fill(Mat12& k, const Eigen::Matrix<double, 3, 12>& df, const Eigen::Matrix<double, 3, 12>& dm,
                   const Mat3& arm) {
    k.topRows<3>() = df;
    k.middleRows<3>(3) = dm + arm * df;
    k.middleRows<3>(6) = -df;
    k.bottomRows<3>() = -dm;
  }

  BushingLaw law_;
};

class Load final : public FrameForce {
 public:
  Load(std::string name, FramePtr a, LoadLaw law)
      : FrameForce(std::move(name), std::move(a), std::make_unique<GroundFrame>()), law_(std::move(law)) {}

 protected:
  [[nodiscard]] Vec12 law(const Pair& p) const override {
    const double factor = law_.factor.value(p.t);
    Vec12 w = Vec12::Zero();
    w.head<3>() = factor * (law_.follower ? Vec3(p.a.rot * law_.force) : law_.force);
    w.segment<3>(3) = factor * (law_.follower ? Vec3(p.a.rot * law_.moment) : law_.moment);
    return w;
  }

  void law_derivatives(const Pair& p, Mat12& k, Mat12& /*d*/) const override {
    if (!law_.follower) return;
    const Vec12 w = law(p);
    k.block<3, 3>(0, 3) = -skew(w.head<3>());
    k.block<3, 3>(3, 3) = -skew(w.segment<3>(3));
  }

 private:
  LoadLaw law_;
};

}  // namespace

std::unique_ptr<FrameForce> spring_damper(std::string name, FramePtr a, FramePtr b, SpringLaw law) {
  return std::make_unique<CoordinateForce>(std::move(name), std::move(a), std::move(b), Relative::distance, 0,
                                           std::move(law));
}

std::unique_ptr<FrameForce> axial_spring(std::string name, FramePtr a, FramePtr b, SpringLaw law) {
  return std::make_unique<CoordinateForce>(std::move(name), std::move(a), std::move(b), Relative::along, 2,
                                           std::move(law));
}

std::unique_ptr<FrameForce> rotational_spring(std::string name, FramePtr a, FramePtr b, SpringLaw law) {
  return std::make_unique<CoordinateForce>(std::move(name), std::move(a), std::move(b), Relative::angle, 0,
                                           std::move(law));
}

std::unique_ptr<FrameForce> bushing(std::string name, FramePtr a, FramePtr b, BushingLaw law) {
  return std::make_unique<Bushing>(std::move(name), std::move(a), std::move(b), std::move(law));
}

std::unique_ptr<FrameForce> load(std::string name, FramePtr a, LoadLaw law) {
  return std::make_unique<Load>(std::move(name), std::move(a), std::move(law));
}

}  // namespace espalier::dynamics
