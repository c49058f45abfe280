#include "matrix/matrix_market_array.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "matrix/line_pieces.hpp"
#include "matrix/parallel.hpp"

namespace espalier::matrix {

namespace {

// The numbers of some whole lines.
struct Piece : LinePiece {
  std::vector<double> numbers;
};

void parse_piece(Piece& piece) {
  const char* p = skip_to_data(piece.begin, piece.end);
  while (p < piece.end) {
    const char* word = p;
    double value = 0;
    const ScanError error = scan_real(p, piece.end, value);
    if (error != ScanError::none || (p < piece.end && !is_blank(*p) && *p != '\n')) {
      piece.error_at = word;
      piece.error = fmt::format("value '{}' {}", word_at(word, piece.end), explain(error));
      return;
    }
    piece.numbers.push_back(value);
    p = skip_to_data(p, piece.end);
  }
}

}  // namespace

std::vector<double> parse_array_numbers(const Source& source, const MatrixMarketHeader& header,
                                        const ReadOptions& options) {
  const char* end = source.text.data() + source.text.size();
  // Every number takes at least one character and all but the last a separator.
  const Offset most = (end - header.data + 1) / 2;
  if (header.count > most)
    fail_at(source, header.sizes,
            fmt::format("the size line promises {} numbers, but only {} characters follow; the file "
                        "is truncated or its size line wrong",
                        header.count, end - header.data));
  auto pieces = cut_lines<Piece>(header.data, end);
  for_each(options.pool, static_cast<std::int64_t>(pieces.size()),
           [&](std::int64_t i) { parse_piece(pieces[static_cast<std::size_t>(i)]); });
  for (const auto& piece : pieces)
    if (piece.error_at != nullptr) fail_at(source, piece.error_at, piece.error);
  std::vector<double> numbers;
  numbers.reserve(static_cast<std::size_t>(header.count));
  for (const auto& piece : pieces) {
    if (static_cast<Offset>(numbers.size() + piece.numbers.size()) > header.count)
      fail_at(source, piece.begin,
              fmt::format("more numbers than the {} that the size line promises stand here or below", header.count));
    numbers.insert(numbers.end(), piece.numbers.begin(), piece.numbers.end());
  }
  if (static_cast<Offset>(numbers.size()) < header.count)
    fail_at(source, end,
            fmt::format("the file ends after {} of the {} numbers that its size line promises", numbers.size(),
                        header.count));
  return numbers;
}

}  // namespace espalier::matrix
