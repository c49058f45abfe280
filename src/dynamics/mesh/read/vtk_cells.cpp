#include "dynamics/mesh/read/vtk_cells.hpp"

#include <fmt/format.h>

#include <array>
#include <map>
#include <set>

#include "dynamics/mesh/file_elements.hpp"

namespace espalier::dynamics {
namespace {

// More different values than this are numbers, not groups.
constexpr std::size_t kMostGroups = 256;

/// Cell types (vtkCellType.h) that are read; voxel and pixel count their corners line by line. Complete cells of second
/// order have so many nodes more, behind the others.
struct CellShape {
  int code;
  ElementType type;
  bool by_lines = false;
  int dropped = 0;
  const char* complete = "";
};
constexpr CellShape kCells[] = {{1, ElementType::point1},
                                {3, ElementType::line2},
                                {5, ElementType::tri3},
                                {8, ElementType::quad4, true},
                                {9, ElementType::quad4},
                                {10, ElementType::tet4},
                                {11, ElementType::hex8, true},
                                {12, ElementType::hex8},
                                {13, ElementType::wedge6},
                                {14, ElementType::pyramid5},
                                {21, ElementType::line3},
                                {22, ElementType::tri6},
                                {23, ElementType::quad8},
                                {24, ElementType::tet10},
                                {25, ElementType::hex20},
                                {26, ElementType::wedge15},
                                {28, ElementType::quad8, false, 1, "quad9"},
                                {29, ElementType::hex20, false, 7, "hex27"},
                                {32, ElementType::wedge15, false, 3, "wedge18"},
                                {33, ElementType::hex20, false, 4, "hex24"},
                                {34, ElementType::tri6, false, 1, "tri7"}};

class VtkCells {
 public:
  VtkCells(const VtkGrid& grid, const std::string& place, Mesh& mesh) : grid_(grid), place_(place), mesh_(mesh) {}

  void add() {
    const std::size_t cells = grid_.start.empty() ? 0 : grid_.start.size() - 1;
    for (std::size_t k = 0; k < cells; ++k) add_cell(k);
    for (const VtkData& data : grid_.data) add_sets(data);
    elements_.finish(mesh_);
    note_complete_kinds(mesh_, complete_);
  }

 private:
  [[noreturn]] void fail_cell(std::size_t cell, const std::string& message) const {
    throw Error(StatusCode::invalid_input, fmt::format("{}: cell {} {}", place_, cell, message));
  }

  void add_cell(std::size_t k) {
    const CellShape* shape = nullptr;
    for (const CellShape& c : kCells)
      if (c.code == grid_.types[k]) shape = &c;
    if (shape == nullptr)
      fail_cell(k,
                fmt::format("is of VTK type {}, which is not read (points, lines, triangles, quadrilaterals, "
                            "tetrahedra, hexahedra, wedges of first and second order, and pyramids of five points are)",
                            grid_.types[k]));
    const auto count = grid_.start[k + 1] - grid_.start[k], own = std::int64_t{shape_of(shape->type).nodes};
    if (count != own + shape->dropped)
      fail_cell(k,
                fmt::format("has {} points, {} has {}", count,
                            shape->dropped > 0 ? shape->complete : shape_of(shape->type).name, own + shape->dropped));
    std::array<Index, kMaxElementNodes> nodes{};
    for (std::int64_t a = 0; a < own; ++a) {
      const std::int64_t node = grid_.connectivity[at(grid_.start[k] + a)];
      if (node < 0 || node >= static_cast<std::int64_t>(mesh_.nodes.size()))
        fail_cell(k, fmt::format("uses point {}; there are {} (counted from 0)", node, mesh_.nodes.size()));
      nodes[at(a)] = static_cast<Index>(node);
    }
    if (shape->by_lines)
      for (std::size_t a = 2; a < at(own); a += 4) std::swap(nodes[a], nodes[a + 1]);
    if (shape->dropped > 0) ++complete_[shape->complete];
    elements_.add(shape->type, static_cast<std::int64_t>(k), {nodes.data(), at(own)});
  }

  void add_sets(const VtkData& data) {
    const std::size_t expected = data.of_cells ? elements_.count() : mesh_.nodes.size();
    if (data.values.size() != expected) {
      mesh_.notices.push_back(fmt::format("{}: '{}' has {} values for {} {}: not used", mesh_.name, data.name,
                                          data.values.size(), expected, data.of_cells ? "cells" : "points"));
      return;
    }
    const std::set<std::int64_t> different(data.values.begin(), data.values.end());
    if (different.size() > kMostGroups) {
      mesh_.notices.push_back(fmt::format("{}: '{}' has {} different values, which are not taken for sets", mesh_.name,
                                          data.name, different.size()));
      return;
    }
    for (std::size_t k = 0; k < data.values.size(); ++k) {
      const std::string set = fmt::format("{}-{}", data.name, data.values[k]);
      if (data.of_cells)
        elements_.add_to_set(k, set);
      else
        mesh_.node_sets[set].push_back(static_cast<Index>(k));
    }
  }

  const VtkGrid& grid_;
  const std::string& place_;
  Mesh& mesh_;
  FileElements elements_;
  std::map<std::string, long> complete_;  // cells that lose nodes, by their kinds
};

}  // namespace

void add_vtk_grid(const VtkGrid& grid, const std::string& place, Mesh& mesh) { VtkCells(grid, place, mesh).add(); }

}  // namespace espalier::dynamics
