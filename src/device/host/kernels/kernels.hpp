/// \file
/// Dense kernels of the host backend: packed SIMD code with run-time dispatch (AVX-512, AVX2, NEON, scalar), one
/// thread each, the same bits in every call.
///
/// Two layouts are in use:
///  - *column-major scratch*: element (i, j) at c[j * ld + i]; ld and the number of allocated columns are multiples of
///    kPanel, so that whole vectors may be stored past the last row or column (what lies there is undefined). From
///    about 100 rows on, an odd multiple of kPanel is the better ld: columns at a power of two apart share few cache
///    sets (ldlt of 128 rows with 2x2 pivots takes 54 us with ld = 128, 28 us with ld = 136).
///  - *panels*, the layout of finished tiles: rows in groups of kPanel<T> (one cache line); element (i, k) of a tile
///    with `depth` columns at p[(i / P) * P * depth + k * P + i % P]. Rows that pad the last panel are zero. A panel
///    tile serves as either operand of a product without packing.
#pragma once

#include <complex>
#include <cstdint>
#include <vector>

#include "base/scalar.hpp"

namespace espalier::device::host {

/// Rows in a panel: one cache line. Pointers to panels and to scratch should be 64-byte aligned (for speed only).
template <class T>
inline constexpr int kPanel = static_cast<int>(64 / sizeof(T));

/// n rounded up to whole panels.
template <class T>
constexpr std::int64_t padded(std::int64_t n) {
  return (n + kPanel<T> - 1) / kPanel<T> * kPanel<T>;
}

/// A pivot smaller than `below` in magnitude is replaced by one of the magnitude `instead`, of its sign.
template <class Real>
struct ZeroPivot {
  Real below;
  Real instead;
};

/// Outcome of a factorization with pivoting inside a tile.
struct PivotCounts {
  int two_by_two = 0;  ///< 2x2 pivots
  int perturbed = 0;   ///< pivots that were replaced
  int negative = 0;    ///< negative eigenvalues of D (ldlt)
};

/// The table of kernels for one instruction set. All sizes may be zero.
///
/// T is real or complex. Of complex numbers there are two tables. In the one for symmetric (and general) matrices a
/// transpose is a transpose; in the one for Hermitian matrices it is the conjugate transpose, A^H, wherever A^T, B^T,
/// L^T or W^T stands below, and D is Hermitian. potrf is that of Hermitian matrices in both. Magnitudes are |re| +
/// |im|.
template <class T>
struct Kernels {
  using Real = typename base::ScalarTraits<T>::Real;

  const char* target;  ///< "AVX3_SPR", "AVX2", "NEON", ...

  // ---- products -------------------------------------------------------------------------------------------------
  /// C (m x n, column-major, ld) -= A B^T; A: m x k panels, B: n x k panels.
  void (*gemm_nt)(std::int64_t m, std::int64_t n, std::int64_t k, const T* a, const T* b, T* c, std::int64_t ld);
  /// Like gemm_nt with m >= n, where only the lower trapezoid (i >= j) of C is wanted; what is above is undefined.
  void (*syrk_nt)(std::int64_t m, std::int64_t n, std::int64_t k, const T* a, const T* b, T* c, std::int64_t ld);
  /// X (m x n panels) = B W^T with B: m x n panels and W: n x n lower triangular panels (zeros above the diagonal);
  /// X must not overlap B. With W = inverse of L this is the triangular solve B L^-T.
  void (*trmm_nt)(std::int64_t m, std::int64_t n, const T* b, const T* w, T* x);

  // ---- layout ---------------------------------------------------------------------------------------------------
  void (*pack)(std::int64_t m, std::int64_t n, const T* c, std::int64_t ld, T* panels);
  void (*unpack)(std::int64_t m, std::int64_t n, const T* panels, T* c, std::int64_t ld);
  /// Panels of C^T: (n x m) panels with element (j, i) = C(i, j).
  void (*pack_transposed)(std::int64_t m, std::int64_t n, const T* c, std::int64_t ld, T* panels);
  /// x(:, j) = b(:, j) * scale: multiplies the columns of an m x n panel tile by D^-1: for the column at k with a 1x1
  /// pivot x_k = d1[k] * b_k; for a 2x2 pivot at (k, k+1), marked by e[k] != 0,
  /// x_k = d1[k] b_k + e[k] b_(k+1), x_(k+1) = e[k] b_k + d1[k+1] b_(k+1) (Hermitian: the conjugate of e[k] there).
  /// d1, e hold the inverse of D. x may equal b.
  void (*scale_columns)(std::int64_t m, std::int64_t n, const T* b, const T* d1, const T* e, T* x);
  /// Largest |x| of each of the n columns of a panel tile: out[j] = max(out[j], max_i |x(i, j)|). NaN counts as
  /// infinity.
  void (*column_max)(std::int64_t m, std::int64_t n, const T* x, Real* out);

