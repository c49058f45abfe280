#include "analysis/product_matcher.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <limits>
#include <utility>

#include "base/at.hpp"

namespace espalier::analysis {
namespace {

// r |a| c of a tight entry is 1 up to the rounding of two divisions and two products.
constexpr double kTight = 1 - 8 * std::numeric_limits<double>::epsilon();
constexpr std::int64_t kMatcherRange = 2048;  // columns per range of a parallel loop
constexpr double kInfinity = std::numeric_limits<double>::infinity();
// A diagonal entry is no measure of its row where it would lift another one above this.
constexpr double kFar = 1e4;
}  // namespace

ProductMatcher::ProductMatcher(const EntryView& a, bool symmetric, base::ThreadPool& pool)
    : row_scale(at(a.n), 0),
      col_scale(at(a.n), 1),
      row_of_col(at(a.n), -1),
      col_of_row(at(a.n), -1),
      a_(a),
      symmetric_(symmetric),
      pool_(pool) {}

double ProductMatcher::product(Offset k, Index j) const {
  return a_.magnitude(k) * row_scale[at(a_.row[at(k)])] * col_scale[at(j)];
}

void ProductMatcher::match(Index i, Index j) {
  row_of_col[at(j)] = i;
  col_of_row[at(i)] = j;
}

/// False: the diagonal is no measure, since an entry that couples it with a row without one is far above it. Scaled by
/// both, that entry would be 1 whatever the diagonal is: the smaller this, the further apart the factors of the two
/// rows, and a solution that is good to rounding in the scaled system is none in the caller's.
bool ProductMatcher::scale_by_diagonal() {
  std::atomic<bool> complete{true};
  pool_.for_each_range(a_.n, kMatcherRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto j = static_cast<Index>(begin); j < static_cast<Index>(end); ++j) {
      for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k)
        if (a_.row[at(k)] == j && a_.magnitude(k) > 0) row_scale[at(j)] = 1 / std::sqrt(a_.magnitude(k));
      if (row_scale[at(j)] == 0) complete.store(false, std::memory_order_relaxed);
    }
  });
  if (complete) return true;
  // A row without a diagonal entry: as if its columns were scaled like their diagonals; where they have none either, as
  // if its own were as large as its largest entry.
  std::vector<double> most(at(a_.n), 0), largest(at(a_.n), 0);
  for (Index j = 0; j < a_.n; ++j) {
    if (symmetric_ && row_scale[at(j)] > 0) continue;
    for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k) {
      // Symmetric: (i, j) stands for (j, i), so that only the columns of such rows are looked at.
      const std::size_t i = symmetric_ ? at(j) : at(a_.row[at(k)]), other = symmetric_ ? at(a_.row[at(k)]) : at(j);
      const double magnitude = a_.magnitude(k);
      largest[i] = std::max(largest[i], magnitude);
      if ((row_scale[i] == 0) == (row_scale[other] == 0)) continue;
      const double scale = std::max(row_scale[i], row_scale[other]), scaled = magnitude * scale;
      if (!(a_.meaning(scaled * scale) <= kFar)) return false;
      if (row_scale[i] == 0) most[i] = std::max(most[i], scaled);
    }
  }
  for (std::size_t i = 0; i < most.size(); ++i)
    if (row_scale[i] == 0) row_scale[i] = most[i] > 0 ? 1 / most[i] : largest[i] > 0 ? 1 / std::sqrt(largest[i]) : 1;
  return true;
}

/// scale_j = 1 / max_i |a_ij| factor_i wherever column j has an entry
void ProductMatcher::divide_by_column_maxima(const std::vector<double>& factor, std::vector<double>& scale) {
  pool_.for_each_range(a_.n, kMatcherRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto j = static_cast<Index>(begin); j < static_cast<Index>(end); ++j) {
      double most = 0;
      for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k)
        most = std::max(most, a_.magnitude(k) * factor[at(a_.row[at(k)])]);
      if (most > 0) scale[at(j)] = 1 / most;
    }
  });
}

void ProductMatcher::scale_columns() { divide_by_column_maxima(row_scale, col_scale); }

void ProductMatcher::scale_rows() {
  if (symmetric_) return divide_by_column_maxima(col_scale, row_scale);
  std::vector<double> most(at(a_.n), 0);
  for (Index j = 0; j < a_.n; ++j)
    for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k) {
      double& m = most[at(a_.row[at(k)])];
      m = std::max(m, a_.magnitude(k) * col_scale[at(j)]);
    }
  for (std::size_t i = 0; i < most.size(); ++i)
    if (most[i] > 0) row_scale[i] = 1 / most[i];
}

