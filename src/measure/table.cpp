#include "measure/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>

namespace espalier::measure {

namespace {

// Characters of UTF-8 text: bytes that do not continue one.
std::size_t characters(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0U) != 0x80U; }));
}

std::string padded(const std::string& text, std::size_t width, bool left) {
  const std::string space(width - std::min(width, characters(text)), ' ');
  return left ? text + space : space + text;
}

}  // namespace

std::string plain_text(const DataTable& table) {
  std::vector<std::size_t> widths;
  for (const Column& column : table.columns) widths.push_back(characters(column.name));
  for (const Line& line : table.lines)
    for (std::size_t k = 0; k < line.cells.size(); ++k) widths[k] = std::max(widths[k], characters(line.cells[k].text));
  std::string out;
  const auto row = [&](auto&& text_of) {
    for (std::size_t k = 0; k < table.columns.size(); ++k)
      out += (k == 0 ? "" : "  ") + padded(text_of(k), widths[k], table.columns[k].left);
    out += '\n';
  };
  row([&](std::size_t k) { return table.columns[k].name; });
  for (const Line& line : table.lines) row([&](std::size_t k) { return line.cells[k].text; });
  for (const std::string& note : table.notes) out += "  " + note + '\n';
  return out;
}

std::string markdown_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '|') out += '\\';
    out += c == '\n' ? ' ' : c;
  }
  return out;
}

std::string markdown(const DataTable& table) {
  std::string out = "|", rule = "|";
  for (const Column& column : table.columns) {
    out += " " + column.name + " |";
    rule += column.left ? "---|" : "---:|";
  }
  out += "\n" + rule + "\n";
  for (const Line& line : table.lines) {
    out += "|";
    for (std::size_t k = 0; k < line.cells.size(); ++k) {
      const std::string anchor = k == 0 && !line.anchor.empty() ? fmt::format("<a id=\"{}\"></a>", line.anchor) : "";
      const char* strong = line.best && k > 0 && table.columns[k].name == "times best" ? "**" : "";
      out += fmt::format(" {}{}{}{} |", anchor, strong, markdown_text(line.cells[k].text), strong);
    }
    out += "\n";
  }
  for (const std::string& note : table.notes) out += "\n- " + markdown_text(note);
  return out + (table.notes.empty() ? "" : "\n");
}

}  // namespace espalier::measure
