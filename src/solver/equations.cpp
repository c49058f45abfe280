#include "solver/equations.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>

#include "analysis/matching.hpp"
#include "matrix/norms.hpp"

namespace espalier::solver {

namespace {

template <class V>
Offset bytes_of(const V& v) {
  return static_cast<Offset>(v.capacity() * sizeof(typename V::value_type));
}

// Sums of the diagonal entries of each column.
std::vector<double> diagonal(const MatrixView& a) {
  std::vector<double> d(static_cast<std::size_t>(a.cols), 0.0);
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q)
      if (a.row_ind[q] == c) d[static_cast<std::size_t>(c)] += a.values[q];
  return d;
}

// The general matrix of a symmetric one, with the position that each entry came from.
void expand(const MatrixView& a, Equations& e) {
  const auto n = static_cast<std::size_t>(a.cols);
  const bool both = a.storage == Storage::symmetric_both;
  auto& ptr = e.a.col_ptr;
  ptr.assign(n + 1, 0);
  const auto visit = [&](auto&& use) {
    for (Index c = 0; c < a.cols; ++c)
      for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q) {
        use(a.row_ind[q], c, q);
        if (!both && a.row_ind[q] != c) use(c, a.row_ind[q], q);
      }
  };
  visit([&](Index, Index c, Offset) { ++ptr[c + 1]; });
  std::partial_sum(ptr.begin(), ptr.end(), ptr.begin());
  e.a.row_ind.resize(static_cast<std::size_t>(ptr.back()));
  e.source.resize(e.a.row_ind.size());
  std::vector<Offset> next(ptr.begin(), ptr.end() - 1);
  visit([&](Index r, Index c, Offset q) {
    const Offset at = next[c]++;
    e.a.row_ind[at] = r;
    e.source[at] = q;
  });
  e.a.storage = Storage::general;
}

}  // namespace

Offset Equations::bytes() const {
  return bytes_of(a.col_ptr) + bytes_of(a.row_ind) + bytes_of(a.values) + bytes_of(source) + bytes_of(row_scale) +
         bytes_of(col_scale) + bytes_of(row_of_col) + bytes_of(pair) + bytes_of(zero_diagonal);
}

Kind choose_kind(const MatrixView& a, Kind wish) {
  if (wish == Kind::lu) return wish;
  const bool symmetric =
      a.symmetric() || (!a.values.empty() ? matrix::values_are_symmetric(a) : matrix::structure_is_symmetric(a));
  if (!symmetric) {
    if (wish == Kind::automatic) return Kind::lu;
    throw Error(StatusCode::invalid_input,
                fmt::format("{} was asked for, but the matrix is not symmetric; use kind lu (or auto)",
                            wish == Kind::llt ? "llt" : "ldlt"));
  }
  if (wish != Kind::automatic) return wish;
  if (a.values.empty()) return Kind::llt;
  const std::vector<double> d = diagonal(a);
  return std::all_of(d.begin(), d.end(), [](double x) { return x > 0; }) ? Kind::llt : Kind::ldlt;
}

Equations copy_equations(const MatrixView& a, Kind kind) {
  Equations e;
  e.caller_nonzeros = a.nonzeros();
  e.a.rows = a.rows;
  e.a.cols = a.cols;
  e.a.storage = a.storage;
  if (kind == Kind::lu && a.symmetric()) {
    expand(a, e);
  } else {
    e.a.col_ptr.assign(a.col_ptr.begin(), a.col_ptr.end());
    e.a.row_ind.assign(a.row_ind.begin(), a.row_ind.end());
    if (kind != Kind::lu && a.storage == Storage::general) e.a.storage = Storage::symmetric_both;
  }
  e.a.values.assign(e.a.row_ind.size(), 1.0);
  if (!a.values.empty()) copy_values(e, a.values);
  return e;
}

void copy_values(Equations& e, std::span<const double> values) {
  if (e.source.empty()) {
    std::copy(values.begin(), values.end(), e.a.values.begin());
    return;
  }
  for (std::size_t q = 0; q < e.source.size(); ++q) e.a.values[q] = values[static_cast<std::size_t>(e.source[q])];
}

