#include "matrix/validate.hpp"

#include <fmt/format.h>

#include <cmath>
#include <mutex>
#include <optional>

#include "base/at.hpp"
#include "base/parallel.hpp"

namespace espalier::matrix {

namespace {

constexpr Index kValidatedColumns = 4096;

void check_shape(const MatrixView& a) {
  const auto refuse = [](const std::string& message) { throw Error(StatusCode::invalid_input, message); };
  if (a.rows < 0 || a.cols < 0) refuse(fmt::format("a matrix of {} x {}: sizes must not be negative", a.rows, a.cols));
  if (static_cast<unsigned>(a.storage) > static_cast<unsigned>(Storage::symmetric_both))
    refuse(fmt::format("storage {} is none of espalier::Storage", static_cast<int>(a.storage)));
  if (a.symmetric() && a.rows != a.cols) refuse(fmt::format("a matrix of {} x {} cannot be symmetric", a.rows, a.cols));
  if (a.col_ptr.size() != at(a.cols) + 1)
    refuse(fmt::format("{} columns need {} column pointers, {} were given", a.cols, a.cols + 1, a.col_ptr.size()));
  if (a.col_ptr.front() != 0) refuse(fmt::format("the first column pointer is {}; it must be 0", a.col_ptr.front()));
  for (std::size_t j = 0; j + 1 < a.col_ptr.size(); ++j)
    if (a.col_ptr[j + 1] < a.col_ptr[j])
      refuse(fmt::format("the column pointers fall from {} to {} at column {}", a.col_ptr[j], a.col_ptr[j + 1], j));
  const auto nonzeros = at(a.col_ptr.back());
  if (a.row_ind.size() != nonzeros)
    refuse(fmt::format("the column pointers end at {}, but {} row indices were given", nonzeros, a.row_ind.size()));
  if (!a.values.empty() && a.values.size() != nonzeros)
    refuse(fmt::format("the column pointers end at {}, but {} values were given", nonzeros, a.values.size()));
}

// The first entry of column j that is wrong.
std::optional<Error> check_column(const MatrixView& a, Index j) {
  const Index top = a.storage == Storage::symmetric_lower ? j : 0;
  const Index bottom = a.storage == Storage::symmetric_upper ? j + 1 : a.rows;
  for (Offset p = a.col_ptr[at(j)]; p < a.col_ptr[at(j) + 1]; ++p) {
    const Index i = a.row_ind[at(p)];
    if (i < 0 || i >= a.rows)
      return Error(StatusCode::invalid_input,
                   fmt::format("column {} holds row index {}; rows run from 0 to {}", j, i, a.rows - 1));
    if (i < top || i >= bottom)
      return Error(StatusCode::invalid_input,
                   fmt::format("entry ({}, {}) stands outside the {} triangle that the storage declares", i, j,
                               a.storage == Storage::symmetric_lower ? "lower" : "upper"),
                   i);
    if (!a.values.empty() && !std::isfinite(a.values[at(p)]))
      return Error(StatusCode::invalid_input, fmt::format("entry ({}, {}) is {}", i, j, a.values[at(p)]), i);
  }
  return std::nullopt;
}

}  // namespace

namespace {

// Throws the error of the lowest wrong column, so that the message does not depend on the threads.
template <class Check>
void check_columns(Index cols, base::ThreadPool* pool, const Check& check) {
  std::mutex mutex;
  std::int64_t first_wrong = cols;
  std::optional<Error> error;
  base::for_each_range(pool, cols, kValidatedColumns, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t j = begin; j < end; ++j) {
      auto wrong = check(static_cast<Index>(j));
      if (!wrong) continue;
      const std::lock_guard lock(mutex);
      if (j < first_wrong) {
        first_wrong = j;
        error = std::move(wrong);
      }
      return;
    }
  });
  if (error) throw Error(*error);
}

std::optional<Error> check_complex_column(const ComplexMatrixView& a, Index j) {
  for (Offset p = a.col_ptr[at(j)]; p < a.col_ptr[at(j) + 1]; ++p) {
    const Index i = a.row_ind[at(p)];
    const std::complex<double> v = a.values[at(p)];
    if (!std::isfinite(v.real()) || !std::isfinite(v.imag()))
      return Error(StatusCode::invalid_input, fmt::format("entry ({}, {}) is {} + {}i", i, j, v.real(), v.imag()), i);
    if (a.hermitian() && i == j && v.imag() != 0)
      return Error(StatusCode::invalid_input,
                   fmt::format("entry ({}, {}) is {} + {}i, but the diagonal of a Hermitian matrix is real", i, j,
                               v.real(), v.imag()),
                   i);
  }
  return std::nullopt;
}

}  // namespace

void validate(const MatrixView& a, base::ThreadPool* pool) {
  check_shape(a);
  check_columns(a.cols, pool, [&](Index j) { return check_column(a, j); });
}

MatrixView pattern_of(const ComplexMatrixView& a) {
  Storage storage = a.storage;
  if (a.storage == Storage::hermitian_lower) storage = Storage::symmetric_lower;
  if (a.storage == Storage::hermitian_upper) storage = Storage::symmetric_upper;
  if (a.storage == Storage::hermitian_both) storage = Storage::symmetric_both;
  return {a.rows, a.cols, a.col_ptr, a.row_ind, {}, storage};
}

void validate(const ComplexMatrixView& a, base::ThreadPool* pool) {
  validate(pattern_of(a), pool);
  if (a.values.empty()) return;
  if (a.values.size() != a.row_ind.size())
    throw Error(StatusCode::invalid_input, fmt::format("the column pointers end at {}, but {} values were given",
                                                       a.row_ind.size(), a.values.size()));
  check_columns(a.cols, pool, [&](Index j) { return check_complex_column(a, j); });
}

}  // namespace espalier::matrix
