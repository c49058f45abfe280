/// \file
/// What `espalier simulate --derivative` says.
#pragma once

#include <string>

#include "espalier/sensitivities.hpp"

namespace espalier::cli {

/// A table: a row for each quantity at the end, a column for each parameter; frequencies below it.
[[nodiscard]] std::string sensitivity_summary(const SensitivityResult& r);
/// All times as CSV: t, then for each quantity its value and its derivatives.
[[nodiscard]] std::string sensitivity_csv(const SensitivityResult& r);

}  // namespace espalier::cli
