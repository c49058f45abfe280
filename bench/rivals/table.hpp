/// \file
/// Rows of a comparison for people and for machines.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "rivals/session.hpp"

namespace espalier::bench {

/// One line per rival; medians; "-" where a rival does not tell; verdicts in place of figures that do not exist.
std::string text_table(const std::vector<Row>& rows, Index columns);

/// Everything in a row, all samples included.
nlohmann::json row_record(const Row& row);

}  // namespace espalier::bench
