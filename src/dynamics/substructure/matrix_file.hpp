/// \file
/// Matrices of substructures out of files that finite element programs write.
#pragma once

#include <compare>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// One unknown of a finite element model.
struct NodalUnknown {
  std::int64_t node = 0;  ///< label of the node
  int component = 0;      ///< 1 to 3: displacement along x, y, z; 4 to 6: rotation about them; else: a scalar
  auto operator<=>(const NodalUnknown&) const = default;
};

/// A matrix as it stands in a file.
struct FileMatrix {
  struct Entry {
    Index row = 0, column = 0;  ///< from 0; of `unknowns` where there are any
    double value = 0;
  };
  std::string name;  ///< upper case; empty in files of one matrix
  Index rows = 0, columns = 0;
  std::vector<Entry> entries;          ///< those that the file has; repeated ones count once, the last one holds
  std::vector<NodalUnknown> unknowns;  ///< rising; empty: the file has no labels, rows are counted alone
};

/// More rows than this are refused: a substructure is worked on as a dense matrix.
inline constexpr Index kMostSubstructureUnknowns = 5000;

/// All real matrices of a file. The format is recognised by the content:
/// - Nastran's OUTPUT4 (also written by OptiStruct and others): text or binary of either byte order and of 4 or 8 bytes
///   an integer, dense columns, strings and BIGMAT, single and double precision;
/// - DMIG cards of Nastran's bulk data or punch files, in all three field formats, square (1) and symmetric (6);
/// - lines "node, component, node, component, value" (Abaqus's and CalculiX's matrix output);
/// - Matrix Market.
/// Text may be packed by gzip. @throws Error(invalid_input) that names the file and the line or column
[[nodiscard]] std::vector<FileMatrix> read_file_matrices(const std::string& path);

/// One of them: by its name, in either case, or, with an empty name, the only one.
/// @throws Error(invalid_input) that lists the names in the file
[[nodiscard]] FileMatrix read_file_matrix(const std::string& path, const std::string& name);

/// A node with its place.
struct GridPoint {
  std::int64_t label = 0;
  Point position{};
};
/// The GRID cards of a Nastran file, in their order. @throws Error for other coordinate systems than the basic one
[[nodiscard]] std::vector<GridPoint> read_grid_points(const std::string& path);

// The formats, of a whole content in memory.

[[nodiscard]] bool is_output4(std::string_view content);
[[nodiscard]] std::vector<FileMatrix> parse_output4(std::string content, const std::string& path);
[[nodiscard]] std::vector<FileMatrix> parse_dmig(std::string content, const std::string& path);
[[nodiscard]] std::vector<FileMatrix> parse_nodal_entries(std::string content, const std::string& path);

}  // namespace espalier::dynamics
