#include "dynamics/dae/kkt.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <new>
#include <utility>

#include "base/at.hpp"
#include "base/parallel.hpp"
#include "dynamics/dae/row_ranges.hpp"
#include "dynamics/dae/vectors.hpp"

namespace espalier::dynamics {

void KktSolver::set_pattern(const SparsePattern& w, const SparsePattern& phi_q, const SparsePattern* f_lambda) {
  w_ = &w;
  phi_q_ = &phi_q;
  f_lambda_ = f_lambda;
  n_ = w.cols;
  m_ = phi_q.rows;
  dropped_.assign(at(m_), 0);
  w_values_ = {};
  w_values_.resize(at(w.nonzeros()));
  fill_zero(pool_, w_values_);
  phi_q_values_.assign(at(phi_q.nonzeros()), 0.0);
  f_lambda_values_.assign(f_lambda == nullptr ? 0 : at(f_lambda->nonzeros()), 0.0);
  scale_.assign(at(n_ + m_), 1.0);
  diagonal_.assign(at(n_), 0.0);
  largest_.assign(at(n_), 0.0);
  leave_device();
  response_.forget();
  layout();
  if (analyzed_ == Analyzed::yes) analyzed_ = Analyzed::other_pattern;
}

void KktSolver::set_dropped(const std::vector<char>& dropped) { dropped_ = dropped; }

// Rows of F_lambda in the column of a constraint.
std::span<const Index> KktSolver::multiplier_rows(Index constraint) const {
  if (f_lambda_ == nullptr) return {};
  return std::span(f_lambda_->ind)
      .subspan(at(f_lambda_->ptr[at(constraint)]),
               at(f_lambda_->ptr[at(constraint) + 1] - f_lambda_->ptr[at(constraint)]));
}

void KktSolver::layout() {
  std::vector<Offset> below(at(n_), 0);  // entries of Phi_q in each column
  for (const Index c : phi_q_->ind) ++below[at(c)];
  k_ptr_.assign(at(n_ + m_) + 1, 0);
  for (Index j = 0; j < n_; ++j) {
    k_ptr_[at(j) + 1] = k_ptr_[at(j)] + (w_->ptr[at(j) + 1] - w_->ptr[at(j)]) + below[at(j)];
  }
  std::vector<Index> rows;
  for (Index i = 0; i < m_; ++i) {
    const auto own =
        std::span(phi_q_->ind).subspan(at(phi_q_->ptr[at(i)]), at(phi_q_->ptr[at(i) + 1] - phi_q_->ptr[at(i)]));
    const auto more = multiplier_rows(i);
    rows.clear();
    std::set_union(own.begin(), own.end(), more.begin(), more.end(), std::back_inserter(rows));
    k_ptr_[at(n_ + i) + 1] = k_ptr_[at(n_ + i)] + static_cast<Offset>(rows.size()) + 1;
  }
  k_ind_ = {};
  k_ind_.resize(at(k_ptr_.back()));
  k_values_ = {};
  k_values_.resize(at(k_ptr_.back()));
  fill_zero(pool_, k_values_);
  std::vector<Offset> next(at(n_));
  for_columns_of_w([&](Index j) {
    const auto of_w = std::span(w_->ind).subspan(at(w_->ptr[at(j)]), at(w_->ptr[at(j) + 1] - w_->ptr[at(j)]));
    std::copy(of_w.begin(), of_w.end(), k_ind_.begin() + k_ptr_[at(j)]);
    next[at(j)] = k_ptr_[at(j)] + static_cast<Offset>(of_w.size());
  });
  phi_position_.resize(phi_q_->ind.size());
  for (Index i = 0; i < m_; ++i) {
    for (Offset p = phi_q_->ptr[at(i)]; p < phi_q_->ptr[at(i) + 1]; ++p) {
      phi_position_[at(p)] = next[at(phi_q_->ind[at(p)])]++;
      k_ind_[at(phi_position_[at(p)])] = n_ + i;
    }
  }
  layout_right();
}

// The columns of the multipliers: Phi_q^T and F_lambda merged, then the diagonal.
void KktSolver::layout_right() {
  right_position_.resize(phi_q_->ind.size());
  f_lambda_position_.resize(f_lambda_values_.size());
  for (Index i = 0; i < m_; ++i) {
    const auto more = multiplier_rows(i);
    Offset p = phi_q_->ptr[at(i)], right = k_ptr_[at(n_ + i)];
    const Offset end = phi_q_->ptr[at(i) + 1];
    std::size_t e = 0;
    for (; p < end || e < more.size(); ++right) {
      const Index own = p < end ? phi_q_->ind[at(p)] : n_, other = e < more.size() ? more[e] : n_;
      k_ind_[at(right)] = std::min(own, other);
      if (own <= other) right_position_[at(p++)] = right;
      if (other <= own) f_lambda_position_[at(f_lambda_->ptr[at(i)]) + e++] = right;
    }
    k_ind_[at(right)] = n_ + i;
  }
}

void KktSolver::for_columns_of_w(const std::function<void(Index)>& body) const {
  constexpr std::int64_t kColumns = 512;  // some ten microseconds
  base::for_each_range(pool_, n_, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto j = static_cast<Index>(begin); j < end; ++j) body(j);
  });
}

