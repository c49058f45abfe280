#include "sheet/sheet.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "base/output_file.hpp"
#include "command.hpp"
#include "common/terminal.hpp"

namespace espalier::cli {

namespace {

using SheetJson = nlohmann::ordered_json;

SheetJson finite_numbers(const std::vector<double>& values) {
  SheetJson list = SheetJson::array();
  for (const double v : values) list.push_back(std::isfinite(v) ? SheetJson(v) : SheetJson());
  return list;
}

std::string letters_of(const std::vector<unsigned char>& bytes) {  // base64
  constexpr std::string_view kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    const std::size_t left = bytes.size() - k;
    const unsigned word = bytes[k] << 16U | (left > 1 ? bytes[k + 1] << 8U : 0U) | (left > 2 ? bytes[k + 2] : 0U);
    for (unsigned p = 0; p < 4; ++p) text += p <= left ? kLetters[word >> (18 - 6 * p) & 63U] : '=';
  }
  return text;
}

/// JSON that may stand inside a page: these letters occur in its strings alone.
std::string without_markup(const std::string& json) {
  std::string text;
  for (const char c : json) {
    if (c == '<' || c == '>' || c == '&' || c == '\'')
      text += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    else
      text += c;
  }
  return text;
}

std::array<std::string, 2> state_words(int exit_code) {
  switch (exit_code) {
    case kSolved:
      return {"done", "good"};
    case kInterrupted:
      return {"stopped", "warn"};
    case kAccuracy:
      return {"accuracy not reached", "warn"};
    default:
      return {"failed", "bad"};
  }
}

}  // namespace

Sheet::Sheet(const std::string& source, Json report)
    : title_(source.substr(source.find_last_of('/') + 1)), report_(std::move(report)) {}

void Sheet::begin_plot(const std::string& title, const SheetAxis& x, const SheetAxis& y, const std::string& style) {
  const auto axis = [](const SheetAxis& a) { return Json{{"name", a.name}, {"log", a.logarithmic}}; };
  plots_.push_back({{"title", title}, {"x", axis(x)}, {"y", axis(y)}, {"style", style}, {"series", Json::array()}});
}

void Sheet::add_series(const std::string& name, const std::vector<double>& x, const std::vector<double>& y) {
  plots_.back()["series"].push_back({{"name", name}, {"x", finite_numbers(x)}, {"y", finite_numbers(y)}});
}

void Sheet::add_picture(const std::string& title, int size, const std::vector<unsigned char>& counts,
                        const std::string& said) {
  pictures_.push_back({{"title", title}, {"size", size}, {"cells", letters_of(counts)}, {"said", said}});
}

std::string Sheet::text() const {
  const Json data = {{"title", title_},  {"facts", facts_},       {"state", state_words(report_.at("exit_code"))},
                     {"plots", plots_},  {"pictures", pictures_}, {"timeline", timeline_},
                     {"report", report_}};
  std::string page = kSheetFrame;
  const std::pair<std::string_view, std::string> parts[] = {
      {"{{style}}", kSheetStyle},
      {"{{script}}", kSheetScript},
      {"{{data}}", without_markup(data.dump(-1, ' ', false, Json::error_handler_t::replace))}};
  for (const auto& [mark, part] : parts) page.replace(page.find(mark), mark.size(), part);
  return page;
}

void Sheet::write(const std::string& path) const {
  base::OutputFile file(path);
  file.write(text());
  file.commit();
}

CLI::Option* add_page(CLI::App& command, std::string& file, const std::string& usual) {
  return command
      .add_flag(fmt::format("--page{{{}}}", usual), file, "write a page to look at, to " + usual + " or =FILE")
      ->type_name("[=FILE]");
}

void write_page(const std::string& path, const Sheet& sheet, bool quiet) {
  if (path.empty()) return;
  try {
    sheet.write(path);
    if (!quiet) print_note("page: {} (espalier view {})\n", path, path);
  } catch (const Error& error) {
    print_note("espalier: the page could not be written: {}\n", error.what());
  }
}

}  // namespace espalier::cli
