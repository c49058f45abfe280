// Matrices whose unknowns are components of nodes: DMIG cards, and lines of node, component, node, component, value.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "dynamics/mesh/nastran_cards.hpp"
#include "dynamics/substructure/matrix_file.hpp"

namespace espalier::dynamics {
namespace {

struct NodalEntry {
  NodalUnknown row, column;
  double value = 0;
};

/// Counts the unknowns of a matrix, rising.
FileMatrix counted(std::string name, const std::vector<NodalEntry>& entries, const std::string& path) {
  std::set<NodalUnknown> all;
  for (const NodalEntry& e : entries) all.insert({e.row, e.column});
  FileMatrix matrix;
  matrix.name = std::move(name);
  matrix.unknowns.assign(all.begin(), all.end());
  if (all.size() > at(kMostSubstructureUnknowns))
    throw Error(StatusCode::invalid_input, fmt::format("{}: matrix '{}' has {} unknowns; at most {} are read", path,
                                                       matrix.name, all.size(), kMostSubstructureUnknowns));
  matrix.rows = matrix.columns = static_cast<Index>(all.size());
  const auto number = [&](const NodalUnknown& u) {
    return static_cast<Index>(std::lower_bound(matrix.unknowns.begin(), matrix.unknowns.end(), u) -
                              matrix.unknowns.begin());
  };
  for (const NodalEntry& e : entries) matrix.entries.push_back({number(e.row), number(e.column), e.value});
  return matrix;
}

/// Node and component in fields k and k + 1; a scalar point has no component.
NodalUnknown unknown_in(const NastranCard& card, std::size_t k) {
  return {card.integer(k, "node"), static_cast<int>(card.integer(k + 1, "component", 0))};
}

/// The head of a card DMIG: its first one says what the matrix is, the others hold a column each.
void check_head(const NastranCard& card, const std::string& name) {
  const std::int64_t form = card.integer(2, "form"), type = card.integer(3, "type of values");
  if (form != 1 && form != 6)
    card.fail(fmt::format("matrix '{}' has the form {}; only square (1) and symmetric (6) ones are read", name, form));
  if (type != 1 && type != 2)
    card.fail(fmt::format("matrix '{}' is complex (type {}); only real matrices are read", name, type));
}

}  // namespace

std::vector<FileMatrix> parse_dmig(std::string content, const std::string& path) {
  NastranCards cards(std::move(content), path);
  NastranCard card;
  std::vector<std::string> order;
  std::map<std::string, std::vector<NodalEntry>> all;
  while (cards.next(card)) {
    if (card.name != "DMIG") continue;
    const std::string name = upper(card.field(0));
    if (name.empty()) card.fail("field 2 (name) is empty");
    if (card.field(1) == "0") {
      check_head(card, name);
      if (!all.contains(name)) order.push_back(name);
      all[name];
      continue;
    }
    const auto found = all.find(name);
    if (found == all.end()) card.fail(fmt::format("a column of matrix '{}' before the card that begins it", name));
    const NodalUnknown column = unknown_in(card, 1);
    for (std::size_t k = 4; k < card.fields.size(); k += 4) {
      if (card.field(k).empty() && card.field(k + 1).empty() && card.field(k + 2).empty()) continue;
      found->second.push_back({unknown_in(card, k), column, card.real(k + 2, "value")});
    }
  }
  std::vector<FileMatrix> matrices;
  for (const std::string& name : order) matrices.push_back(counted(name, all[name], path));
  return matrices;
}

std::vector<FileMatrix> parse_nodal_entries(std::string content, const std::string& path) {
  LineReader lines(path, std::move(content));
  std::vector<NodalEntry> entries;
  std::string_view line;
  while (lines.next(line)) {
    const std::string_view text = trim(line);
    if (text.empty() || text.starts_with('*')) continue;  // comments and keywords
    Fields fields(lines, text, text.find(',') == std::string_view::npos ? ' ' : ',');
    NodalEntry e;
    e.row.node = fields.integer("node of the row");
    e.row.component = static_cast<int>(fields.integer("component of the row"));
    e.column.node = fields.integer("node of the column");
    e.column.component = static_cast<int>(fields.integer("component of the column"));
    e.value = fields.real("value");
    std::string_view more;
    if (fields.next(more) && !more.empty()) lines.fail("more than node, component, node, component, value");
    entries.push_back(e);
  }
  return {counted("", entries, path)};
}

std::vector<GridPoint> read_grid_points(const std::string& path) {
  NastranCards cards(read_whole_file(path), path);
  NastranCard card;
  std::vector<GridPoint> points;
  while (cards.next(card)) {
    if (card.name != "GRID") continue;
    for (const std::size_t k : {std::size_t{1}, std::size_t{5}})
      if (card.integer(k, "coordinate system", 0) != 0)
        card.fail("stands in a coordinate system of its own; nodes of substructures must be in the basic one");
    points.push_back({card.integer(0, "label"), {card.real(2, "x", 0), card.real(3, "y", 0), card.real(4, "z", 0)}});
  }
  if (points.empty()) throw Error(StatusCode::invalid_input, fmt::format("{}: the file has no GRID cards", path));
  return points;
}

}  // namespace espalier::dynamics
