/// \file
/// The linear system as the solver keeps it: a copy of the matrix, its scaling and matching.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "analysis/assembly_tree.hpp"
#include "base/at.hpp"
#include "base/lazy_vector.hpp"
#include "base/scalar.hpp"
#include "base/thread_pool.hpp"
#include "espalier/solver.hpp"

namespace espalier::solver {

/// What row or column i is multiplied by; 1 where nothing is scaled.
[[nodiscard]] inline double factor_of(const std::vector<double>& scale, Index i) {
  return scale.empty() ? 1.0 : scale[at(i)];
}

/// A sparse matrix of the conventions of MatrixView whose large arrays are left uninitialised, so that all threads can
/// fill them for the first time.
struct StoredMatrix {
  Index rows = 0;
  Index cols = 0;
  base::LazyVector<Offset> col_ptr;
  base::LazyVector<Index> row_ind;
  base::LazyVector<double> values;  ///< or parts of values: see base::Numbers
  Storage storage = Storage::general;

  [[nodiscard]] Offset nonzeros() const { return col_ptr.empty() ? 0 : col_ptr.back(); }
  operator MatrixView() const {  // NOLINT(google-explicit-constructor): an owner is a view
    return {rows, cols, col_ptr, row_ind, values, storage};
  }
};

/// Values of the entries of PreparedMatrix::a, in their order; of complex ones the parts (base::Numbers).
using Values = base::LazyVector<double>;

/// A caller's matrix. Of complex values the view holds the parts, twice as many as its pattern asks for, and Hermitian
/// storage is called symmetric; whether the values are Hermitian is known where the storage says so.
struct GivenMatrix {
  GivenMatrix(const MatrixView& the_a,  // NOLINT(google-explicit-constructor): most are real
              base::Numbers the_numbers = base::Numbers::real)
      : a(the_a), numbers(the_numbers) {}
  MatrixView a;
  base::Numbers numbers;
};
GivenMatrix given(const ComplexMatrixView& a);
/// The way back. @pre a.numbers is not real
ComplexMatrixView complex_view(const GivenMatrix& a);

/// A copy of the caller's matrix in the form that the factorization kind needs, and the transformation to the scaled,
/// row-permuted matrix B = R P A C that is factored: B(c', c) = r_i a_ic c_c with i = row_of_col[c'].
struct PreparedMatrix {
  /// General storage for lu, a symmetric one otherwise. An analysis has given the values away: each of its factors has
  /// its own.
  StoredMatrix a;
  std::vector<Offset> target;  ///< entry to which each of the caller's values is added; empty: they are those of `a`
  std::vector<Offset> source;  ///< lu of symmetric storage: entry before expansion of each entry of `a`; else empty
  std::vector<char> turned;    ///< lu of Hermitian storage: entries of `a` that are conjugates of their source
  base::Numbers numbers = base::Numbers::real;  ///< never hermitian for lu
  bool symmetric_values = false;     ///< stored in general, taken as symmetric: new values must be symmetric as well
  Offset caller_nonzeros = 0;        ///< length of the caller's value array
  std::uint64_t caller_pattern = 0;  ///< pattern_hash() of the caller's matrix, where `a` does not tell: caller_hash()
  std::vector<double> row_scale;     ///< n; empty: 1
  std::vector<double> col_scale;     ///< n; empty: 1
  std::vector<Index> row_of_col;     ///< n; empty: identity
  std::vector<Index> pair;           ///< n; 2x2 pivot candidates; empty: none. lu: then row_of_col is empty
  std::vector<char> zero_diagonal;   ///< n; empty: none
  /// det A = det B * transform_sign * exp(-transform_log): sign of P, logarithm of det(R C). See note_determinant().
  double transform_sign = 1, transform_log = 0;
  bool unmatched = false;  ///< entries leave rows without partner: singular whatever the values
  bool wide = false;  ///< a scaling factor lies outside 2^-300 .. 2^300: products with two of them overflow on the way

