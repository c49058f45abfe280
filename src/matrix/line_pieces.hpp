/// \file
/// A text in pieces of whole lines, which threads read side by side.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "matrix/text.hpp"

namespace espalier::matrix {

/// Some whole lines.
struct LinePiece {
  const char* begin = nullptr;
  const char* end = nullptr;
  const char* error_at = nullptr;  ///< set when the piece is malformed there
  std::string error;
};

/// Pieces of 1 MiB: large enough that taking one costs nothing, small enough that a pool of 64 threads finds work in
/// 100 MB. @tparam Piece  a LinePiece
template <class Piece>
std::vector<Piece> cut_lines(const char* begin, const char* end) {
  constexpr std::size_t kPieceBytes = std::size_t{1} << 20;
  std::vector<Piece> pieces;
  while (begin < end) {
    const char* stop = end;
    if (static_cast<std::size_t>(end - begin) > kPieceBytes) stop = end_of_line(begin + kPieceBytes, end);
    if (stop < end) ++stop;
    Piece& piece = pieces.emplace_back();
    piece.begin = begin;
    piece.end = stop;
    begin = stop;
  }
  return pieces;
}

}  // namespace espalier::matrix
