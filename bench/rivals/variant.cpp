#include "rivals/variant.hpp"

#include <sstream>

#include "rivals/rival.hpp"

namespace espalier::bench {

Variant::Variant(const std::string& text, const std::string& known) {
  std::istringstream parts(text);
  std::string part;
  while (std::getline(parts, part, '+')) {
    const std::size_t equals = part.find('=');
    const std::string word = part.substr(0, equals);
    if ((" " + known + " ").find(" " + word + " ") == std::string::npos)
      throw Failure(Outcome::failed, "unknown variant '" + word + "'; known: " + (known.empty() ? "none" : known));
    settings_[word] = equals == std::string::npos ? "" : part.substr(equals + 1);
  }
}

std::string Variant::text(const std::string& word, const std::string& fallback) const {
  const auto found = settings_.find(word);
  return found == settings_.end() ? fallback : found->second;
}

long long Variant::number(const std::string& word, long long fallback) const {
  const auto found = settings_.find(word);
  if (found == settings_.end()) return fallback;
  std::size_t used = 0;
  long long value = 0;
  try {
    value = std::stoll(found->second, &used);
  } catch (const std::logic_error&) {
    used = std::string::npos;
  }
  if (used != found->second.size())
    throw Failure(Outcome::failed, "variant " + word + "=" + found->second + " is not a whole number");
  return value;
}

}  // namespace espalier::bench
