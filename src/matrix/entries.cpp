#include "matrix/entries.hpp"

#include <fmt/format.h>

#include <limits>
#include <utility>

#include "matrix/transform.hpp"
#include "matrix/triplets.hpp"

namespace espalier::matrix {

namespace {

constexpr Index kNone = -1;

TripletView view_of(const RawEntries& raw, Storage storage) {
  const auto n = at(raw.count);
  const bool pattern = raw.value.size() == 0;
  return {raw.rows, raw.cols, {raw.row.data(), n}, {raw.col.data(), n}, {raw.value.data(), pattern ? 0 : n}, storage};
}

// One triangle of the entries as a lower triangle: the entries on and below the diagonal, or those above it, mirrored
// (and with their sign changed when the matrix is skew).
SparseMatrix one_triangle(const RawEntries& raw, bool upper, base::ThreadPool* pool) {
  std::vector<Index> row, col;
  std::vector<double> value;
  const bool pattern = raw.value.size() == 0;
  const double sign = upper && raw.symmetry == Symmetry::skew ? -1.0 : 1.0;
  for (Offset k = 0; k < raw.count; ++k) {
    if ((raw.row[k] < raw.col[k]) != upper) continue;
    row.push_back(upper ? raw.col[k] : raw.row[k]);
    col.push_back(upper ? raw.row[k] : raw.col[k]);
    if (!pattern) value.push_back(sign * raw.value[k]);
  }
  return to_csc({raw.rows, raw.cols, row, col, value, Storage::symmetric_lower}, pool);
}

// An entry below the diagonal, and the value that stands at its mirror image.
struct Mirrored {
  Index row, col;
  double lower, upper;
};

[[noreturn]] void fail_both(const RawEntries& raw, const Source& source, const Mirrored& entry,
                            const std::function<const char*(Offset)>& locate) {
  const auto [row, col, lower, upper] = entry;
  Offset k = 0;
  while (raw.row[k] != col || raw.col[k] != row) ++k;
  const double sign = raw.symmetry == Symmetry::skew ? -1.0 : 1.0;
  fail_at(
      source, locate(k),
      fmt::format("entry ({}, {}) is {}, its mirror image ({}, {}) elsewhere in this file is {}; a file that declares "
                  "itself {} holds one triangle; delete the other one or declare the file general",
                  col + 1, row + 1, sign * upper, row + 1, col + 1, lower,
                  raw.symmetry == Symmetry::skew ? "skew-symmetric" : "symmetric"));
}

// Union of the two triangles; entries present in both must agree.
SparseMatrix merge_triangles(const RawEntries& raw, const ReadOptions& options, const Source& source,
                             const std::function<const char*(Offset)>& locate) {
  const SparseMatrix lower = one_triangle(raw, false, options.pool), upper = one_triangle(raw, true, options.pool);
  Offset pairs = 0;
  const bool pattern = raw.value.size() == 0;
  SparseMatrix merged{raw.rows, raw.cols, {0}, {}, {}, Storage::symmetric_lower};
  const auto take = [&](const SparseMatrix& from, Offset p) {
    merged.row_ind.push_back(from.row_ind[at(p)]);
    if (!pattern) merged.values.push_back(from.values[at(p)]);
  };
  for (std::size_t j = 0; j < at(raw.cols); ++j) {
    Offset p = lower.col_ptr[j], q = upper.col_ptr[j];
    while (p < lower.col_ptr[j + 1] || q < upper.col_ptr[j + 1]) {
      const Index in_lower = p < lower.col_ptr[j + 1] ? lower.row_ind[at(p)] : kNone;
      const Index in_upper = q < upper.col_ptr[j + 1] ? upper.row_ind[at(q)] : kNone;
      if (in_lower == in_upper && !pattern) {
        const double a = lower.values[at(p)], b = upper.values[at(q)];
        if (a != b) fail_both(raw, source, {in_lower, static_cast<Index>(j), a, b}, locate);
      }
      const bool from_lower = in_upper == kNone || (in_lower != kNone && in_lower <= in_upper);
      take(from_lower ? lower : upper, from_lower ? p : q);
      if (in_lower == in_upper) ++q, ++pairs;
      ++(from_lower ? p : q);
    }
    merged.col_ptr.push_back(static_cast<Offset>(merged.row_ind.size()));
  }
  if (pairs > 0 && options.notice)
    options.notice(
        fmt::format("{}: the file holds both triangles, though its first line promises one; {} {} mirror "
                    "{} taken once",
                    source.name, pairs, pairs == 1 ? "entry and its" : "entries and their",
                    pairs == 1 ? "image were" : "images were"));
  return merged;
}

// The diagonal of a skew matrix is zero; where a file holds it nevertheless, it must hold zeros, which are dropped.
SparseMatrix expand_skew(SparseMatrix lower) {
  Offset to = 0;
  Offset begin = 0;
  for (std::size_t j = 0; j < at(lower.cols); ++j) {
    const Offset end = lower.col_ptr[j + 1];
    for (Offset p = begin; p < end; ++p) {
      if (lower.row_ind[at(p)] == static_cast<Index>(j)) continue;
      lower.row_ind[at(to)] = lower.row_ind[at(p)];
      lower.values[at(to++)] = lower.values[at(p)];
    }
    begin = end;
    lower.col_ptr[j + 1] = to;
  }
  lower.row_ind.resize(at(to));
  lower.values.resize(at(to));
  return expand_lower(lower, -1.0);
}

SparseMatrix skew_lower(const RawEntries& raw, base::ThreadPool* pool) {
  return raw.above ? one_triangle(raw, true, pool) : to_csc(view_of(raw, Storage::symmetric_lower), pool);
}

}  // namespace

SparseMatrix assemble_entries(const RawEntries& raw, const ReadOptions& options, const Source& source,
                              const std::function<const char*(Offset)>& locate) {
  SparseMatrix a;
  const bool mixed = raw.above && raw.below;
  if (raw.symmetry == Symmetry::general) {
    a = to_csc(view_of(raw, Storage::general), options.pool);
  } else if (mixed) {
    a = merge_triangles(raw, options, source, locate);
  } else if (raw.symmetry == Symmetry::symmetric) {
    a = to_csc(view_of(raw, Storage::symmetric_lower), options.pool);
  } else {
    a = skew_lower(raw, options.pool);
  }
  if (raw.symmetry == Symmetry::skew) a = expand_skew(std::move(a));
  if (raw.value.size() == 0 && !options.keep_pattern) a.values.assign(a.row_ind.size(), 1.0);
  return a;
}

// Both parts have the same pattern. Above the diagonal a Hermitian file holds conjugates of what is below.
ComplexSparseMatrix assemble_complex_entries(RawEntries raw, const ReadOptions& options, const Source& source,
                                             const std::function<const char*(Offset)>& locate) {
  const bool hermitian = raw.symmetry == Symmetry::hermitian;
  if (hermitian) {
    raw.symmetry = Symmetry::symmetric;
    for (Offset k = 0; k < raw.count; ++k)
      if (raw.row[k] < raw.col[k]) raw.imaginary[k] = -raw.imaginary[k];
  }
  SparseMatrix real = assemble_entries(raw, options, source, locate);
  std::swap(raw.value, raw.imaginary);
  const SparseMatrix imaginary = assemble_entries(raw, {options.pool, options.keep_pattern}, source, locate);
  ComplexSparseMatrix a{real.rows, real.cols, std::move(real.col_ptr), std::move(real.row_ind), {}, real.storage};
  if (hermitian) a.storage = Storage::hermitian_lower;
  a.values.reserve(real.values.size());
  for (std::size_t q = 0; q < real.values.size(); ++q) a.values.emplace_back(real.values[q], imaginary.values[q]);
  return a;
}

void check_sizes(std::int64_t rows, std::int64_t cols, std::int64_t entries, const Source& source,
                 const char* position) {
  constexpr std::int64_t kMost = std::numeric_limits<Index>::max() - 1;
  constexpr std::int64_t kFree = std::int64_t{1} << 22;
  if (rows < 0 || cols < 0 || entries < 0)
    fail_at(source, position,
            fmt::format("sizes must not be negative, found {} x {} with {} entries", rows, cols, entries));
  if (rows > kMost || cols > kMost)
    fail_at(source, position, fmt::format("{} x {}: at most {} rows and columns are supported", rows, cols, kMost));
  const std::int64_t larger = rows > cols ? rows : cols;
  if (larger > kFree && larger / 16 > entries)
    fail_at(source, position,
            fmt::format("{} x {} with only {} entries: nearly all rows or columns would be empty, the matrix singular; "
                        "check the size line",
                        rows, cols, entries));
}

}  // namespace espalier::matrix
