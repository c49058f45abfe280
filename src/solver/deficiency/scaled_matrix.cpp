#include "solver/deficiency/scaled_matrix.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "base/at.hpp"

namespace espalier::solver {

namespace {

constexpr std::int64_t kFactorColumns = 4096, kRowsPerRange = 1 << 15;

}  // namespace

ScaledMatrix::ScaledMatrix(const DeficiencyJob& job)
    : job_(job),
      parts_(base::parts_of(job.prepared.numbers)),
      n_(job.prepared.n()),
      row_(job.numeric.scales().row),
      col_(job.numeric.scales().col) {
  if (job.kind == Kind::llt || row_.empty()) by_diagonal();
  measure();
}

// use(row, column, |b_rc|) for every entry of the full matrix.
template <class Use>
void ScaledMatrix::visit(Use&& use) const {
  const auto& a = job_.prepared.a;
  const bool mirrored = a.storage == Storage::symmetric_lower || a.storage == Storage::symmetric_upper;
  for (Index c = 0; c < n_; ++c)
    for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q) {
      const auto i = static_cast<std::size_t>(a.row_ind[q]), j = static_cast<std::size_t>(c);
      use(i, j, std::abs(size_of(q) * col_[j] * row_[i]));
      if (mirrored && i != j) use(j, i, std::abs(size_of(q) * col_[i] * row_[j]));
    }
}

double ScaledMatrix::size_of(Offset q) const {
  if (parts_ == 1) return job_.values[static_cast<std::size_t>(q)];
  const auto at = static_cast<std::size_t>(2 * q);
  return std::hypot(job_.values[at], job_.values[at + 1]);
}

void ScaledMatrix::by_diagonal() {
  row_.assign(static_cast<std::size_t>(n_), 1.0);
  const auto& a = job_.prepared.a;
  if (job_.kind == Kind::llt)
    job_.pool.for_each_range(n_, kFactorColumns, [&](std::int64_t begin, std::int64_t end) {
      for (auto c = begin; c < end; ++c)
        for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q)
          if (a.row_ind[q] == c) row_[static_cast<std::size_t>(c)] = 1 / std::sqrt(job_.values[parts_ * q]);
    });
  col_ = row_;
}

void ScaledMatrix::make_even() {
  constexpr int kMostRuizSweeps = 12;
  const auto uneven = [](double m) { return m > 0 && (m < 0.5 || m > 2); };
  for (int sweep = 0; sweep < kMostRuizSweeps; ++sweep) {
    std::vector<double> rows(row_.size(), 0.0), cols(rows);
    visit([&](std::size_t i, std::size_t j, double v) {
      rows[i] = std::max(rows[i], v);
      cols[j] = std::max(cols[j], v);
    });
    if (std::none_of(rows.begin(), rows.end(), uneven) && std::none_of(cols.begin(), cols.end(), uneven)) break;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (rows[i] > 0) row_[i] /= std::sqrt(rows[i]);
      if (cols[i] > 0) col_[i] /= std::sqrt(cols[i]);
    }
  }
  make_empty_ones_large();
  measure();
}

// Nothing measures rows and columns without entries. As large as any, their part of a null vector is not smaller in the
// caller's units than what rounding leaves of the others.
void ScaledMatrix::make_empty_ones_large() {
  std::vector<char> row_has(row_.size(), 0), col_has(col_.size(), 0);
  visit([&](std::size_t i, std::size_t j, double v) {
    if (v > 0) row_has[i] = col_has[j] = 1;
  });
  const double most_row = *std::max_element(row_.begin(), row_.end());
  const double most_col = *std::max_element(col_.begin(), col_.end());
  for (std::size_t k = 0; k < row_.size(); ++k) {
    if (row_has[k] == 0) row_[k] = most_row;
    if (col_has[k] == 0) col_[k] = most_col;
  }
}

