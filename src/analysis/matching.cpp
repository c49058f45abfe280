#include "analysis/matching.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>

#include "analysis/columns.hpp"
#include "analysis/product_matcher.hpp"
#include "base/at.hpp"
#include "matrix/row_index.hpp"

namespace espalier::analysis {

namespace {

/// A matching with the scaling that goes with it.
struct Matched {
  const std::vector<Index>&row_of_col, &col_of_row;
  const std::vector<double>&row_scale, &col_scale;
};

/// Cycles and paths of a matching of a matrix with symmetric pattern, split into pairs and single vertices (Duff and
/// Pralet 2005). Where values are not symmetric, the entry opposite to the matched one is the weaker of the two, and it
/// decides which pairs a cycle is split into.
class PairChooser {
 public:
  PairChooser(const EntryView& a, const Matched& m, bool symmetric, base::ThreadPool& pool)
      : a_(a), next_(m.row_of_col), diagonal_(at(a.n), 0), link_(at(a.n), 0), pair_(at(a.n)) {
    std::iota(pair_.begin(), pair_.end(), 0);
    constexpr std::int64_t kColumns = 2048;  // per range
    const std::vector<Index>& partner = symmetric ? m.row_of_col : m.col_of_row;
    pool.for_each_range(a.n, kColumns, [&](std::int64_t begin, std::int64_t end) {
      for (auto j = static_cast<Index>(begin); j < static_cast<Index>(end); ++j)
        for (Offset k = a.ptr[at(j)]; k < a.ptr[at(j) + 1]; ++k) {
          const Index i = a.row[at(k)];
          if (i != j && i != partner[at(j)]) continue;
          const double v = a.meaning(a.magnitude(k) * m.row_scale[at(i)] * m.col_scale[at(j)]);
          if (i == j)
            diagonal_[at(j)] = v;
          else
            link_[at(symmetric ? j : i)] = v;
        }
    });
  }

  std::vector<Index> run(const std::vector<Index>& col_of_row) {
    std::vector<char> seen(pair_.size(), 0);
    const auto follow = [&](Index start) {
      std::vector<Index> walk;
      for (Index v = start; v >= 0 && seen[at(v)] == 0; v = next_[at(v)]) {
        seen[at(v)] = 1;
        walk.push_back(v);
      }
      return walk;
    };
    for (Index v = 0; v < a_.n; ++v)  // paths start where no column is matched to the row
      if (col_of_row[at(v)] < 0) split_path(follow(v));
    for (Index v = 0; v < a_.n; ++v)
      if (seen[at(v)] == 0 && next_[at(v)] != v) split_cycle(follow(v));
    return std::move(pair_);
  }

  /// How many pairs and single vertices hold no good pivot, on the diagonal or, in a pair, off it.
  [[nodiscard]] Index count_poor(const std::vector<Index>& pair) const {
    constexpr double kGood = 0.01;  // the default threshold of the pivoting
    Index poor = 0;
    for (Index v = 0; v < a_.n; ++v) {
      const Index w = pair[at(v)];
      if (w < v) continue;
      double best = diagonal_[at(v)];  // of the two products in the determinant of a pair
      if (w != v) best = std::max(best * diagonal_[at(w)], link_[at(next_[at(v)] == w ? v : w)]);
      poor += best < kGood ? 1 : 0;
    }
    return poor;
  }

 private:
  // A pair whose diagonal entries are both this large (after scaling) is left to the pivoting inside the front: the
  // off-diagonal entry is at most 1, so either is an acceptable 1x1 pivot with the default threshold of 0.01 to spare.
  static constexpr double kGoodDiagonal = 0.1;

  void join(Index v, Index w) {
    if (diagonal_[at(v)] >= kGoodDiagonal && diagonal_[at(w)] >= kGoodDiagonal) return;
    pair_[at(v)] = w;
    pair_[at(w)] = v;
  }
  /// Joins walk[start], walk[start + 1], then the next two, ... `count` times, around the end.
  void join_from(const std::vector<Index>& walk, std::size_t start, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k)
      join(walk[(start + 2 * k) % walk.size()], walk[(start + 2 * k + 1) % walk.size()]);
  }
  void split_path(const std::vector<Index>& walk) {
    if (walk.size() < 2) return;
    // An odd path leaves one vertex alone: the end with the larger diagonal entry.
    const bool first_alone = walk.size() % 2 == 1 && diagonal_[at(walk.front())] > diagonal_[at(walk.back())];
    join_from(walk, first_alone ? 1 : 0, walk.size() / 2);
  }
  void split_cycle(const std::vector<Index>& walk) {
    const std::size_t size = walk.size();
    if (size % 2 == 1) {  // the vertex with the largest diagonal entry stays alone
      const auto best = std::max_element(walk.begin(), walk.end(),
                                         [&](Index v, Index w) { return diagonal_[at(v)] < diagonal_[at(w)]; });
      join_from(walk, static_cast<std::size_t>(best - walk.begin()) + 1, size / 2);
      return;
    }
    double logs[2] = {0, 0};  // of the products of the off-diagonal entries of the two ways to pair
    for (std::size_t k = 0; k < size; ++k) logs[k % 2] += std::log(std::max(link_[at(walk[k])], 0x1p-400));
    join_from(walk, logs[1] > logs[0] ? 1 : 0, size / 2);
  }

