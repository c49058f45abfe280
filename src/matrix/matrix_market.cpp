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
  const std::size_t parts = header.complex ? 2 : 1;
  const auto is_zero = [&](Offset k) {
    const double* value = &numbers[parts * at(k)];
    return value[0] == 0 && value[parts - 1] == 0;
  };
  Offset count = 0;
  for (Offset k = 0; k < header.count; ++k) count += is_zero(k) ? 0 : 1;
  RawEntries raw;
  raw.rows = header.rows;
  raw.cols = header.cols;
  raw.symmetry = header.symmetry;
  raw.count = count;
  raw.row = base::Buffer<Index>(count, nullptr);
  raw.col = base::Buffer<Index>(count, nullptr);
  raw.value = base::Buffer<double>(count, nullptr);
  if (header.complex) raw.imaginary = base::Buffer<double>(count, nullptr);
  Offset to = 0;
  for_each_packed(header, [&](Index i, Index j, Offset k) {
    if (is_zero(k)) return;
    const double* value = &numbers[parts * at(k)];
    raw.row[to] = i;
    raw.col[to] = j;
    raw.value[to] = value[0];
    if (header.complex) raw.imaginary[to] = value[1];
    ++to;
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
  return {rows, cols, std::vector<double>(at(count), 0.0)};
}

SparseMatrix parse_coordinate(const Source& source, const MatrixMarketHeader& header, const ReadOptions& options) {
  const RawEntries raw = parse_coordinate_entries(source, header, options);
  return assemble_entries(raw, options, source, [&](Offset k) { return locate_coordinate_entry(source, header, k); });
}

// A Hermitian array file holds imaginary parts on its diagonal, which must be zero.
void check_array_diagonal(const Source& source, const MatrixMarketHeader& header, const std::vector<double>& numbers) {
  if (header.symmetry != Symmetry::hermitian) return;
  for_each_packed(header, [&](Index i, Index j, Offset k) {
    const double imaginary = numbers[2 * at(k) + 1];
    if (i == j && imaginary != 0)
      fail_at(source, header.data,
              fmt::format("the diagonal of a hermitian matrix is real; entry ({}, {}) has the imaginary part {}", i + 1,
                          j + 1, imaginary));
  });
}

// Every entry, of any storage.
template <class Use>
void visit_all(const ComplexSparseMatrix& a, const Use& use) {
  for (Index j = 0; j < a.cols; ++j)
    for (Offset p = a.col_ptr[at(j)]; p < a.col_ptr[at(j) + 1]; ++p) {
      const Index i = a.row_ind[at(p)];
      const std::complex<double> v = a.values[at(p)];
      use(i, j, v);
      if (a.storage != Storage::general && i != j) use(j, i, a.view().hermitian() ? std::conj(v) : v);
    }
}

}  // namespace

bool is_complex_matrix_market(std::string_view text, const std::string& name) {
  return parse_matrix_market_header({name, text}).complex;
}

SparseMatrix parse_matrix_market(std::string_view text, const std::string& name, const ReadOptions& options) {
  const Source source{name, text};
  const MatrixMarketHeader header = parse_matrix_market_header(source);
  expect_real(header, source, "a real matrix");
  if (!header.array) return parse_coordinate(source, header, options);
  const RawEntries raw = sparse_entries(parse_array_numbers(source, header, options), header);
  return assemble_entries(raw, options, source, [&](Offset) { return header.data; });
}

DenseVectors parse_matrix_market_vectors(std::string_view text, const std::string& name, const ReadOptions& options) {
  const Source source{name, text};
  const MatrixMarketHeader header = parse_matrix_market_header(source);
  expect_real(header, source, "real vectors");
  if (header.array && header.symmetry == Symmetry::general)
    return {header.rows, header.cols, parse_array_numbers(source, header, options)};
  if (header.array) {
    const std::vector<double> numbers = parse_array_numbers(source, header, options);
    DenseVectors v = zero_vectors(source, header.rows, header.cols, header.count);
    const double sign = header.symmetry == Symmetry::skew ? -1.0 : 1.0;
    const auto n = at(header.rows);
    for_each_packed(header, [&](Index i, Index j, Offset k) {
      const double value = numbers[at(k)];
      v.values[at(i) * n + at(j)] = sign * value;
      v.values[at(j) * n + at(i)] = value;
    });
    return v;
  }
  ReadOptions with_values = options;
  with_values.keep_pattern = false;
  const SparseMatrix a = to_general(parse_coordinate(source, header, with_values), options.pool);
  DenseVectors v = zero_vectors(source, a.rows, a.cols, a.nonzeros());
  for (std::size_t j = 0; j < at(a.cols); ++j)
    for (Offset p = a.col_ptr[j]; p < a.col_ptr[j + 1]; ++p)
      v.values[j * at(a.rows) + static_cast<std::size_t>(a.row_ind[at(p)])] = a.values[at(p)];
  return v;
}

ComplexSparseMatrix parse_complex_matrix_market(std::string_view text, const std::string& name,
                                                const ReadOptions& options) {
  const Source source{name, text};
  const MatrixMarketHeader header = parse_matrix_market_header(source);
  if (!header.complex) {
    SparseMatrix a = parse_matrix_market(text, name, options);
    return {a.rows, a.cols, std::move(a.col_ptr), std::move(a.row_ind), {a.values.begin(), a.values.end()}, a.storage};
  }
  if (!header.array)
    return assemble_complex_entries(parse_coordinate_entries(source, header, options), options, source,
                                    [&](Offset k) { return locate_coordinate_entry(source, header, k); });
  const std::vector<double> numbers = parse_array_numbers(source, header, options);
  check_array_diagonal(source, header, numbers);
  return assemble_complex_entries(sparse_entries(numbers, header), options, source,
                                  [&](Offset) { return header.data; });
}

ComplexVectors parse_complex_matrix_market_vectors(std::string_view text, const std::string& name,
                                                   const ReadOptions& options) {
  const Source source{name, text};
  const MatrixMarketHeader header = parse_matrix_market_header(source);
  if (!header.complex) {
    const DenseVectors v = parse_matrix_market_vectors(text, name, options);
    return {v.rows, v.cols, {v.values.begin(), v.values.end()}};
  }
  if (header.array && header.symmetry == Symmetry::general) {
    const std::vector<double> numbers = parse_array_numbers(source, header, options);
    ComplexVectors v{header.rows, header.cols, {}};
    for (std::size_t k = 0; k < numbers.size(); k += 2) v.values.emplace_back(numbers[k], numbers[k + 1]);
    return v;
  }
  const ComplexSparseMatrix a = parse_complex_matrix_market(text, name, options);
  const auto size = zero_vectors(source, a.rows, a.cols, a.nonzeros()).values.size();
  ComplexVectors v{a.rows, a.cols, std::vector<std::complex<double>>(size)};
  visit_all(a, [&](Index i, Index j, std::complex<double> value) { v.values[at(j) * at(a.rows) + at(i)] = value; });
  return v;
}

}  // namespace espalier::matrix
