/// \file
/// Values that every plan of a pattern factorizes without a failing pivot.
#pragma once

#include <span>

#include "solver/analysis/prepared_matrix.hpp"

namespace espalier::batch {

/// Values of p.a that make an identity of the scaled, permuted matrix.
/// @returns false, and zeros: the pattern has no such values
bool take_easy_values(const solver::PreparedMatrix& p, std::span<double> values);

}  // namespace espalier::batch
