#include "c/matrix.hpp"

#include <fmt/format.h>

#include <complex>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <type_traits>

#include "c/handle.hpp"

namespace espalier::solver {

namespace {

[[noreturn]] void reject(const std::string& message, Index row = -1) {
  throw Error(StatusCode::invalid_input, message, row);
}

/// The storage of the arrays read as columns: the rows of a lower triangle are the columns of an upper one.
Storage storage_by_columns(int32_t storage, bool by_rows) {
  switch (storage) {
    case ESPALIER_GENERAL:
      return Storage::general;
    case ESPALIER_SYMMETRIC_LOWER:
      return by_rows ? Storage::symmetric_upper : Storage::symmetric_lower;
    case ESPALIER_SYMMETRIC_UPPER:
      return by_rows ? Storage::symmetric_lower : Storage::symmetric_upper;
    case ESPALIER_SYMMETRIC_BOTH:
      return Storage::symmetric_both;
    case ESPALIER_HERMITIAN_LOWER:
      return by_rows ? Storage::hermitian_upper : Storage::hermitian_lower;
    case ESPALIER_HERMITIAN_UPPER:
      return by_rows ? Storage::hermitian_lower : Storage::hermitian_upper;
    case ESPALIER_HERMITIAN_BOTH:
      return Storage::hermitian_both;
    default:
      throw std::invalid_argument("storage is none of espalier_storage");
  }
}

/// 0-based positions; checks that they begin at the base, never fall and end at `nonzeros`.
template <class Int>
std::vector<Offset> checked_pointers(const Int* pointers, int64_t count, int64_t base, int64_t nonzeros) {
  std::vector<Offset> result(static_cast<std::size_t>(count) + 1);
  if (pointers[0] != base) reject(fmt::format("pointers[0] is {}; it must be the index base {}", pointers[0], base));
  Offset before = 0;
  for (int64_t i = 0; i <= count; ++i) {
    const int64_t pointer = pointers[i];
    const Offset here = pointer < base ? -1 : pointer - base;  // a pointer may be any number
    if (here < before || here > nonzeros) {
      reject(fmt::format("pointers[{}] is {}; pointers must not fall and not pass nonzeros ({}) plus the index base", i,
                         pointers[i], nonzeros),
             i > 0 ? static_cast<Index>(i - 1) : -1);
    }
    result[static_cast<std::size_t>(i)] = before = here;
  }
  if (before != nonzeros) {
    reject(fmt::format("the last of pointers says {} entries, nonzeros says {}", before, nonzeros));
  }
  return result;
}

/// 0-based 32-bit indices; checks their range.
template <class Int>
std::vector<Index> checked_indices(const Int* indices, int64_t nonzeros, int64_t base, int64_t limit) {
  std::vector<Index> result(static_cast<std::size_t>(nonzeros));
  for (int64_t k = 0; k < nonzeros; ++k) {
    const int64_t index = indices[k];
    if (index < base || index - base >= limit) {
      reject(fmt::format("indices[{}] is {}; it must lie from {} to {}", k, index, base, limit - 1 + base));
    }
    result[static_cast<std::size_t>(k)] = static_cast<Index>(index - base);
  }
  return result;
}

}  // namespace

template <class Matrix>
CMatrix::CMatrix(const Matrix& a, bool values_needed) {
  constexpr int64_t most = std::numeric_limits<Index>::max();
  require(a.size >= offsetof(Matrix, numbers), "the matrix's field 'size' must be sizeof of its struct");
  const std::int64_t numbers = a.size >= sizeof(Matrix) ? a.numbers : std::int64_t{ESPALIER_REAL};
  require(numbers == ESPALIER_REAL || numbers == ESPALIER_COMPLEX, "numbers is none of espalier_numbers");
  complex_ = numbers == ESPALIER_COMPLEX;
  require(complex_ || a.storage < ESPALIER_HERMITIAN_LOWER, "only a complex matrix is Hermitian");
  require(a.layout == ESPALIER_CSC || a.layout == ESPALIER_CSR, "layout is none of espalier_layout");
  require(a.index_base == 0 || a.index_base == 1, "index_base must be 0 or 1");
  const bool by_rows = a.layout == ESPALIER_CSR;
  const Storage storage = storage_by_columns(a.storage, by_rows);
  if (a.rows < 0 || a.cols < 0 || a.rows > most || a.cols > most || a.nonzeros < 0) {
    reject(fmt::format("a matrix of {} x {} with {} entries cannot be", a.rows, a.cols, a.nonzeros));
  }
  require(a.pointers != nullptr, "the matrix's pointers are null");
  require(a.nonzeros == 0 || a.indices != nullptr, "the matrix's indices are null");
  require(!values_needed || a.nonzeros == 0 || a.values != nullptr, "the matrix's values are null");

  const int64_t outer = by_rows ? a.rows : a.cols;
  const int64_t inner = by_rows ? a.cols : a.rows;
  pointers_ = checked_pointers(a.pointers, outer, a.index_base, a.nonzeros);
  const auto count = static_cast<std::size_t>(a.nonzeros);
  view_.rows = static_cast<Index>(inner);
  view_.cols = static_cast<Index>(outer);
  view_.storage = storage;
  view_.col_ptr = pointers_;
  if constexpr (std::is_same_v<decltype(a.indices), const Index*>) {
    if (a.index_base == 0) view_.row_ind = {a.indices, count};  // the solver checks their range
  }
  if (view_.row_ind.empty()) {
    indices_ = checked_indices(a.indices, a.nonzeros, a.index_base, inner);
    view_.row_ind = indices_;
  }
  transposed_ = by_rows && storage == Storage::general;
  if (!complex_) {
    if (a.values != nullptr) view_.values = {a.values, count};
  } else {
    complex_view_ = {view_.rows, view_.cols, view_.col_ptr, view_.row_ind, {}, storage};
    if (a.values != nullptr) complex_view_.values = {reinterpret_cast<const std::complex<double>*>(a.values), count};
    view_.storage = Storage::general;  // a pattern alone
  }
  by_rows_ = by_rows;
}

template CMatrix::CMatrix(const espalier_matrix_i32&, bool);
template CMatrix::CMatrix(const espalier_matrix_i64&, bool);

}  // namespace espalier::solver
