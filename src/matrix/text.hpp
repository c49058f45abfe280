/// \file
/// Numbers in text, and errors that say where in which file.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "espalier/types.hpp"

namespace espalier::matrix {

/// A text in memory and the name under which messages speak of it.
struct Source {
  std::string name;       ///< usually a path
  std::string_view text;  ///< the whole text
};

/// Number of newlines in [begin, end); some 4 GB/s.
Offset count_newlines(const char* begin, const char* end);

/// 1-based number of the line that holds `position`, a pointer into (or to the end of) source.text.
Offset line_number(const Source& source, const char* position);

/// @throws Error(invalid_input) "name:line: message"
[[noreturn]] void fail_at(const Source& source, const char* position, const std::string& message);
/// @throws Error(invalid_input) "name: message"
[[noreturn]] void fail(const Source& source, const std::string& message);

/// Blanks that separate words within a line.
inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

/// Moves `p` over blanks, at most to `end`.
inline const char* skip_blanks(const char* p, const char* end) {
  while (p < end && is_blank(*p)) ++p;
  return p;
}

/// End of the line that `p` stands in: its newline, or `end`.
const char* end_of_line(const char* p, const char* end);

/// The word at `p` (up to a blank, a newline or 24 characters), for messages; unprintable characters become '?'.
std::string word_at(const char* p, const char* end);

/// How a number could not be read.
enum class ScanError { none, not_a_number, too_large, not_finite };

/// Reads digits (an optional sign before them) and moves `p` behind them. ScanError::too_large beyond 18 digits.
ScanError scan_integer(const char*& p, const char* end, std::int64_t& value);

/// Reads a decimal number, correctly rounded, and moves `p` behind it: C notation, an optional leading '+', and
/// Fortran's exponent letters d and D. Values below the smallest double become 0 or subnormal; NaN and infinity are
/// not_finite.
ScanError scan_real(const char*& p, const char* end, double& value);

/// "is not a number", "does not fit a double" ...: the end of a sentence that begins with the word.
std::string explain(ScanError error);

/// The whole of `word` as lower-case ASCII.
std::string lower_case(std::string_view word);

}  // namespace espalier::matrix
