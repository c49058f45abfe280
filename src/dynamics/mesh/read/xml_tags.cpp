#include "dynamics/mesh/read/xml_tags.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {
namespace {

constexpr std::string_view kBlank = " \t\r\n";

std::string_view name_at(std::string_view text) {
  return text.substr(0, std::min(text.find_first_of(" \t\r\n=/>"), text.size()));
}

}  // namespace

std::string_view XmlTags::Tag::get(std::string_view attribute) const {
  for (const auto& [key, value] : attributes)
    if (key == attribute) return value;
  return {};
}

std::size_t XmlTags::line() const {
  return 1 +
         static_cast<std::size_t>(std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(at_), '\n'));
}

void XmlTags::fail(const std::string& message) const {
  throw Error(StatusCode::invalid_input, fmt::format("{}:{}: {}", path_, line(), message));
}

std::string_view XmlTags::content() {
  const std::size_t end = std::min(text_.find('<', at_), text_.size());
  const std::string_view found = text_.substr(at_, end - at_);
  at_ = end;
  return found;
}

bool XmlTags::next(Tag& tag) {
  while (true) {
    static_cast<void>(content());
    if (at_ >= text_.size()) return false;
    const std::string_view from = text_.substr(at_);
    const std::string_view end = from.starts_with("<!--") ? "-->" : from.starts_with("<?") ? "?>" : ">";
    if (end == ">" && !from.starts_with("<!")) break;
    const std::size_t stop = from.find(end);
    if (stop == std::string_view::npos) fail("a comment or declaration does not end");
    at_ += stop + end.size();
  }
  ++at_;
  tag = {};
  std::string_view rest = text_.substr(at_);
  const std::size_t slash = rest.starts_with('/') ? 1 : 0;
  tag.name = rest.substr(0, slash + name_at(rest.substr(slash)).size());
  std::size_t k = tag.name.size();
  while (true) {
    k = std::min(rest.find_first_not_of(kBlank, k), rest.size());
    if (k == rest.size()) fail(fmt::format("the tag <{}> does not end", tag.name.substr(0, 40)));
    if (rest[k] == '>') break;
    if (rest[k] == '/') {
      tag.empty = true;
      ++k;
      continue;
    }
    const std::string_view name = name_at(rest.substr(k));
    k = std::min(rest.find_first_not_of(kBlank, k + name.size()), rest.size());
    if (name.empty() || k == rest.size() || rest[k] != '=')
      fail(fmt::format("the tag <{}> has an attribute without a value", tag.name.substr(0, 40)));
    k = std::min(rest.find_first_not_of(kBlank, k + 1), rest.size());
    const std::size_t close =
        k < rest.size() && (rest[k] == '"' || rest[k] == '\'') ? rest.find(rest[k], k + 1) : std::string_view::npos;
    if (close == std::string_view::npos)
      fail(fmt::format("the value of {} has no quotation marks", name.substr(0, 40)));
    tag.attributes.emplace_back(name, rest.substr(k + 1, close - k - 1));
    k = close + 1;
  }
  at_ += k + 1;
  return true;
}

}  // namespace espalier::dynamics
