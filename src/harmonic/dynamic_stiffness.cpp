#include "harmonic/dynamic_stiffness.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/at.hpp"
#include "matrix/transform.hpp"
#include "modes/pencil.hpp"

namespace espalier::harmonic {
namespace {

constexpr double kAsymmetry = 1e-12;

double largest(const std::vector<double>& values) {
  double most = 0;
  for (const double v : values) most = std::max(most, std::abs(v));
  return most;
}

// To kAsymmetry of the largest entry. @param a  general, rows rising
bool nearly_symmetric(const SparseMatrix& a) {
  return largest(modes::sum(1, a, -1, matrix::transpose(a)).values) <= kAsymmetry * largest(a.values);
}

SparseMatrix lower_of(const SparseMatrix& general) {
  MatrixView view = general;
  view.storage = Storage::symmetric_both;
  return matrix::to_lower(view);
}

SparseMatrix empty(Index n) {
  SparseMatrix a;
  a.rows = a.cols = n;
  a.col_ptr.assign(at(n) + 1, 0);
  return a;
}

}  // namespace

DynamicStiffness::DynamicStiffness(const MatrixView& k, const MatrixView& c, const MatrixView& m, double loss_factor,
                                   base::ThreadPool& pool, const MatrixView& h)
    : loss_factor_(loss_factor) {
  SparseMatrix a = modes::general_of(k, "K", pool),
               b = c.rows == 0 && c.cols == 0 ? empty(k.rows) : modes::general_of(c, "C", pool),
               d = modes::general_of(m, "M", pool), e = h.rows == 0 ? empty(k.rows) : modes::general_of(h, "H", pool);
  if (a.rows != b.rows || a.rows != d.rows)
    throw Error(StatusCode::invalid_input,
                fmt::format("K, C and M have {}, {} and {} rows; they must be of one size", a.rows, b.rows, d.rows));
  const bool symmetric = nearly_symmetric(a) && nearly_symmetric(b) && nearly_symmetric(d) && nearly_symmetric(e);
  if (symmetric) {
    a = lower_of(a);
    b = lower_of(b);
    d = lower_of(d);
    e = lower_of(e);
  }
  const SparseMatrix all = modes::sum(0, modes::sum(0, modes::sum(0, a, 0, b), 0, d), 0, e);
  pattern_ = modes::sum(0, all, 1, a);
  c_ = modes::sum(0, all, 1, b).values;
  m_ = modes::sum(0, all, 1, d).values;
  if (h.rows > 0) h_ = modes::sum(0, all, 1, e).values;
  pattern_.storage = symmetric ? Storage::symmetric_lower : Storage::general;
  damped_ = loss_factor > 0 || largest(c_) > 0 || largest(h_) > 0;
}

void DynamicStiffness::evaluate(double w, std::vector<Complex>& z) const {
  z.resize(pattern_.values.size());
  for (std::size_t p = 0; p < z.size(); ++p) {
    const double k = pattern_.values[p];
    z[p] = {k - w * w * m_[p], loss_factor_ * k + (h_.empty() ? 0 : h_[p]) + w * c_[p]};
  }
}

ComplexMatrixView DynamicStiffness::view(const std::vector<Complex>& z) const {
  return {pattern_.rows, pattern_.cols, pattern_.col_ptr, pattern_.row_ind, z, pattern_.storage};
}

template <class Use>
void DynamicStiffness::each(const Use& use) const {
  for (Index j = 0; j < pattern_.cols; ++j)
    for (Offset p = pattern_.col_ptr[at(j)]; p < pattern_.col_ptr[at(j) + 1]; ++p) {
      const Index i = pattern_.row_ind[at(p)];
      use(i, j, at(p));
      if (symmetric() && i != j) use(j, i, at(p));
    }
}

void DynamicStiffness::magnitudes(double w, const Complex* x, Complex* y) const {
  std::fill(y, y + n(), Complex());
  each([&](Index i, Index j, std::size_t p) {
    const double size = std::abs(pattern_.values[p]) * (1 + loss_factor_) + (h_.empty() ? 0 : std::abs(h_[p])) +
                        w * std::abs(c_[p]) + w * w * std::abs(m_[p]);
    y[i] += size * std::abs(x[j]);
  });
  for (Index i = 0; i < n(); ++i)
    if (const double size = std::abs(x[i]); size > 0) y[i] *= x[i] / size;
}

double DynamicStiffness::norm(double w) const {
  const std::vector<Complex> ones(at(n()), 1.0);
  std::vector<Complex> sums(at(n()));
  magnitudes(w, ones.data(), sums.data());
  double most = 0;
  for (const Complex& s : sums) most = std::max(most, s.real());
  return most;
}

const std::vector<double>& DynamicStiffness::values(Matrix which) const {
  return which == Matrix::stiffness ? pattern_.values : which == Matrix::damping ? c_ : which == Matrix::mass ? m_ : h_;
}

MatrixView DynamicStiffness::part(Matrix which) const {
  return {pattern_.rows, pattern_.cols, pattern_.col_ptr, pattern_.row_ind, values(which), pattern_.storage};
}

void DynamicStiffness::product(Matrix which, const double* x, double* y) const {
  const std::vector<double>& a = values(which);
  std::fill(y, y + n(), 0.0);
  each([&](Index i, Index j, std::size_t p) { y[i] += a[p] * x[j]; });
}

SparseMatrix DynamicStiffness::symmetric_part(Matrix which) const {
  const MatrixView own = part(which);
  SparseMatrix out;
  if (symmetric()) {
    out = matrix::to_lower(own);
  } else {
    const SparseMatrix general = matrix::to_general(own);
    out = lower_of(modes::sum(0.5, general, 0.5, matrix::transpose(general)));
  }
  return out;
}

}  // namespace espalier::harmonic