  [[nodiscard]] Index n() const { return a.cols; }
  /// Whether the caller's values are those of `a`, one by one and unchecked.
  [[nodiscard]] bool keeps_order() const { return target.empty() && source.empty() && !symmetric_values; }
  [[nodiscard]] Index row_of(Index col) const { return row_of_col.empty() ? col : row_of_col[at(col)]; }
  /// Bytes of all arrays.
  [[nodiscard]] Offset bytes() const;
};

/// The kind for `a`: the wish, or by symmetry and diagonal when automatic. Says in `a` where general storage turns out
/// to hold Hermitian values.
/// @throws Error(invalid_input) when the wish contradicts the matrix (llt or ldlt of an unsymmetric one)
Kind choose_kind(GivenMatrix& a, Kind wish, base::ThreadPool& pool);
/// The kind of a real matrix.
Kind choose_kind(const MatrixView& a, Kind wish, base::ThreadPool& pool);

/// Copies the matrix for `kind`. A general matrix with symmetric values becomes symmetric_both for llt and ldlt; a
/// symmetric one is expanded for lu. Duplicates are summed, so that errors are measured against the entries themselves.
PreparedMatrix prepare_matrix(const GivenMatrix& a, Kind kind, base::ThreadPool& pool);

/// Takes new values from the caller's array to those of p.a. @pre from holds p.caller_nonzeros numbers
/// @throws Error(invalid_input) when a matrix in general storage was analyzed as symmetric and its new values are not
void copy_values(const PreparedMatrix& p, std::span<const double> from, Values& to, base::ThreadPool& pool);

/// The way back: values in the caller's order that make `values` of p.a. Of duplicates the first takes all.
std::vector<double> values_by_caller(const PreparedMatrix& p, std::span<const double> values);

/// pattern_hash() of the caller's matrix.
std::uint64_t caller_hash(const PreparedMatrix& p, base::ThreadPool& pool);

/// Whether `a` has the pattern from which `p` was copied.
bool same_pattern(const PreparedMatrix& p, const MatrixView& a, base::ThreadPool& pool);

/// Scaling and, with options.matching, the maximum product matching (ldlt, lu). llt is scaled only for factors of low
/// precision (in FP64 Cholesky's error does not depend on scaling: van der Sluis 1969) and where products of its
/// entries would overflow.
/// Stored zeros take part in the matching where the other entries do not suffice: optimisers fill them in later.
/// @throws Error(singular) for a structurally singular matrix, unless a report is asked for: then rows without partner
///         are matched to the columns that are left, where nothing stands
void scale_and_match(PreparedMatrix& p, Kind kind, const Options& options, base::ThreadPool& pool);

/// @throws Error(singular) when a row of a symmetric matrix holds zeros alone
void refuse_zero_rows(const PreparedMatrix& p);

/// Sets p.transform_sign, p.transform_log and p.wide for its scaling and matching. Once an analysis: n logarithms after
/// every factorization cost a small system more than its arithmetic.
void note_determinant(PreparedMatrix& p);

/// A check of a Hermitian matrix; others have nothing to fulfil.
bool has_real_diagonal(const PreparedMatrix& p, std::span<const double> values);

/// Throws Error(invalid_input) naming an entry that is not finite, or saying that scaling made one so.
[[noreturn]] void refuse_entry(const PreparedMatrix& p, std::span<const double> values);

/// The scaling of a factorization: that of the prepared matrix, or its own.
struct Scales {
  std::vector<double> row, col;  ///< n each; empty: 1
  double log = 0;                ///< PreparedMatrix::transform_log
  bool wide = false;             ///< PreparedMatrix::wide
};
/// What `values` of p.a need (Options::rescale): the scaling of a maximum product matching, or equilibration.
Scales scales_for(const PreparedMatrix& p, std::span<const double> values, bool matching, base::ThreadPool& pool);

/// scaled[q] = r_i a_ij c_j for the entries of p.a in their order; `values` are the a_ij. @returns the largest
/// magnitude
/// @throws Error(invalid_input) naming an entry that is not finite, or saying that the values have gone too far from
///         the analyzed ones for their scaling
/// Of a Hermitian matrix they are those of the lower triangle in the order of elimination (device::Executor).
/// @param position  n, by column: its place in the order; read of Hermitian matrices alone. Empty: entries stay as
///                  they are stored
template <class T>
double scale_values(const PreparedMatrix& p, const Scales& scales, std::span<const double> values, T* scaled,
                    base::ThreadPool& pool, std::span<const Index> position = {});
/// @throws Error(invalid_input) where factors of T have no room for scaled values of this largest magnitude
template <class T>
void expect_in_range(const PreparedMatrix& p, std::span<const double> values, double largest);
/// scale_values() of some of the entries, ascending. @returns the largest magnitude of these, which expect_in_range()
/// has not seen; infinite where one is not finite
template <class T>
double scale_values(const PreparedMatrix& p, const Scales& scales, std::span<const double> values,
                    std::span<const Offset> entries, T* scaled, base::ThreadPool& pool,
                    std::span<const Index> position);
/// Place of each column in the order of elimination; empty unless the matrix is Hermitian.
std::vector<Index> positions_for(const PreparedMatrix& p, std::span<const Index> order);

/// Sums of the diagonal entries of each column.
[[nodiscard]] std::vector<double> diagonal(const MatrixView& a, base::ThreadPool& pool);
/// |a_ij|, or of real matrices the values themselves.
std::vector<double> magnitudes(base::Numbers numbers, std::span<const double> values);

/// By position of the elimination: where the diagonal entry stands among the values of `a`. Empty when one is missing.
std::vector<Offset> diagonal_places(const MatrixView& a, std::span<const Index> order, base::ThreadPool& pool);

/// "row 17 (counted from 0)", "rows 3, 8, 9 and 14 more (counted from 0)": rows of the caller's matrix, ascending.
std::string name_rows(std::vector<Index> rows);

}  // namespace espalier::solver
