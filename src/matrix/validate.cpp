#include "matrix/validate.hpp"

#include <fmt/format.h>

#include <cmath>
#include <mutex>
#include <optional>

#include "base/parallel.hpp"

namespace espalier::matrix {

namespace {

constexpr Index kColumnsPerTask = 4096;

void check_shape(const MatrixView& a) {
  const auto refuse = [](const std::string& message) { throw Error(StatusCode::invalid_input, message); };
  if (a.rows < 0 || a.cols < 0) refuse(fmt::format("a matrix of {} x {}: sizes must not be negative", a.rows, a.cols));
  if (static_cast<unsigned>(a.storage) > static_cast<unsigned>(Storage::symmetric_both))
    refuse(fmt::format("storage {} is none of espalier::Storage", static_cast<int>(a.storage)));
  if (a.symmetric() && a.rows != a.cols) refuse(fmt::format("a matrix of {} x {} cannot be symmetric", a.rows, a.cols));
  if (a.col_ptr.size() != static_cast<std::size_t>(a.cols) + 1)
    refuse(fmt::format("{} columns need {} column pointers, {} were given", a.cols, a.cols + 1, a.col_ptr.size()));
  if (a.col_ptr.front() != 0) refuse(fmt::format("the first column pointer is {}; it must be 0", a.col_ptr.front()));
  for (std::size_t j = 0; j + 1 < a.col_ptr.size(); ++j)
    if (a.col_ptr[j + 1] < a.col_ptr[j])
      refuse(fmt::format("the column pointers fall from {} to {} at column {}", a.col_ptr[j], a.col_ptr[j + 1], j));
  const auto nonzeros = static_cast<std::size_t>(a.col_ptr.back());
  if (a.row_ind.size() != nonzeros)
    refuse(fmt::format("the column pointers end at {}, but {} row indices were given", nonzeros, a.row_ind.size()));
  if (!a.values.empty() && a.values.size() != nonzeros)
    refuse(fmt::format("the column pointers end at {}, but {} values were given", nonzeros, a.values.size()));
}

// The first entry of column j that is wrong.
std::optional<Error> check_column(const MatrixView& a, Index j) {
  const Index top = a.storage == Storage::symmetric_lower ? j : 0;
  const Index bottom = a.storage == Storage::symmetric_upper ? j + 1 : a.rows;
  for (Offset p = a.col_ptr[static_cast<std::size_t>(j)]; p < a.col_ptr[static_cast<std::size_t>(j) + 1]; ++p) {
    const Index i = a.row_ind[static_cast<std::size_t>(p)];
    if (i < 0 || i >= a.rows)
      return Error(StatusCode::invalid_input,
                   fmt::format("column {} holds row index {}; rows run from 0 to {}", j, i, a.rows - 1));
    if (i < top || i >= bottom)
      return Error(StatusCode::invalid_input,
                   fmt::format("entry ({}, {}) stands outside the {} triangle that the storage declares", i, j,
                               a.storage == Storage::symmetric_lower ? "lower" : "upper"),
                   i);
    if (!a.values.empty() && !std::isfinite(a.values[static_cast<std::size_t>(p)]))
      return Error(StatusCode::invalid_input,
                   fmt::format("entry ({}, {}) is {}", i, j, a.values[static_cast<std::size_t>(p)]), i);
  }
  return std::nullopt;
}

}  // namespace

void validate(const MatrixView& a, base::ThreadPool* pool) {
  check_shape(a);
  std::mutex mutex;
  std::int64_t first_wrong = a.cols;  // the lowest wrong column, so that the message does not depend on the threads
  std::optional<Error> error;
  base::for_each_range(pool, a.cols, kColumnsPerTask, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t j = begin; j < end; ++j) {
      auto wrong = check_column(a, static_cast<Index>(j));
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

}  // namespace espalier::matrix
