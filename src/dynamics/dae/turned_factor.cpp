#include "dynamics/dae/turned_factor.hpp"

#include <algorithm>
#include <cmath>

#include "base/at.hpp"
#include "base/parallel.hpp"
#include "dynamics/dae/products.hpp"
#include "dynamics/dae/vectors.hpp"

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
void TurnedFactor::rotate(Span x, bool back, base::ThreadPool* pool) const {
  for (const BodyTurn& turn : turns_) {
    const auto& r = turn.rotation;
    for_each_entry(pool, at(turn.vertices), [&](std::size_t k) {
      double* v = x.data() + at(turn.first) + 3 * k;
      const double a = v[0], b = v[1], c = v[2];
      for (std::size_t i = 0; i < 3; ++i)
        v[i] = back ? r[i] * a + r[3 + i] * b + r[6 + i] * c : r[3 * i] * a + r[3 * i + 1] * b + r[3 * i + 2] * c;
    });
  }
}

// D = P R - P_0, row by row: as many entries as P has, or the others of their vertices too.
void TurnedFactor::make_change(ConstSpan phi_q_values) {
  std::sort(turns_.begin(), turns_.end(), [](const BodyTurn& x, const BodyTurn& y) { return x.first < y.first; });
  change_ = {static_cast<Index>(kept_.size()), phi_q_->cols, {0}, {}};
  change_values_.clear();
  const auto turn_of = [this](Index column) -> const BodyTurn* {
    const auto after = std::upper_bound(turns_.begin(), turns_.end(), column,
                                        [](Index c, const BodyTurn& turn) { return c < turn.first; });
    if (after == turns_.begin() || column >= (after - 1)->first + 3 * (after - 1)->vertices) return nullptr;
    return &*(after - 1);
  };
  for (const Index row : kept_) {
    const Offset end = phi_q_->ptr[at(row) + 1];
    for (Offset p = phi_q_->ptr[at(row)]; p < end;) {
      const Index column = phi_q_->ind[at(p)];
      const BodyTurn* turn = turn_of(column);
      if (turn == nullptr) {
        change_.ind.push_back(column);
        change_values_.push_back(phi_q_values[at(p)] - phi_q_0_[at(p)]);
        ++p;
        continue;
      }
      const Index first = column - (column - turn->first) % 3;
      double now[3] = {}, before[3] = {};
      for (; p < end && phi_q_->ind[at(p)] < first + 3; ++p) {
        now[phi_q_->ind[at(p)] - first] = phi_q_values[at(p)];
        before[phi_q_->ind[at(p)] - first] = phi_q_0_[at(p)];
      }
      const auto& r = turn->rotation;
      for (std::size_t i = 0; i < 3; ++i) {
        change_.ind.push_back(first + static_cast<Index>(i));
        change_values_.push_back(r[i] * now[0] + r[3 + i] * now[1] + r[6 + i] * now[2] - before[i]);
      }
    }
    change_.ptr.push_back(static_cast<Offset>(change_.ind.size()));
  }
}

// V^T z = [mu; D z_v], of the constraints kept.
void TurnedFactor::apply_v(ConstSpan z, double* out) const {
  const std::size_t n = at(phi_q_->cols), k = kept_.size();
  for (std::size_t c = 0; c < k; ++c) out[c] = z[n + at(kept_[c])];
  multiply_by_rows(change_, change_values_, z.first(n), {out + k, k});
}

bool TurnedFactor::turn(std::vector<BodyTurn> turns, ConstSpan phi_q_values, const Solve& solve,
                        base::ThreadPool* pool) {
  const std::size_t n = at(phi_q_->cols), size = n + at(phi_q_->rows), k = kept_.size();
  active_ = false;
  turns_ = std::move(turns);
  make_change(phi_q_values);
  dense::resize(g_, static_cast<Eigen::Index>(size), static_cast<Eigen::Index>(2 * k));
  if (k == 0) return active_ = true;
  if (y_0_.empty()) {
    base::LazyVector<double> units(size * k);
    fill_zero(pool, units);
    for (std::size_t c = 0; c < k; ++c) units[c * size + n + at(kept_[c])] = 1;
    solve(units, static_cast<Index>(k));  // may be interrupted
    y_0_ = std::move(units);
  }
  const Span of_motion(g_.data(), k * size), of_constraints(g_.data() + k * size, k * size);
  fill_zero(pool, of_motion);
  for (std::size_t c = 0; c < k; ++c)
    for (Offset p = change_.ptr[c]; p < change_.ptr[c + 1]; ++p)
      of_motion[c * size + at(change_.ind[at(p)])] = change_values_[at(p)];
  solve(of_motion, static_cast<Index>(k));
  copy(pool, y_0_, of_constraints);
  dense::resize(core_matrix_, static_cast<Eigen::Index>(2 * k), static_cast<Eigen::Index>(2 * k));
  base::for_each(pool, static_cast<std::int64_t>(2 * k), [&](std::int64_t c) {
    apply_v({g_.data() + at(c) * size, size}, core_matrix_.data() + at(c) * 2 * k);
  });
  core_.compute(core_matrix_ + Eigen::MatrixXd::Identity(core_matrix_.rows(), core_matrix_.cols()));
  const double rcond = core_.rcond();
  active_ = std::isfinite(rcond) && rcond > 1e-12;
  return active_;
}

void TurnedFactor::solve(Span b, Index columns, const Solve& solve, base::ThreadPool* pool) const {
  const auto size = at(g_.rows());
  const std::size_t k = 2 * kept_.size();
  for (std::size_t c = 0; c < at(columns); ++c) rotate(b.subspan(c * size, size), true, pool);
  solve(b, columns);
  Eigen::VectorXd w(static_cast<Eigen::Index>(k)), z(static_cast<Eigen::Index>(k));
  for (std::size_t c = 0; c < at(columns); ++c) {
    const Span x = b.subspan(c * size, size);
    if (k > 0) {
      apply_v(x, w.data());
      core_.solve(w, z);
      w = -z;
      add_columns(g_.data(), {w.data(), k}, x, pool);
    }
    rotate(x, false, pool);
  }
}

base::LazyVector<double> TurnedFactor::response(base::ThreadPool* pool) const {
  const std::size_t size = at(g_.rows()), k = kept_.size();
  base::LazyVector<double> columns(y_0_.size());
  copy(pool, y_0_, columns);
  if (k == 0) return columns;
  const Eigen::MatrixXd factors = core_.solve(core_matrix_.rightCols(static_cast<Eigen::Index>(k)));
  Eigen::Map<Eigen::MatrixXd> y(columns.data(), g_.rows(), static_cast<Eigen::Index>(k));
  for_each_block(pool, size, [&](std::size_t begin, std::size_t end) {
    const auto first = static_cast<Eigen::Index>(begin), count = static_cast<Eigen::Index>(end - begin);
    y.middleRows(first, count).noalias() -= g_.middleRows(first, count) * factors;
  });
  for (std::size_t c = 0; c < k; ++c) rotate({columns.data() + c * size, size}, false, pool);
  return columns;
}

}  // namespace espalier::dynamics
