// The only source that knows the TOML library.
#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>

#include "dynamics/mesh/read/formats.hpp"
#include "dynamics/model/read/value.hpp"

namespace espalier::dynamics::model {
namespace {

/// Passes over a string that begins at `at` with a quote; counts its lines. @return the place behind it
std::size_t behind_string(std::string_view text, std::size_t at, int& line) {
  const char quote = text[at];
  const std::string_view three = text.substr(at, 3);
  const bool long_one = three == "\"\"\"" || three == "\'\'\'";
  for (at += long_one ? 3 : 1; at < text.size(); ++at) {
    if (text[at] == '\\' && quote == '"') {
      ++at;
    } else if (text[at] == '\n') {
      ++line;
      if (!long_one) return at;  // the library will say that it does not end
    } else if (long_one ? text.substr(at, 3) == three : text[at] == quote) {
      return at + (long_one ? 3 : 1);
    }
  }
  return text.size();
}

/// The library nests a table for every dot of a key, and takes them apart by recursion: a key of 100,000 parts would
/// end the program. @throws Error(invalid_input) for a key that is too long or has too many parts
void check_keys(std::string_view text, const std::string& file) {
  std::size_t begin = 0, parts = 1;  // of the key or value that stands here
  int line = 1;
  for (std::size_t at = 0; at < text.size();) {
    const char c = text[at];
    if (c == '"' || c == '\'') {
      at = begin = behind_string(text, at, line);
      continue;
    }
    if (c == '#') {
      at = std::min(text.find('\n', at), text.size());
      continue;
    }
    if (c == '\n') ++line;
    if (c == '.') ++parts;
    if (std::string_view(" \t\r\n=[]{},").find(c) != std::string_view::npos) begin = at + 1;
    if (std::string_view("\n=[]{},").find(c) != std::string_view::npos) parts = 1;
    if (at >= begin + kLongestKey || parts > kMostKeyParts)
      fail({file, line, ""}, fmt::format("\"{}\" is longer than {} characters or {} parts: no key, and no value",
                                         excerpt(text.substr(begin, at - begin)), kLongestKey, kMostKeyParts));
    ++at;
  }
}

class Converter {
 public:
  explicit Converter(std::string file) : file_(std::move(file)) {}

  Value convert(const toml::node& node, const std::string& path, int depth = 0) const {
    constexpr int kDeepest = 200;
    Value value;
    value.place = {file_, static_cast<int>(node.source().begin.line), path};
    if (depth > kDeepest) fail({file_, value.place.line, excerpt(path)}, "lists and tables are nested too deeply");
    if (const auto* boolean = node.as_boolean()) {
      value.type = Value::Type::boolean;
      value.boolean = boolean->get();
    } else if (const auto* integer = node.as_integer()) {
      value.type = Value::Type::integer;
      value.integer = integer->get();
      value.real = static_cast<double>(value.integer);
    } else if (const auto* real = node.as_floating_point()) {
      value.type = Value::Type::real;
      value.real = real->get();
    } else if (const auto* text = node.as_string()) {
      value.type = Value::Type::text;
      value.text = text->get();
    } else if (const auto* array = node.as_array()) {
      value.type = Value::Type::array;
      for (std::size_t k = 0; k < array->size(); ++k)
        value.items.push_back(convert(*array->get(k), fmt::format("{}[{}]", path, k), depth + 1));
    } else if (const auto* table = node.as_table()) {
      convert_table(*table, path, value, depth);
    } else {
      fail(value.place, "dates and times have no meaning in a model; write a number or a text");
    }
    return value;
  }

 private:
  void convert_table(const toml::table& table, const std::string& path, Value& value, int depth) const {
    for (const auto& [key, node] : table) {
      const std::string name(key.str());
      Value entry = convert(node, path.empty() ? name : fmt::format("{}.{}", path, name), depth + 1);
      // A super-table that the text never opens stands where its first key does.
      if (entry.place.line == 0) entry.place.line = static_cast<int>(key.source().begin.line);
      value.entries.emplace_back(name, std::move(entry));
    }
    // The library sorts keys; messages and numbering follow the text.
    std::stable_sort(value.entries.begin(), value.entries.end(),
                     [](const auto& a, const auto& b) { return a.second.place.line < b.second.place.line; });
  }

  std::string file_;
};

/// @throws Error saying what to do with a mesh file, where `file` is one
void refuse_mesh(const std::string& file) {
  if (const std::string advice = mesh_is_no_model(file); !advice.empty())
    throw Error(StatusCode::invalid_input, advice);
}

/// toml++ says of a number for which it has no memory that it is none: only what fails twice is a mistake. It would end
/// the process where it has none for the name of a file.
toml::table parsed(std::string_view text) {
  try {
    return toml::parse(text);
  } catch (const toml::parse_error&) {
    return toml::parse(text);
  }
}

}  // namespace

Value parse_toml(std::string_view text, const std::string& file) {
  try {
    check_keys(text, file);
    return Converter(file).convert(parsed(text), "");
  } catch (const Error&) {
    refuse_mesh(file);
    throw;
  } catch (const toml::parse_error& error) {
    refuse_mesh(file);
    fail({file, static_cast<int>(error.source().begin.line), ""}, std::string(error.description()));
  }
}

}  // namespace espalier::dynamics::model
