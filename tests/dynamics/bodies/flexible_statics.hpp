// A small static Newton solver for one flexible body with fixed coordinates and dead loads.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Sparse>
#include <functional>
#include <vector>

#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/dae/assembled_system.hpp"

namespace espalier::dynamics::test {

class Statics {
 public:
  /// @param add_loads adds what acts on the body to its system
  using AddLoads = std::function<void(AssembledSystem&, const FlexibleBody&)>;
  explicit Statics(std::unique_ptr<FlexibleBody> body, const AddLoads& add_loads = {})
      : body_(system_.add(std::move(body))) {
    if (add_loads) add_loads(system_, body_);
    system_.finish();
    n_ = system_.sizes().velocity;
    q_.resize(n_);
    load_.setZero(n_);
    fixed_.assign(static_cast<std::size_t>(n_), false);
    std::vector<double> v(static_cast<std::size_t>(n_));
    system_.initial({q_.data(), static_cast<std::size_t>(n_)}, v);
  }
  FlexibleBody& body() { return body_; }
  Eigen::VectorXd& q() { return q_; }
  void fix(Index vertex, int axis) { fixed_[static_cast<std::size_t>(3 * vertex + axis)] = true; }
  void fix(Index vertex) {
    for (int i = 0; i < 3; ++i) fix(vertex, i);
  }
  /// Dead load on a vertex.
  void set_load(Index vertex, const Eigen::Vector3d& f) { load_.segment<3>(3 * vertex) = f; }
  [[nodiscard]] Eigen::Vector3d position(Index vertex) const { return q_.segment<3>(3 * vertex); }
  [[nodiscard]] Eigen::Vector3d displacement(Index vertex) const {
    return q_.segment<3>(3 * vertex) - Eigen::Map<const Eigen::Vector3d>(body_.reference().data() + 3 * vertex);
  }

  [[nodiscard]] Eigen::VectorXd residual(double t = 0) {
    Eigen::VectorXd f = Eigen::VectorXd::Zero(n_);
    system_.residual(state(t), {f.data(), static_cast<std::size_t>(n_)});
    return f;
  }
  /// F_q * weights.q + F_v * weights.v + F_a * weights.a
  [[nodiscard]] Eigen::SparseMatrix<double> tangent(const TangentWeights& weights = {0, 0, 1}, double t = 0) {
    const SparsePattern& p = system_.tangent_pattern();
    std::vector<double> values(static_cast<std::size_t>(p.nonzeros()));
    system_.tangent(state(t), weights, values);
    std::vector<int> outer(p.ptr.begin(), p.ptr.end());
    return Eigen::Map<const Eigen::SparseMatrix<double>>(n_, n_, static_cast<Eigen::Index>(values.size()), outer.data(),
                                                         p.ind.data(), values.data());
  }

  /// Newton's method in `steps` equal load steps (pressures see t = 0 .. 1). @return iterations of the last step
  int solve(int steps = 1, int limit = 40) {
    int iterations = 0;
    for (int k = 1; k <= steps; ++k) {
      iterations = newton(static_cast<double>(k) / steps, limit);
      if (iterations < 0) ADD_FAILURE() << "Newton did not converge in load step " << k;
      if (iterations < 0) break;
    }
    return iterations;
  }

 private:
  StateView state(double t) {
    StateView s;
    s.t = t;
    s.q = {q_.data(), static_cast<std::size_t>(n_)};
    return s;
  }
  int newton(double fraction, int limit) {
    double last = 1e300;
    for (int i = 1; i <= limit; ++i) {
      Eigen::VectorXd r = residual(fraction) - fraction * load_;
      Eigen::SparseMatrix<double> k = tangent({0, 0, 1}, fraction);
      for (int c = 0; c < k.outerSize(); ++c)
        for (Eigen::SparseMatrix<double>::InnerIterator it(k, c); it; ++it)
          if (fixed_[static_cast<std::size_t>(c)] || fixed_[static_cast<std::size_t>(it.row())])
            it.valueRef() = it.row() == c ? 1 : 0;
      for (Eigen::Index d = 0; d < n_; ++d)
        if (fixed_[static_cast<std::size_t>(d)]) r[d] = 0;
      Eigen::SparseLU<Eigen::SparseMatrix<double>> lu(k);
      if (lu.info() != Eigen::Success) return -1;
      const Eigen::VectorXd step = lu.solve(r);
      q_ -= step;
      const double size = step.cwiseAbs().maxCoeff() / q_.cwiseAbs().maxCoeff();
      if (!(size < 1e6)) return -1;
      if (size < 1e-13 || (size < 1e-9 && size > 0.5 * last)) return i;
      last = size;
    }
    return -1;
  }

  AssembledSystem system_;
  FlexibleBody& body_;
  Eigen::Index n_ = 0;
  Eigen::VectorXd q_, load_;
  std::vector<bool> fixed_;
};

}  // namespace espalier::dynamics::test
