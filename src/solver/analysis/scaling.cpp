// Scaling and matching of a prepared matrix.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <utility>

#include "analysis/matching.hpp"
#include "base/at.hpp"
#include "device/determinant.hpp"
#include "matrix/norms.hpp"
#include "matrix/transform.hpp"
#include "solver/analysis/prepared_matrix.hpp"

namespace espalier::solver {

namespace {

// Rows that no column is matched to.
std::vector<Index> unmatched_rows(const std::vector<Index>& row_of_col) {
  std::vector<char> matched(row_of_col.size(), 0);
  for (const Index r : row_of_col)
    if (r >= 0) matched[r] = 1;
  std::vector<Index> rows;
  for (std::size_t r = 0; r < matched.size(); ++r)
    if (matched[r] == 0) rows.push_back(static_cast<Index>(r));
  return rows;
}

[[noreturn]] void refuse_unmatched(const std::vector<Index>& rows, Index n) {
  throw Error(
      StatusCode::singular,
      fmt::format("the matrix is structurally singular: at most {} of its {} rows can be matched to columns with "
                  "nonzero entries, without partner: {}; remove or complete them",
                  n - static_cast<Index>(rows.size()), n, name_rows(rows)),
      rows.empty() ? -1 : rows.front());
}

// Sign of the permutation p; empty: identity.
double permutation_sign(const std::vector<Index>& p) {
  std::vector<char> seen(p.size(), 0);
  double sign = 1;
  for (std::size_t k = 0; k < p.size(); ++k) {
    if (seen[k] != 0) continue;
    seen[k] = 1;
    for (auto q = at(p[k]); q != k; q = at(p[q])) {
      seen[q] = 1;
      sign = -sign;
    }
  }
  return sign;
}

// Scaling and matching ask for magnitudes alone. Of real matrices they take the values: empty.
std::vector<double> sizes_for_scaling(base::Numbers numbers, std::span<const double> values) {
  if (numbers == base::Numbers::real) return {};
  return magnitudes(numbers, values);
}

// What a matching is to choose from where the entries that are not zero do not suffice: these by their scaled sizes,
// and stored zeros, which optimisers fill in later, behind them.
std::vector<double> sizes_with_zeros(const MatrixView& a, const std::vector<double>& row,
                                     const std::vector<double>& col) {
  constexpr double kLeast = 0x1p-20, kZero = 0x1p-40;
  std::vector<double> sizes(a.values.size());
  for (std::size_t c = 0; c < col.size(); ++c)
    for (auto q = at(a.col_ptr[c]); q < at(a.col_ptr[c + 1]); ++q) {
      const double size = std::abs(a.values[q]);
      sizes[q] = size > 0 ? std::clamp(size * row[at(a.row_ind[q])] * col[c], kLeast, 1.0) : kZero;
    }
  return sizes;
}

bool has_zeros(const MatrixView& a) { return std::find(a.values.begin(), a.values.end(), 0.0) != a.values.end(); }

// Where a matching is not complete, its scaling says little of rows and columns without partner. The scaling of Curtis
// and Reid (1972) leaves logarithms of the entries whose squares have the smallest sum: whatever the units of rows and
// columns were, it leaves the same matrix, by conjugate gradients. Then sweeps of Ruiz bring the largest to 1.
// @param a  in general storage
void balance(const MatrixView& a, std::vector<double>& row, std::vector<double>& col) {
  constexpr int kMostSteps = 200, kSweeps = 8;
  constexpr double kLittle = 1e-2, kMostLog = 1000;
  const std::size_t n = col.size();
  std::vector<double> x(2 * n, 0), residual(x), direction(x), image(x), count(x);
  const auto visit = [&](const auto& use) {
    for (std::size_t c = 0; c < n; ++c)
      for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q)
        if (a.values[at(q)] != 0) use(at(a.row_ind[at(q)]), n + c, std::log2(std::abs(a.values[at(q)])));
  };
  visit([&](std::size_t r, std::size_t c, double log) {
    for (const std::size_t k : {r, c}) {
      residual[k] -= log;
      ++count[k];
    }
  });
  const auto preconditioned = [&](std::size_t k) { return count[k] > 0 ? residual[k] / count[k] : 0; };
  double before = 0;
  for (int step = 0; step < kMostSteps; ++step) {
    double most = 0, product = 0, curvature = 0;
    for (std::size_t k = 0; k < 2 * n; ++k) {
      most = std::max(most, std::abs(preconditioned(k)));
      product += residual[k] * preconditioned(k);
    }
    if (!(most > kLittle)) break;
    for (std::size_t k = 0; k < 2 * n; ++k)
      direction[k] = preconditioned(k) + (before > 0 ? product / before * direction[k] : 0);
    before = product;
    std::fill(image.begin(), image.end(), 0);
    visit([&](std::size_t r, std::size_t c, double) {
      const double sum = direction[r] + direction[c];
      image[r] += sum;
      image[c] += sum;
    });
    for (std::size_t k = 0; k < 2 * n; ++k) curvature += direction[k] * image[k];
    if (!(curvature > 0)) break;
    for (std::size_t k = 0; k < 2 * n; ++k) {
      x[k] += product / curvature * direction[k];
      residual[k] -= product / curvature * image[k];
    }
  }
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    std::fill(image.begin(), image.end(), -std::numeric_limits<double>::infinity());
    visit([&](std::size_t r, std::size_t c, double log) {
      for (const std::size_t k : {r, c}) image[k] = std::max(image[k], log + x[r] + x[c]);
    });
    for (std::size_t k = 0; k < 2 * n; ++k)
      if (count[k] > 0) x[k] -= image[k] / 2;
  }
  for (std::size_t k = 0; k < n; ++k) {
    row[k] = std::exp2(std::clamp(x[k], -kMostLog, kMostLog));
    col[k] = std::exp2(std::clamp(x[n + k], -kMostLog, kMostLog));
  }
}

