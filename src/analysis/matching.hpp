/// \file
/// Maximum product matching and scaling (Duff and Koster 2001), and its symmetric form (Duff and Pralet 2005).
#pragma once

#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::analysis {

/// Whether an entry lies outside 2^-400 .. 2^400: products of such entries overflow or vanish before they are scaled.
bool is_wide(std::span<const double> values, base::ThreadPool& pool);

/// Row and column scaling r, c such that |r_i a_ij c_j| <= 1 with equality on the matching, and the matching.
struct Matching {
  std::vector<double> row_scale;  ///< n, positive
  std::vector<double> col_scale;  ///< n, positive; equal to row_scale for a symmetric matrix
  std::vector<Index> row_of_col;  ///< n; the row matched to each column, -1 when unmatched
  Index structural_rank = 0;      ///< number of matched columns
};

/// Matching of a square general matrix (storage general; duplicates must have been summed). Rows and columns that
/// cannot be matched get the scaling that bounds their entries by 1. Factors stay within 2^-1000 .. 2^1000; only where
/// a matrix needs more, entries are left below 1.
Matching maximum_product_matching(const MatrixView& a, base::ThreadPool& pool);
Matching maximum_product_matching(const MatrixView& a);  ///< on the calling thread alone

/// For a symmetric matrix (any symmetric storage): symmetric scaling s = sqrt(r c) of the unsymmetric matching, and the
/// pairs of Duff and Pralet: pair[v] == w means that v and w are a 2x2 pivot candidate, pair[v] == v a 1x1.
struct SymmetricMatching {
  std::vector<double> scale;  ///< n, positive
  std::vector<Index> pair;    ///< n
  Index structural_rank = 0;
};
SymmetricMatching symmetric_matching(const MatrixView& a, base::ThreadPool& pool);

/// The same pairs for L U of a matrix (storage general) whose pattern is symmetric or nearly so, as in incompressible
/// flow: rows stay with their columns, and the two unknowns of a matched entry off the diagonal are eliminated next to
/// each other, where row pivoting finds the entry. Rows that follow the matching instead make the pattern unsymmetric,
/// and the fill and the pivots that fail many times more (docs/design/analysis.md).
/// @param m  of full structural rank
/// @returns n entries as above; empty where the rows had better follow the matching: it lies on the diagonal, or less
///          than 0.9 of the entries off the diagonal have a counterpart, or more than a hundredth of the pairs and
///          single unknowns hold no pivot of 0.01 of the largest scaled entries
std::vector<Index> pairs_for_lu(const MatrixView& a, const Matching& m, base::ThreadPool& pool);

/// Symmetric or two-sided equilibration in the infinity norm (Ruiz 2001), powers of two: for llt and wherever matching
/// is switched off. row_scale == col_scale for symmetric storage.
struct Scaling {
  std::vector<double> row, col;
};
Scaling equilibrate(const MatrixView& a, base::ThreadPool& pool);

}  // namespace espalier::analysis
