/// \file
/// Tables of results, the same for the page and for Markdown.
#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "evidence/results.hpp"

namespace espalier::cli::evidence {

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

/// The tables of one file, the main one first.
std::vector<DataTable> tables_of(const Results& results);

/// Share of the machine's dense product that the refactorization reaches, and of its memory bandwidth that the solve
/// reaches (every entry of the factor is read twice). NaN where something is not known.
double share_of_product(const Results& results, const Json& row);
double share_of_bandwidth(const Results& results, const Json& row);

}  // namespace espalier::cli::evidence
