/// \file
/// An analysis on disk: the tree and the scaling, from which the plan is laid out again without any ordering.
#pragma once

#include <string>

#include "analysis/assembly_tree.hpp"
#include "base/thread_pool.hpp"
#include "solver/analysis/prepared_matrix.hpp"

namespace espalier::solver {

struct SavedAnalysis {
  Kind kind = Kind::automatic;
  analysis::AssemblyTree tree;
  std::vector<double> row_scale, col_scale;
  std::vector<Index> row_of_col;
};

/// use(array) for every array of an analysis, in the order of files.
template <class Analysis, class Use>
void each_array(Analysis& s, Use&& use) {
  use(s.tree.order);
  use(s.tree.first);
  use(s.tree.parent);
  use(s.tree.row_ptr);
  use(s.tree.rows);
  use(s.row_scale);
  use(s.col_scale);
  use(s.row_of_col);
}

/// The faults of one that was read: what is wrong with its scaling and matching, and with sizes of its tree; empty:
/// nothing.
std::string wrong_with(const SavedAnalysis& saved);

/// A number that differs for different patterns (FNV-1a over sizes, pointers and indices).
std::uint64_t pattern_hash(const MatrixView& a, base::ThreadPool& pool);

/// @throws Error(invalid_input) when the file cannot be written
void write_analysis(const std::string& path, const SavedAnalysis& saved, std::uint64_t hash);
/// Reads it back and checks its scaling and matching. The tree is only read: before it is used, it must pass
/// analysis::verify_tree() for the matrix.
/// @throws Error(invalid_input) when the file is not an analysis of a pattern with this hash, or damaged
SavedAnalysis read_analysis(const std::string& path, std::uint64_t hash);

}  // namespace espalier::solver
