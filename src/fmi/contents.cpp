#include "fmi/contents.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "espalier/types.hpp"

namespace espalier::fmi {
namespace {

constexpr std::string_view kFirstLine = "espalier-fmu 1";

/// Texts with line ends and blanks as one word.
std::string word(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '%' || c == ' ' || c == '\n' || c == '\r') {
      out += fmt::format("%{:02x}", static_cast<unsigned char>(c));
    } else {
      out += c;
    }
  }
  return out.empty() ? "%" : out;
}

[[noreturn]] void damaged(std::string_view line) {
  throw Error(StatusCode::invalid_input,
              fmt::format("resources/espalier.txt of the FMU is damaged, or of another version: '{}'", line));
}

std::string text_of(std::string_view given) {
  std::string out;
  for (std::size_t k = 0; k < given.size(); ++k) {
    unsigned code = 0;
    if (given[k] == '%' && k + 2 < given.size() &&
        std::from_chars(given.data() + k + 1, given.data() + k + 3, code, 16).ec == std::errc()) {
      out += static_cast<char>(code);
      k += 2;
    } else if (given[k] != '%') {
      out += given[k];
    }
  }
  return out;
}

/// The words of a line, one after the other.
class Words {
 public:
  explicit Words(std::string_view line) : line_(line), rest_(line) {}
  std::string text() {
    if (rest_.empty()) damaged(line_);
    const std::size_t end = std::min(rest_.find(' '), rest_.size());
    std::string found = text_of(rest_.substr(0, end));
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    return found;
  }
  double number() {
    const std::string found = text();
    double value = 0;
    const auto [end, error] = std::from_chars(found.data(), found.data() + found.size(), value);
    if (error != std::errc() || end != found.data() + found.size()) damaged(line_);
    return value;
  }

 private:
  std::string_view line_, rest_;
};

}  // namespace

std::string to_text(const Contents& c) {
  std::string out = fmt::format("{}\ntoken {}\nmodel {}\nend {}\nadaptive {}\n", kFirstLine, word(c.token),
                                word(c.model), c.end, c.adaptive ? 1 : 0);
  for (const std::string& set : c.set) out += fmt::format("set {}\n", word(set));
  for (const Variable& v : c.variables)
    out += fmt::format("{} {} {} {}\n", row_of(v.kind).name, word(v.name), v.start, word(v.unit));
  for (const auto& [path, file] : c.files) out += fmt::format("file {} {}\n", word(path), word(file));
  return out;
}

const VariableKind& row_of(Variable::Kind kind) {
  return *std::find_if(std::begin(kVariableKinds), std::end(kVariableKinds),
                       [&](const auto& r) { return r.kind == kind; });
}

Contents parse_contents(std::string_view text) {
  Contents c;
  for (bool first = true; !text.empty(); first = false) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (first) {
      if (line != kFirstLine) damaged(line);
      continue;
    }
    Words words(line);
    const std::string key = words.text();
    if (key == "token") {
      c.token = words.text();
    } else if (key == "model") {
      c.model = words.text();
    } else if (key == "end") {
      c.end = words.number();
    } else if (key == "adaptive") {
      c.adaptive = words.number() != 0;
    } else if (key == "set") {
      c.set.push_back(words.text());
    } else if (key == "file") {
      std::string path = words.text();
      c.files.emplace_back(std::move(path), words.text());
    } else {
      const auto* const row = std::find_if(std::begin(kVariableKinds), std::end(kVariableKinds),
                                           [&](const auto& r) { return r.name == key; });
      if (row == std::end(kVariableKinds)) damaged(line);
      Variable v{row->kind, words.text(), 0, {}};
      v.start = words.number();
      v.unit = words.text();
      c.variables.push_back(std::move(v));
    }
  }
  if (c.variables.empty() || c.variables.front().kind != Variable::Kind::time || c.token.empty())
    damaged("the end of the file");
  return c;
}

}  // namespace espalier::fmi