bool same_pattern(const Equations& e, const MatrixView& a) {
  if (a.rows != e.a.rows || a.cols != e.a.cols || a.nonzeros() != e.caller_nonzeros) return false;
  if (e.source.empty())
    return std::equal(a.col_ptr.begin(), a.col_ptr.end(), e.a.col_ptr.begin()) &&
           std::equal(a.row_ind.begin(), a.row_ind.end(), e.a.row_ind.begin());
  for (Index c = 0; c < e.a.cols; ++c)
    for (Offset q = e.a.col_ptr[c]; q < e.a.col_ptr[c + 1]; ++q) {
      const Offset s = e.source[static_cast<std::size_t>(q)];
      const Index r = e.a.row_ind[static_cast<std::size_t>(q)];
      if (a.row_ind[s] != r && a.row_ind[s] != c) return false;
    }
  return true;
}

void scale_and_match(Equations& e, Kind kind, const Options& options) {
  if (kind == Kind::llt && options.precision == Precision::fp64) return;
  const auto refuse = [&](Index rank) {
    throw Error(
        StatusCode::singular,
        fmt::format("the matrix is structurally singular: at most {} of its {} rows can be matched to columns with "
                    "nonzero entries; remove or complete the rows without partner",
                    rank, e.n()));
  };
  if (kind == Kind::ldlt && options.matching) {
    analysis::SymmetricMatching m = analysis::symmetric_matching(e.a);
    if (m.structural_rank < e.n()) refuse(m.structural_rank);
    e.row_scale = m.scale;
    e.col_scale = std::move(m.scale);
    e.pair = std::move(m.pair);
  } else if (kind == Kind::lu && options.matching) {
    analysis::Matching m = analysis::maximum_product_matching(e.a);
    if (m.structural_rank < e.n()) refuse(m.structural_rank);
    e.row_scale = std::move(m.row_scale);
    e.col_scale = std::move(m.col_scale);
    e.row_of_col = std::move(m.row_of_col);
  } else {
    analysis::Scaling s = analysis::equilibrate(e.a);
    e.row_scale = std::move(s.row);
    e.col_scale = std::move(s.col);
  }
  if (kind == Kind::ldlt) {
    const std::vector<double> d = diagonal(e.a);
    e.zero_diagonal.resize(d.size());
    std::transform(d.begin(), d.end(), e.zero_diagonal.begin(), [](double x) { return static_cast<char>(x == 0); });
  }
}

template <class T>
double scale_values(const Equations& e, T* scaled, base::ThreadPool& pool) {
  constexpr std::int64_t kColumnsPerPiece = 4096;
  std::vector<double> piece_max(static_cast<std::size_t>((e.n() + kColumnsPerPiece - 1) / kColumnsPerPiece), 0);
  pool.for_each_piece(e.n(), kColumnsPerPiece, [&](std::int64_t begin, std::int64_t end) {
    double most = 0;
    for (auto c = static_cast<std::size_t>(begin); c < static_cast<std::size_t>(end); ++c) {
      const double s = e.col_scale.empty() ? 1.0 : e.col_scale[c];
      for (Offset q = e.a.col_ptr[c]; q < e.a.col_ptr[c + 1]; ++q) {
        const auto at = static_cast<std::size_t>(q);
        const double r = e.row_scale.empty() ? 1.0 : e.row_scale[static_cast<std::size_t>(e.a.row_ind[at])];
        const double v = e.a.values[at] * s * r;
        scaled[at] = static_cast<T>(v);
        most = std::max(most, std::abs(v));
      }
    }
    piece_max[static_cast<std::size_t>(begin / kColumnsPerPiece)] = most;
  });
  return piece_max.empty() ? 0 : *std::max_element(piece_max.begin(), piece_max.end());
}

template double scale_values(const Equations&, double*, base::ThreadPool&);
template double scale_values(const Equations&, float*, base::ThreadPool&);

std::string name_rows(std::vector<Index> rows) {
  constexpr std::size_t kNamed = 8;
  std::sort(rows.begin(), rows.end());
  std::string text = rows.size() == 1 ? "row " : "rows ";
  for (std::size_t k = 0; k < std::min(kNamed, rows.size()); ++k)
    text += fmt::format("{}{}", k == 0 ? "" : ", ", rows[k]);
  if (rows.size() > kNamed) text += fmt::format(" and {} more", rows.size() - kNamed);
  return text;
}

}  // namespace espalier::solver
