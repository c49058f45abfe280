// Makes the source of dynamics/page/parts.hpp: texts as they are, libraries compressed and as letters.
//   page_embed OUT --head FILES... --tail FILES... --libraries FILES...
// In the head and the tail a line `{{style}}` or `{{script}}` stands for the files .css or .js that follow.
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "dynamics/page/packed.hpp"

namespace {

std::string read(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) {
    std::cerr << "page_embed: cannot read '" << path << "'\n";
    std::exit(1);
  }
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

/// A string literal for C++, in lines.
std::string literal(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '\\' || c == '"')
      (out += '\\') += c;
    else if (c == '\n')
      out += "\\n\"\n\"";
    else if (c == '?')
      out += "\\?";  // no trigraphs
    else if (static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) > 0x7E) {
      const char* digits = "01234567";
      const auto byte = static_cast<unsigned char>(c);
      ((out += '\\') += digits[byte >> 6U]) += digits[(byte >> 3U) & 7U];
      out += digits[byte & 7U];
    } else
      out += c;
  }
  return out + "\"";
}

/// A function that returns the text in pieces: literals have a limit.
void write_function(std::ostream& out, const std::string& name, std::string_view text) {
  constexpr std::size_t kPiece = 15'000;
  out << "std::span<const std::string_view> " << name << "() {\n  static constexpr std::string_view kPieces[] = {\n";
  std::size_t pieces = 0;
  for (; !text.empty() || pieces == 0; ++pieces) {
    out << "std::string_view(" << literal(text.substr(0, kPiece)) << ", " << std::min(kPiece, text.size()) << "),\n";
    text.remove_prefix(std::min(kPiece, text.size()));
  }
  out << "  };\n  return kPieces;\n}\n\n";
}

/// The frame with its styles or scripts in place of the mark.
std::string joined(const std::vector<std::string>& files) {
  if (files.empty()) return {};
  std::string frame = read(files[0]), parts;
  for (std::size_t k = 1; k < files.size(); ++k) parts += read(files[k]);
  for (const std::string_view mark : {"{{style}}\n", "{{script}}\n"})
    if (const std::size_t place = frame.find(mark); place != std::string::npos)
      frame.replace(place, mark.size(), parts);
  return frame;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 1;
  std::map<std::string, std::vector<std::string>> files;
  std::string group;
  for (int k = 2; k < argc; ++k) {
    const std::string word = argv[k];
    if (word.starts_with("--"))
      group = word;
    else
      files[group].push_back(word);
  }
  std::string libraries;
  for (const std::string& file : files["--libraries"]) libraries += read(file) + "\n;\n";
  namespace page = espalier::dynamics::page;
  std::ofstream out(argv[1], std::ios::binary);
  out << "// Made by page_embed.\n#include \"dynamics/page/parts.hpp\"\n\nnamespace espalier::dynamics::page {\n\n";
  write_function(out, "page_head", joined(files["--head"]));
  write_function(out, "page_libraries", libraries.empty() ? "" : page::base64(page::compressed(libraries, 9)));
  write_function(out, "page_tail", joined(files["--tail"]));
  out << "}  // namespace espalier::dynamics::page\n";
  return out.flush() ? 0 : 1;
}
