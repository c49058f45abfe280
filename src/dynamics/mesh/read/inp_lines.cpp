#include "dynamics/mesh/read/inp_lines.hpp"

#include <fmt/format.h>

namespace espalier::dynamics {
namespace {

std::string without_blanks(std::string text) {
  std::erase_if(text, [](char c) { return c == ' ' || c == '\t'; });
  return text;
}

}  // namespace

std::string InpKeyword::get(const char* key) const {
  const auto found = parameters.find(key);
  return found == parameters.end() ? std::string() : found->second;
}

std::string InpKeyword::need(const LineReader& reader, const char* key) const {
  if (get(key).empty()) reader.fail(fmt::format("{} needs {}=", name, key));
  return get(key);
}

bool is_inp_comment(std::string_view line) {
  line = trim(line);
  return line.empty() || line.starts_with("**");
}

std::string inp_unquoted(std::string_view text) {
  text = trim(text);
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return std::string(text);
}

InpKeyword read_inp_keyword(LineReader& reader, std::string_view first) {
  std::string text(trim(first));
  std::string_view more;
  while (!text.empty() && text.back() == ',' && reader.next(more))
    if (!is_inp_comment(more)) text += trim(more);
  InpKeyword k;
  Fields fields(reader, text, ',');
  std::string_view field;
  for (bool head = true; fields.next(field); head = false) {
    if (field.empty()) continue;
    const std::size_t equal = field.find('=');
    const std::string key = without_blanks(upper(field.substr(0, equal)));
    if (head)
      k.name = key;
    else
      k.parameters[key] = equal == std::string_view::npos ? std::string() : inp_unquoted(field.substr(equal + 1));
  }
  return k;
}

bool next_inp_data(LineReader& reader, std::string_view& line) {
  while (reader.next(line)) {
    if (is_inp_comment(line)) continue;
    line = trim(line);
    if (line.front() != '*') return true;
    reader.back();
    return false;
  }
  return false;
}

int read_inp_reals(Fields& fields, double* values, int count) {
  int given = 0;
  std::string_view field;
  for (int i = 0; i < count; ++i) {
    Fields ahead = fields;
    values[i] = 0;
    if (!ahead.next(field)) continue;
    if (field.empty()) {
      fields = ahead;
      continue;
    }
    values[i] = fields.real("number");
    given = i + 1;
  }
  return given;
}

std::int64_t read_inp_integer(Fields& fields, const char* what, std::int64_t otherwise) {
  Fields ahead = fields;
  std::string_view field;
  if (ahead.next(field) && !field.empty()) return fields.integer(what);
  fields = ahead;
  return otherwise;
}

}  // namespace espalier::dynamics
