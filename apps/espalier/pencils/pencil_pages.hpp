/// \file
/// Pages of `espalier modes` and `espalier harmonic`: their reports with plots.
#pragma once

#include <string>

#include "espalier/harmonic.hpp"
#include "espalier/model_modes.hpp"
#include "espalier/modes.hpp"
#include "sheet/sheet.hpp"

namespace espalier::cli {

/// Each: @param report  of the command, whole; @param source  what was read
[[nodiscard]] Sheet modes_sheet(const std::string& source, const ModesResult& r, bool buckling, Sheet::Json report);
[[nodiscard]] Sheet quadratic_sheet(const std::string& source, const QuadraticModesResult& r, Sheet::Json report);
[[nodiscard]] Sheet model_modes_sheet(const std::string& source, const ModelModesResult& r, Sheet::Json report);
[[nodiscard]] Sheet harmonic_sheet(const std::string& source, const HarmonicOptions& o, const HarmonicResult& r,
                                   Sheet::Json report);

}  // namespace espalier::cli
