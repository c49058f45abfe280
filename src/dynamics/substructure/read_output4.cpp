// OUTPUT4 files: matrices column by column, as text or as Fortran records.
//
// Layout: MSC Nastran's DMAP Programmer's Guide, module OUTPUT4. A matrix has a header (columns, rows, form, type,
// name) and then columns (number, first row, words); a column past the last ends it. First row 0: the column comes in
// strings of its own, headed by one number that holds length and row, or, where rows < 0 (BIGMAT), by two.
#include <fmt/format.h>

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>

#include "dynamics/mesh/text_file.hpp"
#include "dynamics/substructure/matrix_file.hpp"

namespace espalier::dynamics {
namespace {

constexpr int kBinaryHead = 24, kLongHead = 48;  // bytes of a header's record with integers of 4 and 8 bytes

/// What both encodings share: columns and strings into entries.
class Columns {
 public:
  Columns(std::string path, std::string name, std::int64_t columns, std::int64_t rows, std::int64_t type)
      : path_(std::move(path)), big_(rows < 0), words_(type == 2 ? 2 : 1) {
    matrix_.name = std::move(name);
    if (type != 1 && type != 2)
      fail(type == 3 || type == 4 ? "is complex; only real matrices are read"
                                  : fmt::format("has the type {}, not 1 (single) or 2 (double precision)", type));
    rows = rows < 0 ? -rows : rows;  // the least number of all stays negative
    if (rows < 1 || columns < 1) fail(fmt::format("has {} rows and {} columns", rows, columns));
    if (rows > kMostSubstructureUnknowns || columns > kMostSubstructureUnknowns)
      fail(fmt::format("has {} rows and {} columns; at most {} are read", rows, columns, kMostSubstructureUnknowns));
    matrix_.rows = static_cast<Index>(rows);
    matrix_.columns = static_cast<Index>(columns);
  }

  [[nodiscard]] bool big() const { return big_; }
  /// 4-byte words of one value where strings are counted in words.
  [[nodiscard]] std::int64_t words() const { return words_; }
  [[nodiscard]] bool is_last(std::int64_t column) const { return column > matrix_.columns; }
  void start_column(std::int64_t column) {
    if (column < 1) fail(fmt::format("has a column {}", column));
    column_ = static_cast<Index>(column - 1);
  }
  /// Before anything is read: that rows `row` (from 1) and the next lie in the matrix.
  void check_string(std::int64_t row, std::int64_t count) const {
    if (row < 1 || count < 0 || count > matrix_.rows || row - 1 > matrix_.rows - count)
      fail(
          fmt::format("column {}: {} values from row {} on do not fit {} rows", column_ + 1, count, row, matrix_.rows));
  }
  void add(std::int64_t row, double value) {
    if (!std::isfinite(value)) fail(fmt::format("column {}, row {}: the value is not finite", column_ + 1, row));
    if (value != 0) matrix_.entries.push_back({static_cast<Index>(row - 1), column_, value});
  }
  [[nodiscard]] FileMatrix take() { return std::move(matrix_); }
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(StatusCode::invalid_input, fmt::format("{}: matrix '{}' {}", path_, matrix_.name, what));
  }

 private:
  std::string path_;
  FileMatrix matrix_;
  bool big_;
  std::int64_t words_;
  Index column_ = 0;
};

// Strings of small matrices: words + 1 in the upper half of the number, the row in the lower.
std::int64_t packed_words(std::int64_t head) { return (head >> 16) - 1; }
std::int64_t packed_row(std::int64_t head) { return head & 0xffff; }

/// Text: lines of numbers in columns of fixed width, as the header's format says.
class Text {
 public:
  Text(std::string content, const std::string& path) : lines_(path, std::move(content)) {}

  std::vector<FileMatrix> read() {
    std::vector<FileMatrix> all;
    std::string_view line;
    while (lines_.next(line))
      if (!trim(line).empty()) all.push_back(read_matrix(line));
    return all;
  }

