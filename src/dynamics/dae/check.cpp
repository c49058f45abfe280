#include "dynamics/dae/check.hpp"

#include <algorithm>
#include <cmath>

namespace espalier::dynamics {

namespace {

class Checker {
 public:
  Checker(System& system, const State& s)
      : system_(system),
        s_(s),
        n_(s.v.size()),
        m_(s.lambda.size()),
        w_(at(system.tangent_pattern().nonzeros())),
        phi_q_(at(system.constraint_pattern().nonzeros())) {}

  JacobianCheck run() {
    result_.f_a = tangent({1, 0, 0}, "F_a", &State::a);
    result_.f_v = tangent({0, 1, 0}, "F_v", &State::v);
    result_.f_q = tangent({0, 0, 1}, "F_q", nullptr);
    if (m_ > 0) {
      multiplier_jacobian();
      constraint_jacobian();
      rates();
    }
    chart();
    return result_;
  }

 private:
  // Third root of eps, the step at which truncation and round-off of a central difference balance.
  static constexpr double kStep = 6e-6;

  void note(double& field, double difference, const std::string& what) {
    if (difference > result_.largest()) result_.worst = what;
    field = std::max(field, difference);
  }

  std::vector<double> residual(const State& s) {
    std::vector<double> f(n_);
    system_.residual(s.view(), f);
    if (m_ > 0) {
      std::vector<double> values(phi_q_.size());
      system_.constraints(s.t, s.q, {}, {{}, {}, {}, values});
      add_transposed(system_.constraint_pattern(), values, s.lambda, f);
    }
    return f;
  }

  [[nodiscard]] State moved(std::vector<double> State::*part, std::size_t j, double step) const {
    State x = s_;
    if (part != nullptr) {
      (x.*part)[j] += step;
    } else {
      std::vector<double> dq(n_, 0.0);
      dq[j] = step;
      system_.retract(s_.q, dq, x.q);
    }
    return x;
  }

  double tangent(const TangentWeights& weights, const std::string& name, std::vector<double> State::*part) {
    system_.tangent(s_.view(), weights, w_);
    const SparsePattern& p = system_.tangent_pattern();
    double size = 1, difference = 0;
    for (std::size_t j = 0; j < n_; ++j) {
      const double x = part == nullptr ? 1.0 : std::abs((s_.*part)[j]);
      const double step = kStep * std::max(1.0, x);
      const std::vector<double> plus = residual(moved(part, j, step)), minus = residual(moved(part, j, -step));
      std::vector<double> column(n_, 0.0);
      for (auto k = at(p.ptr[j]); k < at(p.ptr[j + 1]); ++k) {
        column[at(p.ind[k])] = w_[k];
      }
      for (std::size_t i = 0; i < n_; ++i) {
        const double value = (plus[i] - minus[i]) / (2 * step);
        size = std::max(size, std::abs(value));
        if (std::abs(value - column[i]) > difference) {
          difference = std::abs(value - column[i]);
          place_ = name + " (" + system_.coordinate_name(static_cast<Index>(i)) + "; " +
                   system_.coordinate_name(static_cast<Index>(j)) + "): " + std::to_string(column[i]) + " stated, " +
                   std::to_string(value) + " by differences";
        }
      }
    }
    double field = 0;
    note(field, difference / size, place_);
    return field;
  }

  // F_lambda + Phi_q^T against differences; noted in f_lambda.
  void multiplier_jacobian() {
    std::vector<double> dense(n_ * m_, 0.0);
    system_.constraints(s_.t, s_.q, {}, {{}, {}, {}, phi_q_});
    const SparsePattern& p = system_.constraint_pattern();
    for (std::size_t r = 0; r < m_; ++r)
      for (auto k = at(p.ptr[r]); k < at(p.ptr[r + 1]); ++k) dense[r * n_ + at(p.ind[k])] = phi_q_[k];
    if (const SparsePattern* more = system_.multiplier_pattern()) {
      std::vector<double> values(at(more->nonzeros()));
      system_.multiplier_tangent(s_.view(), values);
      for (std::size_t r = 0; r < m_; ++r)
        for (auto k = at(more->ptr[r]); k < at(more->ptr[r + 1]); ++k) dense[r * n_ + at(more->ind[k])] += values[k];
    }
    const double size = std::max(1.0, max_norm(dense));
    for (std::size_t r = 0; r < m_; ++r) {
      const double step = kStep * std::max(1.0, std::abs(s_.lambda[r]));
      const std::vector<double> plus = residual(moved(&State::lambda, r, step)),
                                minus = residual(moved(&State::lambda, r, -step));
      for (std::size_t i = 0; i < n_; ++i)
        note(result_.f_lambda, std::abs((plus[i] - minus[i]) / (2 * step) - dense[r * n_ + i]) / size,
             "F_lambda (" + system_.coordinate_name(static_cast<Index>(i)) + "; " +
                 system_.constraint_name(static_cast<Index>(r)) + ")");
    }
  }

  [[nodiscard]] bool has_position_level(std::size_t row) const {
    const std::span<const Index> rows = system_.non_holonomic();
    return !std::binary_search(rows.begin(), rows.end(), static_cast<Index>(row));
  }

