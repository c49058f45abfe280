#include "matrix/rutherford_boeing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <vector>

#include "matrix/fortran_format.hpp"

namespace espalier::matrix {

namespace {

constexpr std::size_t kHeaderField = 14;  // width of the integers of lines 2 and 3 (Rutherford-Boeing: 1x, i13)
constexpr std::size_t kFormatField = 16;  // width of the first two formats of line 4
constexpr std::size_t kValueFormat = 20;  // width of the third

// Walks over the lines of a text.
class Lines {
 public:
  explicit Lines(const Source& source)
      : source_(&source), next_(source.text.data()), end_(source.text.data() + source.text.size()) {}
  // The next line without its end; fails when there is none.
  std::string_view take(const char* what) {
    if (next_ == end_) fail_at(*source_, end_, fmt::format("the file ends before {}; it is truncated", what));
    const char* begin = next_;
    const char* stop = end_of_line(begin, end_);
    next_ = stop < end_ ? stop + 1 : end_;
    if (stop > begin && stop[-1] == '\r') --stop;
    return {begin, at(stop - begin)};
  }
  [[nodiscard]] const char* position() const { return next_; }
  [[nodiscard]] Offset bytes_left() const { return end_ - next_; }
  [[nodiscard]] const Source& source() const { return *source_; }

