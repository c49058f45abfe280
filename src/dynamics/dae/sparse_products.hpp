/// \file
/// Products with sparse matrices.
#pragma once

#include "dynamics/dae/system.hpp"

namespace espalier::dynamics {

/// y = A x for A stored by rows (ptr over rows).
void multiply_by_rows(const SparsePattern& p, ConstSpan values, ConstSpan x, Span y);
/// y += A^T x for A stored by rows; with A stored by columns the same loop is y += A x.
void add_transposed(const SparsePattern& p, ConstSpan values, ConstSpan x, Span y);

}  // namespace espalier::dynamics