void KktSolver::measure_columns() {
  for_columns_of_w([this](Index j) {
    double largest = 0, diagonal = 0;
    for (Offset p = w_->ptr[at(j)]; p < w_->ptr[at(j) + 1]; ++p) {
      const double value = std::abs(w_values_[at(p)]);
      largest = std::max(largest, value);
      if (w_->ind[at(p)] == j) diagonal = value;
    }
    largest_[at(j)] = largest;
    diagonal_[at(j)] = diagonal;
  });
}

void KktSolver::compute_scaling() {
  for_each_entry(pool_, at(n_), [&](std::size_t j) {
    const double largest = largest_[j], diagonal = diagonal_[j];
    // A massless coordinate has no useful diagonal; its largest entry, or one, stands in.
    double size = diagonal > 1e-6 * largest ? diagonal : largest;
    if (!typical_.empty() && size < 1e-6 * typical_[j]) size = typical_[j];
    scale_[j] = size > 0 ? 1 / std::sqrt(size) : 1.0;
  });
  for (Index i = 0; i < m_; ++i) {
    double largest = 0;
    for (Offset p = phi_q_->ptr[at(i)]; p < phi_q_->ptr[at(i) + 1]; ++p) {
      largest = std::max(largest, std::abs(phi_q_values_[at(p)]) * scale_[at(phi_q_->ind[at(p)])]);
    }
    scale_[at(n_ + i)] = largest > 0 ? 1 / largest : 1.0;
  }
}

// K outside W.
void KktSolver::fill_rest() {
  if (f_lambda_ != nullptr) std::fill(k_values_.begin() + k_ptr_[at(n_)], k_values_.end(), 0.0);
  for (Index i = 0; i < m_; ++i) {
    const double row = dropped_[at(i)] ? 0.0 : scale_[at(n_ + i)];
    for (Offset p = phi_q_->ptr[at(i)]; p < phi_q_->ptr[at(i) + 1]; ++p) {
      const double value = phi_q_values_[at(p)] * row * scale_[at(phi_q_->ind[at(p)])];
      k_values_[at(phi_position_[at(p)])] = value;
      k_values_[at(right_position_[at(p)])] = value;
    }
    k_values_[at(k_ptr_[at(n_ + i) + 1] - 1)] = dropped_[at(i)] ? 1.0 : 0.0;
    if (f_lambda_ == nullptr) continue;
    for (Offset p = f_lambda_->ptr[at(i)]; p < f_lambda_->ptr[at(i) + 1]; ++p)
      k_values_[at(f_lambda_position_[at(p)])] += f_lambda_values_[at(p)] * row * scale_[at(f_lambda_->ind[at(p)])];
  }
}

void KktSolver::factorize() {
  w_on_device_ = scale_on_device_ = false;
  measure_columns();
  compute_scaling();
  for_columns_of_w([this](Index j) {
    Offset k = k_ptr_[at(j)];
    for (Offset p = w_->ptr[at(j)]; p < w_->ptr[at(j) + 1]; ++p) {
      k_values_[at(k++)] = w_values_[at(p)] * scale_[at(w_->ind[at(p)])] * scale_[at(j)];
    }
  });
  fill_rest();
  if (analyzed_ != Analyzed::yes) {
    const bool follows = std::exchange(analyzed_, Analyzed::none) == Analyzed::other_pattern;
    const Status s = follows ? solver_->analyze_change(matrix()) : solver_->analyze(matrix());
    if (!s.ok()) throw Error(s);
    analyzed_ = Analyzed::yes;
  }
  factor_is_new(nullptr);
  if (const Status s = solver_->factorize(k_values_); !s.ok()) throw Error(s);
  put_scale_on_device();
}

