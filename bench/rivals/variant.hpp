/// \file
/// Words after the colon of a rival's name: "hybrid=4096+deterministic".
#pragma once

#include <map>
#include <optional>
#include <string>

namespace espalier::bench {

/// The settings of one variant. Every rival names the words that it knows; others are refused.
class Variant {
 public:
  /// Splits `text` at plus signs and at the first equals sign of each part. Throws Failure(Outcome::failed) with the
  /// known words when a word is not in `known` (words separated by spaces).
  Variant(const std::string& text, const std::string& known);

  [[nodiscard]] bool has(const std::string& word) const { return settings_.count(word) != 0; }
  /// The text behind "word=", `fallback` where the word is absent.
  [[nodiscard]] std::string text(const std::string& word, const std::string& fallback = "") const;
  /// The number behind "word=". Throws Failure where it is not a whole number.
  [[nodiscard]] long long number(const std::string& word, long long fallback) const;

 private:
  std::map<std::string, std::string> settings_;
};

}  // namespace espalier::bench