// Rows and columns alike.
void balance(const MatrixView& a, std::vector<double>& scale) {
  std::vector<double> row(scale.size());
  balance(a, row, scale);
  for (std::size_t k = 0; k < scale.size(); ++k) scale[k] = std::sqrt(row[k]) * std::sqrt(scale[k]);
}

void match_symmetric(PreparedMatrix& p, MatrixView a, bool partners_needed, base::ThreadPool& pool) {
  analysis::SymmetricMatching m = analysis::symmetric_matching(a, pool);
  p.row_scale = p.col_scale = std::move(m.scale);
  p.pair = std::move(m.pair);
  if (m.structural_rank == p.n()) return;
  balance(matrix::to_general(a), p.col_scale);
  p.row_scale = p.col_scale;
  std::vector<double> sizes;
  if (has_zeros(a)) {
    sizes = sizes_with_zeros(a, p.row_scale, p.col_scale);
    a.values = sizes;
    m = analysis::symmetric_matching(a, pool);
    p.pair = std::move(m.pair);
  }
  p.unmatched = m.structural_rank < p.n();
  if (partners_needed && p.unmatched)
    refuse_unmatched(unmatched_rows(analysis::maximum_product_matching(matrix::to_general(a)).row_of_col), p.n());
}

// Rows without partner take the columns that are left, their own where it is among these.
void match_the_rest(std::vector<Index>& row_of_col) {
  std::vector<Index> rows = unmatched_rows(row_of_col);
  std::erase_if(rows, [&](Index r) {
    const bool own = row_of_col[at(r)] < 0;
    if (own) row_of_col[at(r)] = r;
    return own;
  });
  auto next = rows.begin();
  for (Index& row : row_of_col)
    if (row < 0) row = *next++;
}

void match_general(PreparedMatrix& p, const MatrixView& a, bool partners_needed, base::ThreadPool& pool) {
  analysis::Matching m = analysis::maximum_product_matching(a, pool);
  if (m.structural_rank < p.n()) balance(a, m.row_scale, m.col_scale);
  std::vector<double> sizes;
  if (m.structural_rank < p.n() && has_zeros(a)) {
    sizes = sizes_with_zeros(a, m.row_scale, m.col_scale);
    MatrixView with_zeros = a;
    with_zeros.values = sizes;
    analysis::Matching all = analysis::maximum_product_matching(with_zeros, pool);
    m.row_of_col = std::move(all.row_of_col);
    m.structural_rank = all.structural_rank;
  }
  if (m.structural_rank < p.n()) {
    if (partners_needed) refuse_unmatched(unmatched_rows(m.row_of_col), p.n());
    p.unmatched = true;
    match_the_rest(m.row_of_col);
  }
  p.pair = analysis::pairs_for_lu(a, m, pool);
  p.row_scale = std::move(m.row_scale);
  p.col_scale = std::move(m.col_scale);
  if (p.pair.empty()) p.row_of_col = std::move(m.row_of_col);
}

}  // namespace

