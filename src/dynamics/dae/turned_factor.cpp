#include "dynamics/dae/turned_factor.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/dae/at.hpp"
#include "dynamics/dae/products.hpp"

namespace espalier::dynamics {

void TurnedFactor::start(const SparsePattern& phi_q, ConstSpan phi_q_values, const std::vector<char>& dropped) {
  phi_q_ = &phi_q;
  kept_.clear();
  for (Index i = 0; i < phi_q.rows; ++i)
    if (dropped[at(i)] == 0) kept_.push_back(i);
  phi_q_0_.assign(phi_q_values.begin(), phi_q_values.end());
  y_0_.clear();
  active_ = false;
}

// The part of motion of x: R x, or R^T x.
void TurnedFactor::rotate(Span x, bool back) const {
  for (const BodyTurn& turn : turns_) {
    const auto& r = turn.rotation;
    double* v = x.data() + turn.first;
    for (Index k = 0; k < turn.vertices; ++k, v += 3) {
      const double a = v[0], b = v[1], c = v[2];
      for (std::size_t i = 0; i < 3; ++i)
        v[i] = back ? r[i] * a + r[3 + i] * b + r[6 + i] * c : r[3 * i] * a + r[3 * i + 1] * b + r[3 * i + 2] * c;
    }
  }
}

// V^T z = [mu; P R z_v - P_0 z_v], of the constraints kept.
void TurnedFactor::apply_v(ConstSpan z, double* out) const {
  const std::size_t n = at(phi_q_->cols);
  work_n_.assign(z.begin(), z.begin() + phi_q_->cols);
  work_m_.resize(at(phi_q_->rows));
  multiply_by_rows(*phi_q_, phi_q_0_, work_n_, work_m_);
  const std::size_t k = kept_.size();
  for (std::size_t c = 0; c < k; ++c) {
    out[c] = z[n + at(kept_[c])];
    out[k + c] = -work_m_[at(kept_[c])];
  }
  rotate(work_n_, false);
  multiply_by_rows(*phi_q_, phi_q_now_, work_n_, work_m_);
  for (std::size_t c = 0; c < k; ++c) out[k + c] += work_m_[at(kept_[c])];
}

bool TurnedFactor::turn(std::vector<BodyTurn> turns, ConstSpan phi_q_values, const Solve& solve) {
  const std::size_t n = at(phi_q_->cols), size = n + at(phi_q_->rows), k = kept_.size();
  active_ = false;
  turns_ = std::move(turns);
  phi_q_now_.assign(phi_q_values.begin(), phi_q_values.end());
  g_.setZero(static_cast<Eigen::Index>(size), static_cast<Eigen::Index>(2 * k));
  if (k == 0) return active_ = true;
  if (y_0_.empty()) {
    std::vector<double> units(size * k, 0.0);
    for (std::size_t c = 0; c < k; ++c) units[c * size + n + at(kept_[c])] = 1;
    solve(units, static_cast<Index>(k));  // may be interrupted
    y_0_ = std::move(units);
  }
  for (std::size_t c = 0; c < k; ++c) {  // R^T P^T - P_0^T
    const Span column(g_.data() + c * size, size);
    const Index row = kept_[c];
    for (Offset p = phi_q_->ptr[at(row)]; p < phi_q_->ptr[at(row) + 1]; ++p)
      column[at(phi_q_->ind[at(p)])] = phi_q_now_[at(p)];
    rotate(column, true);
    for (Offset p = phi_q_->ptr[at(row)]; p < phi_q_->ptr[at(row) + 1]; ++p)
      column[at(phi_q_->ind[at(p)])] -= phi_q_0_[at(p)];
  }
  solve({g_.data(), k * size}, static_cast<Index>(k));
  std::copy(y_0_.begin(), y_0_.end(), g_.data() + k * size);
  core_matrix_.resize(static_cast<Eigen::Index>(2 * k), static_cast<Eigen::Index>(2 * k));
  for (std::size_t c = 0; c < 2 * k; ++c) apply_v({g_.data() + c * size, size}, core_matrix_.data() + c * 2 * k);
  core_.compute(core_matrix_ + Eigen::MatrixXd::Identity(core_matrix_.rows(), core_matrix_.cols()));
  const double rcond = core_.rcond();
  active_ = std::isfinite(rcond) && rcond > 1e-12;
  return active_;
}

void TurnedFactor::solve(Span b, Index columns, const Solve& solve, base::ThreadPool* pool) const {
  const auto size = static_cast<std::size_t>(g_.rows());
  const std::size_t k = 2 * kept_.size();
  for (std::size_t c = 0; c < at(columns); ++c) rotate(b.subspan(c * size, size), true);
  solve(b, columns);
  Eigen::VectorXd w(static_cast<Eigen::Index>(k));
  for (std::size_t c = 0; c < at(columns); ++c) {
    const Span x = b.subspan(c * size, size);
    if (k > 0) {
      apply_v(x, w.data());
      w = -core_.solve(w).eval();
      add_columns(g_.data(), {w.data(), k}, x, pool);
    }
    rotate(x, false);
  }
}

std::vector<double> TurnedFactor::response() const {
  const Eigen::Index size = g_.rows(), k = static_cast<Eigen::Index>(kept_.size());
  std::vector<double> columns = y_0_;
  if (k == 0) return columns;
  Eigen::Map<Eigen::MatrixXd> y(columns.data(), size, k);
  y.noalias() -= g_ * core_.solve(core_matrix_.rightCols(k));
  for (Eigen::Index c = 0; c < k; ++c) rotate({columns.data() + c * size, at(size)}, false);
  return columns;
}

}  // namespace espalier::dynamics
