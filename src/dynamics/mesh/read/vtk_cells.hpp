/// \file
/// Cells and data of VTK grids, legacy or XML, as elements and sets.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// Whole numbers of one component, one for each cell or each point.
struct VtkData {
  std::string name;
  bool of_cells = true;
  std::vector<std::int64_t> values;
};

/// An unstructured grid as its file lists it.
struct VtkGrid {
  std::vector<std::int64_t> start;         ///< of each cell in `connectivity`, and the end: one more than cells
  std::vector<std::int64_t> connectivity;  ///< points, counted from 0
  std::vector<std::int64_t> types;         ///< vtkCellType.h, one for each cell
  std::vector<VtkData> data;
};

/// Adds the cells to `mesh`, whose nodes stand, and a set "name-value" for every value of the data (not if there are
/// more than 256 different ones: notice). Of complete cells of second order the nodes in the middle of faces and
/// volumes are dropped, with a notice. @throws Error at `place` ("file:line") naming the cell that cannot be read
void add_vtk_grid(const VtkGrid& grid, const std::string& place, Mesh& mesh);

}  // namespace espalier::dynamics
