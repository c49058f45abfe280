#include "dynamics/bodies/rigid_body.hpp"

#include <cmath>
#include <stdexcept>

#include "dense/dense.hpp"

namespace espalier::dynamics {

namespace {

Vec3 vec3(ConstSpan x, Index at) {
  const auto i = static_cast<std::size_t>(at);
  return {x[i], x[i + 1], x[i + 2]};
}

Quat quat(ConstSpan x, Index at) {
  const auto i = static_cast<std::size_t>(at);
  return {x[i], x[i + 1], x[i + 2], x[i + 3]};
}

template <class Vector>
void write_at(Span x, Index at, const Vector& value) {
  for (Eigen::Index k = 0; k < value.size(); ++k) x[static_cast<std::size_t>(at + k)] = value[k];
}

}  // namespace

RigidBody::RigidBody(std::string name, const RigidBodyData& data) : Component(std::move(name)), data_(data) {
  const std::string who = "rigid body \"" + this->name() + "\": ";
  if (!(data.mass > 0) || !std::isfinite(data.mass)) throw std::invalid_argument(who + "the mass must be positive");
  if (!data.inertia.allFinite() || !data.position.allFinite() || !data.rotation.allFinite() ||
      !data.velocity.allFinite() || !data.angular_velocity.allFinite() || !data.gravity.allFinite()) {
    throw std::invalid_argument(who + "a number is not finite");
  }
  const Vec3 principal = dense::principal_values(data.inertia);
  if (!(principal[0] > 0)) throw std::invalid_argument(who + "the inertia must be positive definite");
  if (!(data.inertia - data.inertia.transpose()).isZero(1e-12 * principal[2])) {
    throw std::invalid_argument(who + "the inertia must be symmetric");
  }
  if (!(data.rotation.norm() > 0)) throw std::invalid_argument(who + "the rotation quaternion is zero");
  data_.rotation.normalize();
}

Vec3 RigidBody::position(ConstSpan q) const { return vec3(q, placement().q); }
Quat RigidBody::quaternion(ConstSpan q) const { return quat(q, placement().q + 3); }
Vec3 RigidBody::velocity(ConstSpan v) const { return vec3(v, placement().v); }
Vec3 RigidBody::angular(ConstSpan v) const { return vec3(v, placement().v + 3); }

void RigidBody::place(const Placement& at) {
  Component::place(at);
  for (std::size_t k = 0; k < 6; ++k) coordinates_[k] = at.v + static_cast<Index>(k);
}

std::string RigidBody::coordinate_name(Index local_coordinate) const {
  static constexpr std::array<const char*, 6> kNames = {"position x", "position y", "position z",
                                                        "rotation x", "rotation y", "rotation z"};
  return "body \"" + name() + "\", " + kNames.at(static_cast<std::size_t>(local_coordinate));
}

void RigidBody::initial(Span q, Span v) const {
  write_at(q, placement().q, data_.position);
  write_at(q, placement().q + 3, data_.rotation);
  write_at(v, placement().v, data_.velocity);
  write_at(v, placement().v + 3, Vec3(rotation_matrix(data_.rotation).transpose() * data_.angular_velocity));
}

void RigidBody::retract(ConstSpan q, ConstSpan dq, Span q_out) const {
  write_at(q_out, placement().q, Vec3(vec3(q, placement().q) + vec3(dq, placement().v)));
  const Quat moved = multiply(quat(q, placement().q + 3), quaternion_exp(vec3(dq, placement().v + 3)));
  write_at(q_out, placement().q + 3, Quat(moved / moved.norm()));
}

void RigidBody::local(ConstSpan base, ConstSpan q, Span theta) const {
  write_at(theta, placement().v, Vec3(vec3(q, placement().q) - vec3(base, placement().q)));
  Quat inverse = quat(base, placement().q + 3);
  inverse.tail<3>() *= -1;
  write_at(theta, placement().v + 3, quaternion_log(multiply(inverse, quat(q, placement().q + 3))));
}

void RigidBody::velocity_of_rate(ConstSpan theta, ConstSpan theta_dot, Span v) const {
  const Index at = placement().v;
  write_at(v, at, vec3(theta_dot, at));
  write_at(v, at + 3, tangent_times(vec3(theta, at + 3), vec3(theta_dot, at + 3)));
}

void RigidBody::rate_of_velocity(ConstSpan theta, ConstSpan v, Span theta_dot) const {
  const Index at = placement().v;
  write_at(theta_dot, at, vec3(v, at));
  write_at(theta_dot, at + 3, inverse_tangent_transposed_times(vec3(theta, at + 3), vec3(v, at + 3)));
}

void RigidBody::carry(ConstSpan theta, std::span<const Span> vectors) const {
  const Index at = placement().v + 3;
  const Quat turn = quaternion_exp(vec3(theta, at));
  for (const Span x : vectors) write_at(x, at, turned_back(turn, vec3(x, at)));
}

void RigidBody::magnitude(ConstSpan q, Span out) const {
  write_at(out, placement().v, Vec3(vec3(q, placement().q).cwiseAbs()));
  write_at(out, placement().v + 3, Vec3(Vec3::Ones()));
}

void RigidBody::declare(PatternBuilder& w, PatternBuilder& /*phi_q*/) const {
  const std::span<const Index> all(coordinates_);
  w.add_block(all.subspan(3), all.subspan(3));
}

void RigidBody::bind(const SparsePattern& w, const SparsePattern& /*phi_q*/) {
  for (std::size_t k = 0; k < 3; ++k) mass_position_[k] = find_entry(w, coordinates_[k], coordinates_[k]);
  for (std::size_t j = 0; j < 3; ++j) {
    for (std::size_t i = 0; i < 3; ++i) {
      inertia_position_[3 * j + i] = find_entry(w, coordinates_[3 + j], coordinates_[3 + i]);
    }
  }
}

void RigidBody::residual(const StateView& s, Span f) {
  const Index at = placement().v;
  const Vec3 force = data_.mass * (vec3(s.a, at) - load_factor() * data_.gravity);
  const Vec3 omega = vec3(s.v, at + 3);
  const Vec3 torque = data_.inertia * vec3(s.a, at + 3) + omega.cross(data_.inertia * omega);
  for (int k = 0; k < 3; ++k) {
    f[static_cast<std::size_t>(at + k)] += force[k];
    f[static_cast<std::size_t>(at + 3 + k)] += torque[k];
  }
}

void RigidBody::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  for (const Offset p : mass_position_) w_values[static_cast<std::size_t>(p)] += weights.a * data_.mass;
  const Vec3 omega = vec3(s.v, placement().v + 3);
  const Mat3 block =
      weights.a * data_.inertia + weights.v * (skew(omega) * data_.inertia - skew(data_.inertia * omega));
  for (std::size_t k = 0; k < 9; ++k) w_values[static_cast<std::size_t>(inertia_position_[k])] += block.data()[k];
}

