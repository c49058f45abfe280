/// \file
/// Products of long vectors with sparse matrices, and with a few dense columns.
#pragma once

#include "base/thread_pool.hpp"
#include "dynamics/dae/system.hpp"

namespace espalier::dynamics {

/// y = A x for A stored by rows (ptr over rows). @param pool  null: the calling thread alone
void multiply_by_rows(const SparsePattern& p, ConstSpan values, ConstSpan x, Span y, base::ThreadPool* pool = nullptr);
/// y += A^T x for A stored by rows; with A stored by columns the same loop is y += A x.
void add_transposed(const SparsePattern& p, ConstSpan values, ConstSpan x, Span y);
/// x += the sum of factors[c] times column c; columns as long as x, one after the other. The sums do not depend on the
/// threads of the pool (null: the calling one).
void add_columns(const double* columns, ConstSpan factors, Span x, base::ThreadPool* pool);

}  // namespace espalier::dynamics
