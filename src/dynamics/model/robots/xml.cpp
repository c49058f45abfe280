#include "dynamics/model/robots/xml.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "espalier/types.hpp"

namespace espalier::dynamics::model::robots {
namespace {

constexpr int kDeepest = 200;  // of the largest public robots: 45

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == ','; }

}  // namespace

std::optional<std::vector<double>> numbers_of(std::string_view text) {
  std::vector<double> list;
  const char *at = text.data(), *end = text.data() + text.size();
  while (true) {
    while (at != end && is_blank(*at)) ++at;
    if (at == end) return list;
    if (*at == '+') ++at;
    double x = 0;
    const auto [next, error] = std::from_chars(at, end, x);
    if (error != std::errc{} || !std::isfinite(x) || (next != end && !is_blank(*next))) return std::nullopt;
    list.push_back(x);
    at = next;
  }
}

XmlFile::XmlFile(std::string name, std::string text)
    : name_(std::move(name)), text_(std::move(text)), document_(std::make_unique<pugi::xml_document>()) {
  lines_ = {0};
  for (std::size_t k = 0; k < text_.size(); ++k)
    if (text_[k] == '\n') lines_.push_back(k + 1);
  const pugi::xml_parse_result result = document_->load_buffer(text_.data(), text_.size());
  const auto at = static_cast<std::size_t>(std::max<std::ptrdiff_t>(result.offset, 0));
  const auto line = std::upper_bound(lines_.begin(), lines_.end(), at) - lines_.begin();
  if (!result)
    throw Error(StatusCode::invalid_input, name_ + ":" + std::to_string(line) + ": is no XML: " + result.description());
  if (root().empty()) throw Error(StatusCode::invalid_input, name_ + ": has no element");
  int depth = 0;
  for (pugi::xml_node node = root(); !node.empty();) {  // not by recursion, whose stack would end
    if (depth > kDeepest)
      throw Error(StatusCode::invalid_input, name_ + ":" + std::to_string(line_of(node)) +
                                                 ": elements are nested more than " + std::to_string(kDeepest) +
                                                 " deep");
    if (const pugi::xml_node inner = node.first_child(); !inner.empty()) {
      node = inner;
      ++depth;
      continue;
    }
    while (!node.empty() && node != root() && node.next_sibling().empty()) {
      node = node.parent();
      --depth;
    }
    if (node.empty() || node == root()) break;
    node = node.next_sibling();
  }
}

int XmlFile::line_of(const pugi::xml_node& node) const {
  const auto at = static_cast<std::size_t>(std::max<std::ptrdiff_t>(node.offset_debug(), 0));
  return static_cast<int>(std::upper_bound(lines_.begin(), lines_.end(), at) - lines_.begin());
}

std::string Element::where() const { return file->name() + ":" + std::to_string(file->line_of(node)); }

void Element::fail(const std::string& what) const {
  const std::string name = text("name");
  throw Error(StatusCode::invalid_input,
              where() + ": <" + std::string(tag()) + (name.empty() ? "" : " name=\"" + name + "\"") + ">: " + what);
}

std::string Element::need(const char* key) const {
  std::string value = text(key);
  if (value.empty()) fail(std::string("needs the attribute '") + key + "'");
  return value;
}

std::vector<Element> Element::children() const {
  std::vector<Element> list;
  for (const pugi::xml_node& inner : node.children())
    if (inner.type() == pugi::node_element) list.push_back({inner, file});
  return list;
}

std::vector<double> Element::numbers(const char* key, std::size_t least, std::size_t most) const {
  const auto list = numbers_of(node.attribute(key).value());
  if (!list) fail(std::string("'") + key + "' must be numbers, not '" + text(key).substr(0, 60) + "'");
  if (list->size() < least || list->size() > most)
    fail(std::string("'") + key + "' needs " + std::to_string(least) +
         (most == least ? ""
          : most < 100  ? " to " + std::to_string(most)
                        : " or more") +
         " numbers, not " + std::to_string(list->size()));
  return *list;
}

double Element::number(const char* key, double otherwise) const { return has(key) ? numbers(key, 1, 1)[0] : otherwise; }

Vec3 Element::vector(const char* key, const Vec3& otherwise) const {
  if (!has(key)) return otherwise;
  const std::vector<double> x = numbers(key, 3, 3);
  return {x[0], x[1], x[2]};
}

}  // namespace espalier::dynamics::model::robots
