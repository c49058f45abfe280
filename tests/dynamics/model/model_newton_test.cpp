// Newton's iteration converges as Newton's: one implicit Euler step of every small model of the documentation and of
// the examples, begun near its solution. A term that is missing in the matrix, or wrong, makes the order 1 and hides
// behind more iterations otherwise.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace model_newton_test {

constexpr Index kMostUnknowns = 300;

// v and a follow what q has moved since the step began.
class EulerStep {
 public:
  EulerStep(model::Mechanism& mechanism, double h) : system_(mechanism.system), s_(system_.sizes()), h_(h) {
    mechanism.system.initial(s_.q, s_.v);
    s_.t = h_;
    n_ = static_cast<Index>(s_.v.size());
    m_ = static_cast<Index>(s_.lambda.size());
    const std::vector<double> q = s_.q;
    std::vector<double> way(s_.v);
    for (double& x : way) x *= h_;
    system_.retract(q, way, s_.q);
  }

  void move(const Eigen::VectorXd& d) {
    const std::vector<double> q = s_.q, step(d.data(), d.data() + n_);
    system_.retract(q, step, s_.q);
    for (Index i = 0; i < n_; ++i) {
      s_.v[at(i)] += d[i] / h_;
      s_.a[at(i)] += d[i] / (h_ * h_);
    }
    for (Index r = 0; r < m_; ++r) s_.lambda[at(r)] += d[n_ + r];
  }

  // The step of Newton's method; redundant constraints are met together.
  [[nodiscard]] Eigen::VectorXd newton() {
    system_.update_pattern(s_.q);
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(n_ + m_, n_ + m_);
    const SparsePattern& w = system_.tangent_pattern();
    std::vector<double> values(at(w.nonzeros()));
    system_.tangent(s_.view(), {1 / (h_ * h_), 1 / h_, 1}, values);
    for (Index j = 0; j < n_; ++j)
      for (Offset k = w.ptr[at(j)]; k < w.ptr[at(j) + 1]; ++k) matrix(w.ind[at(k)], j) += values[at(k)];
    std::vector<double> f(at(n_)), phi(at(m_));
    system_.residual(s_.view(), f);
    Eigen::VectorXd right(n_ + m_);
    right.head(n_) = Eigen::Map<const Eigen::VectorXd>(f.data(), n_);
    if (m_ > 0) {
      const SparsePattern& p = system_.constraint_pattern();
      std::vector<double> of_phi(at(p.nonzeros()));
      system_.constraints(s_.t, s_.q, {}, {phi, {}, {}, of_phi});
      for (Index r = 0; r < m_; ++r)
        for (Offset k = p.ptr[at(r)]; k < p.ptr[at(r) + 1]; ++k) {
          matrix(p.ind[at(k)], n_ + r) += of_phi[at(k)];
          matrix(n_ + r, p.ind[at(k)]) += of_phi[at(k)];
          right[p.ind[at(k)]] += of_phi[at(k)] * s_.lambda[at(r)];
        }
      if (const SparsePattern* more = system_.multiplier_pattern()) {
        std::vector<double> slopes(at(more->nonzeros()));
        system_.multiplier_tangent(s_.view(), slopes);
        for (Index r = 0; r < m_; ++r)
          for (Offset k = more->ptr[at(r)]; k < more->ptr[at(r) + 1]; ++k)
            matrix(more->ind[at(k)], n_ + r) += slopes[at(k)];
      }
      right.tail(m_) = Eigen::Map<const Eigen::VectorXd>(phi.data(), m_);
    }
    // Rows and columns of about 1: forces and lengths have units of their own.
    const Eigen::VectorXd scale = matrix.cwiseAbs().rowwise().maxCoeff().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd scaled = scale.asDiagonal() * matrix * scale.asDiagonal();
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> qr(scaled);
    Eigen::VectorXd d = scale.cwiseProduct(qr.solve(-scale.cwiseProduct(right)));
    return d;
  }
  [[nodiscard]] double size_of_way(const Eigen::VectorXd& d) const { return d.head(n_).cwiseAbs().maxCoeff(); }
  [[nodiscard]] double extent() const {
    double most = 1e-3;
    for (const double x : s_.q) most = std::max(most, std::abs(x));
    return most;
  }
  [[nodiscard]] Index unknowns() const { return n_; }
  [[nodiscard]] Eigen::VectorXd any(double size, unsigned seed) const {
    std::mt19937 engine(seed);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Eigen::VectorXd d = Eigen::VectorXd::Zero(n_ + m_);
    for (Index i = 0; i < n_; ++i) d[i] = size * uniform(engine);
    return d;
  }

 private:
  System& system_;
  State s_;
  double h_;  // s
  Index n_ = 0, m_ = 0;
};

// What one step leaves, of the distance before it: the best exponent between two distances from the solution; 2 where
// it leaves rounding.
double order_of(const EulerStep& solution) {
  double best = 0, before = 0, left_before = 0;
  for (double size = 1e-2; size > 1e-8; size /= 3) {
    EulerStep near = solution;
    near.move(solution.any(size * solution.extent(), 5));
    const Eigen::VectorXd step = near.newton();
    near.move(step);
    const double distance = solution.size_of_way(step), left = solution.size_of_way(near.newton());
    if (left <= 1e-11 * distance) return std::max(best, 2.0);
    if (before > 0) best = std::max(best, std::log(left_before / left) / std::log(before / distance));
    before = distance;
    left_before = left;
  }
  return best;
}

TEST(ModelNewton, ConvergesQuadratically) {
  int checked = 0;
  for_each_small_model(kMostUnknowns, [&](model::Mechanism& mechanism, const std::string& name) {
    for (const double h : {1e-3, 0.05}) {
      SCOPED_TRACE(name + ", a step of " + std::to_string(h));
      EulerStep step(mechanism, h);
      double last = 1;
      for (int k = 0; k < 40 && last > 1e-13 * step.extent(); ++k) {
        const Eigen::VectorXd d = step.newton();
        last = step.size_of_way(d);
        step.move(d);
        if (!std::isfinite(last)) break;
      }
      if (!(last <= 1e-9 * step.extent())) continue;  // no solution beside the beginning
      ++checked;
      EXPECT_GE(order_of(step), 1.9);
    }
  });
  EXPECT_GE(checked, 40);
}

}  // namespace model_newton_test
}  // namespace espalier::dynamics
