/// \file
/// The matching of largest product (an assignment problem): shortest augmenting paths on sparse columns.
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "base/at.hpp"
#include "base/lazy_vector.hpp"
#include "base/thread_pool.hpp"
#include "espalier/types.hpp"

namespace espalier::analysis {

/// Sparse columns of a square matrix; somebody else owns the arrays. Zeros and entries that are not finite do not
/// count.
struct EntryView {
  Index n = 0;
  std::span<const Offset> ptr;
  std::span<const Index> row;
  std::span<const double> value;

  /// The fourth roots of the magnitudes instead of these, where a product of entries and scaling factors would overflow
  /// or vanish (see is_wide()): the matching is the same, the factors are the fourth roots as well.
  bool roots = false;

  /// |value[k]|, or its root; 0: no entry.
  [[nodiscard]] double magnitude(Offset k) const {
    const double v = std::abs(value[at(k)]);
    if (!(v > 0) || !std::isfinite(v)) return 0;
    return roots ? std::sqrt(std::sqrt(v)) : v;
  }
  /// What a product of magnitudes and factors stands for.
  [[nodiscard]] double meaning(double product) const {
    return roots ? product * product * (product * product) : product;
  }
};

/// Maximises the product of |a_ij| over the matched entries (Duff and Koster 2001, "MC64" with job 5).
///
/// With scaling factors r, c > 0 such that r_i |a_ij| c_j <= 1, an entry is *tight* where equality holds; a matching of
/// tight entries is optimal. The start is r_i = |a_ii|^(-1/2), which makes every diagonal entry of a positive definite
/// matrix tight at once, or 1 where diagonal entries are no measure; then columns and rows are scaled to maximum 1 and
/// tight entries are matched greedily. Columns that are left bid for rows (augmenting row reduction of Jonker and
/// Volgenant 1987, in chains of bounded length), which matches most of them at the price of looking at their entries;
/// every column still left is matched by a shortest augmenting path in the reduced costs -log(r_i |a_ij| c_j)
/// (Dijkstra).
class ProductMatcher {
 public:
  /// @param symmetric values and pattern are symmetric: rows are read as columns, by all threads
  ProductMatcher(const EntryView& a, bool symmetric, base::ThreadPool& pool);
  void run();

  std::vector<double> row_scale, col_scale;   ///< n, positive
  std::vector<Index> row_of_col, col_of_row;  ///< n, -1 when unmatched
  Index rank = 0;

 private:
  struct Reached {
    double distance;
    Index row;
    bool operator<(const Reached& o) const {  // a max-heap gives the nearest; ties by row for reproducibility
      return distance != o.distance ? distance > o.distance : row > o.row;
    }
  };

  [[nodiscard]] bool scale_by_diagonal();
  void scale_columns();
  void divide_by_column_maxima(const std::vector<double>& factor, std::vector<double>& scale);
  void scale_rows();
  [[nodiscard]] bool diagonal_measures() const;
  void match_tight_diagonal();
  void match_tight();
  void match_tight_column(Index j);
  void match(Index i, Index j);
  void take_logarithms();
  void bid();
  Index bid_for_row(Index j, std::vector<Index>& displaced);
  void search_all();
  void search(Index root);
  void scan(Index j, double base);
  void augment(Index root);
  void update_duals(Index root);
  void repair_deficient();
  void raise_rows(const std::vector<double>& most);
  [[nodiscard]] double product(Offset k, Index j) const;

  EntryView a_;
  bool symmetric_;
  base::ThreadPool& pool_;
  std::vector<double> log_row_, log_col_;  // logarithms of the scaling factors, from the first bid on
  base::LazyVector<double> log_;           // logarithms of the magnitudes, -infinity for no entry
  Offset effort_ = 0;                      // entries that bids may still look at
  // One search: distances of rows, the columns they were reached from, the rows whose distance is final.
  std::vector<double> distance_;
  std::vector<Index> via_;
  std::vector<char> final_;
  std::vector<Index> touched_, finished_;
  std::vector<Reached> heap_;
  double best_ = 0;
  Index best_row_ = -1;
  // A search that fails visits a closed set: its columns have entries in its rows only. Such rows are never reached
  // again. deficient_row_[i] and deficient_col_[j] number the set, 0: none.
  std::vector<Index> deficient_row_, deficient_col_;
  Index deficient_sets_ = 0;
};

}  // namespace espalier::analysis
