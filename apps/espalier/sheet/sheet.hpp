/// \file
/// `--page`: what a command has found, as one HTML file that needs nothing beside itself.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace espalier::cli {

/// Parts of the page, made by CMake from this folder and from those of the page of a run.
extern const char* const kSheetFrame;
extern const char* const kSheetStyle;
extern const char* const kSheetScript;

/// An axis of a plot.
struct SheetAxis {
  std::string name;
  bool logarithmic = false;
};

/// The report of a command, all of it, with plots and pictures of it.
class Sheet {
 public:
  using Json = nlohmann::ordered_json;
  /// @param source  what was read: without its folders it is the title
  /// @param report  its members become cards and tables; exit_code and message say how it went
  Sheet(const std::string& source, Json report);
  /// A short line beside the title.
  void set_facts(std::string facts) { facts_ = std::move(facts); }
  /// @param style  "line", "dots" or "bars"
  void begin_plot(const std::string& title, const SheetAxis& x, const SheetAxis& y, const std::string& style);
  /// A series of the plot begun last; what is not finite is left out.
  void add_series(const std::string& name, const std::vector<double>& x, const std::vector<double>& y);
  /// `size` x `size` counts, row by row, 0 to 255. @param said  the picture in words
  void add_picture(const std::string& title, int size, const std::vector<unsigned char>& counts,
                   const std::string& said);
  void set_timeline(Json timeline) { timeline_ = std::move(timeline); }
  /// The page. Texts are data in it, never markup.
  [[nodiscard]] std::string text() const;
  /// @throws Error(invalid_input) where it cannot be written; what was there stays then
  void write(const std::string& path) const;

 private:
  std::string title_, facts_;
  Json report_, plots_ = Json::array(), pictures_ = Json::array(), timeline_;
};

/// Adds `--page[=FILE]`. @param file  becomes the name, `usual` where none is given; empty: no page
CLI::Option* add_page(CLI::App& command, std::string& file, const std::string& usual);

/// Writes a page, if there is a name for it, and says where it is. For the end of a command: what keeps it from being
/// written is a notice, and the rest is none the worse.
void write_page(const std::string& path, const Sheet& sheet, bool quiet);

}  // namespace espalier::cli