 private:
  FileMatrix read_matrix(std::string_view head) {
    std::size_t wide = 8;
    if (head.ends_with("|I16")) {
      wide = 16;
      head.remove_suffix(4);
    }
    const std::int64_t columns = integer(head, 0, wide), rows = integer(head, wide, wide);
    const std::int64_t type = integer(head, 2 * wide + 8, 8);
    const std::size_t name = 2 * wide + 16;
    Columns to(lines_.path(), upper(trim(piece(head, name, 8))), columns, rows, type);
    read_format(piece(head, name + 8, head.size()));
    std::string_view line = needed();
    for (std::int64_t column = integer(line, 0, wide); !to.is_last(column);
         line = needed(), column = integer(line, 0, wide)) {
      to.start_column(column);
      const std::int64_t row = integer(line, wide, wide);
      std::int64_t left = integer(line, 2 * wide, wide);
      if (row > 0) {
        values(to, row, left);
        continue;
      }
      while (left > 0) {
        line = needed();
        const std::int64_t first = integer(line, 0, to.big() ? wide : line.size());
        const std::int64_t words = to.big() ? first - 1 : packed_words(first);
        const std::int64_t at = to.big() ? integer(line, wide, wide) : packed_row(first);
        if (words < 1) lines_.fail("a string of numbers without any");
        left -= words + (to.big() ? 2 : 1);
        values(to, at, words / to.words());
      }
    }
    skip_end(integer(line, 2 * wide, wide));
    return to.take();
  }

  /// "1P,3E23.16": three numbers of 23 columns a line.
  void read_format(std::string_view format) {
    std::string text = upper(trim(format));
    if (text.starts_with("1P")) text.erase(0, text.find_first_not_of(", ", 2));
    const std::size_t letter = text.find_first_of("ED");
    const auto number = [&](std::size_t from, std::size_t to) {
      std::size_t value = 0;
      const char* begin = text.data() + std::min(from, text.size());
      const char* end = text.data() + std::min(to, text.size());
      return std::from_chars(begin, end, value).ec == std::errc() ? value : 0;
    };
    per_line_ = letter == std::string::npos ? 5 : number(0, letter);
    width_ = letter == std::string::npos ? 16 : number(letter + 1, text.size());
    if (per_line_ < 1 || per_line_ > 1000 || width_ < 2 || width_ > 1000)
      lines_.fail(fmt::format("the format '{}' of the numbers is not like 1P,3E23.16", std::string(trim(format))));
  }

  void values(Columns& to, std::int64_t row, std::int64_t count) {
    to.check_string(row, count);
    std::string_view line;
    for (std::int64_t k = 0; k < count; ++k) {
      const auto place = static_cast<std::size_t>(k) % per_line_;
      if (place == 0) line = needed();
      to.add(row + k, real(piece(line, place * width_, width_)));
    }
  }

  /// The numbers of the column that ends a matrix.
  void skip_end(std::int64_t count) {
    std::string_view line;
    for (std::int64_t k = 0; k < count && lines_.next(line); k += static_cast<std::int64_t>(per_line_)) {
    }
  }

  std::string_view needed() {
    std::string_view line;
    if (!lines_.next(line)) lines_.fail("the file ends within a matrix");
    return line;
  }
  static std::string_view piece(std::string_view line, std::size_t from, std::size_t width) {
    return from < line.size() ? line.substr(from, width) : std::string_view();
  }
  [[nodiscard]] std::int64_t integer(std::string_view line, std::size_t from, std::size_t width) const {
    const std::string_view text = trim(piece(line, from, width));
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
      lines_.fail(fmt::format("'{}' is not a whole number", text));
    return value;
  }
  [[nodiscard]] double real(std::string_view field) const {
    std::string text(trim(field));
    for (char& c : text)
      if (c == 'D' || c == 'd') c = 'e';
    const char* begin = text.data() + (text.starts_with('+') ? 1 : 0);
    double value = 0;
    const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
      lines_.fail(fmt::format("'{}' is not a number", text));
    return value;
  }

  LineReader lines_;
  std::size_t per_line_ = 5, width_ = 16;
};

/// Fortran records, each between two copies of its length in bytes.
class Binary {
 public:
  Binary(std::string content, const std::string& path) : content_(std::move(content)), path_(path) {
    std::array<unsigned char, 4> first{};
    std::memcpy(first.data(), content_.data(), 4);
    swap_ = first[0] == 0 && first[3] != 0;  // the length, 24 or 48, fits one byte
    if constexpr (std::endian::native == std::endian::big) swap_ = !swap_;
    wide_ = peek_length() == kLongHead;
  }

  std::vector<FileMatrix> read() {
    std::vector<FileMatrix> all;
    while (at_ < content_.size()) all.push_back(read_matrix());
    return all;
  }

