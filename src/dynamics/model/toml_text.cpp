// The only source that knows the TOML library.
#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>

#include "dynamics/model/value.hpp"

namespace espalier::dynamics::model {
namespace {

class Converter {
 public:
  explicit Converter(std::string file) : file_(std::move(file)) {}

  Value convert(const toml::node& node, const std::string& path) const {
    Value value;
    value.place = {file_, static_cast<int>(node.source().begin.line), path};
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
        value.items.push_back(convert(*array->get(k), fmt::format("{}[{}]", path, k)));
    } else if (const auto* table = node.as_table()) {
      convert_table(*table, path, value);
    } else {
      fail(value.place, "dates and times have no meaning in a model; write a number or a text");
    }
    return value;
  }

 private:
  void convert_table(const toml::table& table, const std::string& path, Value& value) const {
    for (const auto& [key, node] : table) {
      const std::string name(key.str());
      Value entry = convert(node, path.empty() ? name : fmt::format("{}.{}", path, name));
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

}  // namespace

Value parse_toml(std::string_view text, const std::string& file) {
  try {
    return Converter(file).convert(toml::parse(text, std::string_view(file)), "");
  } catch (const toml::parse_error& error) {
    fail({file, static_cast<int>(error.source().begin.line), ""}, std::string(error.description()));
  }
}

}  // namespace espalier::dynamics::model