/// Whether the diagonal is a measure of its rows and columns. Entries of rounding error there are none: scaled to 1
/// they would lift the others far above it, and no matching brings such factors down again.
bool ProductMatcher::diagonal_measures() const {
  std::atomic<bool> measures{true};
  pool_.for_each_range(a_.n, kMatcherRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto j = static_cast<Index>(begin); j < static_cast<Index>(end); ++j)
      for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k)
        if (!(a_.meaning(a_.magnitude(k) * row_scale[at(a_.row[at(k)])] * row_scale[at(j)]) <= kFar))
          return measures.store(false, std::memory_order_relaxed);
  });
  return measures;
}

void ProductMatcher::match_tight_diagonal() {
  pool_.for_each_range(a_.n, kMatcherRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto j = static_cast<Index>(begin); j < static_cast<Index>(end); ++j)
      for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k)
        if (a_.row[at(k)] == j && product(k, j) >= kTight) match(j, j);
  });
}

/// Matches column j by a tight entry in a free row, or by moving the column of a tight row to another free tight row.
void ProductMatcher::match_tight_column(Index j) {
  for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k)
    if (col_of_row[at(a_.row[at(k)])] < 0 && product(k, j) >= kTight) return match(a_.row[at(k)], j);
  for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k) {
    if (product(k, j) < kTight) continue;
    const Index i = a_.row[at(k)], other = col_of_row[at(i)];
    for (Offset l = a_.ptr[at(other)]; l < a_.ptr[at(other) + 1]; ++l)
      if (col_of_row[at(a_.row[at(l)])] < 0 && product(l, other) >= kTight) {
        match(a_.row[at(l)], other);
        return match(i, j);
      }
  }
}

void ProductMatcher::match_tight() {
  match_tight_diagonal();
  for (Index j = 0; j < a_.n; ++j)
    if (row_of_col[at(j)] < 0) match_tight_column(j);
}

/// Reaches the rows of column j, which itself lies at the distance `base` from the root.
void ProductMatcher::scan(Index j, double base) {
  for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k) {
    const Index i = a_.row[at(k)];
    if (log_[at(k)] == -kInfinity || final_[at(i)] != 0 || deficient_row_[at(i)] != 0 || col_of_row[at(i)] == j)
      continue;
    const double d = base + std::max(0.0, -(log_[at(k)] + log_row_[at(i)] + log_col_[at(j)]));
    if (d >= best_ || d >= distance_[at(i)]) continue;
    if (distance_[at(i)] == kInfinity) touched_.push_back(i);
    distance_[at(i)] = d;
    via_[at(i)] = j;
    if (col_of_row[at(i)] < 0) {
      best_ = d;
      best_row_ = i;
    } else {
      heap_.push_back({d, i});
      std::push_heap(heap_.begin(), heap_.end());
    }
  }
}

void ProductMatcher::update_duals(Index root) {
  log_col_[at(root)] += best_;
  for (const Index i : finished_) {
    const double change = best_ - distance_[at(i)];
    log_row_[at(i)] -= change;
    log_col_[at(col_of_row[at(i)])] += change;
  }
}

void ProductMatcher::augment(Index root) {
  for (Index i = best_row_;;) {
    const Index j = via_[at(i)];
    const Index next = row_of_col[at(j)];
    match(i, j);
    if (j == root) return;
    i = next;
  }
}

void ProductMatcher::search(Index root) {
  best_ = kInfinity;
  best_row_ = -1;
  scan(root, 0);
  while (!heap_.empty()) {
    std::pop_heap(heap_.begin(), heap_.end());
    const Reached nearest = heap_.back();
    heap_.pop_back();
    if (nearest.distance >= best_) break;
    if (final_[at(nearest.row)] != 0) continue;  // an older, longer distance
    final_[at(nearest.row)] = 1;
    finished_.push_back(nearest.row);
    scan(col_of_row[at(nearest.row)], nearest.distance);
  }
  if (best_row_ >= 0) {
    update_duals(root);
    augment(root);
  } else {
    deficient_col_[at(root)] = ++deficient_sets_;
    for (const Index i : finished_) {
      deficient_row_[at(i)] = deficient_sets_;
      deficient_col_[at(col_of_row[at(i)])] = deficient_sets_;
    }
  }
  for (const Index i : touched_) {
    distance_[at(i)] = kInfinity;
    final_[at(i)] = 0;
  }
  touched_.clear();
  finished_.clear();
  heap_.clear();
}

