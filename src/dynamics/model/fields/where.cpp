// What stands in the brackets of a quantity.
#include <fmt/format.h>

#include <charconv>

#include "base/text_stream.hpp"
#include "dynamics/model/fields/sites.hpp"

namespace espalier::dynamics::model {
namespace {

[[noreturn]] void not_a_place(const std::string& text) {
  throw std::invalid_argument(
      fmt::format("[{}] is no place on a body: write [node 12], [element 7], [x y z] (a point of the material, in the "
                  "coordinates of the mesh), [SET], or [face SET], [nodes SET], [elements SET]; for shells with top, "
                  "middle or bottom behind it",
                  text));
}

template <class Number>
std::optional<Number> number_in(const std::string& word) {
  Number value{};
  const char* end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

}  // namespace

Where read_where(const std::string& text) {
  std::string spaced = text;
  for (char& c : spaced)
    if (c == ',') c = ' ';
  base::TextReader in(spaced);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  Where where;
  if (words.size() > 0)
    for (const auto& [name, side] : {std::pair{"bottom", -1.0}, std::pair{"middle", 0.0}, std::pair{"top", 1.0}})
      if (words.back() == name && !where.side) where.side = side;
  if (where.side) words.pop_back();
  if (words.empty()) {
    if (!where.side) not_a_place(text);
    return where;
  }
  const auto named = [&](const char* word, Where::Kind kind) {
    if (words.size() != 2 || words[0] != word) return false;
    where.kind = kind;
    where.set = words[1];
    return true;
  };
  if (named("node", Where::Kind::node) || named("element", Where::Kind::element)) {
    const auto label = number_in<std::int64_t>(where.set);
    if (!label) not_a_place(text);
    where.label = *label;
    return where;
  }
  if (named("face", Where::Kind::faces) || named("nodes", Where::Kind::nodes) ||
      named("elements", Where::Kind::elements))
    return where;
  if (words.size() == 3) {
    where.kind = Where::Kind::point;
    for (int i = 0; i < 3; ++i) {
      const auto x = number_in<double>(words[at(i)]);
      if (!x) not_a_place(text);
      where.point[i] = *x;
    }
    return where;
  }
  if (words.size() != 1) not_a_place(text);
  where.kind = Where::Kind::set;
  where.set = words[0];
  return where;
}

}  // namespace espalier::dynamics::model
