#include "matrix/text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>

#include "base/at.hpp"
#include "base/strtod.hpp"

namespace espalier::matrix {

namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

// Characters that may stand in a number, letters of "inf" and "nan" included.
bool is_number_char(char c) {
  return is_digit(c) || c == '+' || c == '-' || c == '.' || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

// Reads [begin, end) of a word that from_chars found difficult: Fortran exponents, and values outside the range of
// normal numbers.
ScanError scan_difficult(const char* begin, const char* end, double& value) {
  std::string word(begin, end);
  const auto letter = word.find_first_of("dDqQ");
  if (letter != std::string::npos) word[letter] = 'e';
  if (word.find_first_of("xXpP") != std::string::npos) return ScanError::not_a_number;  // C's hexadecimal notation
  char* stop = nullptr;
  value = base::strtod(word.c_str(), &stop);
  if (word.empty() || *stop != '\0') return ScanError::not_a_number;
  if (std::isfinite(value)) return ScanError::none;
  const bool named = word.find_first_of("nN") != std::string::npos;  // "nan", "inf"
  return named ? ScanError::not_finite : ScanError::too_large;
}

}  // namespace

Offset count_newlines(const char* begin, const char* end) {
  constexpr std::uint64_t kOnes = 0x0101010101010101u, kLow = 0x7f7f7f7f7f7f7f7fu;
  constexpr int kMostWords = 255;  // so that no byte of `counts` overflows
  Offset total = 0;
  while (end - begin >= 8) {
    const int words = static_cast<int>(std::min<std::ptrdiff_t>(kMostWords, (end - begin) / 8));
    std::uint64_t counts = 0;
    for (int w = 0; w < words; ++w, begin += 8) {
      std::uint64_t x = 0;
      std::memcpy(&x, begin, 8);
      x ^= kOnes * '\n';                                    // zero bytes are newlines
      counts += ~((((x & kLow) + kLow) | x) >> 7) & kOnes;  // 1 in every zero byte
    }
    for (; counts != 0; counts >>= 8) total += static_cast<Offset>(counts & 0xff);
  }
  return total + std::count(begin, end, '\n');
}

Offset line_number(const Source& source, const char* position) {
  return 1 + count_newlines(source.text.data(), position);
}

void fail_at(const Source& source, const char* position, const std::string& message) {
  throw Error(StatusCode::invalid_input, fmt::format("{}:{}: {}", source.name, line_number(source, position), message));
}

void fail(const Source& source, const std::string& message) {
  throw Error(StatusCode::invalid_input, fmt::format("{}: {}", source.name, message));
}

const char* end_of_line(const char* p, const char* end) {
  if (p == end) return end;
  const void* newline = std::memchr(p, '\n', at(end - p));
  return newline == nullptr ? end : static_cast<const char*>(newline);
}

std::string word_at(const char* p, const char* end) {
  constexpr std::ptrdiff_t kLongest = 24;
  std::string word;
  for (const char* q = p; q < end && q - p < kLongest && !is_blank(*q) && *q != '\n'; ++q)
    word += *q > ' ' && *q < 127 ? *q : '?';
  return word;
}

ScanError scan_integer(const char*& p, const char* end, std::int64_t& value) {
  constexpr std::ptrdiff_t kMostDigits = 18;  // below 2^63
  const char* q = p;
  const bool negative = q < end && *q == '-';
  if (q < end && (*q == '-' || *q == '+')) ++q;
  const char* digits = q;
  std::int64_t v = 0;
  while (q < end && is_digit(*q)) {
    if (q - digits >= kMostDigits) return ScanError::too_large;
    v = 10 * v + (*q++ - '0');
  }
  if (q == digits) return ScanError::not_a_number;
  value = negative ? -v : v;
  p = q;
  return ScanError::none;
}

ScanError scan_real(const char*& p, const char* end, double& value) {
  const char* begin = p;
  if (begin < end && *begin == '+' && begin + 1 < end && *(begin + 1) != '-') ++begin;
  const auto [stop, error] = std::from_chars(begin, end, value);
  if (error == std::errc() && (stop == end || !is_number_char(*stop))) {
    p = stop;
    return std::isfinite(value) ? ScanError::none : ScanError::not_finite;
  }
  const char* last = begin;
  while (last < end && is_number_char(*last)) ++last;
  const ScanError difficult = scan_difficult(begin, last, value);
  if (difficult == ScanError::none) p = last;
  return difficult;
}

std::string explain(ScanError error) {
  switch (error) {
    case ScanError::too_large:
      return "is too large";
    case ScanError::not_finite:
      return "is not finite; a matrix with NaN or infinite entries cannot be solved";
    default:
      return "is not a number";
  }
}

std::string lower_case(std::string_view word) {
  std::string lower(word);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return lower;
}

}  // namespace espalier::matrix
