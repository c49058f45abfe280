/// \file
/// Sparsity patterns of W and Phi_q, and how components declare them.
#pragma once

#include <compare>
#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "espalier/dae.hpp"

namespace espalier::dynamics {

/// A fixed sparsity pattern in compressed form with sorted, unique indices. `ptr` runs over columns for W (compressed
/// sparse column) and over rows for Phi_q (compressed sparse row); `ind` holds the other index.
struct SparsePattern {
  Index rows = 0;
  Index cols = 0;
  std::vector<Offset> ptr;
  std::vector<Index> ind;
  [[nodiscard]] Offset nonzeros() const { return ptr.empty() ? 0 : ptr.back(); }
};

/// Position of entry (major, minor) in a pattern's values: major is the column of W or the row of Phi_q.
/// @throws std::logic_error if the entry was never declared.
[[nodiscard]] Offset find_entry(const SparsePattern& pattern, Index major, Index minor);

/// Collects declared entries and makes the pattern of them. Duplicates are merged; negative indices (ground, fixed
/// coordinates) are skipped.
class PatternBuilder {
 public:
  PatternBuilder(Index rows, Index cols, bool by_columns);
  void add(Index row, Index col);
  /// Declares every (row, col) pair of the two lists; by columns, long lists are kept as they are.
  void add_block(std::span<const Index> rows, std::span<const Index> cols);
  /// Declares the whole diagonal.
  void add_diagonal() { diagonal_ = true; }
  /// Declares 3 x 3 blocks, without a copy: vertex b has the columns first + 3 b and the next two, and in them the
  /// three rows of each vertex ind[ptr[b] .. ptr[b + 1]), which rise. @pre built by columns; ranges of columns come in
  /// rising order and do not overlap; the lists live until the last build()
  void add_vertex_pairs(Index first, std::span<const Offset> ptr, std::span<const Index> ind);
  /// How many entries were declared so far, those declared several times among them; without the diagonal.
  [[nodiscard]] Offset declared() const { return declared_; }
  /// The pattern of all entries declared so far. @param pool  null: the calling thread alone
  [[nodiscard]] SparsePattern build(base::ThreadPool* pool = nullptr) const;

 private:
  struct VertexPairs {
    Index first;
    std::span<const Offset> ptr;
    std::span<const Index> ind;
  };
  /// A column and a list of blocks_ that belongs to it.
  struct BlockColumn {
    Index column, block;
    friend auto operator<=>(const BlockColumn&, const BlockColumn&) = default;
  };
  [[nodiscard]] std::span<const Index> vertices_of(Index major) const;
  void collect(Index major, std::span<const BlockColumn> blocks, std::vector<Index>& out) const;

  Index rows_, cols_;
  bool by_columns_;
  bool diagonal_ = false;
  Offset declared_ = 0;
  std::vector<VertexPairs> pairs_;
  std::vector<std::vector<Index>> lists_;   // minor indices of every major index, compacted lazily
  std::vector<std::vector<Index>> blocks_;  // rows, sorted and unique
  std::vector<BlockColumn> block_columns_;
};

}  // namespace espalier::dynamics
