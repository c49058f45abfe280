/// \file
/// Entries of an inverse by a factor, compared with columns that are solved for.
#pragma once

#include <span>

#include "base/lazy_vector.hpp"
#include "espalier/inverse.hpp"
#include "solver/session/session.hpp"

namespace espalier::inverse {

/// Entries (unknown, row) of A^-1: x[unknown] of A x = e_row.
struct Entries {
  base::LazyVector<Index> unknown, row;
  Entries() = default;
  /// To be set.
  explicit Entries(std::size_t count) : unknown(count), row(count) {}
  void set(std::size_t q, Index of_unknown, Index of_row) {
    unknown[q] = of_unknown;
    row[q] = of_row;
  }
  void append(Index of_unknown, Index of_row) {
    unknown.push_back(of_unknown);
    row.push_back(of_row);
  }
  [[nodiscard]] std::size_t size() const { return row.size(); }
  bool operator==(const Entries&) const = default;
};

/// Value: double or complex<double>, as the numbers of the session's matrix.
/// @param x  as many as entries
/// @param result  gets error, checked and solved
/// @throws Error: see selected_inverse()
template <class Value>
void invert_entries(solver::Session& session, const Entries& entries, std::span<Value> x, InverseResult& result);

}  // namespace espalier::inverse
