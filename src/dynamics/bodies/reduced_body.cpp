#include "dynamics/bodies/reduced_body.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/at.hpp"
#include "dynamics/bodies/axial.hpp"

namespace espalier::dynamics {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Eigen::Map<const Mat3> block_of(const VectorXd& x, Eigen::Index k) { return Eigen::Map<const Mat3>(x.data() + 9 * k); }
Mat3 spread(const Mat3& d) { return d.trace() * Mat3::Identity() - d; }

}  // namespace

ReducedBody::ReducedBody(std::unique_ptr<NodalBody> nodal, ReducedBasis shapes, ReducedInertia inertia,
                         double modal_damping)
    : Component(nodal->body().name()),
      nodal_(std::move(nodal)),
      shapes_(std::move(shapes)),
      inertia_(std::move(inertia)),
      viscous_(2 * modal_damping * shapes_.mass.cwiseProduct(shapes_.stiffness).cwiseSqrt()),
      length_(std::max(nodal_->body().size(), std::sqrt(inertia_.rest.trace() / inertia_.mass))),
      initial_position_(shapes_.centre) {}

void ReducedBody::set_initial_motion(const Mat3& rotation, const Vec3& translation, const Vec3& velocity,
                                     const Vec3& angular_velocity) {
  initial_position_ = rotation * shapes_.centre + translation;
  initial_rotation_ = quaternion_of(rotation);
  initial_velocity_ = velocity + angular_velocity.cross(initial_position_);
  initial_angular_ = rotation.transpose() * angular_velocity;
}

Vec3 ReducedBody::position(ConstSpan q) const { return Eigen::Map<const Vec3>(q.data() + placement().q); }
Quat ReducedBody::quaternion(ConstSpan q) const { return Eigen::Map<const Quat>(q.data() + placement().q + 3); }
Vec3 ReducedBody::velocity(ConstSpan v) const { return Eigen::Map<const Vec3>(v.data() + placement().v); }
Vec3 ReducedBody::angular(ConstSpan v) const { return Eigen::Map<const Vec3>(v.data() + placement().v + 3); }
Eigen::Map<const VectorXd> ReducedBody::amplitudes(ConstSpan q) const {
  return {q.data() + placement().q + 7, static_cast<Eigen::Index>(modes())};
}
Eigen::Map<const VectorXd> ReducedBody::rates(ConstSpan v) const {
  return {v.data() + placement().v + 6, static_cast<Eigen::Index>(modes())};
}

std::vector<double> ReducedBody::strained(ConstSpan q) const {
  std::vector<double> x(nodal().reference().begin(), nodal().reference().end());
  Eigen::Map<VectorXd>(x.data(), static_cast<Eigen::Index>(x.size())) += shapes_.shapes * amplitudes(q);
  return x;
}

void ReducedBody::nodal_motion(ConstSpan q, ConstSpan v, std::vector<double>& x, std::vector<double>& rate) const {
  x = strained(q);
  const Mat3 r = rotation_matrix(quaternion(q));
  const int step = nodal().vertices_per_node();
  Eigen::Map<Eigen::Matrix3Xd> places(x.data(), 3, nodal().vertices());
  for (Eigen::Index k = 0; k < places.cols(); k += step) places.col(k) -= shapes_.centre;
  rate.clear();
  if (!v.empty()) {
    rate.resize(x.size());
    Eigen::Map<VectorXd>(rate.data(), static_cast<Eigen::Index>(rate.size())) = shapes_.shapes * rates(v);
    Eigen::Map<Eigen::Matrix3Xd> speeds(rate.data(), 3, nodal().vertices());
    speeds = (r * (speeds + skew(angular(v)) * places)).eval();
    for (Eigen::Index k = 0; k < speeds.cols(); k += step) speeds.col(k) += velocity(v);
  }
  places = (r * places).eval();
  for (Eigen::Index k = 0; k < places.cols(); k += step) places.col(k) += position(q);
}

