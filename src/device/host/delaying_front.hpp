/// \file
/// A dense front that eliminates the pivots that are stable there, and says which have to go on to its parent.
#pragma once

#include <span>
#include <vector>

#include "base/memory.hpp"
#include "device/factor_outcome.hpp"
#include "device/host/kernels.hpp"
#include "plan/front_layout.hpp"

namespace espalier::device::host {

/// Column-major, `rows` x `rows`; the lower triangle alone for ldlt. Pivots are searched within tiles like those of the
/// plan, and judged by the entries of L in all rows of the front. A column that fails takes its row along: tries its
/// luck again behind the other pivots where the front has several tiles, else leaves.
class DelayingFront {
 public:
  DelayingFront(Kind kind, const PivotRule& rule, const plan::TileRule& tiles, base::MemoryBudget* budget)
      : lu_(kind == Kind::lu), rule_(rule), tiles_(tiles), budget_(budget) {}

  /// Begins a front of zeros whose first `pivots` rows and columns may be eliminated.
  void start(Index pivots, Index rows);
  void add(Index row, Index col, double value) { c_[col * ld_ + row] += value; }
  void eliminate();

  /// The rows as they stand now, by their places at start(): eliminated ones, pivots that leave, rows below.
  [[nodiscard]] std::span<const Index> order() const { return order_; }
  [[nodiscard]] Index eliminated() const { return done_; }
  [[nodiscard]] Index leaving() const { return failed_; }
  /// Whether the pivot (by its place at start()) was put behind the others.
  [[nodiscard]] bool late(Index pivot) const { return late_[static_cast<std::size_t>(pivot)] != 0; }
  /// What is left, at (row, col) of the rows that were not eliminated; ldlt: row >= col.
  [[nodiscard]] double rest(Index row, Index col) const { return c_[(done_ + col) * ld_ + done_ + row]; }

 private:
  /// Places from done_ on: a column, and the row that was chosen for it (ldlt: the same).
  struct Failure {
    Index column, row;
  };

  [[nodiscard]] Index next_width() const;
  [[nodiscard]] std::vector<Failure> factor_tile(Index width);
  [[nodiscard]] std::vector<Index> culprits(std::span<const Failure> failures);
  void put_back(std::span<const Index> failing, bool last_tile);
  void restore(std::span<const Index> order);

  bool lu_;
  PivotRule rule_;
  plan::TileRule tiles_;
  base::MemoryBudget* budget_;
  base::Buffer<double> c_, saved_;  // the front; what of it a tile is about to change
  Index rows_ = 0;
  Offset ld_ = 0;
  Index done_ = 0, left_ = 0, failed_ = 0;  // eliminated; pivots to come; pivots that leave
  Index suspect_ = -1;                      // the row (by its place at start()) of the last failure
  std::vector<Index> order_;                // rows
  std::vector<char> late_;                  // pivots
  // Of one tile.
  std::vector<std::int32_t> perm_;
  std::vector<char> replaced_;
  base::Buffer<double> d_;
};

}  // namespace espalier::device::host
