/// \file
/// Adjacency graphs of matrices, and their compression to weighted vertices.
#pragma once

#include <span>
#include <vector>

#include "base/at.hpp"
#include "base/lazy_vector.hpp"
#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"
#include "matrix/row_index.hpp"

namespace espalier::analysis {

/// A symmetric pattern without its diagonal, both triangles, rows sorted within a column, no duplicates. 0-based.
struct Graph {
  Index n = 0;
  std::vector<Offset> ptr;      ///< n + 1
  base::LazyVector<Index> adj;  ///< ptr[n]

  [[nodiscard]] std::span<const Index> neighbours(Index v) const {
    const auto k = at(v);
    return {adj.data() + ptr[k], adj.data() + ptr[k + 1]};
  }
};

/// The graph of A + A^T (general storage), or of the symmetric matrix of which `a` stores a triangle or both.
/// @param row_of_col n entries or empty; with it (general storage only) the rows are permuted first, so that the entry
///        (row_of_col[j], j) comes to stand on the diagonal. Columns with -1 get the rows that are left, in rising
///        order.
/// @param rows the index of `a`, which saves a transpose; null or empty: made here where needed
/// @pre a is square and its row indices lie in [0, n)
Graph graph_of(const MatrixView& a, base::ThreadPool& pool, std::span<const Index> row_of_col = {},
               const matrix::RowIndex* rows = nullptr);

/// A graph whose vertices stand for one or several unknowns that are eliminated together.
struct CompressedGraph {
  Graph graph;
  std::vector<Index> weight;      ///< vertices; number of unknowns in each
  std::vector<Index> member_ptr;  ///< vertices + 1; into `members`
  std::vector<Index> members;     ///< the unknowns of each vertex; the two of a pair stand next to each other
};

/// Merges the pairs (see TreeOptions::pair; may be empty), then unknowns with identical closed neighbourhoods.
CompressedGraph compress(const Graph& graph, std::span<const Index> pair, base::ThreadPool& pool);

/// Merges the pairs only (one unknown per vertex where `pair` is empty).
CompressedGraph compress_pairs(const Graph& graph, std::span<const Index> pair, base::ThreadPool& pool);

}  // namespace espalier::analysis
