#include <algorithm>

#include "dynamics/model/check/part_keys.hpp"

namespace espalier::dynamics::model {
namespace {

void add_words(std::string_view words, std::vector<std::string>& out) {
  while (!words.empty()) {
    const std::size_t end = std::min(words.find(' '), words.size());
    out.emplace_back(words.substr(0, end));
    words.remove_prefix(std::min(end + 1, words.size()));
  }
}

}  // namespace

void refuse_unknown_keys(std::string_view section, const Value& part) {
  if (!part.is_table()) return;
  const Value* type = part.find(section == "surfaces" ? "shape" : "type");
  const std::string_view kind = type != nullptr ? std::string_view(type->text) : std::string_view();
  std::vector<std::string> known;
  for (const PartKeys& row : all_part_keys())
    if (row.section == section && (row.type.empty() || row.type == kind)) add_words(row.keys, known);
  if (known.empty()) return;
  for (const auto& [key, value] : part.entries)
    if (std::find(known.begin(), known.end(), key) == known.end())
      fail(value.place, "unknown key" + suggestion(key, known));
}

void refuse_unknown_sections(const Value& root) {
  refuse_unknown_keys("", root);
  for (const char* section : {"integrator", "statics", "initial", "harmonic", "output"})
    if (const Value* table = root.find(section); table != nullptr) refuse_unknown_keys(section, *table);
}

}  // namespace espalier::dynamics::model
