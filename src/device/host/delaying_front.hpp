/// \file
/// A dense front that eliminates the pivots that are stable there, and says which have to go on to its parent.
#pragma once

#include <atomic>
#include <span>
#include <vector>

#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "device/factor_outcome.hpp"
#include "device/host/numeric_state.hpp"
#include "plan/front_layout.hpp"

namespace espalier::device::host {

/// How much work a search may be, in operations. Shared by threads.
class Effort {
 public:
  explicit Effort(double most) : left_(most) {}
  /// @returns false from the call on that takes more than there is
  bool spend(double operations) { return left_.fetch_sub(operations, std::memory_order_relaxed) >= operations; }
  [[nodiscard]] bool spent() const { return left_.load(std::memory_order_relaxed) < 0; }

 private:
  std::atomic<double> left_;
};

/// Column-major, `rows` x `rows`; the lower triangle alone for ldlt. Pivots are searched within tiles like those of the
/// plan, and judged by the entries of L in all rows of the front. A column that fails takes its row along: tries its
/// luck again behind the other pivots where the front has several tiles, else leaves.
///
/// Rows and columns stay where they are; what moves are their numbers in order(). A tile is factored in copies of its
/// columns (and rows), and the rest of the front hears of it when all of its pivots are good.
/// Value: double or complex<double>.
template <class Value>
class DelayingFront {
 public:
  /// @param pool  shares the updates of large fronts; null: the calling thread does them alone
  /// @param effort  null: no end
  DelayingFront(MatrixKind matrix, const PivotRule& rule, const plan::TileRule& tiles, base::MemoryBudget* budget,
                base::ThreadPool* pool = nullptr, Effort* effort = nullptr)
      : lu_(matrix.kind == Kind::lu),
        hermitian_(matrix.hermitian),
        rule_(rule),
        tiles_(tiles),
        budget_(budget),
        pool_(pool),
        effort_(effort) {}

  /// Begins a front of zeros whose first `pivots` rows and columns may be eliminated. Its last `border` rows judge no
  /// pivot.
  void start(Index pivots, Index rows, Index border = 0);
  void add(Index row, Index col, Value value) { c_[col * ld_ + row] += value; }
  /// @returns false where the effort is spent: then the front is unfinished
  bool eliminate();

  /// The rows as they stand now, by their places at start(): eliminated ones, pivots that leave, rows below.
  [[nodiscard]] std::span<const Index> order() const { return order_; }
  [[nodiscard]] Index eliminated() const { return done_; }
  [[nodiscard]] Index leaving() const { return failed_; }
  /// Whether the pivot (by its place at start()) was put behind the others.
  [[nodiscard]] bool late(Index pivot) const { return late_[at(pivot)] != 0; }
  /// What is left, at (row, col) of the rows that were not eliminated; ldlt: row >= col.
  [[nodiscard]] Value rest(Index row, Index col) const {
    return entry(order_[at(done_ + row)], order_[at(done_ + col)]);
  }

 private:
  /// Places from done_ on: a column, and the row that was chosen for it (ldlt: the same).
  struct Failure {
    Index column, row;
  };

  [[nodiscard]] Value entry(Index row, Index col) const {
    if (lu_ || row >= col) return c_[col * ld_ + row];
    const Value mirrored = c_[row * ld_ + col];
    return hermitian_ ? base::conjugate(mirrored) : mirrored;
  }
  [[nodiscard]] Index next_width() const;
  [[nodiscard]] std::vector<Failure> factor_tile(Index width);
  void measure_growth(Index width);
  void take_rows(Index width);
  void pack_columns(std::span<const Index> columns, bool transposed);
  void update(Index width);
  [[nodiscard]] std::vector<Index> culprits(std::span<const Failure> failures);
  void put_back(std::span<const Index> failing, bool last_tile);

  bool lu_, hermitian_;
  PivotRule rule_;
  plan::TileRule tiles_;
  base::MemoryBudget* budget_;
  base::ThreadPool* pool_;
  Effort* effort_;
  base::Buffer<Value> c_;
  Index rows_ = 0, border_ = 0;
  Offset ld_ = 0;
  Index done_ = 0, left_ = 0, failed_ = 0;  // eliminated; pivots to come; pivots that leave
  Index suspect_ = -1;                      // the row (by its place at start()) of the last failure
  std::vector<Index> order_;                // rows
  std::vector<char> late_;                  // pivots
  // The rows of one tile. Below it stand all rows from first_ on, a multiple of kPanel; those that are not to be
  // changed are zero.
  Index first_ = 0;
  std::vector<char> waits_;                         // rows below the tile
  std::vector<std::int32_t> perm_;                  // pivots
  std::vector<char> replaced_;                      // pivots
  base::Buffer<Value> tile_, inverse_, inverse_u_;  // the diagonal tile; inverses of its factors
  base::Buffer<Value> columns_, panels_;            // of the rows below: as they are given; packed
  base::Buffer<Value> l_, right_;                   // panels: L, and L D (ldlt) or the transpose of U (lu)
  std::vector<Value> d_, d_inverse_, e_inverse_;
  std::vector<double> growth_;
};

}  // namespace espalier::device::host
