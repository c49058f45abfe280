#include "dynamics/model/robots/toml_writer.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace espalier::dynamics::model::robots {
namespace {

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Whether all of it is UTF-8, as TOML asks for (overlong forms and surrogates are not looked for).
bool is_utf8(std::string_view text) {
  int more = 0;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (more > 0 ? (byte & 0xc0U) != 0x80U : (byte & 0xc0U) == 0x80U || byte >= 0xf8U) return false;
    more = more > 0 ? more - 1 : byte >= 0xf0U ? 3 : byte >= 0xe0U ? 2 : byte >= 0xc0U ? 1 : 0;
  }
  return more == 0;
}

}  // namespace

std::string printable(std::string text) {
  const bool good = is_utf8(text);
  for (char& c : text)
    if ((c >= 0 && c < ' ') || c == 0x7f || (c < 0 && !good)) c = ' ';
  return text;
}

std::string number_text(double x) {
  char text[40];
  if (x == 0) return "0";
  const auto end = std::to_chars(text, text + sizeof(text), x).ptr;
  return {text, end};
}

std::string vector_text(const Vec3& x) {
  return "[" + number_text(x[0]) + ", " + number_text(x[1]) + ", " + number_text(x[2]) + "]";
}

std::string rotation_text(const Mat3& r) {
  const Eigen::Quaterniond q(r);
  return "{ quaternion = [" + number_text(q.w()) + ", " + number_text(q.x()) + ", " + number_text(q.y()) + ", " +
         number_text(q.z()) + "] }";
}

std::string in_quotes(std::string_view text) {
  std::string out = "\"";
  for (const char c : printable(std::string(text))) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

std::string Names::take(const std::string& wish, const std::string& suffix) {
  std::string name;
  for (const char c : wish) name += is_letter(c) || is_digit(c) || (dashes_ && c == '-') ? c : '_';
  name = fresh(std::move(name), suffix);
  if (!wish.empty() && name != wish) renamed_.push_back(printable(wish) + " (" + name + ")");
  return name;
}

std::string Names::fresh(std::string name, const std::string& suffix) {
  if (name.empty()) name = suffix.empty() ? "part" : suffix.substr(1);
  if (taken_.empty())
    for (const char* word : {"ground", "energy", "constraints", "step", "time", "inputs", "sensors"}) taken_[word] = 1;
  if (taken_.emplace(name, 1).second) return name;
  name += suffix;
  if (!suffix.empty() && taken_.emplace(name, 1).second) return name;
  for (int& k = ++taken_[name];; ++k)
    if (std::string numbered = name + "_" + std::to_string(k); taken_.emplace(numbered, 1).second) return numbered;
}

std::string Names::renamed() const {
  constexpr std::size_t kMost = 12;
  std::string text;
  for (std::size_t k = 0; k < renamed_.size() && k < kMost; ++k) text += (k > 0 ? ", " : "") + renamed_[k];
  if (renamed_.size() > kMost) text += " and " + std::to_string(renamed_.size() - kMost) + " more";
  return text;
}

std::string in_expression(const std::string& name, const std::string& quantity) {
  const bool plain = !name.empty() && is_letter(name.front()) &&
                     std::all_of(name.begin(), name.end(), [](char c) { return is_letter(c) || is_digit(c); });
  const std::string all = name + quantity;
  return plain ? all : "'" + all + "'";
}

std::string clamped(const std::string& x, double least, double largest) {
  std::string text = x;
  if (std::isfinite(least)) text = "max(" + text + ", " + number_text(least) + ")";
  if (std::isfinite(largest)) text = "min(" + text + ", " + number_text(largest) + ")";
  return text;
}

}  // namespace espalier::dynamics::model::robots