void refuse_zero_rows(const PreparedMatrix& p) {
  const std::vector<double> sizes = sizes_for_scaling(p.numbers, p.a.values);
  const std::span<const double> values = sizes.empty() ? std::span<const double>(p.a.values) : sizes;
  std::vector<Index> partner(at(p.n()), -1);
  for (Index j = 0; j < p.n(); ++j)
    for (Offset k = p.a.col_ptr[at(j)]; k < p.a.col_ptr[at(j) + 1]; ++k)
      if (values[at(k)] != 0) partner[at(j)] = j, partner[at(p.a.row_ind[at(k)])] = p.a.row_ind[at(k)];
  const std::vector<Index> rows = unmatched_rows(partner);
  if (!rows.empty()) refuse_unmatched(rows, p.n());
}

void scale_and_match(PreparedMatrix& p, Kind kind, const Options& options, base::ThreadPool& pool) {
  if (kind == Kind::llt && options.precision == Precision::fp64 && !analysis::is_wide(p.a.values, pool)) return;
  const std::vector<double> sizes = sizes_for_scaling(p.numbers, p.a.values);
  MatrixView a = p.a;
  if (!sizes.empty()) a.values = sizes;
  const bool partners_needed = options.singular == SingularMatrix::error;
  if (kind == Kind::ldlt && options.matching) {
    match_symmetric(p, a, partners_needed, pool);
  } else if (kind == Kind::lu && options.matching) {
    match_general(p, a, partners_needed, pool);
  } else {
    analysis::Scaling s = analysis::equilibrate(a, pool);
    p.row_scale = std::move(s.row);
    p.col_scale = std::move(s.col);
  }
  if (kind == Kind::ldlt) {
    const std::vector<double> d = diagonal(a, pool);
    p.zero_diagonal.resize(d.size());
    std::transform(d.begin(), d.end(), p.zero_diagonal.begin(), [](double x) { return static_cast<char>(x == 0); });
  }
  note_determinant(p);
}

namespace {

// Logarithm of the product of all factors, and whether one is far from 1.
void measure_scales(const std::vector<double>& row, const std::vector<double>& col, double& log, bool& wide) {
  device::Determinant product;
  wide = false;
  for (const auto* scale : {&row, &col})
    for (const double s : *scale) {
      product.multiply(s);
      wide = wide || s > 0x1p300 || s < 0x1p-300;
    }
  log = product.log();
}

}  // namespace

void note_determinant(PreparedMatrix& p) {
  measure_scales(p.row_scale, p.col_scale, p.transform_log, p.wide);
  p.transform_sign = permutation_sign(p.row_of_col);
}

Scales scales_for(const PreparedMatrix& p, std::span<const double> values, bool matching, base::ThreadPool& pool) {
  MatrixView a = p.a;
  const std::vector<double> sizes = sizes_for_scaling(p.numbers, values);
  a.values = sizes.empty() ? values : sizes;
  Scales scales;
  if (matching && a.symmetric()) {
    analysis::SymmetricMatching m = analysis::symmetric_matching(a, pool);
    if (m.structural_rank < p.n()) balance(matrix::to_general(a), m.scale);
    scales.row = scales.col = std::move(m.scale);
  } else if (matching) {
    analysis::Matching m = analysis::maximum_product_matching(a, pool);
    if (m.structural_rank < p.n()) balance(a, m.row_scale, m.col_scale);
    scales.row = std::move(m.row_scale);
    scales.col = std::move(m.col_scale);
  } else {
    analysis::Scaling s = analysis::equilibrate(a, pool);
    scales.row = std::move(s.row);
    scales.col = std::move(s.col);
  }
  measure_scales(scales.row, scales.col, scales.log, scales.wide);
  return scales;
}

}  // namespace espalier::solver
