#include "matrix/fortran_format.hpp"

#include <algorithm>
#include <cmath>

namespace espalier::matrix {

namespace {

constexpr int kLargest = 1000;  // no line of a matrix file is longer

// The unsigned integer at the front of `text`, removed from it; -1 when there is none, kLargest when it is larger.
int take_number(std::string_view& text) {
  if (text.empty() || text[0] < '0' || text[0] > '9') return -1;
  int value = 0;
  while (!text.empty() && text[0] >= '0' && text[0] <= '9') {
    value = std::min(kLargest, 10 * value + (text[0] - '0'));
    text.remove_prefix(1);
  }
  return value;
}

bool take(std::string_view& text, char c) {
  if (text.empty() || text[0] != c) return false;
  text.remove_prefix(1);
  return true;
}

// "kP" or "kP," at the front, k possibly negative.
int take_scale(std::string_view& text) {
  std::string_view rest = text;
  const bool negative = take(rest, '-');
  if (!negative) take(rest, '+');
  const int scale = take_number(rest);
  if (scale < 0 || !take(rest, 'p')) return 0;
  take(rest, ',');
  text = rest;
  return negative ? -scale : scale;
}

// The repeat count at the front, 1 when there is none.
int take_repeat(std::string_view& text) {
  const int repeat = take_number(text);
  return repeat < 0 ? 1 : repeat;
}

// Without the blanks of `field`.
std::string squeeze(std::string_view field) {
  std::string word;
  std::copy_if(field.begin(), field.end(), std::back_inserter(word), [](char c) { return !is_blank(c); });
  return word;
}

// "0.25-100" (Fortran drops the letter of a three-digit exponent) becomes "0.25e-100".
void insert_exponent_letter(std::string& word) {
  for (std::size_t i = 1; i < word.size(); ++i)
    if ((word[i] == '+' || word[i] == '-') && ((word[i - 1] >= '0' && word[i - 1] <= '9') || word[i - 1] == '.')) {
      word.insert(i, 1, 'e');
      return;
    }
}

}  // namespace

std::optional<FortranFormat> parse_fortran_format(std::string_view text) {
  const std::string squeezed = lower_case(squeeze(text));
  std::string_view rest = squeezed;
  while (!rest.empty() && rest.back() == ')') rest.remove_suffix(1);
  (void)take(rest, '(');
  FortranFormat format;
  format.scale = take_scale(rest);
  format.per_line = take_repeat(rest);
  if (take(rest, '(')) {  // 3(1PE25.16)
    format.scale = take_scale(rest);
    format.per_line *= take_repeat(rest);
  }
  if (rest.empty()) return std::nullopt;
  const char letter = rest[0];
  rest.remove_prefix(1);
  format.real = letter == 'd' || letter == 'e' || letter == 'f' || letter == 'g';
  if (!format.real && letter != 'i') return std::nullopt;
  if (letter == 'e' && !take(rest, 's')) (void)take(rest, 'n');  // ES and EN read like E
  format.width = take_number(rest);
  if (take(rest, '.')) format.decimals = std::max(0, take_number(rest));
  if (format.real && take(rest, 'e')) (void)take_number(rest);
  const bool sane = rest.empty() && format.width > 0 && format.per_line > 0 && format.width < kLargest &&
                    format.per_line < kLargest && format.decimals < kLargest && std::abs(format.scale) < kLargest;
  return sane ? std::optional(format) : std::nullopt;
}

ScanError scan_field(std::string_view field, const FortranFormat& format, double& value) {
  std::string word = squeeze(field);
  value = 0;
  if (word.empty()) return ScanError::none;
  insert_exponent_letter(word);
  const bool exponent = word.find_first_of("eEdDqQ") != std::string::npos;
  const bool point = word.find('.') != std::string::npos;
  const char* p = word.data();
  const char* end = p + word.size();
  const ScanError error = scan_real(p, end, value);
  if (error != ScanError::none) return error;
  if (p != end) return ScanError::not_a_number;
  const int power = (point ? 0 : -format.decimals) - (exponent ? 0 : format.scale);
  if (power != 0) value *= std::pow(10.0, power);
  return std::isfinite(value) ? ScanError::none : ScanError::too_large;
}

ScanError scan_field(std::string_view field, std::int64_t& value) {
  const std::string word = squeeze(field);
  value = 0;
  if (word.empty()) return ScanError::none;
  const char* p = word.data();
  const char* end = p + word.size();
  const ScanError error = scan_integer(p, end, value);
  return error == ScanError::none && p != end ? ScanError::not_a_number : error;
}

}  // namespace espalier::matrix