  const EntryView& a_;
  const std::vector<Index>& next_;       // the row matched to each column
  std::vector<double> diagonal_, link_;  // scaled magnitudes of a_vv and of the matched entry in column v
  std::vector<Index> pair_;
};

// Factors from their fourth roots, each times 2^shift first.
void raise(std::vector<double>& factors, int shift) {
  constexpr double kMost = 0x1p1000;
  for (double& f : factors) {
    const double square = std::ldexp(f, shift) * std::ldexp(f, shift);
    f = std::clamp(square * square, 1 / kMost, kMost);
  }
}

SymmetricMatching match_symmetric(const EntryView& entries, base::ThreadPool& pool) {
  ProductMatcher matcher(entries, true, pool);
  matcher.run();
  SymmetricMatching out;
  out.structural_rank = matcher.rank;
  out.scale.resize(at(entries.n));
  for (std::size_t i = 0; i < out.scale.size(); ++i)
    out.scale[i] = std::sqrt(matcher.row_scale[i]) * std::sqrt(matcher.col_scale[i]);
  PairChooser chooser(entries, {matcher.row_of_col, matcher.col_of_row, out.scale, out.scale}, true, pool);
  out.pair = chooser.run(matcher.col_of_row);
  if (entries.roots) raise(out.scale, 0);
  return out;
}

// Whether nearly every entry (i, j) off the diagonal has a counterpart (j, i).
bool is_nearly_symmetric(const MatrixView& a, base::ThreadPool& pool) {
  constexpr double kShare = 0.9;
  const matrix::RowIndex rows = matrix::index_rows(a, pool);
  std::vector<Index> column(at(a.rows), -1);  // the last one in which the row was met
  Offset off = 0, met = 0;
  for (Index j = 0; j < a.cols; ++j) {
    for (Offset k = a.col_ptr[at(j)]; k < a.col_ptr[at(j) + 1]; ++k) column[at(a.row_ind[at(k)])] = j;
    for (Offset k = rows.ptr[at(j)]; k < rows.ptr[at(j) + 1]; ++k) {
      const Index i = rows.col[at(k)];
      if (i == j) continue;
      ++off;
      met += column[at(i)] == j ? 1 : 0;
    }
  }
  return static_cast<double>(met) >= kShare * static_cast<double>(off);
}

// The middle of the exponents of positive numbers.
int middle_exponent(const std::vector<double>& v) {
  if (v.empty()) return 0;
  const auto [least, most] = std::minmax_element(v.begin(), v.end());
  return (std::ilogb(*least) + std::ilogb(*most)) / 2;
}

}  // namespace

bool is_wide(std::span<const double> values, base::ThreadPool& pool) {
  constexpr std::int64_t kRange = 1 << 18;
  constexpr double kLeast = 0x1p-400, kMost = 0x1p400;
  std::atomic<bool> wide{false};
  pool.for_each_range(static_cast<std::int64_t>(values.size()), kRange, [&](std::int64_t begin, std::int64_t end) {
    bool any = false;
    for (auto k = at(begin); k < at(end); ++k) {
      const double v = std::abs(values[k]);
      any = any || v > kMost || (v < kLeast && v != 0);
    }
    if (any) wide.store(true, std::memory_order_relaxed);
  });
  return wide;
}

Matching maximum_product_matching(const MatrixView& a, base::ThreadPool& pool) {
  const bool roots = is_wide(a.values, pool);
  ProductMatcher matcher({a.cols, a.col_ptr, a.row_ind, a.values, roots}, a.symmetric(), pool);
  matcher.run();
  if (roots) {  // rows may give 2^k to the columns: both stay in range
    const int k = (middle_exponent(matcher.col_scale) - middle_exponent(matcher.row_scale)) / 2;
    raise(matcher.row_scale, k);
    raise(matcher.col_scale, -k);
  }
  return {std::move(matcher.row_scale), std::move(matcher.col_scale), std::move(matcher.row_of_col), matcher.rank};
}

std::vector<Index> pairs_for_lu(const MatrixView& a, const Matching& m, base::ThreadPool& pool) {
  std::vector<Index> col_of_row(at(a.cols));
  bool on_diagonal = true;
  for (Index c = 0; c < a.cols; ++c) {
    on_diagonal = on_diagonal && m.row_of_col[at(c)] == c;
    col_of_row[at(m.row_of_col[at(c)])] = c;
  }
  if (on_diagonal || is_wide(a.values, pool) || !is_nearly_symmetric(a, pool)) return {};
  const EntryView entries{a.cols, a.col_ptr, a.row_ind, a.values};
  PairChooser chooser(entries, {m.row_of_col, col_of_row, m.row_scale, m.col_scale}, false, pool);
  std::vector<Index> pair = chooser.run(col_of_row);
  constexpr Index kOneIn = 100;  // unknowns may hold no good pivot
  if (chooser.count_poor(pair) > a.cols / kOneIn) return {};
  return pair;
}

SymmetricMatching symmetric_matching(const MatrixView& a, base::ThreadPool& pool) {
  const bool roots = is_wide(a.values, pool);
  if (a.storage == Storage::general || a.storage == Storage::symmetric_both)
    return match_symmetric({a.cols, a.col_ptr, a.row_ind, a.values, roots}, pool);
  const FullMatrix full = both_triangles(a, pool);
  return match_symmetric({a.cols, full.ptr, full.row, full.value, roots}, pool);
}

Matching maximum_product_matching(const MatrixView& a) {
  base::ThreadPool alone(1);
  return maximum_product_matching(a, alone);
}

}  // namespace espalier::analysis
