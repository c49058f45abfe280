/// \file
/// Beams and bars of Nastran: their sections and how they stand.
#pragma once

#include "dynamics/mesh/line_sections.hpp"

namespace espalier::dynamics {

/// PBAR, PBARL, PBEAM, PBEAML and PROD of the elements CBAR, CBEAM and CROD of a file.
/// @throws Error(invalid_input) that names file and line
[[nodiscard]] LineSections line_cards(const std::string& path, const Mesh& mesh);

}  // namespace espalier::dynamics