 private:
  const Source* source_;
  const char* next_;
  const char* end_;
};

struct RutherfordBoeingHeader {
  char value_type = 'r';  // r, i or p
  Symmetry symmetry = Symmetry::general;
  std::int64_t rows = 0, cols = 0, entries = 0;
  FortranFormat pointers, indices, values;
};

std::int64_t header_integer(const Lines& lines, std::string_view line, std::size_t field, const char* what) {
  std::int64_t value = 0;
  const std::size_t begin = std::min(field * kHeaderField, line.size());
  const auto text = line.substr(begin, kHeaderField);
  if (scan_field(text, value) != ScanError::none)
    fail_at(lines.source(), line.data(),
            fmt::format("'{}' is not the {}; is this a Rutherford-Boeing file?",
                        word_at(skip_blanks(text.begin(), text.end()), text.end()), what));
  return value;
}

void read_type(const Lines& lines, std::string_view line, RutherfordBoeingHeader& header) {
  const std::string type = lower_case(line.substr(0, 3));
  const auto refuse = [&](const std::string& why) {
    fail_at(lines.source(), line.data(), fmt::format("matrix type '{}': {}", type, why));
  };
  if (type.size() < 3) refuse("three letters were expected, such as 'rsa'");
  header.value_type = type[0];
  if (type[0] == 'c') refuse("complex matrices are not supported");
  if (type[0] != 'r' && type[0] != 'i' && type[0] != 'p') refuse("the first letter must be r, i or p");
  if (type[1] == 'h') refuse("hermitian matrices are not supported");
  if (type[1] == 's')
    header.symmetry = Symmetry::symmetric;
  else if (type[1] == 'z')
    header.symmetry = Symmetry::skew;
  else if (type[1] != 'u' && type[1] != 'r')
    refuse("the second letter must be s, u, z or r");
  if (type[2] == 'e') refuse("elemental (unassembled) matrices are not supported; assemble the matrix first");
  if (type[2] != 'a') refuse("the third letter must be a");
  if (header.value_type == 'p' && header.symmetry == Symmetry::skew) refuse("a pattern cannot be skew");
}

FortranFormat read_format(const Lines& lines, std::string_view line, std::size_t begin, std::size_t width, bool real) {
  const auto text = line.substr(std::min(begin, line.size()), width);
  const auto format = parse_fortran_format(text);
  if (!format || (!real && format->real))
    fail_at(lines.source(), line.data(),
            fmt::format("'{}' is not a Fortran format for {}", std::string(text),
                        real ? "numbers, such as (4E20.12)" : "integers, such as (10I8)"));
  return *format;
}

RutherfordBoeingHeader read_header(Lines& lines) {
  RutherfordBoeingHeader header;
  (void)lines.take("the title");
  const std::string_view counts = lines.take("the line counts");
  const bool harwell_boeing =
      counts.size() > 4 * kHeaderField && header_integer(lines, counts, 4, "number of lines") > 0;
  const std::string_view sizes = lines.take("the matrix type");
  read_type(lines, sizes, header);
  header.rows = header_integer(lines, sizes, 1, "number of rows");
  header.cols = header_integer(lines, sizes, 2, "number of columns");
  header.entries = header_integer(lines, sizes, 3, "number of entries");
  check_sizes(header.rows, header.cols, header.entries, lines.source(), sizes.data());
  if (header.symmetry != Symmetry::general && header.rows != header.cols)
    fail_at(lines.source(), sizes.data(),
            fmt::format("a matrix of {} x {} cannot be symmetric", header.rows, header.cols));
  const std::string_view formats = lines.take("the formats");
  header.pointers = read_format(lines, formats, 0, kFormatField, false);
  header.indices = read_format(lines, formats, kFormatField, kFormatField, false);
  if (header.value_type != 'p') header.values = read_format(lines, formats, 2 * kFormatField, kValueFormat, true);
  if (harwell_boeing) (void)lines.take("the description of the right-hand sides");
  return header;
}

// Reads `count` fields and calls take(k, field): field is a part of a line. Each section begins on a new line.
template <class Take>
void read_section(Lines& lines, const FortranFormat& format, Offset count, const char* what, const Take& take) {
  // A field is at least one character unless it is blank at the end of its line; a line holds per_line fields.
  if (count > lines.bytes_left() * format.per_line)
    fail_at(lines.source(), lines.position(),
            fmt::format("the header promises {} {}, but only {} characters follow: truncated?", count, what,
                        lines.bytes_left()));
  for (Offset k = 0; k < count;) {
    const std::string_view line = lines.take(what);
    for (int f = 0; f < format.per_line && k < count; ++f, ++k) {
      const std::size_t begin = std::min(at(f) * at(format.width), line.size());
      take(k, line.substr(begin, at(format.width)));
    }
  }
}

[[noreturn]] void fail_field(const Lines& lines, std::string_view field, const std::string& what) {
  fail_at(lines.source(), field.data(),
          fmt::format("'{}' {}", word_at(skip_blanks(field.begin(), field.end()), field.end()), what));
}

std::vector<Offset> read_pointers(Lines& lines, const RutherfordBoeingHeader& header) {
  std::vector<Offset> pointers;
  read_section(lines, header.pointers, header.cols + 1, "column pointers", [&](Offset k, std::string_view field) {
    std::int64_t value = 0;
    if (const auto error = scan_field(field, value); error != ScanError::none) fail_field(lines, field, explain(error));
    const std::int64_t least = k == 0 ? 1 : pointers.back() + 1;
    const std::int64_t most = k == 0 ? 1 : header.entries + 1;
    if (value < least || value > most)
      fail_field(lines, field, fmt::format("is not a column pointer in {}..{}", least, most));
    pointers.push_back(value - 1);
  });
  if (pointers.back() != header.entries)
    fail_at(
        lines.source(), lines.position(),
        fmt::format("the column pointers end at {}, the header promises {} entries", pointers.back(), header.entries));
  return pointers;
}

// Reads indices and values into the raw entries; remembers where each section of the text begins.
void read_entries(Lines& lines, const RutherfordBoeingHeader& header, const std::vector<Offset>& pointers,
                  RawEntries& raw) {
  read_section(lines, header.indices, header.entries, "row indices", [&](Offset k, std::string_view field) {
    std::int64_t value = 0;
    if (const auto error = scan_field(field, value); error != ScanError::none) fail_field(lines, field, explain(error));
    if (value < 1 || value > header.rows)
      fail_field(lines, field, fmt::format("is not a row index in 1..{}", header.rows));
    raw.row[k] = static_cast<Index>(value - 1);
  });
  for (Index j = 0; j < raw.cols; ++j)
    for (Offset k = pointers[at(j)]; k < pointers[at(j) + 1]; ++k) {
      raw.col[k] = j;
      raw.below |= raw.row[k] > j;
      raw.above |= raw.row[k] < j;
    }
  if (header.value_type == 'p') return;
  read_section(lines, header.values, header.entries, "values", [&](Offset k, std::string_view field) {
    if (const auto error = scan_field(field, header.values, raw.value[k]); error != ScanError::none)
      fail_field(lines, field, explain(error));
    if (header.symmetry == Symmetry::skew && raw.row[k] == raw.col[k] && raw.value[k] != 0)
      fail_field(lines, field, "stands on the diagonal; that of a skew-symmetric matrix is zero");
  });
}

const char* line_of_field(const Source& source, const char* section, const FortranFormat& format, Offset k) {
  const char* end = source.text.data() + source.text.size();
  for (Offset line = k / format.per_line; line > 0 && section < end; --line)
    section = std::min(end, end_of_line(section, end) + 1);
  return section;
}

}  // namespace

bool is_rutherford_boeing(std::string_view text) {
  const char* p = text.data();
  const char* end = p + text.size();
  for (int line = 0; line < 2; ++line) {
    p = end_of_line(p, end);
    if (p == end) return false;
    ++p;
  }
  const std::string type = lower_case({p, static_cast<std::size_t>(std::min<std::ptrdiff_t>(3, end - p))});
  return type.size() == 3 && std::string_view("ripc").find(type[0]) != std::string_view::npos &&
         std::string_view("suhzr").find(type[1]) != std::string_view::npos && (type[2] == 'a' || type[2] == 'e');
}

SparseMatrix parse_rutherford_boeing(std::string_view text, const std::string& name, const ReadOptions& options) {
  const Source source{name, text};
  if (text.empty()) fail(source, "the file is empty");
  Lines lines(source);
  const RutherfordBoeingHeader header = read_header(lines);
  const auto pointers = read_pointers(lines, header);
  const char* indices = lines.position();
  if (header.entries > lines.bytes_left())  // an index takes one character at least
    fail_at(source, indices,
            fmt::format("the header promises {} entries, but only {} characters follow: truncated?", header.entries,
                        lines.bytes_left()));
  RawEntries raw;
  raw.rows = static_cast<Index>(header.rows);
  raw.cols = static_cast<Index>(header.cols);
  raw.symmetry = header.symmetry;
  raw.count = header.entries;
  raw.row = base::Buffer<Index>(raw.count, nullptr);
  raw.col = base::Buffer<Index>(raw.count, nullptr);
  if (header.value_type != 'p') raw.value = base::Buffer<double>(raw.count, nullptr);
  read_entries(lines, header, pointers, raw);
  return assemble_entries(raw, options, source,
                          [&](Offset k) { return line_of_field(source, indices, header.indices, k); });
}

}  // namespace espalier::matrix