Energy RigidBody::energy(const StateView& s) {
  const Vec3 omega = angular(s.v);
  return {0.5 * (data_.mass * velocity(s.v).squaredNorm() + omega.dot(data_.inertia * omega)),
          -data_.mass * load_factor() * data_.gravity.dot(position(s.q))};
}

// ---- RigidFrame: r = r_c + R s, J = [I, -R s~; 0, R]

void RigidFrame::motion(ConstSpan q, ConstSpan v, FrameMotion& out) const {
  out.body_rot = rotation_matrix(body_->quaternion(q));
  out.arm = out.body_rot * point_;
  out.r = body_->position(q) + out.arm;
  out.rot = out.body_rot * rotation_;
  if (v.empty()) return;
  out.omega = out.body_rot * body_->angular(v);
  const Vec3 turning = out.omega.cross(out.arm);
  out.vel = body_->velocity(v) + turning;
  out.bias_acc = out.omega.cross(turning);
  out.bias_alpha.setZero();  // d/dt (R omega_body) = R alpha_body
}

void RigidFrame::jacobian(ConstSpan q, double* j) const {
  const Mat3 rot = rotation_matrix(body_->quaternion(q));
  Eigen::Map<Eigen::Matrix<double, 6, 6>> jac(j);
  jac.setZero();
  jac.topLeftCorner<3, 3>().setIdentity();
  jac.topRightCorner<3, 3>() = -rot * skew(point_);
  jac.bottomRightCorner<3, 3>() = rot;
}

// Written out: joints call it for every equation in every iteration, and most gradients have no force or no moment.
void RigidFrame::project(ConstSpan /*q*/, const FrameMotion& motion, const double* c, int count, double* out) const {
  const double* rot = motion.body_rot.data();  // column by column
  const double x = motion.arm[0], y = motion.arm[1], z = motion.arm[2];
  for (int r = 0; r < count; ++r, c += 6, out += 6) {
    double mx = c[3], my = c[4], mz = c[5];
    if (c[0] != 0 || c[1] != 0 || c[2] != 0) {  // arm x force
      mx += y * c[2] - z * c[1];
      my += z * c[0] - x * c[2];
      mz += x * c[1] - y * c[0];
    }
    for (int k = 0; k < 3; ++k) {
      out[k] = c[k];
      out[3 + k] = rot[3 * k] * mx + rot[3 * k + 1] * my + rot[3 * k + 2] * mz;
    }
  }
}

void RigidFrame::rate_jacobian(ConstSpan q, ConstSpan v, double* jv) const {
  // omega = R omega_body and omega x arm turn with the body: d(x) = dphi x x, dphi = R dtheta
  const Mat3 rot = rotation_matrix(body_->quaternion(q));
  const Vec3 omega = rot * body_->angular(v);
  Eigen::Map<Eigen::Matrix<double, 6, 6>> out(jv);
  out.setZero();
  out.topRightCorner<3, 3>() = -skew(omega.cross(rot * point_)) * rot;
  out.bottomRightCorner<3, 3>() = -skew(omega) * rot;
}

void RigidFrame::wrench_stiffness(ConstSpan q, const Vec6& wrench, double scale, double* k) const {
  // J^T w = [f; R^T m + s x R^T f]; d(R^T x) = (R^T x)~ dtheta
  const Mat3 rot = rotation_matrix(body_->quaternion(q));
  const Vec3 force = rot.transpose() * wrench.head<3>(), moment = rot.transpose() * wrench.tail<3>();
  Eigen::Map<Eigen::Matrix<double, 6, 6>> block(k);
  block.bottomRightCorner<3, 3>() += scale * (skew(moment) + skew(point_) * skew(force));
}

std::unique_ptr<Frame> frame_at(const RigidBody& body, const Vec3& global_point, const Mat3& global_axes) {
  const Mat3 rot = rotation_matrix(body.data().rotation);
  return std::make_unique<RigidFrame>(body, rot.transpose() * (global_point - body.data().position),
                                      rot.transpose() * global_axes);
}

}  // namespace espalier::dynamics
