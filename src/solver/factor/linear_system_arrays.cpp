#include "solver/factor/linear_system_arrays.hpp"

#include <algorithm>

#include "solver/factor/pivot_policy.hpp"

namespace espalier::solver {

device::LinearSystemArrays arrays_of(const System& system, std::span<const Index> order,
                                     std::span<const Offset> diagonal, double epsilon, std::span<const double> values,
                                     base::ThreadPool& pool) {
  const PreparedMatrix& prepared = system.prepared;
  device::LinearSystemArrays arrays;
  const auto indexed = static_cast<std::size_t>(system.rows->col.size());
  arrays.pattern = prepared.a;
  arrays.row_ptr = system.rows->ptr;
  arrays.row_col = {system.rows->col.data(), indexed};
  arrays.row_source = {system.rows->source.data(), indexed};
  arrays.order = order;
  arrays.row_of_col = prepared.row_of_col;
  arrays.row_scale = prepared.row_scale;
  arrays.col_scale = prepared.col_scale;
  arrays.diagonal = diagonal;
  arrays.rounding = suspect_pivot(epsilon);
  if (system.real_form) {
    arrays.real_columns = system.real_form->a.col_ptr;
    arrays.hermitian = system.real_form->hermitian;
  }
  arrays.values = values;
  arrays.copy = [&pool](double* to, const double* from, Offset count) {
    constexpr std::int64_t kRange = 1 << 16;  // doubles
    pool.for_each_range(count, kRange,
                        [&](std::int64_t begin, std::int64_t end) { std::copy(from + begin, from + end, to + begin); });
  };
  return arrays;
}

}  // namespace espalier::solver
