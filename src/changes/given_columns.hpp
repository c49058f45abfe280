/// \file
/// Columns and numbers as callers give them, checked.
#pragma once

#include <cmath>
#include <complex>
#include <span>
#include <string>
#include <vector>

#include "changes/changed_matrix.hpp"
#include "espalier/solve_rows.hpp"

namespace espalier::changes {

/// For messages: "2.5", "1-2i".
std::string shown(double v);
std::string shown(std::complex<double> v);
inline bool is_finite(double v) { return std::isfinite(v); }
inline bool is_finite(std::complex<double> v) { return std::isfinite(v.real()) && std::isfinite(v.imag()); }

/// @throws Error(invalid_input) that names what is not finite
template <class T>
void check_finite(std::span<const T> values, const char* name);
/// Columns of n values each, without their zeros. @throws likewise
template <class T>
std::vector<SparseVector<T>> columns_of(std::span<const T> values, Index n, const char* name);
template <class T>
[[nodiscard]] Index count_of(const SparseColumnsOf<T>& columns) {
  return columns.col_ptr.empty() ? 0 : static_cast<Index>(columns.col_ptr.size()) - 1;
}
/// @param most  rows run from 0 to most - 1
/// @throws Error(invalid_input), std::invalid_argument for rows and values of different numbers
template <class T>
std::vector<SparseVector<T>> columns_of(const SparseColumnsOf<T>& from, Index most, const char* name);

}  // namespace espalier::changes
