/// \file
/// Sections of beams and bars as mesh files state them: shape or constants, material, orientation.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

enum class LineShape {
  rectangle,  ///< height along y, width along z
  circle,     ///< radius
  pipe,       ///< outer radius, wall
  box,        ///< height along y, width along z, the wall at its ends along y, the wall at its ends along z
  i_beam,     ///< height along y, width of the flanges, their thickness, that of the web
  constants,  ///< area, I about y, I about z, J, shear factors along y and z (0: stiff)
  bar         ///< area: it carries axial forces alone
};

/// The section of one set of elements.
struct LineSection {
  std::string set;       ///< name of the element set, as the file's mesh has it
  std::string material;  ///< name; empty: `own`
  LineShape shape = LineShape::rectangle;
  std::array<double, 6> size{};
  MeshMaterial own{};          ///< what the section itself states
  double extra_mass = 0;       ///< per length, beside that of the material
  std::optional<Point> first;  ///< the direction that the file gives; none: of each element (LineSections::directions)
  bool across = false;         ///< y of the section is x cross this direction, else the direction itself
  std::string fault{};         ///< what the section says that is not read; with file and line
  std::string place{};         ///< "file:line"
};

struct LineSections {
  std::vector<LineSection> list;
  /// The directions of elements by their labels: the direction of y (Nastran), or what is not read of them.
  std::map<std::int64_t, Point> directions;
  std::map<std::int64_t, std::string> faults;
};

/// *BEAM SECTION, *BEAM GENERAL SECTION, *SOLID SECTION with an area of .inp; PBAR, PBARL, PBEAM, PBEAML, PROD with
/// CBAR, CBEAM, CROD of Nastran; none of other files. Where sets have the name of others, the last counts.
/// @param mesh  that of the file: nodes that give directions, before any scale
/// @throws Error(invalid_input) that names file and line
[[nodiscard]] LineSections read_line_sections(const std::string& path, const Mesh& mesh);

}  // namespace espalier::dynamics
