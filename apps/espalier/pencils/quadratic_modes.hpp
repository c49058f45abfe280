/// \file
/// What `espalier modes --damping` prints.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "espalier/modes.hpp"

namespace espalier::cli {

/// A row for each mode: exponent, frequency, damping ratio, residual.
[[nodiscard]] std::string quadratic_table(const QuadraticModesResult& r);
[[nodiscard]] nlohmann::ordered_json quadratic_report(const QuadraticModesResult& r, int code);

}  // namespace espalier::cli
