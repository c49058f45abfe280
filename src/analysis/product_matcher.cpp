#include "analysis/product_matcher.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <limits>

namespace espalier::analysis {

namespace {
auto at(Index k) { return static_cast<std::size_t>(k); }
auto at(Offset k) { return static_cast<std::size_t>(k); }

// r |a| c of a tight entry is 1 up to the rounding of two divisions and two products.
constexpr double kTight = 1 - 8 * std::numeric_limits<double>::epsilon();
constexpr std::int64_t kColumns = 2048;  // columns per piece of a parallel loop
constexpr double kInfinity = std::numeric_limits<double>::infinity();
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

void ProductMatcher::scale_by_diagonal() {
  std::atomic<bool> complete{true};
  pool_.for_each_piece(a_.n, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto j = static_cast<Index>(begin); j < static_cast<Index>(end); ++j) {
      for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k)
        if (a_.row[at(k)] == j && a_.magnitude(k) > 0) row_scale[at(j)] = 1 / std::sqrt(a_.magnitude(k));
      if (row_scale[at(j)] == 0) complete.store(false, std::memory_order_relaxed);
    }
  });
  if (complete) return;
  // A row without a diagonal entry: as if its columns were scaled like their diagonals.
  std::vector<double> most(at(a_.n), 0);
  for (Index j = 0; j < a_.n; ++j) {
    if (symmetric_ ? row_scale[at(j)] > 0 : row_scale[at(j)] == 0) continue;
    for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k) {
      // Symmetric: (i, j) stands for (j, i), so that only the columns of such rows are looked at.
      const std::size_t i = symmetric_ ? at(j) : at(a_.row[at(k)]), other = symmetric_ ? at(a_.row[at(k)]) : at(j);
      if (row_scale[i] == 0 && row_scale[other] > 0) most[i] = std::max(most[i], a_.magnitude(k) * row_scale[other]);
    }
  }
  for (std::size_t i = 0; i < most.size(); ++i)
    if (row_scale[i] == 0) row_scale[i] = most[i] > 0 ? 1 / most[i] : 1;
}

/// scale_j = 1 / max_i |a_ij| factor_i wherever column j has an entry
void ProductMatcher::divide_by_column_maxima(const std::vector<double>& factor, std::vector<double>& scale) {
  pool_.for_each_piece(a_.n, kColumns, [&](std::int64_t begin, std::int64_t end) {
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

void ProductMatcher::match_tight_diagonal() {
  pool_.for_each_piece(a_.n, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto j = static_cast<Index>(begin); j < static_cast<Index>(end); ++j)
      for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k)
        if (a_.row[at(k)] == j && product(k, j) >= kTight) match(j, j);
  });
}

/// Matches column j by a tight entry in a free row, or by moving the column of a tight row to another free tight row.
bool ProductMatcher::match_tight_column(Index j) {
  for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k)
    if (col_of_row[at(a_.row[at(k)])] < 0 && product(k, j) >= kTight) {
      match(a_.row[at(k)], j);
      return true;
    }
  for (Offset k = a_.ptr[at(j)]; k < a_.ptr[at(j) + 1]; ++k) {
    if (product(k, j) < kTight) continue;
    const Index i = a_.row[at(k)], other = col_of_row[at(i)];
    for (Offset l = a_.ptr[at(other)]; l < a_.ptr[at(other) + 1]; ++l)
      if (col_of_row[at(a_.row[at(l)])] < 0 && product(l, other) >= kTight) {
        match(a_.row[at(l)], other);
        match(i, j);
        return true;
      }
  }
  return false;
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
    const double b = a_.magnitude(k);
    if (b == 0 || final_[at(i)] != 0 || deficient_row_[at(i)] != 0 || col_of_row[at(i)] == j) continue;
    const double d = base + std::max(0.0, -(std::log(b) + log_row_[at(i)] + log_col_[at(j)]));
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
  std::vector<std::vector<Index>> columns(static_cast<std::size_t>(deficient_sets_) + 1);
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

void ProductMatcher::run() {
  scale_by_diagonal();
  scale_columns();
  scale_rows();
  match_tight();
  rank = a_.n - static_cast<Index>(std::count(row_of_col.begin(), row_of_col.end(), -1));
  if (rank == a_.n) return;
  const std::size_t n = at(a_.n);
  log_row_.resize(n);
  log_col_.resize(n);
  pool_.for_each_piece(a_.n, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = at(begin); k < at(end); ++k) {
      log_row_[k] = std::log(row_scale[k]);
      log_col_[k] = std::log(col_scale[k]);
    }
  });
  distance_.assign(n, kInfinity);
  via_.assign(n, -1);
  final_.assign(n, 0);
  deficient_row_.assign(n, 0);
  deficient_col_.assign(n, 0);
  for (Index j = 0; j < a_.n; ++j)
    if (row_of_col[at(j)] < 0) search(j);
  if (deficient_sets_ > 0) repair_deficient();
  rank = a_.n - static_cast<Index>(std::count(row_of_col.begin(), row_of_col.end(), -1));
  pool_.for_each_piece(a_.n, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = at(begin); k < at(end); ++k) {
      row_scale[k] = std::exp(log_row_[k]);
      col_scale[k] = std::exp(log_col_[k]);
    }
  });
}

}  // namespace espalier::analysis