MassProperties ReducedBody::mass_properties(ConstSpan q, ConstSpan v) const {
  const Vec3 r = position(q);
  MassProperties result;
  result.mass = inertia_.mass;
  Eigen::Map<Vec3>(result.centre.data()) = r;
  if (v.empty()) return result;
  const Inertia own = inertia(amplitudes(q));
  const Vec3 p = inertia_.mass * velocity(v);
  Eigen::Map<Vec3>(result.momentum.data()) = p;
  Eigen::Map<Vec3>(result.angular_momentum.data()) =
      r.cross(p) + rotation_matrix(quaternion(q)) * (own.j * angular(v) + own.c * rates(v));
  return result;
}

double ReducedBody::strain_energy(ConstSpan q) const { return 0.5 * amplitudes(q).cwiseAbs2().dot(shapes_.stiffness); }

// ---- the manifold: as of a rigid body, amplitudes behind it

void ReducedBody::place(const Placement& at) {
  Component::place(at);
  coordinates_.clear();
  for (Index k = 0; k < sizes().velocity; ++k) coordinates_.push_back(at.v + k);
}

std::string ReducedBody::coordinate_name(Index local) const {
  static constexpr std::array<const char*, 6> kNames = {"position x", "position y", "position z",
                                                        "rotation x", "rotation y", "rotation z"};
  return local < 6 ? fmt::format("body \"{}\", {}", name(), kNames.at(at(local)))
                   : fmt::format("body \"{}\", shape {}", name(), local - 5);
}

void ReducedBody::initial(Span q, Span v) const {
  const Placement& p = placement();
  std::fill_n(q.begin() + p.q, sizes().configuration, 0.0);
  std::fill_n(v.begin() + p.v, sizes().velocity, 0.0);
  Eigen::Map<Vec3>(q.data() + p.q) = initial_position_;
  Eigen::Map<Quat>(q.data() + p.q + 3) = initial_rotation_;
  Eigen::Map<Vec3>(v.data() + p.v) = initial_velocity_;
  Eigen::Map<Vec3>(v.data() + p.v + 3) = initial_angular_;
}

void ReducedBody::retract(ConstSpan q, ConstSpan dq, Span q_out) const {
  const Quat moved = multiply(quaternion(q), quaternion_exp(angular(dq)));
  const Vec3 r = position(q) + velocity(dq);
  Eigen::Map<VectorXd>(q_out.data() + placement().q + 7, modes()) = amplitudes(q) + rates(dq);
  Eigen::Map<Vec3>(q_out.data() + placement().q) = r;
  Eigen::Map<Quat>(q_out.data() + placement().q + 3) = moved / moved.norm();
}

void ReducedBody::local(ConstSpan base, ConstSpan q, Span theta) const {
  Quat inverse = quaternion(base);
  inverse.tail<3>() *= -1;
  Eigen::Map<VectorXd>(theta.data() + placement().v + 6, modes()) = amplitudes(q) - amplitudes(base);
  Eigen::Map<Vec3>(theta.data() + placement().v) = position(q) - position(base);
  Eigen::Map<Vec3>(theta.data() + placement().v + 3) = quaternion_log(multiply(inverse, quaternion(q)));
}

void ReducedBody::velocity_of_rate(ConstSpan theta, ConstSpan theta_dot, Span v) const {
  const Vec3 omega = tangent_times(angular(theta), angular(theta_dot));
  std::copy_n(theta_dot.begin() + placement().v, sizes().velocity, v.begin() + placement().v);
  Eigen::Map<Vec3>(v.data() + placement().v + 3) = omega;
}

void ReducedBody::rate_of_velocity(ConstSpan theta, ConstSpan v, Span theta_dot) const {
  const Vec3 rate = inverse_tangent_transposed_times(angular(theta), angular(v));
  std::copy_n(v.begin() + placement().v, sizes().velocity, theta_dot.begin() + placement().v);
  Eigen::Map<Vec3>(theta_dot.data() + placement().v + 3) = rate;
}

void ReducedBody::carry(ConstSpan theta, std::span<const Span> vectors) const {
  const Quat turn = quaternion_exp(angular(theta));
  for (const Span x : vectors) Eigen::Map<Vec3>(x.data() + placement().v + 3) = turned_back(turn, angular(x));
}

