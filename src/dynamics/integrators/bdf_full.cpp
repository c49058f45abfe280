// The reference iteration: Newton on the square system H = 0 of 3n + m unknowns with an explicit U. The Jacobian of H
// is made by differences of H itself, so it shares no derivative with the reduced iteration. Dense; for tests and for
// small systems.
#include <cmath>

#include "base/at.hpp"
#include "dense/dense.hpp"
#include "dynamics/integrators/bdf.hpp"

namespace espalier::dynamics {

namespace {

Eigen::MatrixXd dense_phi_q(const SparsePattern& p, ConstSpan values, const std::vector<char>& dropped) {
  std::vector<Index> kept;
  for (Index i = 0; i < p.rows; ++i) {
    if (!dropped[at(i)]) kept.push_back(i);
  }
  Eigen::MatrixXd g = Eigen::MatrixXd::Zero(static_cast<Index>(kept.size()), p.cols);
  for (std::size_t r = 0; r < kept.size(); ++r) {
    const auto i = at(kept[r]);
    for (auto k = at(p.ptr[i]); k < at(p.ptr[i + 1]); ++k) {
      g(static_cast<Index>(r), p.ind[k]) = values[k];
    }
  }
  return g;
}

// Adds F_lambda^T to the rows of Phi_q: what stands in the upper right block of K.
void add_f_lambda(const SparsePattern& p, ConstSpan values, const std::vector<char>& dropped, Eigen::MatrixXd& g) {
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < dropped.size(); ++i) {
    if (dropped[i]) continue;
    for (auto k = at(p.ptr[i]); k < at(p.ptr[i + 1]); ++k) g(row, p.ind[k]) += values[k];
    ++row;
  }
}

Eigen::MatrixXd tangent_basis(const Eigen::MatrixXd& g) {
  return dense::qr_factors(g.transpose()).q.rightCols(g.cols() - g.rows());
}

Eigen::MatrixXd boolean_basis(const Eigen::MatrixXd& g) {
  const Eigen::Index n = g.cols(), m = g.rows();
  Eigen::MatrixXd u = Eigen::MatrixXd::Zero(n, n - m);
  const Eigen::VectorXi columns = dense::completely_pivoted_columns(g);
  for (Eigen::Index j = m; j < n; ++j) u(columns[j], j - m) = 1;
  return u;
}

}  // namespace

// U of the kind in use, from the matrix that was factorized last.
void BdfIntegrator::parametrise() {
  KktSolver& kkt = equations_.kkt();
  Eigen::MatrixXd g = dense_phi_q(kkt.phi_q_pattern(), kkt.phi_q_values(), equations_.dropped());
  const Index n = equations_.sizes().velocity;
  Eigen::MatrixXd u;
  if (options_.iteration == DaeIteration::full_boolean) {
    u = boolean_basis(g);
  } else {
    // The solves with K leave free what lies along W^-1 (Phi_q^T + F_lambda).
    const SparsePattern* f_lambda = equations_.system().multiplier_pattern();
    if (f_lambda != nullptr && options_.iteration != DaeIteration::full_tangent)
      add_f_lambda(*f_lambda, kkt.f_lambda_values(), equations_.dropped(), g);
    u = g.rows() == 0 ? Eigen::MatrixXd::Identity(n, n) : tangent_basis(g);
    if (options_.iteration != DaeIteration::full_tangent) {
      Eigen::MatrixXd w = Eigen::MatrixXd::Zero(n, n);
      const SparsePattern& p = kkt.w_pattern();
      for (Index j = 0; j < n; ++j) {
        for (auto k = at(p.ptr[at(j)]); k < at(p.ptr[at(j) + 1]); ++k) {
          w(p.ind[k], j) = kkt.w_of_factor()[k];
        }
      }
      u = w.transpose() * u;
    }
  }
  u_.assign(u.data(), u.data() + u.size());
}

// H = [F + Phi_q^T lambda; Phi_q a - gamma; Phi_q v - nu; Phi; h' U^T R2; h' U^T R1]; dropped rows: lambda = 0 and
// nothing.
void BdfIntegrator::full_residual(const State& s, std::vector<double>& out) {
  const std::size_t n = s.v.size(), m = s.lambda.size();
  const std::size_t free = n == 0 ? 0 : u_.size() / n;
  out.clear();
  equations_.system().local(history_.q(0), s.q, theta_);
  equations_.evaluate_constraints(s.t, s.q, s.v);
  equations_.motion(s.view(), f_);
  find_slip();
  stage_residuals(s);
  out.insert(out.end(), f_.begin(), f_.end());
  const auto keep = [&](ConstSpan values) {
    for (std::size_t i = 0; i < m; ++i) {
      if (!equations_.dropped()[i]) out.push_back(values[i]);
    }
  };
  equations_.level(s.a, equations_.gamma(), level_);
  keep(level_);
  equations_.level(s.v, equations_.nu(), level_);
  keep(level_);
  keep(equations_.phi());
  for (const auto* r : {&r2_, &r1_}) {
    for (std::size_t j = 0; j < free; ++j) {
      double sum = 0;
      for (std::size_t i = 0; i < n; ++i) sum += u_[j * n + i] * (*r)[i];
      out.push_back(formula_.hp * sum);
    }
  }
}

