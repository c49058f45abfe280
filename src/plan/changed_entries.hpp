/// \file
/// Entries of fronts whose pivots are those of a front before: made from its entries, without a look at the matrix.
#pragma once

#include <span>
#include <vector>

#include "plan/kept_entries.hpp"
#include "plan/plan.hpp"

namespace espalier::plan {

/// An entry of A in permuted form: it belongs to the column list of the lower of its two positions.
struct PermutedEntry {
  Offset source;
  Index row;        // the higher position
  bool transposed;  // the entry lies above the diagonal of the permuted matrix (lu)
};

class ChangedEntries {
 public:
  /// @param kept  null: no front is known
  /// @param row_position, column_position  by row and column of `a`; with `kept` and `plan` they outlive the object
  ChangedEntries(const Plan& plan, const MatrixView& a, std::span<const Index> row_position,
                 std::span<const Index> column_position, const KeptEntries* kept);

  /// The front before with these pivots; -1: the entries have to be looked for.
  [[nodiscard]] Index front_before(Index f) const {
    return kept_ == nullptr || kept_->with_pivots.empty() ? -1 : kept_->with_pivots[at(f)];
  }
  /// @pre front_before(f) >= 0, for both
  [[nodiscard]] Offset count(Index f) const;
  /// Columns one after another, in each rows ascending. @param ptr  pivots + 1: each column's part of the list
  void collect(Index f, std::vector<PermutedEntry>& list, std::vector<std::size_t>& ptr) const;

 private:
  struct Added {
    Index front, column;  // of the front
    PermutedEntry entry;
  };
  [[nodiscard]] std::span<const Added> added_to(Index f) const;
  void merge(Index f, std::vector<PermutedEntry>& list, std::vector<std::size_t>& ptr) const;

  const Plan& plan_;
  std::span<const Index> column_position_;
  const KeptEntries* kept_;
  std::vector<Added> added_;      // by front and column
  std::vector<Index> lost_from_;  // fronts, ascending; once for each entry that is gone
};

}  // namespace espalier::plan
