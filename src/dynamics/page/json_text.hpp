/// \file
/// JSON that may stand inside a page: no text of a model becomes markup or script.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace espalier::dynamics::page {

/// "text" with quotes. Markup characters are written as \u003c, bytes that are no UTF-8 as U+FFFD.
[[nodiscard]] std::string json_text(std::string_view text);
/// null for what is not finite.
[[nodiscard]] std::string json_number(double x, int digits = 17);

/// Collects the members of an object: {"name": value, ...}.
class JsonObject {
 public:
  JsonObject& raw(std::string_view name, std::string_view json);
  JsonObject& text(std::string_view name, std::string_view value) { return raw(name, json_text(value)); }
  JsonObject& number(std::string_view name, double value) { return raw(name, json_number(value)); }
  JsonObject& flag(std::string_view name, bool value) { return raw(name, value ? "true" : "false"); }
  [[nodiscard]] std::string done() const { return "{" + members_ + "}"; }

 private:
  std::string members_;
};

[[nodiscard]] std::string json_list(const std::vector<std::string>& values);  ///< of values that are JSON
[[nodiscard]] std::string json_texts(const std::vector<std::string>& texts);
[[nodiscard]] std::string json_numbers(std::span<const double> numbers, int digits = 17);

}  // namespace espalier::dynamics::page