/// Later searches did not look at the rows of the closed sets, so r |a| c may exceed 1 there, in columns of later sets
/// or of none. Scaling the rows of a set by t <= 1 and its columns by 1/t repairs that and keeps its tight entries; the
/// sets are taken last first, so that every column that matters for a set has its final factor.
void ProductMatcher::repair_deficient() {
  std::vector<std::vector<Index>> columns(at(deficient_sets_) + 1);
  std::vector<std::vector<Index>> rows(columns.size());
  for (Index j = 0; j < a_.n; ++j) {
    columns[at(deficient_col_[at(j)])].push_back(j);
    rows[at(deficient_row_[at(j)])].push_back(j);
  }
  std::vector<double> excess(columns.size(), 0);  // largest log(r |a| c)
  const auto visit = [&](Index j) {
    for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k) {
      const Index i = a_.row[at(k)], set = deficient_row_[at(i)];
      if (set == 0 || set == deficient_col_[at(j)] || a_.magnitude(k) == 0) continue;
      excess[at(set)] = std::max(excess[at(set)], std::log(a_.magnitude(k)) + log_row_[at(i)] + log_col_[at(j)]);
    }
  };
  for (const Index j : columns[0]) visit(j);
  for (std::size_t set = columns.size() - 1; set > 0; --set) {
    for (const Index i : rows[set]) log_row_[at(i)] -= excess[set];
    for (const Index j : columns[set]) log_col_[at(j)] += excess[set];
    for (const Index j : columns[set]) visit(j);
  }
}

void ProductMatcher::take_logarithms() {
  log_row_.resize(at(a_.n));
  log_col_.resize(at(a_.n));
  log_.resize(a_.row.size());
  pool_.for_each_range(a_.n, kMatcherRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto j = at(begin); j < at(end); ++j) {
      log_row_[j] = std::log(row_scale[j]);
      log_col_[j] = std::log(col_scale[j]);
      for (Offset k = a_.ptr[j]; k < a_.ptr[j + 1]; ++k) log_[at(k)] = std::log(a_.magnitude(k));
    }
  });
}

/// Column j takes the row in which it is cheapest, at a price by which its next best row would be as cheap. Where both
/// are equally cheap, it takes one that nobody has, if there is one, else the second, and pays nothing.
/// @return the column that had the row and paid less: it bids at once; -1: none. Columns that lose a row for nothing go
///         to `displaced`, so that two of them do not bid against each other for ever.
Index ProductMatcher::bid_for_row(Index j, std::vector<Index>& displaced) {
  double least = kInfinity, second = kInfinity;
  Index best = -1, other = -1;
  effort_ -= a_.ptr[at(j) + 1] - a_.ptr[at(j)];
  for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k) {
    const Index i = a_.row[at(k)];
    const double cost = -(log_[at(k)] + log_row_[at(i)]);
    if (cost >= second) continue;
    if (cost < least) {
      second = std::exchange(least, cost);
      other = std::exchange(best, i);
    } else {
      second = cost;
      other = i;
    }
  }
  if (other < 0) return -1;  // no choice: left to a search
  log_col_[at(j)] = second;
  const bool pays = second > least;
  if (pays)
    log_row_[at(best)] -= second - least;
  else if (col_of_row[at(best)] >= 0)
    best = other;
  const Index loser = col_of_row[at(best)];
  match(best, j);
  if (loser < 0) return -1;
  row_of_col[at(loser)] = -1;
  if (pays) return loser;
  displaced.push_back(loser);
  return -1;
}

void ProductMatcher::bid() {
  // Measured on late interior-point systems (docs/notebook/ordering.md, "Matching"): more bids cost more than the
  // searches that they save; without the bound on a chain, two columns with nearly the same wishes eat up all of it.
  constexpr int kRoundsOfBids = 5;
  constexpr int kChain = 20;
  constexpr Offset kEffort = 20;  // times the entries of the matrix
  effort_ = kEffort * static_cast<Offset>(a_.row.size());
  std::vector<Index> waiting, displaced;
  for (Index j = 0; j < a_.n; ++j)
    if (row_of_col[at(j)] < 0) waiting.push_back(j);
  for (int pass = 0; pass < kRoundsOfBids; ++pass) {
    for (Index j : waiting) {
      for (int step = 0; j >= 0 && effort_ > 0 && step < kChain; ++step) j = bid_for_row(j, displaced);
      if (j >= 0) displaced.push_back(j);
    }
    waiting = std::exchange(displaced, {});
  }
}

