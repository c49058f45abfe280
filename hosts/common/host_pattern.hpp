/// \file
/// The pattern of a matrix as hosts give it, by columns; of a symmetric one the lower triangle.
#pragma once

#include <cstdint>
#include <vector>

#include "espalier/espalier.h"

namespace espalier::hosts {

/// A copy of a host's pattern, and where its values go. Entries that are repeated stay so, and are summed later.
class HostPattern {
 public:
  /// The pattern of a symmetric matrix, from columns. @param pointers  n + 1, from `base` on, never falling; @param
  /// rows  the entries' rows, from `base` on
  /// @pre all rows lie from base to n - 1 + base
  /// @param clean  entries above the diagonal and outside of the matrix are left out, instead of being refused later
  static HostPattern from_columns(int n, const int* pointers, const int* rows, int base, bool clean);
  /// From 1-based coordinates; those of a symmetric matrix lie in either triangle. Entries outside of the matrix are
  /// left out.
  static HostPattern from_coordinates(int n, int count, const int* rows, const int* columns, bool symmetric = true);

  [[nodiscard]] int n() const { return static_cast<int>(pointers_.size()) - 1; }
  /// Entries that the host gives, and those of them that are left out.
  [[nodiscard]] std::int64_t given() const { return given_; }
  [[nodiscard]] std::int64_t left_out() const { return given_ - static_cast<std::int64_t>(rows_.size()); }
  /// The matrix for the C interface, in this object's arrays. @param values  of gather(), or null
  [[nodiscard]] espalier_matrix_i32 matrix(const double* values) const;
  /// The host's values (given() of them) in the order of matrix(). @param buffer  is used where they are not so already
  const double* gather(const double* given, std::vector<double>& buffer) const;
  [[nodiscard]] std::int64_t entries() const { return static_cast<std::int64_t>(rows_.size()); }
  [[nodiscard]] std::int64_t bytes() const;

 private:
  std::vector<int> pointers_, rows_;  // 0-based
  std::vector<int> place_;            // of each given entry, -1: left out; empty: as given
  bool symmetric_ = true;
  std::int64_t given_ = 0;
};

}  // namespace espalier::hosts