  // ---- factorizations of a diagonal tile (column-major scratch, lower triangle given for the symmetric kinds) ------
  /// C = L L^T in place (lower; what stands above is undefined on return). @returns n when positive definite, else the
  /// first column whose pivot is not positive (is NaN, or below the smallest normal number).
  std::int64_t (*potrf)(std::int64_t n, T* c, std::int64_t ld);
  /// P^T C P = L D L^T with Bunch-Kaufman pivoting (rook search) inside the tile. On return the strict lower triangle
  /// of C holds unit L, perm[k] the row of the given C that stands at k, d and e the diagonal and subdiagonal of D
  /// (e[k] != 0 marks a 2x2 pivot at k, k+1). replaced[k] = 1 where a pivot was replaced (else 0; array of n).
  PivotCounts (*ldlt)(std::int64_t n, T* c, std::int64_t ld, ZeroPivot<Real> zero, std::int32_t* perm, T* d, T* e,
                      char* replaced);
  /// P C = L U with row pivoting; unit L strictly below, U on and above the diagonal; perm[k] the row of the given C
  /// that stands at k. Replacement as in ldlt.
  PivotCounts (*getrf)(std::int64_t n, T* c, std::int64_t ld, ZeroPivot<Real> zero, std::int32_t* perm, char* replaced);
  /// W (n x n panels) = inverse of the lower triangle of C (unit diagonal when `unit`), zeros above the diagonal.
  void (*invert_lower)(std::int64_t n, const T* c, std::int64_t ld, bool unit, T* w);
  /// W (n x n panels) = transpose of the inverse of the upper triangle U of C (lower triangular panels).
  void (*invert_upper_transposed)(std::int64_t n, const T* c, std::int64_t ld, T* w);

  // Small fronts: a whole front in column-major scratch, m x m with m <= 512, and 0 <= k <= m pivot columns.
  // The first k columns are eliminated from all m rows; rows and columns from k on are updated but never are
  // pivots. The n-by-n factorizations above are the case k = m. For the symmetric kinds the part above the
  // diagonal is undefined on return.
  /// Columns 0..k-1 become those of L (all m rows), the trailing lower triangle is reduced by L21 L21^T.
  /// @returns k, or the first column whose pivot is not positive (or is NaN); the front is then undefined
  std::int64_t (*partial_potrf)(std::int64_t m, std::int64_t k, T* c, std::int64_t ld);
  /// Like ldlt with pivots chosen among the first k rows: columns 0..k-1 become unit L (strictly below the diagonal,
  /// all m rows; what stands on the diagonal is undefined), the trailing lower triangle is reduced by L21 D L21^T.
  /// perm, d, e, replaced: k entries each. Only |L| inside the pivot block is bounded.
  PivotCounts (*partial_ldlt)(std::int64_t m, std::int64_t k, T* c, std::int64_t ld, ZeroPivot<Real> zero,
                              std::int32_t* perm, T* d, T* e, char* replaced);
  /// Like getrf with row pivots chosen among the first k rows: L in columns 0..k-1 (all m rows), U in rows 0..k-1 (all
  /// m columns), the trailing square is reduced by L21 U12. perm, replaced: k entries each.
  PivotCounts (*partial_getrf)(std::int64_t m, std::int64_t k, T* c, std::int64_t ld, ZeroPivot<Real> zero,
                               std::int32_t* perm, char* replaced);

  // ---- substitution: right-hand sides in row-major groups of `nr` columns (nr == 1, or a multiple of kPanel, ld ==
  // nr) ----
  /// Y (m x nr) -= A X; A: m x n panels, X: n x nr. Y has room for padded(m) rows, the padding is undefined.
  void (*apply)(std::int64_t m, std::int64_t n, std::int64_t nr, const T* a, const T* x, T* y);
  /// Y (n x nr) -= A^T X; A: m x n panels, X: m x nr with padded(m) rows, whose padding must be finite.
  void (*apply_transposed)(std::int64_t m, std::int64_t n, std::int64_t nr, const T* a, const T* x, T* y);
  /// Y (n x nr) = W X for lower triangular panels W (n x n); Y must not overlap X; Y has room for padded(n) rows.
  void (*apply_lower)(std::int64_t n, std::int64_t nr, const T* w, const T* x, T* y);
  /// Y (n x nr) = W^T X likewise; X has padded(n) rows with finite padding.
  void (*apply_lower_transposed)(std::int64_t n, std::int64_t nr, const T* w, const T* x, T* y);
};

/// The kernels for this processor, chosen once. T: see ESPALIER_FOR_SCALARS.
/// @param hermitian  the table for Hermitian matrices; of real numbers there is one
template <class T>
const Kernels<T>& kernels(bool hermitian = false);

/// One table per instruction set that was compiled in and that this processor runs, the best first. For tests and
/// measurements only: it changes the dispatch of the process while it runs, so no other thread may use Highway then.
template <class T>
std::vector<Kernels<T>> all_kernels(bool hermitian = false);

/// Best rate in flop/s of gemm_nt<double> on operands that stay in cache, on one thread, seen in about `seconds`.
double measure_gemm_rate(double seconds);

}  // namespace espalier::device::host
