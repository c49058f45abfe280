#include "solver/session/transposed_text.hpp"

#include <array>
#include <cctype>
#include <utility>

namespace espalier::solver {

namespace {

bool is_letter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }

bool begins(std::string_view text, std::string_view with) { return text.substr(0, with.size()) == with; }

// The other one of a pair; the word itself where it is in none.
std::string_view other(std::string_view word, std::string_view rest) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 3> kPairs{
      {{"row", "column"}, {"rows", "columns"}, {"lower", "upper"}}};
  for (const auto& [one, two] : kPairs) {
    if (one == "lower" && !begins(rest, " triangle")) continue;
    if (word == one) return two;
    if (word == two) return one;
  }
  return word;
}

// "(3, 7)" at the beginning of `text` as "(7, 3)"; empty where something else stands there.
std::string turned(std::string_view text, std::size_t& length) {
  const std::size_t comma = text.find(", "), end = text.find(')');
  if (!begins(text, "(") || comma == text.npos || end == text.npos || comma > end) return {};
  const std::string_view row = text.substr(1, comma - 1), column = text.substr(comma + 2, end - comma - 2);
  for (const std::string_view number : {row, column})
    if (number.empty() || number.find_first_not_of("0123456789") != number.npos) return {};
  length = end + 1;
  return "(" + std::string(column) + ", " + std::string(row) + ")";
}

}  // namespace

std::string transposed_text(std::string_view message) {
  std::string out;
  while (!message.empty()) {
    std::size_t length = 0;
    while (length < message.size() && is_letter(message[length])) ++length;
    if (length == 0) {
      out += message.front();
      message.remove_prefix(1);
      continue;
    }
    const std::string_view word = message.substr(0, length);
    message.remove_prefix(length);
    out += other(word, message);
    std::size_t read = 0;
    if (word != "entry" || !begins(message, " ")) continue;
    if (const std::string entry = turned(message.substr(1), read); !entry.empty()) {
      out += " " + entry;
      message.remove_prefix(1 + read);
    }
  }
  return out;
}

}  // namespace espalier::solver