/// A shortest augmenting path for every column that is left.
void ProductMatcher::search_all() {
  const std::size_t n = at(a_.n);
  distance_.assign(n, kInfinity);
  via_.assign(n, -1);
  final_.assign(n, 0);
  deficient_row_.assign(n, 0);
  deficient_col_.assign(n, 0);
  deficient_sets_ = 0;
  for (Index j = 0; j < a_.n; ++j)
    if (row_of_col[at(j)] < 0) search(j);
}

/// Bids and searches lower the factors of rows further than the matching needs: a column whose second choice is an
/// entry of 1e-70 pays that much for a row that nobody else wants, and the row's other entries vanish beside it. Here
/// each row gets back the largest factor, up to `most`, with which no r |a| c exceeds 1 and matched entries stay tight:
/// shortest paths, since such factors are potentials of the matching (columns lead from their own rows to the others).
/// @param most  logarithms of the factors before the first bid
void ProductMatcher::raise_rows(const std::vector<double>& most) {
  const std::size_t n = at(a_.n);
  std::vector<double>& raised = distance_;  // by how much, at most
  raised.resize(n);
  for (std::size_t i = 0; i < n; ++i) raised[i] = std::max(0.0, most[i] - log_row_[i]);
  const auto relax = [&](Index from) {
    const Index j = col_of_row[at(from)];
    for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k) {
      const Index i = a_.row[at(k)];
      if (log_[at(k)] == -kInfinity || raised[at(i)] <= raised[at(from)]) continue;
      const double d = raised[at(from)] + std::max(0.0, -(log_[at(k)] + log_row_[at(i)] + log_col_[at(j)]));
      if (d >= raised[at(i)]) continue;
      raised[at(i)] = d;
      heap_.push_back({d, i});
      std::push_heap(heap_.begin(), heap_.end());
    }
  };
  heap_.clear();
  for (std::size_t i = 0; i < n; ++i)
    if (raised[i] > 0) heap_.push_back({raised[i], static_cast<Index>(i)});
  std::make_heap(heap_.begin(), heap_.end());
  if (heap_.empty()) return;
  for (std::size_t i = 0; i < n; ++i)
    if (raised[i] == 0) relax(static_cast<Index>(i));
  while (!heap_.empty()) {
    std::pop_heap(heap_.begin(), heap_.end());
    const Reached nearest = heap_.back();
    heap_.pop_back();
    if (nearest.distance == raised[at(nearest.row)]) relax(nearest.row);
  }
  for (std::size_t i = 0; i < n; ++i) {
    log_row_[i] += raised[i];
    log_col_[at(col_of_row[i])] -= raised[i];
  }
}

void ProductMatcher::run() {
  if (!scale_by_diagonal() || !diagonal_measures()) std::fill(row_scale.begin(), row_scale.end(), 1.0);
  scale_columns();
  scale_rows();
  match_tight();
  rank = a_.n - static_cast<Index>(std::count(row_of_col.begin(), row_of_col.end(), -1));
  if (rank == a_.n) return;
  take_logarithms();
  const std::vector<Index> greedy_row = row_of_col, greedy_col = col_of_row;
  const std::vector<double> first_factors = log_row_;
  bid();
  search_all();
  if (deficient_sets_ > 0) {
    // Bids for rows of a closed set raise prices there until they give up, and these become scaling factors: again
    // without.
    row_of_col = greedy_row;
    col_of_row = greedy_col;
    take_logarithms();
    search_all();
    repair_deficient();
  } else {
    raise_rows(first_factors);
  }
  rank = a_.n - static_cast<Index>(std::count(row_of_col.begin(), row_of_col.end(), -1));
  pool_.for_each_range(a_.n, kMatcherRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = at(begin); k < at(end); ++k) {
      row_scale[k] = std::exp(log_row_[k]);
      col_scale[k] = std::exp(log_col_[k]);
    }
  });
}

}  // namespace espalier::analysis
