/// \file
/// Columns and numbers as callers give them, checked.
#pragma once

#include <span>
#include <vector>

#include "changes/changed_matrix.hpp"
#include "espalier/solve_rows.hpp"

namespace espalier::changes {

/// @throws Error(invalid_input) that names what is not finite
void check_finite(std::span<const double> values, const char* name);
/// Columns of n values each, without their zeros. @throws likewise
std::vector<SparseVector> columns_of(std::span<const double> values, Index n, const char* name);
[[nodiscard]] Index count_of(const SparseColumns& columns);
/// @param most  rows run from 0 to most - 1
/// @throws Error(invalid_input), std::invalid_argument for rows and values of different numbers
std::vector<SparseVector> columns_of(const SparseColumns& from, Index most, const char* name);

}  // namespace espalier::changes
