// Springs, bushings and loads.

#include "dynamics/bodies/rotation.hpp"
#include "dynamics/forces/coordinate_force.hpp"

namespace espalier::dynamics {

namespace {

class Spring final : public CoordinateLaw {
 public:
  explicit Spring(SpringLaw law) : law_(std::move(law)) {}
  [[nodiscard]] Strength strength(const LawPoint& p) const override {
    double s = law_.stiffness * (p.g - law_.rest) + law_.damping * p.rate + law_.preload;
    if (law_.active) s += p.load * law_.actuator.value(p.t);
    for (const double u : p.inputs) s += p.load * u;
    return {s, law_.stiffness, law_.damping};
  }
  [[nodiscard]] double by_input(const LawPoint& p, std::size_t /*i*/) const override { return p.load; }
  [[nodiscard]] bool switches() const override { return law_.active && law_.actuator.branches; }
  void branches(const LawPoint& p, Branches& out) const override { law_.actuator.branches(p.t, out); }
  [[nodiscard]] double potential(double g) const override {
    const double stretch = g - law_.rest;
    return 0.5 * law_.stiffness * stretch * stretch + law_.preload * stretch;
  }

 private:
  SpringLaw law_;
};

// Force on B: -R_A (K d_l + D d_l'), d_l = R_A^T (r_B - r_A); moment on B: -R_A (A^T(psi) K_r psi + D_r w_l).
class Bushing final : public FrameForce {
 public:
  Bushing(std::string name, FramePtr a, FramePtr b, BushingLaw law)
      : FrameForce(std::move(name), std::move(a), std::move(b)), law_(std::move(law)) {}

 protected:
  struct Terms {
    Vec3 d, f, psi, m;                            // global offset, force on A, rotation vector, moment on A (global)
    Mat3 stiffness, damping, rotational_damping;  // in global axes
  };

  [[nodiscard]] Terms parts(const Pair& p) const {
    Terms x;
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
    const Terms x = parts(p);
    Vec12 w;  // the force acts at the origin of B; A gets the opposite force and its moment about A's origin
    w << x.f, x.m + x.d.cross(x.f), -x.f, -x.m;
    return w;
  }

  void law_derivatives(const Pair& p, Mat12& k, Mat12& d) const override {
    const Terms x = parts(p);
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
  struct Wrench {
    Vec3 force, moment;  // without the factor, in the load's own axes
    double factor;
  };
  [[nodiscard]] Wrench parts(const Pair& p) const {
    const auto part = [&](int k, double otherwise) {
      const int input = law_.input.at(at(k));
      return input < 0 ? otherwise : p.inputs.at(at(input));
    };
    Wrench x{law_.force, law_.moment, 0};
    for (int i = 0; i < 3; ++i) {
      x.force[i] = part(i, law_.force[i]);
      x.moment[i] = part(3 + i, law_.moment[i]);
    }
    x.factor = load_factor() * law_.factor.value(p.t) * part(6, 1);
    return x;
  }
  /// The wrench of force and moment in the load's own axes.
  [[nodiscard]] Vec12 wrench(const Pair& p, const Vec3& force, const Vec3& moment) const {
    Vec12 w = Vec12::Zero();
    w.head<3>() = law_.follower ? Vec3(p.a.rot * force) : force;
    w.segment<3>(3) = law_.follower ? Vec3(p.a.rot * moment) : moment;
    return w;
  }

  [[nodiscard]] Vec12 law(const Pair& p) const override {
    const Wrench x = parts(p);
    return x.factor * wrench(p, x.force, x.moment);
  }

  void law_derivatives(const Pair& p, Mat12& k, Mat12& /*d*/) const override {
    if (!law_.follower) return;
    const Vec12 w = law(p);
    k.block<3, 3>(0, 3) = -skew(w.head<3>());
    k.block<3, 3>(3, 3) = -skew(w.segment<3>(3));
  }

  [[nodiscard]] Vec12 law_by_input(const Pair& p, std::size_t i) const override {
    const Wrench x = parts(p);
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
    for (int k = 0; k < 3; ++k) {
      if (law_.input.at(at(k)) == static_cast<int>(i)) force[k] = 1;
      if (law_.input.at(at(3 + k)) == static_cast<int>(i)) moment[k] = 1;
    }
    Vec12 w = x.factor * wrench(p, force, moment);
    if (law_.input[6] == static_cast<int>(i))
      w += load_factor() * law_.factor.value(p.t) * wrench(p, x.force, x.moment);
    return w;
  }

  void law_branches(const StateView& s, Branches& out) const override {
    if (law_.factor.branches) law_.factor.branches(s.t, out);
  }

 private:
  LoadLaw law_;
};

}  // namespace

namespace {

std::unique_ptr<FrameForce> spring(std::string name, FramePtr a, FramePtr b, CoordinateForce::Coordinate coordinate,
                                   SpringLaw law) {
  return std::make_unique<CoordinateForce>(std::move(name), std::move(a), std::move(b), std::move(coordinate),
                                           std::make_unique<Spring>(std::move(law)));
}

}  // namespace

std::unique_ptr<FrameForce> spring_damper(std::string name, FramePtr a, FramePtr b, SpringLaw law) {
  return spring(std::move(name), std::move(a), std::move(b), {Relative::distance, 0}, std::move(law));
}

std::unique_ptr<FrameForce> axial_spring(std::string name, FramePtr a, FramePtr b, SpringLaw law) {
  return spring(std::move(name), std::move(a), std::move(b), {Relative::along, 2}, std::move(law));
}

std::unique_ptr<FrameForce> rotational_spring(std::string name, FramePtr a, FramePtr b, SpringLaw law) {
  return spring(std::move(name), std::move(a), std::move(b), {Relative::angle, 0}, std::move(law));
}

std::unique_ptr<FrameForce> bushing(std::string name, FramePtr a, FramePtr b, BushingLaw law) {
  return std::make_unique<Bushing>(std::move(name), std::move(a), std::move(b), std::move(law));
}

std::unique_ptr<FrameForce> load(std::string name, FramePtr a, LoadLaw law) {
  return std::make_unique<Load>(std::move(name), std::move(a), std::move(law));
}

}  // namespace espalier::dynamics
