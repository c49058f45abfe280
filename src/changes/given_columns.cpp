#include "changes/given_columns.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <string>

#include "base/at.hpp"

namespace espalier::changes {

std::string shown(double v) { return fmt::format("{}", v); }

std::string shown(std::complex<double> v) { return fmt::format("{}{:+}i", v.real(), v.imag()); }

template <class T>
void check_finite(std::span<const T> values, const char* name) {
  for (std::size_t k = 0; k < values.size(); ++k)
    if (!is_finite(values[k]))
      throw Error(StatusCode::invalid_input, fmt::format("value {} of {} is {}", k, name, shown(values[k])));
}

template <class T>
std::vector<SparseVector<T>> columns_of(std::span<const T> values, Index n, const char* name) {
  std::vector<SparseVector<T>> list(n == 0 ? 0 : values.size() / at(n));
  for (std::size_t c = 0; c < list.size(); ++c)
    for (Index i = 0; i < n; ++i) {
      const T v = values[c * at(n) + at(i)];
      if (!is_finite(v))
        throw Error(StatusCode::invalid_input, fmt::format("row {} of column {} of {} is {}", i, c, name, shown(v)), i);
      if (v != T(0)) list[c].push(i, v);
    }
  return list;
}

template <class T>
std::vector<SparseVector<T>> columns_of(const SparseColumnsOf<T>& from, Index most, const char* name) {
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
  std::vector<SparseVector<T>> list(at(count));
  for (Index c = 0; c < count; ++c) {
    for (Offset q = from.col_ptr[at(c)]; q < from.col_ptr[at(c) + 1]; ++q) {
      const Index row = from.row_ind[at(q)];
      if (row < 0 || row >= most)
        wrong(fmt::format("entry {} of column {} stands in row {}, of {}", q, c, row, most), row);
      if (!is_finite(from.values[at(q)]))
        wrong(fmt::format("entry {}, in row {} of column {}, is {}", q, row, c, shown(from.values[at(q)])), row);
      list[at(c)].push(row, from.values[at(q)]);
    }
    list[at(c)].sort();
  }
  return list;
}

#define ESPALIER_INSTANTIATE(T)                                                             \
  template void check_finite(std::span<const T>, const char*);                              \
  template std::vector<SparseVector<T>> columns_of(std::span<const T>, Index, const char*); \
  template std::vector<SparseVector<T>> columns_of(const SparseColumnsOf<T>&, Index, const char*);
ESPALIER_FOR_NUMBERS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::changes
