/// \file
/// Which fronts new values of some entries reach.
#pragma once

#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "plan/plan.hpp"
#include "solver/analysis/prepared_matrix.hpp"

namespace espalier::solver {

/// Where the columns and rows of a system stand in a plan.
class ReachedFronts {
 public:
  /// @param parts  columns of the plan for each of the matrix's: 1, of a real form 2
  ReachedFronts(const PreparedMatrix& prepared, const plan::Plan& plan, Index parts, base::ThreadPool& pool);

  /// Fronts; 1: it or one below it has one of these entries of PreparedMatrix::a. Entries stand in the lower of the
  /// fronts of their row and their column, which the other is above.
  /// @param places  of their numbers, ascending; `doubles` for each entry
  [[nodiscard]] std::vector<char> of_places(std::span<const Offset> places, Offset doubles) const;
  /// The same of all entries whose row and column are marked (n each, not 0).
  [[nodiscard]] std::vector<char> of_rows_and_columns(std::span<const unsigned char> rows,
                                                      std::span<const unsigned char> columns) const;

 private:
  void mark_column(Index column, std::vector<char>& fronts) const;
  void mark_parents(std::vector<char>& fronts) const;

  const PreparedMatrix& prepared_;
  const plan::Plan& plan_;
  Index parts_;
  base::ThreadPool& pool_;
  std::vector<Index> front_of_column_;  // of the plan
  std::vector<Index> column_of_row_;    // of the matrix
};

}  // namespace espalier::solver
