/// \file
/// Entries of an inverse by a factor, compared with columns that are solved for.
#pragma once

#include <span>
#include <vector>

#include "espalier/inverse.hpp"
#include "solver/session.hpp"

namespace espalier::inverse {

/// Entries (unknown, row) of A^-1: x[unknown] of A x = e_row.
struct Entries {
  std::vector<Index> unknown, row;
  void reserve(std::size_t count) {
    unknown.reserve(count);
    row.reserve(count);
  }
  void add(Index of_unknown, Index of_row) {
    unknown.push_back(of_unknown);
    row.push_back(of_row);
  }
  [[nodiscard]] std::size_t size() const { return row.size(); }
};

/// Value: double or complex<double>, as the numbers of the session's matrix.
/// @param x  as many as entries
/// @param result  gets error, checked and solved
/// @throws Error: see selected_inverse()
template <class Value>
void invert_entries(solver::Session& session, const Entries& entries, std::span<Value> x, InverseResult& result);

}  // namespace espalier::inverse
