// Beams joined to the ground and to each other, with loads on their nodes, in static equilibrium.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/SparseLU>
#include <string>
#include <vector>

#include "dynamics/bodies/flexible_frame.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/forces/frame_force.hpp"
#include "dynamics/joints/joint.hpp"

namespace espalier::dynamics::test {

/// Forces and moments of loads grow with t from 0 to 1.
class BeamChain {
 public:
  FlexibleBody& add(std::unique_ptr<FlexibleBody> body) {
    bodies_.push_back(&system_.add(std::move(body)));
    return *bodies_.back();
  }
  /// The first node of the first body is clamped, every other first node to the last node of the body before.
  void join() {
    joints_.push_back(&system_.add(fixed_joint("wall", ground_at(0), make_beam_frame(*bodies_[0], 0))));
    for (std::size_t k = 1; k < bodies_.size(); ++k)
      joints_.push_back(
          &system_.add(fixed_joint("joint " + std::to_string(k), make_beam_frame(*bodies_[k - 1], last(k - 1)),
                                   make_beam_frame(*bodies_[k], 0))));
  }
  void load(std::size_t body, Index node, const Vec3& force, const Vec3& moment) {
    LoadLaw law{force, moment, TimeFunction::linear(0, 1)};
    system_.add(dynamics::load("load", make_beam_frame(*bodies_[body], node), law));
  }
  void load_end(const Vec3& force, const Vec3& moment) {
    load(bodies_.size() - 1, last(bodies_.size() - 1), force, moment);
  }

  /// Newton's method on F + Phi_q^T lambda = 0, Phi = 0 in `steps` equal load steps. @return false without an
  /// equilibrium
  [[nodiscard]] bool solve(int steps = 1) {
    if (q_.size() == 0) start();
    for (int k = 1; k <= steps; ++k)
      if (!newton(static_cast<double>(k) / steps)) return false;
    return true;
  }
  [[nodiscard]] FrameMotion node(std::size_t body, Index node) const {
    FrameMotion motion;
    make_beam_frame(*bodies_[body], node)->motion(view(q_), {}, motion);
    return motion;
  }
  [[nodiscard]] FrameMotion end() const { return node(bodies_.size() - 1, last(bodies_.size() - 1)); }
  /// What joint k exerts on the body behind it.
  [[nodiscard]] Wrench reaction(std::size_t k) const { return joints_[k]->reaction(state(1), 1); }
  /// Largest departure of r_y and r_z of any node from two orthogonal unit vectors.
  [[nodiscard]] double section_strain() const {
    double most = 0;
    for (const FlexibleBody* body : bodies_)
      for (Index n = 0; n < body->nodes(); ++n) {
        const Vec3 y = q_.segment<3>(body->configuration(4 * n + 2)), z = q_.segment<3>(body->configuration(4 * n + 3));
        most = std::max({most, std::abs(y.norm() - 1), std::abs(z.norm() - 1), std::abs(y.dot(z))});
      }
    return most;
  }

 private:
  static ConstSpan view(const Eigen::VectorXd& x) { return {x.data(), static_cast<std::size_t>(x.size())}; }
  static Span view(Eigen::VectorXd& x) { return {x.data(), static_cast<std::size_t>(x.size())}; }
  [[nodiscard]] Index last(std::size_t body) const { return bodies_[body]->nodes() - 1; }
  [[nodiscard]] FramePtr ground_at(std::size_t body) const {
    return std::make_unique<GroundFrame>(Eigen::Map<const Vec3>(bodies_[body]->reference().data()));
  }
  [[nodiscard]] StateView state(double t) const { return {t, view(q_), view(v_), {}, view(lambda_)}; }
  void start() {
    system_.finish();
    q_.resize(system_.sizes().configuration);
    v_.resize(system_.sizes().velocity);
    system_.initial(view(q_), view(v_));  // at rest
    lambda_.setZero(system_.sizes().constraints);
  }

  /// [W Phi_q^T; Phi_q 0], values of W and Phi_q in the order of their patterns.
  [[nodiscard]] Eigen::SparseMatrix<double> matrix(const std::vector<double>& w, const Eigen::VectorXd& phi_q) const {
    std::vector<Eigen::Triplet<double>> entries;
    const SparsePattern &wp = system_.tangent_pattern(), &pp = system_.constraint_pattern();
    const Index n = system_.sizes().velocity, m = system_.sizes().constraints;
    for (Index c = 0; c < n; ++c)
      for (Offset k = wp.ptr[static_cast<std::size_t>(c)]; k < wp.ptr[static_cast<std::size_t>(c) + 1]; ++k)
        entries.emplace_back(wp.ind[static_cast<std::size_t>(k)], c, w[static_cast<std::size_t>(k)]);
    for (Index r = 0; r < m; ++r)
      for (Offset k = pp.ptr[static_cast<std::size_t>(r)]; k < pp.ptr[static_cast<std::size_t>(r) + 1]; ++k) {
        entries.emplace_back(n + r, pp.ind[static_cast<std::size_t>(k)], phi_q[k]);
        entries.emplace_back(pp.ind[static_cast<std::size_t>(k)], n + r, phi_q[k]);
      }
    Eigen::SparseMatrix<double> result(n + m, n + m);
    result.setFromTriplets(entries.begin(), entries.end());
    return result;
  }

  [[nodiscard]] bool newton(double t) {
    const Index n = system_.sizes().velocity, m = system_.sizes().constraints;
    double before = 1e300;
    for (int i = 0; i < 40; ++i) {
      Eigen::VectorXd f(n), phi(m), phi_q(system_.constraint_pattern().nonzeros());
      std::vector<double> w(static_cast<std::size_t>(system_.tangent_pattern().nonzeros()));
      system_.residual(state(t), view(f));
      system_.constraints(t, view(q_), {}, {view(phi), {}, {}, view(phi_q)});
      system_.tangent(state(t), {0, 0, 1}, w);
      Eigen::VectorXd right(n + m);
      right << f, phi;
      const SparsePattern& pp = system_.constraint_pattern();
      for (Index r = 0; r < m; ++r)
        for (Offset k = pp.ptr[static_cast<std::size_t>(r)]; k < pp.ptr[static_cast<std::size_t>(r) + 1]; ++k)
          right[pp.ind[static_cast<std::size_t>(k)]] += phi_q[k] * lambda_[r];
      const Eigen::SparseLU<Eigen::SparseMatrix<double>> lu(matrix(w, phi_q));
      if (!right.allFinite() || lu.info() != Eigen::Success) return false;
      const Eigen::VectorXd step = lu.solve(right);
      q_ -= step.head(n);
      lambda_ -= step.tail(m);
      const double size = step.head(n).cwiseAbs().maxCoeff() / q_.cwiseAbs().maxCoeff();
      if (size < 1e-13 || (size < 1e-9 && size > 0.5 * before)) return true;
      before = size;
    }
    return false;
  }

  AssembledSystem system_;
  std::vector<FlexibleBody*> bodies_;
  std::vector<Joint*> joints_;
  Eigen::VectorXd q_, v_, lambda_;
};

}  // namespace espalier::dynamics::test