  void constraint_jacobian() {
    const SparsePattern& p = system_.constraint_pattern();
    system_.constraints(s_.t, s_.q, {}, {{}, {}, {}, phi_q_});
    std::vector<double> dense(m_ * n_, 0.0), plus(m_), minus(m_);
    for (std::size_t i = 0; i < m_; ++i) {
      for (auto k = at(p.ptr[i]); k < at(p.ptr[i + 1]); ++k) {
        dense[i * n_ + at(p.ind[k])] = phi_q_[k];
      }
    }
    const double size = std::max(1.0, max_norm(dense));
    for (std::size_t j = 0; j < n_; ++j) {
      system_.constraints(s_.t, moved(nullptr, j, kStep).q, {}, {plus, {}, {}, {}});
      system_.constraints(s_.t, moved(nullptr, j, -kStep).q, {}, {minus, {}, {}, {}});
      for (std::size_t i = 0; i < m_; ++i) {
        if (!has_position_level(i)) continue;
        const double difference = std::abs((plus[i] - minus[i]) / (2 * kStep) - dense[i * n_ + j]) / size;
        note(result_.phi_q, difference,
             "Phi_q (" + system_.constraint_name(static_cast<Index>(i)) + "; " +
                 system_.coordinate_name(static_cast<Index>(j)) + ")");
      }
    }
  }

  // Phi_q v - nu at time t + tau, on the curve q (+) tau v with constant v.
  std::vector<double> velocity_level(double tau) {
    std::vector<double> step(s_.v), q(s_.q.size()), nu(m_), out(m_), values(phi_q_.size());
    for (double& x : step) x *= tau;
    system_.retract(s_.q, step, q);
    system_.constraints(s_.t + tau, q, {}, {{}, nu, {}, values});
    multiply_by_rows(system_.constraint_pattern(), values, s_.v, out);
    for (std::size_t i = 0; i < m_; ++i) out[i] -= nu[i];
    return out;
  }

  void rates() {
    std::vector<double> nu(m_), gamma(m_), plus(m_), minus(m_);
    system_.constraints(s_.t, s_.q, s_.v, {{}, nu, gamma, {}});
    system_.constraints(s_.t + kStep, s_.q, {}, {plus, {}, {}, {}});
    system_.constraints(s_.t - kStep, s_.q, {}, {minus, {}, {}, {}});
    const double size = std::max(1.0, max_norm(gamma));
    const double tau = kStep / std::max(1.0, max_norm(s_.v));
    const std::vector<double> later = velocity_level(tau), earlier = velocity_level(-tau);
    for (std::size_t i = 0; i < m_; ++i) {
      const std::string name = system_.constraint_name(static_cast<Index>(i));
      note(result_.nu, std::abs(nu[i] + (plus[i] - minus[i]) / (2 * kStep)) / std::max(1.0, max_norm(nu)),
           "nu of " + name);
      note(result_.gamma, std::abs(gamma[i] + (later[i] - earlier[i]) / (2 * tau)) / size, "gamma of " + name);
    }
  }

  void check_carry(std::vector<double> x, std::vector<double> carried) {
    std::vector<double> expected(n_);
    system_.velocity_of_rate(x, carried, expected);
    const Span vectors[] = {carried};
    system_.carry(x, vectors);
    for (double& xi : x) xi = -xi;
    system_.rate_of_velocity(x, expected, expected);
    for (std::size_t i = 0; i < n_; ++i) {
      note(result_.chart, std::abs(carried[i] - expected[i]),
           "carry of " + system_.coordinate_name(static_cast<Index>(i)));
    }
  }

  // local(q, q (+) x) = x; and d/ds [q (+) theta(s)] = T(theta) theta_dot in the tangent at the moved point.
  void chart() {
    std::vector<double> x(n_), y(n_), back(n_), rate(n_), velocity(n_), q(s_.q.size()), q_plus(q), q_minus(q);
    for (std::size_t i = 0; i < n_; ++i) {
      x[i] = 0.3 * std::sin(1.0 + 2.3 * static_cast<double>(i));
      rate[i] = std::cos(0.7 + 1.9 * static_cast<double>(i));
    }
    system_.retract(s_.q, x, q);
    system_.local(s_.q, q, back);
    for (std::size_t i = 0; i < n_; ++i) note(result_.chart, std::abs(back[i] - x[i]), "local(retract)");
    system_.velocity_of_rate(x, rate, velocity);
    for (std::size_t i = 0; i < n_; ++i) y[i] = x[i] + kStep * rate[i];
    system_.retract(s_.q, y, q_plus);
    for (std::size_t i = 0; i < n_; ++i) y[i] = x[i] - kStep * rate[i];
    system_.retract(s_.q, y, q_minus);
    system_.local(q, q_plus, back);
    system_.local(q, q_minus, y);
    for (std::size_t i = 0; i < n_; ++i) {
      note(result_.chart, std::abs((back[i] - y[i]) / (2 * kStep) - velocity[i]),
           "velocity_of_rate of " + system_.coordinate_name(static_cast<Index>(i)));
    }
    system_.rate_of_velocity(x, velocity, velocity);
    for (std::size_t i = 0; i < n_; ++i) {
      note(result_.chart, std::abs(velocity[i] - rate[i]),
           "rate_of_velocity of " + system_.coordinate_name(static_cast<Index>(i)));
    }
    check_carry(x, rate);
  }

  System& system_;
  const State& s_;
  std::size_t n_, m_;
  std::vector<double> w_, phi_q_;
  std::string place_;
  JacobianCheck result_;
};

}  // namespace

JacobianCheck check_jacobians(System& system, const State& s) {
  system.update_pattern(s.q);
  return Checker(system, s).run();
}

}  // namespace espalier::dynamics
