#include "dynamics/model/robots/toml_writer.hpp"

#include <algorithm>
#include <charconv>

namespace espalier::dynamics::model::robots {
namespace {

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

}  // namespace

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
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c >= 0 && c < ' ' ? ' ' : c;
  }
  return out + "\"";
}

std::string Names::take(const std::string& wish, const std::string& suffix) {
  std::string name;
  for (const char c : wish) name += is_letter(c) || is_digit(c) || c == '-' ? c : '_';
  if (name.empty()) name = suffix.empty() ? "part" : suffix.substr(1);
  if (taken_.empty())
    for (const char* word : {"ground", "energy", "constraints", "step", "time", "inputs", "sensors"}) taken_[word] = 1;
  if (taken_.emplace(name, 1).second) return name;
  name += suffix;
  if (!suffix.empty() && taken_.emplace(name, 1).second) return name;
  for (int& k = ++taken_[name];; ++k)
    if (const std::string numbered = name + "_" + std::to_string(k); taken_.emplace(numbered, 1).second)
      return numbered;
}

std::string in_expression(const std::string& name, const std::string& quantity) {
  const bool plain = !name.empty() && is_letter(name.front()) &&
                     std::all_of(name.begin(), name.end(), [](char c) { return is_letter(c) || is_digit(c); });
  const std::string all = name + quantity;
  return plain ? all : "'" + all + "'";
}

}  // namespace espalier::dynamics::model::robots