// In one triangle, what stands in the columns and in the rows makes up a row together.
void ScaledMatrix::measure() {
  const auto& a = job_.prepared.a;
  const matrix::RowIndex& rows = job_.rows;
  const bool general = a.storage == Storage::general;
  std::mutex mutex;
  double most_row = 0, most_column = 0;
  job_.pool.for_each_range(n_, kFactorColumns, [&](std::int64_t begin, std::int64_t end) {
    double row = 0, column = 0;
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
      double in_column = 0, in_row = 0;
      for (Offset q = a.col_ptr[k]; q < a.col_ptr[k + 1]; ++q)
        in_column += std::abs(size_of(q) * col_[k] * row_[a.row_ind[q]]);
      for (Offset q = rows.ptr.empty() ? 0 : rows.ptr[k]; q < (rows.ptr.empty() ? 0 : rows.ptr[k + 1]); ++q)
        in_row += std::abs(size_of(rows.source[q]) * col_[rows.col[q]] * row_[k]);
      row = std::max(row, general ? in_row : in_row + in_column);
      column = std::max(column, general ? in_column : in_row + in_column);
    }
    const std::lock_guard lock(mutex);
    most_row = std::max(most_row, row);
    most_column = std::max(most_column, column);
  });
  norm_ = std::sqrt(most_row * most_column);
}

// To the conjugate, where A^H is that of A^T between two of them.
void ScaledMatrix::turn(Block& x) const {
  if (job_.prepared.numbers != base::Numbers::complex) return;
  for (std::size_t k = 1; k < x.values.size(); k += 2) x.values[k] = -x.values[k];
}

void ScaledMatrix::scale(Block& x, const std::vector<double>& by, bool inverse) const {
  job_.pool.for_each_range(n_, kRowsPerRange, [&](std::int64_t begin, std::int64_t end) {
    for (Index c = 0; c < x.columns; ++c) {
      double* v = x.column(c);
      for (auto i = parts_ * begin; i < parts_ * end; ++i) {
        const double s = by[static_cast<std::size_t>(i / parts_)];
        v[i] = inverse ? v[i] / s : v[i] * s;
      }
    }
  });
}

Block ScaledMatrix::product(const Block& x, bool transpose) const {
  Block in = x, out(n(), x.columns);
  if (transpose) turn(in);
  scale(in, transpose ? row_ : col_, false);
  const std::vector<double> zero(static_cast<std::size_t>(n()), 0.0);
  std::vector<solve::ResidualColumn> columns(static_cast<std::size_t>(x.columns));
  for (Index c = 0; c < x.columns; ++c)
    columns[static_cast<std::size_t>(c)] = {zero.data(), in.column(c), out.column(c), {}};
  job_.residual.compute(columns, transpose);
  scale(out, transpose ? col_ : row_, false);
  for (double& v : out.values) v = -v;
  if (transpose) turn(out);
  return out;
}

Block ScaledMatrix::inverse(Block x, bool transpose) const {
  if (transpose) turn(x);
  scale(x, transpose ? col_ : row_, true);
  job_.numeric.solve(x.values.data(), x.values.data(), x.columns, transpose);
  scale(x, transpose ? row_ : col_, true);
  if (transpose) turn(x);
  return x;
}

void ScaledMatrix::to_caller(RankCorrection& c, bool transpose) const {
  const auto& of_rows = transpose ? col_ : row_;
  for (Index d = 0; d < c.to.columns; ++d) {
    for (std::size_t k = 0; k < c.places.size(); ++k) c.from.column(d)[k] *= of_rows[at(c.places[k] / parts_)];
    for (Index i = 0; i < c.to.rows; ++i) c.to.column(d)[i] = unscaled(i, c.to.column(d)[i], transpose);
  }
  if (!transpose || job_.prepared.numbers != base::Numbers::complex) return;
  for (Index d = 0; d < c.to.columns; ++d) {
    for (std::size_t k = 0; k < c.places.size(); ++k)
      if (c.places[k] % 2 != 0) c.from.column(d)[k] = -c.from.column(d)[k];
    for (Index i = 1; i < c.to.rows; i += 2) c.to.column(d)[i] = -c.to.column(d)[i];
  }
}

}  // namespace espalier::solver
