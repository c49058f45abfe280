#include "cholmod/attached.hpp"

#include <algorithm>
#include <cmath>

namespace espalier::hosts::cholmod {

namespace {

auto sized_matrix(std::int32_t) { return sized<espalier_matrix_i32>(); }
auto sized_matrix(std::int64_t) { return sized<espalier_matrix_i64>(); }

}  // namespace

RealLibrary& real_library() {
  static auto& library = *new RealLibrary("ESPALIER_CHOLMOD_LIBRARY", {"libcholmod.so.3"});
  return library;
}

// Measured on Laplacians in two and three dimensions, two cores with OpenBLAS: the flops of CHOLMOD in a second by
// AMD's order, as many for us, who need fewer of them, and what an entry costs in our analysis.
template <class Int>
bool Attached<Int>::pays() const {
  constexpr double kFewestFlops = 1e7, kTheirRate = 8e9, kOurRate = 3e10, kSecondsPerEntry = 2.5e-6;
  if (solver_ != nullptr || takes_small_systems()) return true;
  return flops_ >= kFewestFlops && spent_ + flops_ / kTheirRate > entries_ * kSecondsPerEntry + flops_ / kOurRate;
}

template <class Int>
bool Attached<Int>::takes(const cholmod_sparse& a) {
  return a.nrow == a.ncol && a.nrow > 0 && a.stype != 0 && a.xtype == CHOLMOD_REAL && a.dtype == CHOLMOD_DOUBLE &&
         a.itype == (sizeof(Int) == 4 ? CHOLMOD_INT : CHOLMOD_LONG) && a.p != nullptr && a.i != nullptr &&
         a.x != nullptr && (a.packed != 0 || a.nz != nullptr);
}

// Entries of the other triangle are no part of the matrix.
template <class Int>
int Attached<Int>::factorize(const cholmod_sparse& a) {
  factorized = false;
  const auto* pointers = static_cast<const Int*>(a.p);
  const auto* lengths = static_cast<const Int*>(a.nz);
  const auto* indices = static_cast<const Int*>(a.i);
  const auto* values = static_cast<const double*>(a.x);
  std::vector<Int> p{0}, i;
  p.reserve(a.ncol + 1);
  i.reserve(indices_.size());
  values_.clear();
  for (std::size_t column = 0; column < a.ncol; ++column) {
    const Int end = a.packed != 0 ? pointers[column + 1] : pointers[column] + lengths[column];
    for (Int k = pointers[column]; k < end; ++k) {
      const auto row = indices[k], here = static_cast<Int>(column);
      if (a.stype > 0 ? row > here : row < here) continue;
      i.push_back(row);
      values_.push_back(values[k]);
    }
    p.push_back(static_cast<Int>(i.size()));
  }
  const auto count = static_cast<std::int64_t>(values_.size());
  if (solver_ != nullptr && stype_ == a.stype && p == pointers_ && i == indices_) {
    const int status = solver_->factorize(values_.data(), count);
    factorized = status == ESPALIER_OK;
    return status;
  }
  pointers_ = std::move(p);
  indices_ = std::move(i);
  stype_ = a.stype;
  n_ = static_cast<std::int64_t>(a.nrow);
  solver_ = std::make_unique<HostSolver>("cholmod");
  solver_->insist("kind", "llt");
  solver_->set_default("refinement_steps", "0");
  solver_->set_default("required_backward_error", "inf");  // HostSolver looks
  auto m = sized_matrix(Int{});
  m.rows = m.cols = n_;
  m.nonzeros = count;
  m.pointers = pointers_.data();
  m.indices = indices_.data();
  m.values = values_.data();
  m.layout = ESPALIER_CSC;
  m.storage = stype_ > 0 ? ESPALIER_SYMMETRIC_UPPER : ESPALIER_SYMMETRIC_LOWER;
  int status = solver_->analyze(m);
  if (status == ESPALIER_OK) status = solver_->factorize(values_.data(), count);
  factorized = status == ESPALIER_OK;
  if (status == ESPALIER_OUT_OF_MEMORY || status == ESPALIER_INVALID_INPUT) solver_ = nullptr;
  return status;
}

template <class Int>
int Attached<Int>::solve(const cholmod_dense& b, cholmod_dense& x) {
  if (!factorized) return ESPALIER_MISUSE;
  const auto* from = static_cast<const double*>(b.x);
  auto* to = static_cast<double*>(x.x);
  const auto n = static_cast<std::size_t>(n_);
  if (b.d == n && x.d == n) return solver_->solve(from, to, static_cast<std::int64_t>(b.ncol), ESPALIER_NO_TRANSPOSE);
  for (std::size_t k = 0; k < b.ncol; ++k) {
    const int status = solver_->solve(from + k * b.d, to + k * x.d, 1, ESPALIER_NO_TRANSPOSE);
    if (status != ESPALIER_OK) return status;
  }
  return ESPALIER_OK;
}

template <class Int>
double Attached<Int>::reciprocal_condition() {
  if (!factorized) return 0;
  const auto n = static_cast<std::size_t>(n_);
  std::vector<double> sums(n, 0.0), x(n);
  for (std::size_t column = 0; column < n; ++column) {
    for (Int k = pointers_[column]; k < pointers_[column + 1]; ++k) {
      const auto at = static_cast<std::size_t>(k), row = static_cast<std::size_t>(indices_[at]);
      sums[row] += std::abs(values_[at]);
      if (row != column) sums[column] += std::abs(values_[at]);
    }
  }
  for (std::size_t k = 0; k < n; ++k) x[k] = scattered_sign(k);
  if (solver_->substitute(x.data(), x.data(), 1, ESPALIER_NO_TRANSPOSE) != ESPALIER_OK) return 0;
  double largest = 0;
  for (const double v : x) largest = std::isfinite(v) ? std::max(largest, std::abs(v)) : HUGE_VAL;
  const double product = largest * *std::max_element(sums.begin(), sums.end());
  return product > 0 ? std::min(1.0, 1 / product) : 0;
}

template <class Int>
cholmod_sparse Attached<Int>::matrix() {
  cholmod_sparse a{};
  a.nrow = a.ncol = static_cast<std::size_t>(n_);
  a.nzmax = indices_.size();
  a.p = pointers_.data();
  a.i = indices_.data();
  a.x = values_.data();
  a.stype = stype_;
  a.itype = sizeof(Int) == 4 ? CHOLMOD_INT : CHOLMOD_LONG;
  a.xtype = CHOLMOD_REAL;
  a.dtype = CHOLMOD_DOUBLE;
  a.packed = 1;
  return a;  // `sorted` stays 0: nobody looked
}

template class Attached<std::int32_t>;
template class Attached<Long>;

}  // namespace espalier::hosts::cholmod
