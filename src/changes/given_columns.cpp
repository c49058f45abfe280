#include "changes/given_columns.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <string>

#include "base/at.hpp"

namespace espalier::changes {

void check_finite(std::span<const double> values, const char* name) {
  for (std::size_t k = 0; k < values.size(); ++k)
    if (!std::isfinite(values[k]))
      throw Error(StatusCode::invalid_input, fmt::format("value {} of {} is {}", k, name, values[k]));
}

std::vector<SparseVector> columns_of(std::span<const double> values, Index n, const char* name) {
  std::vector<SparseVector> list(n == 0 ? 0 : values.size() / at(n));
  for (std::size_t c = 0; c < list.size(); ++c)
    for (Index i = 0; i < n; ++i) {
      const double v = values[c * at(n) + at(i)];
      if (!std::isfinite(v))
        throw Error(StatusCode::invalid_input, fmt::format("row {} of column {} of {} is {}", i, c, name, v), i);
      if (v != 0) list[c].push(i, v);
    }
  return list;
}

Index count_of(const SparseColumns& columns) {
  return columns.col_ptr.empty() ? 0 : static_cast<Index>(columns.col_ptr.size()) - 1;
}

std::vector<SparseVector> columns_of(const SparseColumns& from, Index most, const char* name) {
  if (from.row_ind.size() != from.values.size())
    throw std::invalid_argument(
        fmt::format("ChangedSystem: {} have {} rows for {} values", name, from.row_ind.size(), from.values.size()));
  const auto wrong = [&](const std::string& what, Index row) {
    throw Error(StatusCode::invalid_input, fmt::format("{}: {}", name, what), row);
  };
  const Index count = count_of(from);
  bool ascending = count == 0 || (from.col_ptr.front() == 0 && at(from.col_ptr.back()) == from.values.size());
  for (Index c = 0; c < count; ++c) ascending = ascending && from.col_ptr[at(c)] <= from.col_ptr[at(c) + 1];
  if (!ascending) wrong("the columns do not begin one after another, from 0 to the last entry", -1);
  std::vector<SparseVector> list(at(count));
  for (Index c = 0; c < count; ++c) {
    for (Offset q = from.col_ptr[at(c)]; q < from.col_ptr[at(c) + 1]; ++q) {
      const Index row = from.row_ind[at(q)];
      if (row < 0 || row >= most)
        wrong(fmt::format("entry {} of column {} stands in row {}, of {}", q, c, row, most), row);
      if (!std::isfinite(from.values[at(q)]))
        wrong(fmt::format("entry {}, in row {} of column {}, is {}", q, row, c, from.values[at(q)]), row);
      list[at(c)].push(row, from.values[at(q)]);
    }
    list[at(c)].sort();
  }
  return list;
}

}  // namespace espalier::changes
