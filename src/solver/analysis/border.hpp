/// \file
/// Rows and columns beside the matrix of a system, whose Schur complement a factorization leaves:
///
///     A = [ A_rr A_rs ]    A_rr is the system's matrix, r the rest, s the border;
///         [ A_sr A_ss ]    S = A_ss - A_sr A_rr^-1 A_rs
#pragma once

#include <span>
#include <vector>

#include "analysis/assembly_tree.hpp"
#include "solver/analysis/prepared_matrix.hpp"

namespace espalier::solver {

/// The pattern of A_sr and A_rs, in the order of their values. Entries may stand there twice: they are added.
struct Border {
  struct Entry {
    Index inner;         ///< row or column of A_rr
    Index border;        ///< 0 .. size - 1
    bool upper = false;  ///< of A_rs; else of A_sr, which of a symmetric matrix stands for both
  };
  Index size = 0;
  std::vector<Entry> entries;
};

/// See analysis::add_border().
void add_border(analysis::AssemblyTree& tree, const Border& border, const PreparedMatrix& p);

/// The matrix with its border around it, A_ss left out: what a plan places the entries of.
struct BorderedPattern {
  StoredMatrix a;              ///< without values
  std::vector<Offset> source;  ///< of each entry: among the values of p.a, behind them those of the border
};
BorderedPattern with_border(const PreparedMatrix& p, const Border& border);

/// Powers of two that bring the entries of each row and column of the border to about 1.
struct BorderScales {
  std::vector<double> row, col;  ///< border.size each
};
/// scaled[q]: the border's values in the scaling of the matrix and in one of their own.
/// @throws Error(invalid_input) where one leaves the range of numbers
template <class T>
BorderScales scale_border(const Border& border, const Scales& of_matrix, std::span<const double> values, T* scaled);

}  // namespace espalier::solver