/// Lengths are measured by the size of the body, as those of its nodes would be.
void ReducedBody::magnitude(ConstSpan, Span out) const {
  std::fill_n(out.begin() + placement().v, sizes().velocity, length_);
  std::fill_n(out.begin() + placement().v + 3, 3, 1.0);
}

// ---- equations

ReducedBody::Inertia ReducedBody::inertia(const VectorXd& eta) const {
  Inertia own;
  own.d = couple(eta) + inertia_.first;
  own.c.resize(3, modes());
  Mat3 u = inertia_.rest;
  for (Eigen::Index k = 0; k < modes(); ++k) {
    const Mat3 d = block_of(own.d, k), constant = block_of(inertia_.first, k);
    own.c.col(k) = axial(d);
    u += eta[k] * (d + constant.transpose());
  }
  own.j = spread(0.5 * (u + u.transpose()));
  return own;
}

void ReducedBody::residual(const StateView& s, Span f) {
  const Vec3 omega = angular(s.v), alpha = angular(s.a);
  const VectorXd eta = amplitudes(s.q), rate = rates(s.v), second = rates(s.a);
  const Inertia own = inertia(eta);
  const VectorXd d_rate = couple(rate);
  Eigen::Map<Vec3>(f.data() + placement().v) +=
      inertia_.mass * (velocity(s.a) - load_factor() * gravity_ + damping_.mass * velocity(s.v));
  Vec3 torque =
      own.j * alpha + omega.cross(own.j * omega) + own.c * second + damping_.mass * (own.j * omega + own.c * rate);
  Eigen::Map<VectorXd> force(f.data() + placement().v + 6, modes());
  force += shapes_.mass.cwiseProduct(second + damping_.mass * rate) +
           shapes_.stiffness.cwiseProduct(eta + damping_.stiffness * rate) + viscous_.cwiseProduct(rate);
  for (Eigen::Index k = 0; k < modes(); ++k) {
    const Vec3 turned = spread(block_of(own.d, k)) * omega;
    torque += 2 * rate[k] * turned;
    force[k] +=
        own.c.col(k).dot(alpha + damping_.mass * omega) - omega.dot(turned) + 2 * omega.dot(axial(block_of(d_rate, k)));
  }
  Eigen::Map<Vec3>(f.data() + placement().v + 3) += torque;
}

void ReducedBody::declare(PatternBuilder& w, PatternBuilder&) const {
  const std::span<const Index> all(coordinates_);
  w.add_block(all.subspan(3), all.subspan(3));
}

void ReducedBody::bind(const SparsePattern& w, const SparsePattern&) {
  for (std::size_t k = 0; k < 3; ++k) mass_position_[k] = find_entry(w, coordinates_[k], coordinates_[k]);
  block_start_.clear();
  for (std::size_t k = 3; k < coordinates_.size(); ++k)
    block_start_.push_back(find_entry(w, coordinates_[k], coordinates_[3]));
}

/// Columns of a and v: rotation and amplitudes.
void ReducedBody::fill_velocity(const StateView& s, const TangentWeights& w, MatrixXd& block) const {
  const Vec3 omega = angular(s.v);
  const VectorXd rate = rates(s.v);
  const Inertia own = inertia(amplitudes(s.q));
  const VectorXd d_rate = couple(rate);
  const double by_mass = w.a + damping_.mass * w.v;
  Mat3 turning = skew(omega) * own.j - skew(Vec3(own.j * omega));
  for (Eigen::Index k = 0; k < modes(); ++k) {
    const Mat3 a = spread(block_of(own.d, k));
    turning += 2 * rate[k] * a;
    block.block<3, 1>(0, 3 + k) += by_mass * own.c.col(k) + 2 * w.v * (a * omega);
    block.block<1, 3>(3 + k, 0) +=
        (by_mass * own.c.col(k) + w.v * (2 * axial(block_of(d_rate, k)) - (a + a.transpose()) * omega)).transpose();
  }
  block.topLeftCorner<3, 3>() += by_mass * own.j + w.v * turning;
  block.bottomRightCorner(modes(), modes()).diagonal() +=
      by_mass * shapes_.mass + w.v * (damping_.stiffness * shapes_.stiffness + viscous_) + w.q * shapes_.stiffness;
}

