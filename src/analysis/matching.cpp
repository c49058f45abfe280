#include "analysis/matching.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "analysis/assignment.hpp"
#include "analysis/columns.hpp"

namespace espalier::analysis {

namespace {

auto at(Index k) { return static_cast<std::size_t>(k); }
auto at(Offset k) { return static_cast<std::size_t>(k); }

/// Cycles and paths of a matching of a symmetric matrix, split into pairs and single vertices (Duff and Pralet 2005).
class PairChooser {
 public:
  PairChooser(const EntryView& a, const Assignment& matched, const std::vector<double>& scale, base::ThreadPool& pool)
      : a_(a), next_(matched.row_of_col), diagonal_(scale.size(), 0), link_(scale.size(), 0), pair_(scale.size()) {
    std::iota(pair_.begin(), pair_.end(), 0);
    constexpr std::int64_t kColumns = 2048;  // per piece
    pool.for_each_piece(a.n, kColumns, [&](std::int64_t begin, std::int64_t end) {
      for (auto j = static_cast<Index>(begin); j < static_cast<Index>(end); ++j)
        for (Offset k = a.ptr[at(j)]; k < a.ptr[at(j) + 1]; ++k) {
          const Index i = a.row[at(k)];
          if (i != j && i != next_[at(j)]) continue;
          const double v = a.magnitude(k) * scale[at(i)] * scale[at(j)];
          (i == j ? diagonal_ : link_)[at(j)] = v;
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

SymmetricMatching match_symmetric(const EntryView& entries, base::ThreadPool& pool) {
  Assignment assignment(entries, true, pool);
  assignment.run();
  SymmetricMatching out;
  out.structural_rank = assignment.rank;
  out.scale.resize(at(entries.n));
  for (std::size_t i = 0; i < out.scale.size(); ++i)
    out.scale[i] = std::sqrt(assignment.row_scale[i]) * std::sqrt(assignment.col_scale[i]);
  PairChooser chooser(entries, assignment, out.scale, pool);
  out.pair = chooser.run(assignment.col_of_row);
  return out;
}

}  // namespace

Matching maximum_product_matching(const MatrixView& a, base::ThreadPool& pool) {
  Assignment assignment({a.cols, a.col_ptr, a.row_ind, a.values}, a.symmetric(), pool);
  assignment.run();
  return {std::move(assignment.row_scale), std::move(assignment.col_scale), std::move(assignment.row_of_col),
          assignment.rank};
}

SymmetricMatching symmetric_matching(const MatrixView& a, base::ThreadPool& pool) {
  if (a.storage == Storage::general || a.storage == Storage::symmetric_both)
    return match_symmetric({a.cols, a.col_ptr, a.row_ind, a.values}, pool);
  const FullMatrix full = both_triangles(a, pool);
  return match_symmetric({a.cols, full.ptr, full.row, full.value}, pool);
}

Matching maximum_product_matching(const MatrixView& a) {
  base::ThreadPool alone(1);
  return maximum_product_matching(a, alone);
}

SymmetricMatching symmetric_matching(const MatrixView& a) {
  base::ThreadPool alone(1);
  return symmetric_matching(a, alone);
}

}  // namespace espalier::analysis
