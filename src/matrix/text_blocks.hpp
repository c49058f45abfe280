/// \file
/// A text in blocks of whole lines, which threads read side by side.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "base/at.hpp"
#include "matrix/text.hpp"

namespace espalier::matrix {

/// Some whole lines.
struct TextBlock {
  const char* begin = nullptr;
  const char* end = nullptr;
  const char* error_at = nullptr;  ///< set when the block is malformed there
  std::string error;
};

/// Blocks of 1 MiB: large enough that taking one costs nothing, small enough that a pool of 64 threads finds work in
/// 100 MB. @tparam Block  a TextBlock
template <class Block>
std::vector<Block> cut_lines(const char* begin, const char* end) {
  constexpr std::size_t kBlockBytes = std::size_t{1} << 20;
  std::vector<Block> blocks;
  while (begin < end) {
    const char* stop = end;
    if (at(end - begin) > kBlockBytes) stop = end_of_line(begin + kBlockBytes, end);
    if (stop < end) ++stop;
    Block& block = blocks.emplace_back();
    block.begin = begin;
    block.end = stop;
    begin = stop;
  }
  return blocks;
}

}  // namespace espalier::matrix
