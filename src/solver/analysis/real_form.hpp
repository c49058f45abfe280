/// \file
/// Complex systems as real ones of twice the size, for devices whose backend has no complex numbers.
///
/// Unknown k becomes the unknowns 2k (its real part) and 2k + 1 (its imaginary part), an entry a + bi the block
///   [[a, -b], [ b,  a]]  of a Hermitian matrix: symmetric, and positive definite where the complex one is,
///   [[a, -b], [-b, -a]]  of any other one: symmetric where the complex one is.
/// The second is the first with the rows of imaginary parts negated: the complex system is multiplied out, then
/// conjugated, and so are right-hand sides. Its block has determinant -(a^2 + b^2): what is a pivot of the complex
/// matrix is a pivot of 2 x 2 here, unless it is zero. The transposed block matrix is that of the transposed complex
/// one. Singular values of the complex matrix, and eigenvalues of a Hermitian one, stand here twice.
#pragma once

#include <complex>
#include <memory>
#include <span>
#include <vector>

#include "analysis/assembly_tree.hpp"
#include "matrix/row_index.hpp"
#include "solver/analysis/prepared_matrix.hpp"

namespace espalier::solver {

/// What plans and factors of such a system are made for, beside the complex system itself.
struct RealForm {
  StoredMatrix a;                 ///< 2n x 2n, a pattern, in the storage of the complex matrix
  std::vector<Index> row_of_col;  ///< 2n; empty: identity
  matrix::RowIndex rows;          ///< of a; as solve::ResidualOperator::rows_of() has it
  analysis::AssemblyTree tree;    ///< of the complex matrix, as it was ordered
  bool hermitian = false;         ///< the first block above

  [[nodiscard]] Offset bytes() const;
};

/// @param tree  of the complex matrix
/// @throws Error(invalid_input) where twice the size is no Index
std::shared_ptr<const RealForm> make_real_form(const PreparedMatrix& p, analysis::AssemblyTree tree,
                                               base::ThreadPool& pool);

/// The tree in which 2k and 2k + 1 stand in the place of each unknown k, next to each other.
analysis::AssemblyTree doubled(const analysis::AssemblyTree& tree);

/// Values of f.a from those of the complex matrix `a`. T: float or double.
template <class T>
void real_values(const RealForm& f, const MatrixView& a, const std::complex<T>* from, T* to, base::ThreadPool& pool);
/// The same of some entries of f.a, ascending.
template <class T>
void real_values(const RealForm& f, const MatrixView& a, const std::complex<T>* from, std::span<const Offset> entries,
                 T* to, base::ThreadPool& pool);

}  // namespace espalier::solver
