#include "matrix/matrix_market_coordinate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <vector>

#include "base/parallel.hpp"
#include "matrix/text_blocks.hpp"

namespace espalier::matrix {

namespace {

// What was found in some lines.
struct CoordinateBlock : TextBlock {
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
  double imaginary = 0;
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

// What is wrong with the word at `p`, remembered in the block.
bool reject(CoordinateBlock& block, const char* at, std::string message) {
  block.error_at = at;
  block.error = std::move(message);
  return false;
}

bool parse_index(CoordinateBlock& block, const char*& p, std::int64_t& value, std::int64_t size, const char* what) {
  while (p < block.end && (*p == ' ' || *p == '\t')) ++p;
  const char* word = p;
  if (!scan_short_index(p, block.end, value)) {
    const ScanError error = scan_integer(p, block.end, value);
    if (word == block.end || *word == '\n' || *word == '\r')
      return reject(block, word, fmt::format("the line ends before the {} index", what));
    if (error == ScanError::too_large || (error == ScanError::none && value > size))
      return reject(block, word, fmt::format("{} index {} is outside 1..{}", what, word_at(word, block.end), size));
    if (error != ScanError::none || (p < block.end && !is_blank(*p) && *p != '\n'))
      return reject(block, word, fmt::format("{} index '{}' is not an integer", what, word_at(word, block.end)));
  }
  if (value < 1 || value > size)
    return reject(block, word,
                  fmt::format("{} index {} is outside 1..{}{}", what, value, size,
                              value == 0 ? " (indices of this format begin at 1)" : ""));
  return true;
}

bool parse_value(CoordinateBlock& block, const char*& p, double& value) {
  while (p < block.end && (*p == ' ' || *p == '\t')) ++p;
  const char* word = p;
  const auto [stop, code] = std::from_chars(p, block.end, value);  // the common case
  if (code == std::errc() && stop < block.end && (*stop == '\n' || *stop == ' ' || *stop == '\r') &&
      std::isfinite(value)) {
    p = stop;
    return true;
  }
  const ScanError error = scan_real(p, block.end, value);
  if (error == ScanError::none && (p == block.end || is_blank(*p) || *p == '\n')) return true;
  if (word == block.end || *word == '\n' || *word == '\r') return reject(block, word, "the line ends before the value");
  return reject(block, word, fmt::format("value '{}' {}", word_at(word, block.end), explain(error)));
}

bool parse_entry(CoordinateBlock& block, const char*& p, const MatrixMarketHeader& header, Entry& entry) {
  const char* line = p;
  if (!parse_index(block, p, entry.row, header.rows, "row")) return false;
  if (!parse_index(block, p, entry.col, header.cols, "column")) return false;
  if (!header.pattern && !parse_value(block, p, entry.value)) return false;
  if (header.complex && !parse_value(block, p, entry.imaginary)) return false;
  p = skip_blanks(p, block.end);
  if (p < block.end && *p != '\n' && *p != '%')
    return reject(block, p,
                  fmt::format("'{}' follows the entry; one entry stands in a line{}", word_at(p, block.end),
                              header.pattern ? ", and this file declares a pattern, without values" : ""));
  if (entry.row != entry.col) return true;
  if (header.symmetry == Symmetry::skew && (entry.value != 0 || entry.imaginary != 0))
    return reject(block, line, "the diagonal of a skew-symmetric matrix is zero");
  if (header.symmetry == Symmetry::hermitian && entry.imaginary != 0)
    return reject(block, line,
                  fmt::format("the diagonal of a hermitian matrix is real; entry ({}, {}) has the imaginary part {}",
                              entry.row, entry.col, entry.imaginary));
  return true;
}

void parse_block(CoordinateBlock& block, const MatrixMarketHeader& header, RawEntries& raw) {
  const char* p = block.begin;
  Offset k = block.first;
  Entry entry;
  for (;;) {
    if (p == block.end || static_cast<unsigned char>(*p - '0') >= 10) p = skip_to_data(p, block.end);
    if (p == block.end) break;
    if (!parse_entry(block, p, header, entry)) return;
    raw.row[k] = static_cast<Index>(entry.row - 1);
    raw.col[k] = static_cast<Index>(entry.col - 1);
    if (!header.pattern) raw.value[k] = entry.value;
    if (header.complex) raw.imaginary[k] = entry.imaginary;
    ++k;
    block.below |= entry.row > entry.col;
    block.above |= entry.row < entry.col;
    p = p < block.end && *p == '\n' ? p + 1 : end_of_line(p, block.end);
  }
  block.count = k - block.first;
}

// Upper bounds of the numbers of entries; @returns their sum.
Offset count_lines(std::vector<CoordinateBlock>& blocks, base::ThreadPool* pool) {
  base::for_each(pool, static_cast<std::int64_t>(blocks.size()), [&](std::int64_t i) {
    CoordinateBlock& block = blocks[static_cast<std::size_t>(i)];
    block.lines = count_newlines(block.begin, block.end) + (block.end[-1] == '\n' ? 0 : 1);
  });
  Offset total = 0;
  for (auto& block : blocks) {
    block.first = total;
    total += block.lines;
  }
  return total;
}

// Closes the gaps that blank lines and comments left between the blocks.
void compact(const std::vector<CoordinateBlock>& blocks, RawEntries& raw) {
  Offset to = 0;
  for (const auto& block : blocks) {
    if (to != block.first) {
      std::copy_n(raw.row.data() + block.first, block.count, raw.row.data() + to);
      std::copy_n(raw.col.data() + block.first, block.count, raw.col.data() + to);
      for (base::Buffer<double>* part : {&raw.value, &raw.imaginary})
        if (part->size() > 0) std::copy_n(part->data() + block.first, block.count, part->data() + to);
    }
    to += block.count;
    raw.below |= block.below;
    raw.above |= block.above;
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
  auto blocks = cut_lines<CoordinateBlock>(header.data, end);
  const Offset lines = count_lines(blocks, options.pool);
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
  if (header.complex) raw.imaginary = base::Buffer<double>(lines, nullptr);
  for_each(options.pool, static_cast<std::int64_t>(blocks.size()),
           [&](std::int64_t i) { parse_block(blocks[static_cast<std::size_t>(i)], header, raw); });
  for (const auto& block : blocks)
    if (block.error_at != nullptr) fail_at(source, block.error_at, block.error);
  compact(blocks, raw);
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
