/// \file
/// Tables of figures: for the terminal, for Markdown, and for the page that `espalier report` makes.
#pragma once

#include <limits>
#include <string>
#include <vector>

namespace espalier::measure {

/// What is shown, and the number by which the column sorts (NaN: as text).
struct Cell {
  std::string text;
  double value = std::numeric_limits<double>::quiet_NaN();
};

struct Column {
  std::string name;
  bool left = false;  ///< words stand left, numbers right
};

struct Line {
  std::string anchor;  ///< target of links to this line; empty: none
  std::vector<Cell> cells;
  bool failed = false;
  bool best = false;  ///< the fastest of its system
};

struct DataTable {
  std::string title;
  std::vector<Column> columns;
  std::vector<Line> lines = {};
  std::vector<std::string> notes = {};  ///< why rows have no figures
  bool aside = false;                   ///< for those who look for it: folded away
};

/// For a terminal: columns as wide as their widest cell; notes below, each on a line of its own.
std::string plain_text(const DataTable& table);

/// Text in one cell of Markdown: bars are escaped, lines joined.
std::string markdown_text(const std::string& text);

/// A table of Markdown with its notes as a list.
std::string markdown(const DataTable& table);

}  // namespace espalier::measure
