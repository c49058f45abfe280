/// \file
/// Sections of shells as mesh files state them: thickness, material, offset.
#pragma once

#include <string>
#include <vector>

namespace espalier::dynamics {

/// Of one set of elements.
struct ShellSection {
  std::string set;       ///< name of the element set, as the file's mesh has it
  std::string material;  ///< name; empty: none
  double thickness = 0;  ///< 0: the file does not say
  double offset = 0;     ///< from the nodes to the middle of the thickness, along the normal, over the thickness
  std::string fault{};   ///< what the section says that is not read; with file and line
  std::string notice{};  ///< what is read otherwise
};

/// *SHELL SECTION of .inp (thickness on the next line, OFFSET with SPOS and SNEG), PSHELL with ZOFFS of the elements of
/// .bdf, .dat, .nas; none of other files. Where sets have the name of others, the last counts: those of a part's
/// instances (INSTANCE.SET) stand behind all others.
/// @throws Error(invalid_input) that names file and line
[[nodiscard]] std::vector<ShellSection> read_shell_sections(const std::string& path);

}  // namespace espalier::dynamics
