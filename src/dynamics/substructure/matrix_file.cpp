#include "dynamics/substructure/matrix_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "dynamics/mesh/text_file.hpp"
#include "matrix/matrix_market.hpp"

namespace espalier::dynamics {
namespace {

FileMatrix from_matrix_market(const std::string& content, const std::string& path) {
  const SparseMatrix a = matrix::parse_matrix_market(content, path);
  if (std::max(a.rows, a.cols) > kMostSubstructureUnknowns)
    throw Error(StatusCode::invalid_input, fmt::format("{}: the matrix has {} rows and {} columns; at most {} are read",
                                                       path, a.rows, a.cols, kMostSubstructureUnknowns));
  FileMatrix matrix;
  matrix.rows = a.rows;
  matrix.columns = a.cols;
  for (Index c = 0; c < a.cols; ++c)
    for (Offset k = a.col_ptr[at(c)]; k < a.col_ptr[at(c) + 1]; ++k)
      matrix.entries.push_back({a.row_ind[at(k)], c, a.values[at(k)]});
  return matrix;
}

/// The first line that is no comment and no keyword begins with a number.
bool begins_with_number(std::string_view content) {
  while (!content.empty()) {
    const std::size_t end = content.find('\n');
    const std::string_view line = trim(content.substr(0, end));
    if (!line.empty() && !line.starts_with('*'))
      return line.front() == '-' || (line.front() >= '0' && line.front() <= '9');
    content.remove_prefix(end == std::string_view::npos ? content.size() : end + 1);
  }
  return false;
}

}  // namespace

std::vector<FileMatrix> read_file_matrices(const std::string& path) {
  std::string content = read_whole_file(path);
  if (matrix::is_matrix_market(content)) return {from_matrix_market(content, path)};
  if (is_output4(content)) return parse_output4(std::move(content), path);
  if (begins_with_number(content)) return parse_nodal_entries(std::move(content), path);
  std::vector<FileMatrix> all = parse_dmig(std::move(content), path);
  if (all.empty())
    throw Error(StatusCode::invalid_input,
                fmt::format("{}: no matrix found; files of OUTPUT4, DMIG cards, lines 'node, component, node, "
                            "component, value' and Matrix Market are read",
                            path));
  return all;
}

FileMatrix read_file_matrix(const std::string& path, const std::string& name) {
  std::vector<FileMatrix> all = read_file_matrices(path);
  if (name.empty() && all.size() == 1) return std::move(all.front());
  std::vector<std::string> names;
  for (FileMatrix& m : all) {
    if (!name.empty() && m.name == upper(name)) return std::move(m);
    names.push_back(m.name.empty() ? "one without a name" : "'" + m.name + "'");
  }
  throw Error(StatusCode::invalid_input,
              name.empty()
                  ? fmt::format("{}: say which matrix by 'name'; the file has {}", path, fmt::join(names, ", "))
                  : fmt::format("{}: has no matrix '{}'; it has {}", path, name, fmt::join(names, ", ")));
}

}  // namespace espalier::dynamics