// The scale of a factor that is on a GPU though the host has assembled K: solutions are made there, too.
void KktSolver::put_scale_on_device() {
  if (!on_device()) return;
  try {
    device_->set_scale(scale_);
  } catch (const Error& error) {  // what needs the GPU finds out
    if (error.status().code != StatusCode::device_error) throw;
    return;
  }
  scale_on_device_ = true;
  response_.use_device(*vectors_);
}

void KktSolver::factor_is_new(DeviceVectors* device) {
  response_.start(n_, m_, dropped_, solver_->work().numbers, device);
  turned_.start(*phi_q_, phi_q_values_, dropped_);
}

bool KktSolver::turning_may_pay() const {
  constexpr Offset kSmaller = 2;  // than the factor, in numbers
  const Offset columns = 3 * turned_.constraints();
  return f_lambda_ == nullptr && kSmaller * columns * (n_ + m_) <= solver_->work().numbers;
}

Index KktSolver::turn(std::vector<BodyTurn> turns, ConstSpan phi_q_values) {
  ConstraintResponse::Columns response = response_.give();
  if (!turned_.active() && !response.empty()) turned_.know(std::move(response));
  turned_.drop();
  if (!turning_may_pay()) return -1;
  Index solved = 0;
  const auto solve = [&](Span x, Index count) {
    solve_with_factor(x, count);
    solved += count;
  };
  try {
    if (!turned_.turn(std::move(turns), phi_q_values, solve, pool_)) return -1;
    response_.take(turned_.response(pool_));
  } catch (const std::bad_alloc&) {  // a new factor needs no more than the last one did
    turned_.drop();
    return -1;
  }
  std::copy(phi_q_values.begin(), phi_q_values.end(), phi_q_values_.begin());
  return solved;
}

void KktSolver::use_device(DeviceAssembly& device, std::vector<Offset> host_entries) {
  host_entries_ = std::move(host_entries);
  rest_.clear();
  for (Index j = 0; j < n_ + m_; ++j) {
    const Offset w = j < n_ ? w_->ptr[at(j) + 1] - w_->ptr[at(j)] : 0;
    for (Offset k = k_ptr_[at(j)] + w; k < k_ptr_[at(j) + 1]; ++k) rest_.push_back(k);
  }
  rest_values_.resize(rest_.size());
  std::vector<Offset> in_k(host_entries_.size());
  for_each_block(pool_, in_k.size(), [&](std::size_t begin, std::size_t end) {
    auto next = std::upper_bound(w_->ptr.begin(), w_->ptr.end(), host_entries_[begin]);  // of the column that follows
    for (std::size_t e = begin; e < end; ++e) {
      while (host_entries_[e] >= *next) ++next;
      in_k[e] = k_ptr_[at(next - 1 - w_->ptr.begin())] + host_entries_[e] - *(next - 1);
    }
  });
  device_ = device.make_matrix({w_, k_ptr_, in_k, rest_});
  vectors_ = device_->make_vectors();
  put_scale_on_device();
}

void KktSolver::leave_device() {
  w_on_device_ = false;  // nothing is fetched: a GPU that has failed would throw here, in a destructor too
  scale_on_device_ = false;
  response_.leave_device();
  vectors_.reset();
  device_.reset();
}

bool KktSolver::factorize_on_device() {
  scale_on_device_ = false;
  device_->add_from_host([this](Offset first, Offset count, double* to) {
    for_each_entry(pool_, at(count), [&](std::size_t e) { to[e] = w_values_[at(host_entries_[at(first) + e])]; });
  });
  device_->column_sizes(diagonal_, largest_);
  compute_scaling();
  fill_rest();
  for_each_entry(pool_, rest_.size(), [&](std::size_t e) { rest_values_[e] = k_values_[at(rest_[e])]; });
  const double* values = device_->complete(scale_, rest_values_);
  scale_on_device_ = true;
  factor_is_new(vectors_.get());
  const Status s = solver_->factorize_device(values, k_ptr_.back(), device_->stream());
  if (s.code == StatusCode::device_error && solver_->gpu() < 0) return false;
  if (!s.ok()) throw Error(s);
  w_on_device_ = true;
  return true;
}

ConstSpan KktSolver::w_of_factor() {
  if (std::exchange(w_on_device_, false)) device_->fetch_w(w_values_);
  return w_values_;
}

