#include "dynamics/model/assembly/nearest_positions.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include "dense/dense.hpp"
#include "dynamics/integrators/initial.hpp"

namespace espalier::dynamics::model {
namespace {

using dense::MatrixXd;

/// A configuration with its constraints.
struct Trial {
  std::vector<double> q, phi, phi_q;
  double cost = 0;  ///< sum of (weight phi / size)^2
};

class LeastViolation {
 public:
  LeastViolation(System& system, double t, ConstSpan q, ConstSpan weights)
      : system_(system),
        t_(t),
        weights_(weights.begin(), weights.end()),
        m_(static_cast<std::size_t>(system.sizes().constraints)),
        n_(static_cast<std::size_t>(system.sizes().velocity)),
        widths_(coordinate_sizes(system, q)) {
    at_.q.assign(q.begin(), q.end());
    at_.phi.resize(m_);
    at_.phi_q.resize(static_cast<std::size_t>(system.constraint_pattern().nonzeros()));
    system_.constraints(t_, at_.q, {}, {at_.phi, {}, {}, at_.phi_q});
    sizes_ = constraint_sizes(system_, at_.q, at_.phi_q);
    at_.cost = cost_of(at_.phi);
  }

  NearestPositions run() {
    at_ = descended(std::move(at_));
    // A dead point is stationary without being the least.
    if (at_.cost > kClosed) {
      Trial other = descended(shaken(at_));
      if (other.cost < at_.cost) at_ = std::move(other);
    }
    return result();
  }

  NearestPositions run(const RowRange& last) {
    std::vector<double> own(m_, 0.0);
    for (std::size_t i = last.first; i < last.first + last.count; ++i) std::swap(own[i], weights_[i]);
    at_ = descended(std::move(at_));
    if (at_.cost > kClosed) at_ = descended(shaken(at_));
    if (at_.cost <= kClosed) {
      Trial best = slid(at_, own, last);
      Trial start = descended(shaken(best));
      if (start.cost <= kClosed) {
        Trial other = slid(std::move(start), own, last);
        if (part_of(other, own, last) < part_of(best, own, last)) best = std::move(other);
      }
      at_ = std::move(best);
    }
    return result();
  }

 private:
  static constexpr double kClosed = 1e-22;

  [[nodiscard]] double cost_of(ConstSpan phi) const {
    double sum = 0;
    for (std::size_t i = 0; i < m_; ++i) {
      const double part = weights_[i] * phi[i] / sizes_[i];
      sum += part * part;
    }
    return std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity();
  }

  [[nodiscard]] Trial moved(const Trial& from, ConstSpan step) {
    Trial to{std::vector<double>(from.q.size()), std::vector<double>(m_), std::vector<double>(from.phi_q.size()), 0};
    try {
      system_.retract(from.q, step, to.q);
      system_.constraints(t_, to.q, {}, {to.phi, {}, {}, to.phi_q});
      to.cost = cost_of(to.phi);
    } catch (const Error&) {  // a direction of length zero
      to.cost = std::numeric_limits<double>::infinity();
    }
    return to;
  }

  [[nodiscard]] Trial shaken(const Trial& from) {
    constexpr double kSmall = 1e-3;
    std::mt19937 random(1);
    std::uniform_real_distribution<double> part(-kSmall, kSmall);
    std::vector<double> step(n_);
    for (std::size_t j = 0; j < n_; ++j) step[j] = part(random) * widths_[j];
    return moved(from, step);
  }

  /// Levenberg and Marquardt's method.
  [[nodiscard]] Trial descended(Trial at) {
    constexpr int kMost = 100;
    constexpr double kSlow = 1e-10, kStiffest = 1e12;
    double damping = 1e-3;
    int k = 0;
    for (; k < kMost && at.cost > kClosed && damping < kStiffest; ++k) {
      ++found_.iterations;
      Trial next = moved(at, step_of(at, damping));
      if (!(next.cost < at.cost)) {
        damping *= 8;
        continue;
      }
      const bool slow = next.cost > (1 - kSlow) * at.cost && damping < 1;
      at = std::move(next);
      damping = std::max(0.1 * damping, 1e-12);
      if (slow) break;
    }
    found_.exhausted = k == kMost;
    return at;
  }

  /// Rows of Phi_q over their sizes, columns times those of the coordinates. @param weights of the rows
  [[nodiscard]] MatrixXd scaled(const Trial& at, ConstSpan weights) const {
    const SparsePattern& p = system_.constraint_pattern();
    MatrixXd a = MatrixXd::Zero(static_cast<Eigen::Index>(m_), static_cast<Eigen::Index>(n_));
    for (std::size_t i = 0; i < m_; ++i)
      for (auto k = static_cast<std::size_t>(p.ptr[i]); k < static_cast<std::size_t>(p.ptr[i + 1]); ++k) {
        const auto j = static_cast<std::size_t>(p.ind[k]);
        a(static_cast<Eigen::Index>(i), p.ind[k]) = weights[i] / sizes_[i] * at.phi_q[k] * widths_[j];
      }
    return a;
  }

