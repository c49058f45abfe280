#include "dynamics/dae/kkt.hpp"

#include <algorithm>
#include <cmath>

namespace espalier::dynamics {

namespace {
std::size_t at(Offset i) { return static_cast<std::size_t>(i); }
}  // namespace

void multiply_by_rows(const SparsePattern& p, ConstSpan values, ConstSpan x, Span y) {
  for (Index i = 0; i < p.rows; ++i) {
    double sum = 0;
    for (auto k = at(p.ptr[at(i)]); k < at(p.ptr[at(i) + 1]); ++k) sum += values[k] * x[at(p.ind[k])];
    y[at(i)] = sum;
  }
}

void add_transposed(const SparsePattern& p, ConstSpan values, ConstSpan x, Span y) {
  const std::size_t lines = p.ptr.size() - 1;
  for (std::size_t i = 0; i < lines; ++i) {
    const double xi = x[i];
    if (xi == 0) continue;
    for (auto k = at(p.ptr[i]); k < at(p.ptr[i + 1]); ++k) y[at(p.ind[k])] += values[k] * xi;
  }
}

void KktSolver::set_pattern(const SparsePattern& w, const SparsePattern& phi_q) {
  w_ = &w;
  phi_q_ = &phi_q;
  n_ = w.cols;
  m_ = phi_q.rows;
  dropped_.assign(at(m_), 0);
  w_values_.assign(at(w.nonzeros()), 0.0);
  phi_q_values_.assign(at(phi_q.nonzeros()), 0.0);
  scale_.assign(at(n_ + m_), 1.0);
  layout();
  analyzed_ = false;
}

void KktSolver::set_dropped(const std::vector<char>& dropped) { dropped_ = dropped; }

void KktSolver::layout() {
  std::vector<Offset> below(at(n_), 0);  // entries of Phi_q in each column
  for (const Index c : phi_q_->ind) ++below[at(c)];
  k_ptr_.assign(at(n_ + m_) + 1, 0);
  for (Index j = 0; j < n_; ++j) {
    k_ptr_[at(j) + 1] = k_ptr_[at(j)] + (w_->ptr[at(j) + 1] - w_->ptr[at(j)]) + below[at(j)];
  }
  for (Index i = 0; i < m_; ++i) {
    k_ptr_[at(n_ + i) + 1] = k_ptr_[at(n_ + i)] + (phi_q_->ptr[at(i) + 1] - phi_q_->ptr[at(i)]) + 1;
  }
  k_ind_.resize(at(k_ptr_.back()));
  k_values_.assign(at(k_ptr_.back()), 0.0);
  std::vector<Offset> next(at(n_));
  for (Index j = 0; j < n_; ++j) {
    Offset k = k_ptr_[at(j)];
    for (Offset p = w_->ptr[at(j)]; p < w_->ptr[at(j) + 1]; ++p) k_ind_[at(k++)] = w_->ind[at(p)];
    next[at(j)] = k;
  }
  phi_position_.resize(phi_q_->ind.size());
  for (Index i = 0; i < m_; ++i) {
    Offset right = k_ptr_[at(n_ + i)];
    for (Offset p = phi_q_->ptr[at(i)]; p < phi_q_->ptr[at(i) + 1]; ++p) {
      const Index j = phi_q_->ind[at(p)];
      phi_position_[at(p)] = next[at(j)]++;
      k_ind_[at(phi_position_[at(p)])] = n_ + i;
      k_ind_[at(right++)] = j;
    }
    k_ind_[at(right)] = n_ + i;
  }
}

void KktSolver::compute_scaling() {
  for (Index j = 0; j < n_; ++j) {
    double largest = 0, diagonal = 0;
    for (Offset p = w_->ptr[at(j)]; p < w_->ptr[at(j) + 1]; ++p) {
      const double value = std::abs(w_values_[at(p)]);
      largest = std::max(largest, value);
      if (w_->ind[at(p)] == j) diagonal = value;
    }
    // A massless coordinate has no useful diagonal; its largest entry, or one, stands in.
    const double size = diagonal > 1e-6 * largest ? diagonal : largest;
    scale_[at(j)] = size > 0 ? 1 / std::sqrt(size) : 1.0;
  }
  for (Index i = 0; i < m_; ++i) {
    double largest = 0;
    for (Offset p = phi_q_->ptr[at(i)]; p < phi_q_->ptr[at(i) + 1]; ++p) {
      largest = std::max(largest, std::abs(phi_q_values_[at(p)]) * scale_[at(phi_q_->ind[at(p)])]);
    }
    scale_[at(n_ + i)] = largest > 0 ? 1 / largest : 1.0;
  }
}

void KktSolver::factorize() {
  compute_scaling();
  for (Index j = 0; j < n_; ++j) {
    Offset k = k_ptr_[at(j)];
    for (Offset p = w_->ptr[at(j)]; p < w_->ptr[at(j) + 1]; ++p) {
      k_values_[at(k++)] = w_values_[at(p)] * scale_[at(w_->ind[at(p)])] * scale_[at(j)];
    }
  }
  for (Index i = 0; i < m_; ++i) {
    Offset right = k_ptr_[at(n_ + i)];
    const double row = dropped_[at(i)] ? 0.0 : scale_[at(n_ + i)];
    for (Offset p = phi_q_->ptr[at(i)]; p < phi_q_->ptr[at(i) + 1]; ++p) {
      const double value = phi_q_values_[at(p)] * row * scale_[at(phi_q_->ind[at(p)])];
      k_values_[at(phi_position_[at(p)])] = value;
      k_values_[at(right++)] = value;
    }
    k_values_[at(right)] = dropped_[at(i)] ? 1.0 : 0.0;
  }
  if (!analyzed_) {
    if (const Status s = solver_->analyze(matrix()); !s.ok()) throw Error(s);
    analyzed_ = true;
  }
  if (const Status s = solver_->factorize(k_values_); !s.ok()) throw Error(s);
}

void KktSolver::solve(Span b, Index columns) {
  const std::size_t size = at(n_ + m_);
  for (std::size_t c = 0; c < at(columns); ++c) {
    for (std::size_t i = 0; i < size; ++i) b[c * size + i] *= scale_[i];
    for (std::size_t i = 0; i < at(m_); ++i) {
      if (dropped_[i]) b[c * size + at(n_) + i] = 0;
    }
  }
  const Status s = solver_->solve(b, b, columns);
  if (!s.ok() && s.code != StatusCode::accuracy_not_reached) throw Error(s);
  for (std::size_t c = 0; c < at(columns); ++c) {
    for (std::size_t i = 0; i < size; ++i) b[c * size + i] *= scale_[i];
  }
}

MatrixView KktSolver::matrix() const { return {n_ + m_, n_ + m_, k_ptr_, k_ind_, k_values_, Storage::general}; }

}  // namespace espalier::dynamics
