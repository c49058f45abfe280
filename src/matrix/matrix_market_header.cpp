#include "matrix/matrix_market_header.hpp"

#include <fmt/format.h>

#include <array>

#include "matrix/matrix_market.hpp"

namespace espalier::matrix {

namespace {

constexpr std::string_view kBanner = "%%matrixmarket";

std::string next_word(const char*& p, const char* end) {
  p = skip_blanks(p, end);
  const char* begin = p;
  while (p < end && !is_blank(*p)) ++p;
  return lower_case({begin, at(p - begin)});
}

void read_banner(const Source& source, const char* begin, const char* end, MatrixMarketHeader& header) {
  const char* p = begin + kBanner.size();
  const std::string object = next_word(p, end), format = next_word(p, end), field = next_word(p, end),
                    symmetry = next_word(p, end);
  if (object != "matrix") fail_at(source, begin, fmt::format("the object is '{}'; only 'matrix' is supported", object));
  if (format != "coordinate" && format != "array")
    fail_at(source, begin, fmt::format("the format is '{}'; expected 'coordinate' or 'array'", format));
  header.array = format == "array";
  if (field != "real" && field != "double" && field != "integer" && field != "unsigned-integer" && field != "pattern" &&
      field != "complex")
    fail_at(source, begin, fmt::format("the field is '{}'; expected 'real', 'complex', 'integer' or 'pattern'", field));
  header.pattern = field == "pattern";
  header.complex = field == "complex";
  if (symmetry == "hermitian" && !header.complex)
    fail_at(source, begin, "only complex matrices are hermitian; a real one is called 'symmetric'");
  if (symmetry != "general" && symmetry != "symmetric" && symmetry != "skew-symmetric" && symmetry != "hermitian")
    fail_at(source, begin,
            fmt::format("the symmetry is '{}'; expected 'general', 'symmetric', 'skew-symmetric' or 'hermitian'",
                        symmetry));
  if (symmetry == "hermitian") header.symmetry = Symmetry::hermitian;
  if (symmetry == "symmetric") header.symmetry = Symmetry::symmetric;
  if (symmetry == "skew-symmetric") header.symmetry = Symmetry::skew;
  if (header.pattern && (header.array || header.symmetry == Symmetry::skew))
    fail_at(source, begin, fmt::format("a pattern cannot be '{} {}'", format, symmetry));
}

// Numbers that an array file of these sizes holds.
std::int64_t packed_count(std::int64_t rows, std::int64_t cols, Symmetry symmetry) {
  if (symmetry == Symmetry::general) return rows * cols;
  return symmetry == Symmetry::skew ? rows * (rows - 1) / 2 : rows * (rows + 1) / 2;
}

void read_sizes(const Source& source, const char* end, MatrixMarketHeader& header) {
  const char* p = header.sizes;
  const int expected = header.array ? 2 : 3;
  std::array<std::int64_t, 3> sizes{};
  for (int i = 0; i < expected; ++i) {
    p = skip_blanks(p, end);
    const char* word = p;
    const ScanError error = scan_integer(p, end, sizes[at(i)]);
    if (error != ScanError::none || (p < end && !is_blank(*p)))
      fail_at(source, header.sizes,
              fmt::format("expected the {} integers of the size line ({}), '{}' {}", expected,
                          header.array ? "rows, columns" : "rows, columns, entries", word_at(word, end),
                          error == ScanError::none ? "is not an integer" : explain(error)));
  }
  if (skip_blanks(p, end) != end)
    fail_at(source, header.sizes, fmt::format("the size line goes on after {} integers", expected));
  const auto [rows, cols, entries] = sizes;
  // Rows and columns are checked before they are multiplied; an array promises at least as many numbers as rows, unless
  // it has none.
  const std::int64_t promised = rows > 0 && cols > 0 ? std::max(rows, cols) : 0;
  check_sizes(rows, cols, header.array ? promised : entries, source, header.sizes);
  if (header.symmetry != Symmetry::general && rows != cols)
    fail_at(source, header.sizes, fmt::format("a matrix of {} x {} cannot be symmetric", rows, cols));
  header.rows = static_cast<Index>(rows);
  header.cols = static_cast<Index>(cols);
  header.count = header.array ? packed_count(rows, cols, header.symmetry) : entries;
}

}  // namespace

void expect_real(const MatrixMarketHeader& header, const Source& source, const char* needed) {
  if (header.complex) fail_at(source, source.text.data(), fmt::format("the file is complex; this needs {}", needed));
}

bool is_matrix_market(std::string_view text) { return lower_case(text.substr(0, kBanner.size())) == kBanner; }

const char* skip_to_data(const char* p, const char* end) {
  while (p < end) {
    const char* q = skip_blanks(p, end);
    if (q < end && *q != '\n' && *q != '%') return q;
    q = end_of_line(q, end);
    p = q < end ? q + 1 : end;
  }
  return end;
}

MatrixMarketHeader parse_matrix_market_header(const Source& source) {
  const char* begin = source.text.data();
  const char* end = begin + source.text.size();
  if (source.text.empty()) fail(source, "the file is empty");
  if (!is_matrix_market(source.text))
    fail_at(source, begin,
            "a Matrix Market file begins with '%%MatrixMarket matrix coordinate real general' or the like");
  MatrixMarketHeader header;
  const char* line_end = end_of_line(begin, end);
  read_banner(source, begin, line_end, header);
  header.sizes = skip_to_data(line_end, end);
  if (header.sizes == end) fail_at(source, end, "the file ends before the size line");
  line_end = end_of_line(header.sizes, end);
  read_sizes(source, line_end, header);
  header.data = line_end < end ? line_end + 1 : end;
  return header;
}

}  // namespace espalier::matrix