void KktSolver::sum_rows_of_w(ConstSpan x, Span out) const {
  if (w_on_device_) return device_->sum_rows(x, out);
  fill_zero(pool_, out);
  for_each_row_range(*w_, pool_, [&](Index column, Offset begin, Offset end) {
    const double size = x[at(column)];
    for (Offset k = begin; k < end; ++k) out[at(w_->ind[at(k)])] += std::abs(w_values_[at(k)] * size);
  });
}

Index KktSolver::solve(Span b, Index columns, Index normal) {
  const std::size_t size = at(n_ + m_);
  const Index before = response_.columns();
  const bool ready = normal > 0 && response_is_ready(normal);
  const Index solved = ready ? columns - normal : columns;
  if (solved > 0) solve_now(b.first(at(solved) * size), solved);
  for (Index c = solved; c < columns; ++c) response_.apply(b.subspan(at(c) * size, size), pool_);
  return solved + response_.columns() - before;
}

bool KktSolver::response_is_ready(Index columns) {
  return response_.ready(
      columns, [this](Span x, Index count) { solve_with_factor(x, count); },
      [this](double* x, Index count) { solve_scaled_on_device(x, count); }, pool_);
}

void KktSolver::solve_there(double* x) {
  try {
    vectors_->solve_there(x, [this](double* columns, Index count) { solve_scaled_on_device(columns, count); });
  } catch (const Error& error) {
    if (error.status().code == StatusCode::device_error) scale_on_device_ = false;
    throw;
  }
}

Index KktSolver::solve_normal_there(ConstSpan r, double* x) {
  std::vector<double> kept(r.begin(), r.end());
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (dropped_[i]) kept[i] = 0;
  const Index before = response_.columns();
  if (response_is_ready(1) && response_.on_device()) {
    response_.apply_there(kept, x);
    return response_.columns() - before;
  }
  vectors_->put_lower(kept, x);
  solve_there(x);
  return 1;
}

void KktSolver::solve_now(Span b, Index columns) {
  if (!turned_.active()) return solve_with_factor(b, columns);
  turned_.solve(
      b, columns, [this](Span x, Index count) { solve_with_factor(x, count); }, pool_);
}

// With what was factorized, S K S.
void KktSolver::solve_scaled_on_device(double* columns, Index count) {
  const Status s = solver_->solve_device(columns, count, device_->stream());
  if (!s.ok() && s.code != StatusCode::accuracy_not_reached) throw Error(s);
}

// @return false: the factor is not there, or the GPU has failed or lacks memory; b is as it was
bool KktSolver::solve_through_device(Span b) {
  if (!scale_on_device_ || solver_->gpu() < 0) return false;
  bool solved = false;
  try {
    vectors_->solve(b, [&](double* columns, Index count) {
      solve_scaled_on_device(columns, count);
      solved = true;
    });
  } catch (const Error& error) {
    const StatusCode code = error.status().code;
    if (solved || (code != StatusCode::device_error && code != StatusCode::out_of_memory)) throw;
    scale_on_device_ = false;
    return false;
  }
  return true;
}

void KktSolver::solve_with_factor(Span b, Index columns) {
  const std::size_t size = at(n_ + m_);
  for (std::size_t c = 0; c < at(columns); ++c)
    for (std::size_t i = 0; i < at(m_); ++i)
      if (dropped_[i]) b[c * size + at(n_) + i] = 0;
  for (Index first = 0; first < columns; first += DeviceVectors::kMostColumns) {
    const Index count = std::min(DeviceVectors::kMostColumns, columns - first);
    if (solve_through_device(b.subspan(at(first) * size, at(count) * size))) continue;
    return solve_on_host(b.subspan(at(first) * size), columns - first);
  }
}

void KktSolver::solve_on_host(Span b, Index columns) {
  const std::size_t size = at(n_ + m_);
  const auto scale = [&](std::size_t column) {
    for_each_entry(pool_, size, [&](std::size_t i) { b[column * size + i] *= scale_[i]; });
  };
  for (std::size_t c = 0; c < at(columns); ++c) scale(c);
  const Status s = solver_->solve(b, b, columns);
  if (!s.ok() && s.code != StatusCode::accuracy_not_reached) throw Error(s);
  for (std::size_t c = 0; c < at(columns); ++c) scale(c);
}

MatrixView KktSolver::matrix() const { return {n_ + m_, n_ + m_, k_ptr_, k_ind_, k_values_, Storage::general}; }

}  // namespace espalier::dynamics