// to = from moved by dx = [da; dv; dq; dlambda of the constraints kept].
void BdfIntegrator::move(const State& from, ConstSpan dx, State& to) const {
  const std::size_t n = from.v.size();
  to.t = from.t;
  for (std::size_t i = 0; i < n; ++i) {
    to.a[i] = from.a[i] + dx[i];
    to.v[i] = from.v[i] + dx[n + i];
  }
  equations_.system().retract(from.q, dx.subspan(2 * n, n), to.q);
  std::size_t next = 3 * n;
  for (std::size_t i = 0; i < from.lambda.size(); ++i) {
    to.lambda[i] = equations_.dropped()[i] ? 0.0 : from.lambda[i] + dx[next++];
  }
}

BdfIntegrator::Outcome BdfIntegrator::solve_full(StepReport& report) {
  formula_is_projected_ = false;
  parametrise();
  const std::size_t n = trial_.v.size();
  State now = trial_, moved = trial_;
  std::vector<double> h0, h1;
  double best = std::numeric_limits<double>::infinity();
  for (int iteration = 1; iteration <= options_.max_newton + 8; ++iteration) {
    report.newton_iterations = iteration;
    full_residual(now, h0);
    const std::size_t size = h0.size();
    std::vector<double> dx(size, 0.0);
    Eigen::MatrixXd jacobian(size, size);
    for (std::size_t j = 0; j < size; ++j) {
      // Accelerations and multipliers enter H linearly, so their difference step may be of their own size.
      const double level = j < n       ? max_norm(now.a)
                           : j < 2 * n ? max_norm(now.v)
                           : j < 3 * n ? 1.0
                                       : max_norm(now.lambda);
      const double delta = 1e-7 * std::max(1.0, level);
      dx[j] = delta;
      move(now, dx, moved);
      full_residual(moved, h1);
      dx[j] = 0;
      for (std::size_t i = 0; i < size; ++i) {
        jacobian(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = (h1[i] - h0[i]) / delta;
      }
    }
    const Eigen::VectorXd step =
        dense::solve_by_complete_pivoting(jacobian, -Eigen::Map<Eigen::VectorXd>(h0.data(), jacobian.rows()));
    move(now, {step.data(), size}, moved);
    std::swap(now, moved);
    const double change = std::max(norm({step.data() + 2 * n, n}, weight_q_) / share_q_,
                                   norm({step.data() + n, n}, weight_v_) / share_v_);
    if (!std::isfinite(change)) return Outcome::diverged;
    // Converged when the change no longer falls, far below the tolerance.
    if (change < 1e-3 && change >= 0.3 * best) break;
    if (change == 0) break;
    if (iteration == options_.max_newton + 8) return Outcome::slow;
    best = std::min(best, change);
  }
  trial_ = now;
  equations_.system().local(history_.q(0), trial_.q, theta_);
  equations_.evaluate_constraints(trial_.t, trial_.q, trial_.v);
  equations_.motion(trial_.view(), f_);
  report.residual = max_norm(f_);
  rate_poor_ = true;  // U belongs to this step
  static_cast<void>(constraints_hold(report));
  return Outcome::converged;
}

// Every block of H at the converged state, while the history still stands at the beginning of the step.
void BdfIntegrator::measure_blocks() {
  parametrise();
  std::vector<double> h;
  full_residual(trial_, h);
  const std::size_t n = trial_.v.size(), free = u_.size() / std::max<std::size_t>(n, 1),
                    m = (h.size() - n - 2 * free) / 3;
  const auto block_norm = [&](std::size_t first, std::size_t count) {
    return max_norm(ConstSpan(h).subspan(first, count));
  };
  blocks_ = {block_norm(0, n),
             block_norm(n, m),
             block_norm(n + m, m),
             block_norm(n + 2 * m, m),
             block_norm(n + 3 * m, free),
             block_norm(n + 3 * m + free, free)};
}

}  // namespace espalier::dynamics