  /// A A^T with a part of its largest entry on the diagonal.
  static MatrixXd damped_gram(const MatrixXd& a, double damping) {
    MatrixXd gram = dense::transposed_times(a.transpose(), a.transpose());
    const double largest = gram.rows() > 0 ? gram.diagonal().maxCoeff() : 0;
    gram.diagonal().array() += damping * (largest > 0 ? largest : 1);
    return gram;
  }

  [[nodiscard]] std::vector<double> limited(const MatrixXd& step) const {
    constexpr double kFarthest = 0.5;  // of the sizes: half a radian
    const double longest = step.cwiseAbs().maxCoeff(), part = longest > kFarthest ? kFarthest / longest : 1;
    std::vector<double> out(n_);
    for (std::size_t j = 0; j < n_; ++j) out[j] = part * step(static_cast<Eigen::Index>(j), 0) * widths_[j];
    return out;
  }

  /// dq = D A^T z with (A A^T + mu I) z = -r.
  [[nodiscard]] std::vector<double> step_of(const Trial& at, double damping) {
    const MatrixXd a = scaled(at, weights_);
    MatrixXd z(static_cast<Eigen::Index>(m_), 1);
    for (std::size_t i = 0; i < m_; ++i) z(static_cast<Eigen::Index>(i), 0) = -weights_[i] * at.phi[i] / sizes_[i];
    if (!dense::solve_definite(damped_gram(a, damping), z)) return std::vector<double>(n_, 0.0);
    return limited(dense::transposed_times(a, z));
  }

  [[nodiscard]] double part_of(const Trial& at, ConstSpan own, const RowRange& last) const {
    double sum = 0;
    for (std::size_t i = last.first; i < last.first + last.count; ++i) {
      const double part = own[i] * at.phi[i] / sizes_[i];
      sum += part * part;
    }
    return sum;
  }

  /// The step of the rows `last`, G their gradients beside those of the others: dq = -D G^T (G G^T + mu I)^-1 r.
  [[nodiscard]] std::vector<double> sliding_step(const Trial& at, ConstSpan own, const RowRange& last, double damping) {
    constexpr double kDependent = 1e-13;
    const MatrixXd others = scaled(at, weights_);
    const auto first = static_cast<Eigen::Index>(last.first), count = static_cast<Eigen::Index>(last.count);
    MatrixXd g = scaled(at, own).middleRows(first, count).eval();
    MatrixXd share = dense::times(others, g.transpose());
    if (!dense::solve_definite(damped_gram(others, kDependent), share)) return std::vector<double>(n_, 0.0);
    g -= dense::transposed_times(share, others);
    MatrixXd z(count, 1);
    for (Eigen::Index i = 0; i < count; ++i) {
      const std::size_t row = last.first + static_cast<std::size_t>(i);
      z(i, 0) = -own[row] * at.phi[row] / sizes_[row];
    }
    if (!dense::solve_definite(damped_gram(g, damping), z)) return std::vector<double>(n_, 0.0);
    return limited(dense::transposed_times(g, z));
  }

  /// Goes down with the rows `last` along the positions that satisfy the others. @pre `at` does
  [[nodiscard]] Trial slid(Trial at, ConstSpan own, const RowRange& last) {
    constexpr int kMost = 200;
    constexpr double kSlow = 1e-12, kStiffest = 1e9;
    double damping = 1e-3, part = part_of(at, own, last);
    for (int k = 0; k < kMost && part > kClosed && damping < kStiffest; ++k) {
      Trial next = descended(moved(at, sliding_step(at, own, last, damping)));
      const double now = next.cost <= kClosed ? part_of(next, own, last) : std::numeric_limits<double>::infinity();
      if (!(now < part)) {
        damping *= 8;
        continue;
      }
      const bool slow = now > (1 - kSlow) * part;
      at = std::move(next);
      part = now;
      damping = std::max(0.1 * damping, 1e-9);
      if (slow) break;
    }
    return at;
  }

  NearestPositions result() {
    found_.part.resize(m_);
    for (std::size_t i = 0; i < m_; ++i) found_.part[i] = std::abs(at_.phi[i]) / sizes_[i];
    found_.q = std::move(at_.q);
    found_.phi = std::move(at_.phi);
    return std::move(found_);
  }

  System& system_;
  double t_;
  std::vector<double> weights_;
  std::size_t m_, n_;
  std::vector<double> widths_, sizes_;
  Trial at_;
  NearestPositions found_;
};

}  // namespace

NearestPositions nearest_positions(System& system, double t, ConstSpan q, ConstSpan weights) {
  return LeastViolation(system, t, q, weights).run();
}

NearestPositions nearest_positions(System& system, double t, ConstSpan q, ConstSpan weights, const RowRange& last) {
  return LeastViolation(system, t, q, weights).run(last);
}

}  // namespace espalier::dynamics::model
