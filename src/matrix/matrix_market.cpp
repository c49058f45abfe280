#include "matrix/matrix_market.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/memory.hpp"
#include "matrix/matrix_market_array.hpp"
#include "matrix/matrix_market_coordinate.hpp"
#include "matrix/transform.hpp"

namespace espalier::matrix {

namespace {

// The numbers of an array file with their places, exact zeros left out.
RawEntries sparse_entries(const std::vector<double>& numbers, const MatrixMarketHeader& header) {
  const Offset count = std::count_if(numbers.begin(), numbers.end(), [](double v) { return v != 0; });
  RawEntries raw;
  raw.rows = header.rows;
  raw.cols = header.cols;
  raw.symmetry = header.symmetry;
  raw.count = count;
  raw.row = base::Buffer<Index>(count, nullptr);
  raw.col = base::Buffer<Index>(count, nullptr);
  raw.value = base::Buffer<double>(count, nullptr);
  Offset to = 0;
  for_each_packed(header, [&](Index i, Index j, Offset k) {
    const double v = numbers[static_cast<std::size_t>(k)];
    if (v == 0) return;
    raw.row[to] = i;
    raw.col[to] = j;
    raw.value[to++] = v;
    raw.below |= i > j;
    raw.above |= i < j;
  });
  return raw;
}

// A file of a few bytes must not make us take gigabytes: beyond 2^27 numbers (1 GiB) one in 64 must be in the file.
DenseVectors zero_vectors(const Source& source, Index rows, Index cols, Offset entries) {
  constexpr Offset kFree = Offset{1} << 27;
  const Offset count = static_cast<Offset>(rows) * cols;
  if (count > kFree && count / 64 > entries)
    fail(source, fmt::format("{} x {} as dense vectors would take {} for {} entries; is this a right-hand side?", rows,
                             cols, base::format_bytes(8 * std::min(count, Offset{1} << 59)), entries));
  return {rows, cols, std::vector<double>(static_cast<std::size_t>(count), 0.0)};
}

SparseMatrix parse_coordinate(const Source& source, const MatrixMarketHeader& header, const ReadOptions& options) {
  const RawEntries raw = parse_coordinate_entries(source, header, options);
  return assemble_entries(raw, options, source, [&](Offset k) { return locate_coordinate_entry(source, header, k); });
}

}  // namespace

SparseMatrix parse_matrix_market(std::string_view text, const std::string& name, const ReadOptions& options) {
  const Source source{name, text};
  const MatrixMarketHeader header = parse_matrix_market_header(source);
  if (!header.array) return parse_coordinate(source, header, options);
  const RawEntries raw = sparse_entries(parse_array_numbers(source, header, options), header);
  return assemble_entries(raw, options, source, [&](Offset) { return header.data; });
}

DenseVectors parse_matrix_market_vectors(std::string_view text, const std::string& name, const ReadOptions& options) {
  const Source source{name, text};
  const MatrixMarketHeader header = parse_matrix_market_header(source);
  if (header.array && header.symmetry == Symmetry::general)
    return {header.rows, header.cols, parse_array_numbers(source, header, options)};
  if (header.array) {
    const std::vector<double> numbers = parse_array_numbers(source, header, options);
    DenseVectors v = zero_vectors(source, header.rows, header.cols, header.count);
    const double sign = header.symmetry == Symmetry::skew ? -1.0 : 1.0;
    const auto n = static_cast<std::size_t>(header.rows);
    for_each_packed(header, [&](Index i, Index j, Offset k) {
      const double value = numbers[static_cast<std::size_t>(k)];
      v.values[static_cast<std::size_t>(i) * n + static_cast<std::size_t>(j)] = sign * value;
      v.values[static_cast<std::size_t>(j) * n + static_cast<std::size_t>(i)] = value;
    });
    return v;
  }
  ReadOptions with_values = options;
  with_values.keep_pattern = false;
  const SparseMatrix a = to_general(parse_coordinate(source, header, with_values), options.pool);
  DenseVectors v = zero_vectors(source, a.rows, a.cols, a.nonzeros());
  for (std::size_t j = 0; j < static_cast<std::size_t>(a.cols); ++j)
    for (Offset p = a.col_ptr[j]; p < a.col_ptr[j + 1]; ++p)
      v.values[j * static_cast<std::size_t>(a.rows) +
               static_cast<std::size_t>(a.row_ind[static_cast<std::size_t>(p)])] =
          a.values[static_cast<std::size_t>(p)];
  return v;
}

}  // namespace espalier::matrix