 private:
  FileMatrix read_matrix() {
    open(kBinaryHead * (wide_ ? 2 : 1));
    const std::int64_t columns = integer(), rows = integer();
    integer();  // form
    const std::int64_t type = integer();
    const std::string_view name = bytes(wide_ ? 16 : 8);
    close();
    Columns to(path_, upper(trim(name.substr(0, 8))), columns, rows, type);
    const bool doubles = type == 2 || wide_;
    const std::int64_t words = doubles && !wide_ ? 2 : 1;  // of one value, in the file's own words
    for (;;) {
      open(0);
      const std::int64_t column = integer(), row = integer();
      std::int64_t left = integer();
      if (to.is_last(column)) break;
      to.start_column(column);
      if (row > 0) values(to, row, left / words, doubles);
      while (row == 0 && left > 0) {
        const std::int64_t first = integer();
        const std::int64_t own = to.big() ? first - 1 : packed_words(first);
        const std::int64_t at = to.big() ? integer() : packed_row(first);
        if (own < 1) to.fail(fmt::format("column {}: a string of numbers without any", column));
        left -= own + (to.big() ? 2 : 1);
        values(to, at, own / words, doubles);
      }
      close();
    }
    close();
    return to.take();
  }

  void values(Columns& to, std::int64_t row, std::int64_t count, bool doubles) {
    to.check_string(row, count);
    for (std::int64_t k = 0; k < count; ++k) to.add(row + k, doubles ? number<double>() : number<float>());
  }

  /// A record begins. @param length what it must have in bytes; 0: whatever it says
  void open(std::int64_t length) {
    const std::int64_t said = peek_length();
    if (said < 0 || (length > 0 && said != length))
      fail(fmt::format("a record of {} bytes at byte {}, where {} were expected", said, at_, length));
    at_ += 4;
    end_ = at_ + static_cast<std::size_t>(said);
    if (end_ > content_.size()) fail("the file ends within a record");
  }
  /// It ends, read to its end or not.
  void close() {
    at_ = end_;
    end_ = content_.size();
    number<std::int32_t>();
  }
  [[nodiscard]] std::int64_t peek_length() {
    const std::size_t here = at_;
    end_ = content_.size();
    const auto length = number<std::int32_t>();
    at_ = here;
    return length;
  }
  std::string_view bytes(std::size_t count) {
    if (count > end_ - at_)
      fail(fmt::format("the record or the file ends at byte {}, {} bytes too early", end_, count));
    at_ += count;
    return std::string_view(content_).substr(at_ - count, count);
  }
  template <class T>
  T number() {
    std::array<char, sizeof(T)> raw{};
    const std::string_view from = bytes(sizeof(T));
    for (std::size_t k = 0; k < sizeof(T); ++k) raw.at(k) = from[swap_ ? sizeof(T) - 1 - k : k];
    return std::bit_cast<T>(raw);
  }
  std::int64_t integer() { return wide_ ? number<std::int64_t>() : number<std::int32_t>(); }
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(StatusCode::invalid_input, fmt::format("{}: {}", path_, what));
  }

  std::string content_, path_;
  std::size_t at_ = 0, end_ = 0;
  bool swap_ = false, wide_ = false;
};

bool is_binary(std::string_view content) {
  if (content.size() < 8) return false;
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(content[k]); };
  const auto head = [](unsigned char b) { return b == kBinaryHead || b == kLongHead; };
  return (head(byte(0)) && byte(1) == 0 && byte(2) == 0 && byte(3) == 0) ||
         (head(byte(3)) && byte(0) == 0 && byte(1) == 0 && byte(2) == 0);
}

}  // namespace

/// Text: four numbers in columns of 8 (or two of 16 and two of 8), then a name.
bool is_output4(std::string_view content) {
  if (is_binary(content)) return true;
  const std::string_view line = content.substr(0, content.find('\n'));
  const std::size_t wide = trim(line).ends_with("|I16") ? 16 : 8;
  if (line.size() <= 2 * wide + 16) return false;
  for (const auto& [from, width] :
       {std::pair<std::size_t, std::size_t>{0, wide}, {wide, wide}, {2 * wide, 8}, {2 * wide + 8, 8}}) {
    const std::string_view field = trim(line.substr(from, width));
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc() || end != field.data() + field.size()) return false;
  }
  return true;
}

std::vector<FileMatrix> parse_output4(std::string content, const std::string& path) {
  return is_binary(content) ? Binary(std::move(content), path).read() : Text(std::move(content), path).read();
}

}  // namespace espalier::dynamics