/// Columns of amplitudes: what J, c and D change. Sum over U_kl of a 3 x 3 matrix is one product for all l.
void ReducedBody::fill_position(const StateView& s, const TangentWeights& w, MatrixXd& block) const {
  const Vec3 omega = angular(s.v), driving = angular(s.a) + damping_.mass * omega;
  const VectorXd rate = rates(s.v), second = rates(s.a) + damping_.mass * rate;
  const VectorXd d = couple(amplitudes(s.q)) + inertia_.first, d_rate = couple(rate), d_second = couple(second);
  for (Eigen::Index l = 0; l < modes() && w.q != 0; ++l) {
    const Mat3 a = spread(block_of(d, l)), j = a + a.transpose();
    block.block<3, 1>(0, 3 + l) += w.q * (j * driving + omega.cross(j * omega) - axial(block_of(d_second, l)) +
                                          2 * spread(block_of(d_rate, l).transpose()) * omega);
  }
  const Mat3 weight = w.q * (skew(driving) + omega * omega.transpose() - omega.squaredNorm() * Mat3::Identity()) +
                      2 * w.v * skew(omega);
  const Eigen::Map<const Eigen::Matrix<double, 9, 1>> flat(weight.data());
  const Eigen::Index n = modes();
  for (Eigen::Index l = 0; l < n; ++l)
    block.col(3 + l).tail(n).noalias() +=
        Eigen::Map<const Eigen::Matrix<double, 9, Eigen::Dynamic>>(inertia_.pairs.col(l).data(), 9, n).transpose() *
        flat;
}

void ReducedBody::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  for (const Offset p : mass_position_) w_values[at(p)] += (weights.a + damping_.mass * weights.v) * inertia_.mass;
  const Eigen::Index n = 3 + modes();
  MatrixXd block = MatrixXd::Zero(n, n);
  fill_velocity(s, weights, block);
  fill_position(s, weights, block);
  for (Eigen::Index k = 0; k < n; ++k) Eigen::Map<VectorXd>(w_values.data() + block_start_[at(k)], n) += block.col(k);
}

Energy ReducedBody::energy(const StateView& s) {
  Energy result;
  result.potential = strain_energy(s.q) - inertia_.mass * load_factor() * gravity_.dot(position(s.q));
  if (s.v.empty()) return result;
  const Inertia own = inertia(amplitudes(s.q));
  const Vec3 omega = angular(s.v);
  const VectorXd rate = rates(s.v);
  result.kinetic = 0.5 * (inertia_.mass * velocity(s.v).squaredNorm() + omega.dot(own.j * omega) +
                          rate.cwiseAbs2().dot(shapes_.mass)) +
                   omega.dot(own.c * rate);
  return result;
}

void ReducedBody::save(std::vector<double>& out) const {
  for (Eigen::Index k = 0; k < modes(); ++k) {
    double mark = 0;
    for (Eigen::Index i = 0; i < shapes_.shapes.rows(); ++i)
      mark += std::cos(static_cast<double>(i)) * shapes_.shapes(i, k);
    out.push_back(mark);
  }
}

void ReducedBody::restore(ConstSpan& in) {
  std::vector<double> own;
  save(own);
  double size = 0;
  for (const double x : own) size = std::max(size, std::abs(x));
  for (std::size_t k = 0; k < own.size(); ++k)
    if (!(std::abs(in[k] - own[k]) <= 1e-6 * size))
      throw Error(
          StatusCode::invalid_input,
          fmt::format("shape {} of the reduced body '{}' is not the one of the saved state (another machine, or "
                      "equal frequencies in another order); start anew",
                      k + 1, name()));
  in = in.subspan(own.size());
}

}  // namespace espalier::dynamics
