/// \file
/// Sections of shells as mesh files state them: thickness, material, offset.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

struct ShellLayer {
  double thickness = 0;
  std::string material;  ///< name
};
/// The section of one set of elements.
struct ShellSection {
  std::string set;       ///< name of the element set, as the file's mesh has it
  std::string material;  ///< name; empty: none
  double thickness = 0;  ///< 0: the file does not say
  double offset = 0;     ///< from the nodes to the middle of the thickness, along the normal, over the thickness
  std::string fault{};   ///< what the section says that is not read; with file and line
  std::string notice{};  ///< what is read otherwise
  std::string place{};   ///< "file:line"
  bool nodal = false;    ///< thicknesses are those of nodes
  std::vector<ShellLayer> layers{};  ///< from the bottom; empty: one, as above
};

struct ShellSections {
  std::vector<ShellSection> list;
  std::vector<std::pair<std::string, double>> of_nodes;   ///< thickness: a label or a node set; the last counts
  std::map<std::int64_t, std::array<double, 4>> corners;  ///< thickness at those of an element, by its label; 0: none
};

/// *SHELL SECTION of .inp (thickness on the next line, OFFSET with SPOS and SNEG, COMPOSITE), *NODAL THICKNESS; PSHELL
/// and PCOMP, with ZOFFS and T1 to T4 of the elements, of .bdf, .dat, .nas; none of other files. Where sets have the
/// name of others, the last counts: those of a part's instances (INSTANCE.SET) stand behind all others.
/// @throws Error(invalid_input) that names file and line
[[nodiscard]] ShellSections read_shell_sections(const std::string& path);

/// The one material that bends and stretches as layers of isotropic materials do: E t and E t^3 / 12 are their sums,
/// and so is the mass. That is exact where they lie alike on both sides of the middle and have one Poisson's ratio;
/// shear across the thickness is that of the mean. @return thickness and material
/// @throws Error(invalid_input) where they do not, or have no material
[[nodiscard]] std::pair<double, MeshMaterial> equivalent_layer(const ShellSection& section,
                                                               const std::vector<MeshMaterial>& materials);

}  // namespace espalier::dynamics
