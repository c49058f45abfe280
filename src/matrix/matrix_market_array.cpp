#include "matrix/matrix_market_array.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/parallel.hpp"
#include "matrix/text_blocks.hpp"

namespace espalier::matrix {

namespace {

// The numbers of some whole lines.
struct ArrayBlock : TextBlock {
  std::vector<double> numbers;
};

void parse_block(ArrayBlock& block) {
  const char* p = skip_to_data(block.begin, block.end);
  while (p < block.end) {
    const char* word = p;
    double value = 0;
    const ScanError error = scan_real(p, block.end, value);
    if (error != ScanError::none || (p < block.end && !is_blank(*p) && *p != '\n')) {
      block.error_at = word;
      block.error = fmt::format("value '{}' {}", word_at(word, block.end), explain(error));
      return;
    }
    block.numbers.push_back(value);
    p = skip_to_data(p, block.end);
  }
}

}  // namespace

std::vector<double> parse_array_numbers(const Source& source, const MatrixMarketHeader& header,
                                        const ReadOptions& options) {
  const char* end = source.text.data() + source.text.size();
  // Every number takes at least one character and all but the last a separator.
  const Offset most = (end - header.data + 1) / 2;
  if (header.numbers() > most)
    fail_at(source, header.sizes,
            fmt::format("the size line promises {} numbers, but only {} characters follow; the file "
                        "is truncated or its size line wrong",
                        header.numbers(), end - header.data));
  auto blocks = cut_lines<ArrayBlock>(header.data, end);
  for_each(options.pool, static_cast<std::int64_t>(blocks.size()), [&](std::int64_t i) { parse_block(blocks[at(i)]); });
  for (const auto& block : blocks)
    if (block.error_at != nullptr) fail_at(source, block.error_at, block.error);
  std::vector<double> numbers;
  numbers.reserve(at(header.numbers()));
  for (const auto& block : blocks) {
    if (static_cast<Offset>(numbers.size() + block.numbers.size()) > header.numbers())
      fail_at(
          source, block.begin,
          fmt::format("more numbers than the {} that the size line promises stand here or below", header.numbers()));
    numbers.insert(numbers.end(), block.numbers.begin(), block.numbers.end());
  }
  if (static_cast<Offset>(numbers.size()) < header.numbers())
    fail_at(source, end,
            fmt::format("the file ends after {} of the {} numbers that its size line promises", numbers.size(),
                        header.numbers()));
  return numbers;
}

}  // namespace espalier::matrix
