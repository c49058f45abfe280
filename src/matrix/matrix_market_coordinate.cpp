#include "matrix/matrix_market_coordinate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <vector>

#include "matrix/line_pieces.hpp"
#include "matrix/parallel.hpp"

namespace espalier::matrix {

namespace {

// What was found in some lines.
struct Piece : LinePiece {
  Offset first = 0;  // position of its first entry in the buffers
  Offset lines = 0;  // lines, hence at most so many entries
  Offset count = 0;  // entries found
  bool below = false;
  bool above = false;
};

struct Entry {
  std::int64_t row = 0;
  std::int64_t col = 0;
  double value = 1;
};

// The common form of an index: up to 9 digits and a blank behind them. Leaves everything else to scan_integer.
inline bool scan_short_index(const char*& p, const char* end, std::int64_t& value) {
  constexpr std::ptrdiff_t kMostDigits = 9;
  const char* q = p;
  std::uint32_t v = 0;
  while (q < end && static_cast<unsigned char>(*q - '0') < 10 && q - p < kMostDigits)
    v = 10 * v + static_cast<std::uint32_t>(*q++ - '0');
  if (q == p || q == end || (*q != ' ' && *q != '\n' && *q != '\t' && *q != '\r')) return false;
  value = v;
  p = q;
  return true;
}

// What is wrong with the word at `p`, remembered in the piece.
bool reject(Piece& piece, const char* at, std::string message) {
  piece.error_at = at;
  piece.error = std::move(message);
  return false;
}

bool parse_index(Piece& piece, const char*& p, std::int64_t& value, std::int64_t size, const char* what) {
  while (p < piece.end && (*p == ' ' || *p == '\t')) ++p;
  const char* word = p;
  if (!scan_short_index(p, piece.end, value)) {
    const ScanError error = scan_integer(p, piece.end, value);
    if (word == piece.end || *word == '\n' || *word == '\r')
      return reject(piece, word, fmt::format("the line ends before the {} index", what));
    if (error == ScanError::too_large || (error == ScanError::none && value > size))
      return reject(piece, word, fmt::format("{} index {} is outside 1..{}", what, word_at(word, piece.end), size));
    if (error != ScanError::none || (p < piece.end && !is_blank(*p) && *p != '\n'))
      return reject(piece, word, fmt::format("{} index '{}' is not an integer", what, word_at(word, piece.end)));
  }
  if (value < 1 || value > size)
    return reject(piece, word,
                  fmt::format("{} index {} is outside 1..{}{}", what, value, size,
                              value == 0 ? " (indices of this format begin at 1)" : ""));
  return true;
}

bool parse_value(Piece& piece, const char*& p, double& value) {
  while (p < piece.end && (*p == ' ' || *p == '\t')) ++p;
  const char* word = p;
  const auto [stop, code] = std::from_chars(p, piece.end, value);  // the common case
  if (code == std::errc() && stop < piece.end && (*stop == '\n' || *stop == ' ' || *stop == '\r') &&
      std::isfinite(value)) {
    p = stop;
    return true;
  }
  const ScanError error = scan_real(p, piece.end, value);
  if (error == ScanError::none && (p == piece.end || is_blank(*p) || *p == '\n')) return true;
  if (word == piece.end || *word == '\n' || *word == '\r') return reject(piece, word, "the line ends before the value");
  return reject(piece, word, fmt::format("value '{}' {}", word_at(word, piece.end), explain(error)));
}

bool parse_entry(Piece& piece, const char*& p, const MatrixMarketHeader& header, Entry& entry) {
  const char* line = p;
  if (!parse_index(piece, p, entry.row, header.rows, "row")) return false;
  if (!parse_index(piece, p, entry.col, header.cols, "column")) return false;
  if (!header.pattern && !parse_value(piece, p, entry.value)) return false;
  p = skip_blanks(p, piece.end);
  if (p < piece.end && *p != '\n' && *p != '%')
    return reject(piece, p,
                  fmt::format("'{}' follows the entry; one entry stands in a line{}", word_at(p, piece.end),
                              header.pattern ? ", and this file declares a pattern, without values" : ""));
  if (header.symmetry == Symmetry::skew && entry.row == entry.col && entry.value != 0)
    return reject(piece, line, "the diagonal of a skew-symmetric matrix is zero");
  return true;
}

void parse_piece(Piece& piece, const MatrixMarketHeader& header, RawEntries& raw) {
  const char* p = piece.begin;
  Offset k = piece.first;
  Entry entry;
  for (;;) {
    if (p == piece.end || static_cast<unsigned char>(*p - '0') >= 10) p = skip_to_data(p, piece.end);
    if (p == piece.end) break;
    if (!parse_entry(piece, p, header, entry)) return;
    raw.row[k] = static_cast<Index>(entry.row - 1);
    raw.col[k] = static_cast<Index>(entry.col - 1);
    if (!header.pattern) raw.value[k] = entry.value;
    ++k;
    piece.below |= entry.row > entry.col;
    piece.above |= entry.row < entry.col;
    p = p < piece.end && *p == '\n' ? p + 1 : end_of_line(p, piece.end);
  }
  piece.count = k - piece.first;
}

// Upper bounds of the numbers of entries; @returns their sum.
Offset count_lines(std::vector<Piece>& pieces, base::ThreadPool* pool) {
  for_each(pool, static_cast<std::int64_t>(pieces.size()), [&](std::int64_t i) {
    Piece& piece = pieces[static_cast<std::size_t>(i)];
    piece.lines = count_newlines(piece.begin, piece.end) + (piece.end[-1] == '\n' ? 0 : 1);
  });
  Offset total = 0;
  for (auto& piece : pieces) {
    piece.first = total;
    total += piece.lines;
  }
  return total;
}

// Closes the gaps that blank lines and comments left between the pieces.
void compact(const std::vector<Piece>& pieces, RawEntries& raw) {
  Offset to = 0;
  for (const auto& piece : pieces) {
    if (to != piece.first) {
      std::copy_n(raw.row.data() + piece.first, piece.count, raw.row.data() + to);
      std::copy_n(raw.col.data() + piece.first, piece.count, raw.col.data() + to);
      if (raw.value.size() > 0) std::copy_n(raw.value.data() + piece.first, piece.count, raw.value.data() + to);
    }
    to += piece.count;
    raw.below |= piece.below;
    raw.above |= piece.above;
  }
  raw.count = to;
}

}  // namespace

const char* locate_coordinate_entry(const Source& source, const MatrixMarketHeader& header, Offset k) {
  const char* end = source.text.data() + source.text.size();
  const char* p = skip_to_data(header.data, end);
  for (; k > 0 && p < end; --k) p = skip_to_data(end_of_line(p, end), end);
  return p;
}

RawEntries parse_coordinate_entries(const Source& source, const MatrixMarketHeader& header,
                                    const ReadOptions& options) {
  const char* end = source.text.data() + source.text.size();
  auto pieces = cut_lines<Piece>(header.data, end);
  const Offset lines = count_lines(pieces, options.pool);
  if (lines < header.count)
    fail_at(source, header.sizes,
            fmt::format("the size line promises {} entries, but only {} lines follow; the file is "
                        "truncated or its size line wrong",
                        header.count, lines));
  RawEntries raw;
  raw.rows = header.rows;
  raw.cols = header.cols;
  raw.symmetry = header.symmetry;
  raw.row = base::Buffer<Index>(lines, nullptr);
  raw.col = base::Buffer<Index>(lines, nullptr);
  if (!header.pattern) raw.value = base::Buffer<double>(lines, nullptr);
  for_each(options.pool, static_cast<std::int64_t>(pieces.size()),
           [&](std::int64_t i) { parse_piece(pieces[static_cast<std::size_t>(i)], header, raw); });
  for (const auto& piece : pieces)
    if (piece.error_at != nullptr) fail_at(source, piece.error_at, piece.error);
  compact(pieces, raw);
  if (raw.count < header.count)
    fail_at(
        source, end,
        fmt::format("the file ends after {} of the {} entries that its size line promises", raw.count, header.count));
  if (raw.count > header.count)
    fail_at(source, locate_coordinate_entry(source, header, header.count),
            fmt::format("this is entry {}, but the size line promises {}", header.count + 1, header.count));
  return raw;
}

}  // namespace espalier::matrix
