/// \file
/// Right-hand sides and solutions of K in the memory of the GPU that has its factor.
#pragma once

#include <functional>
#include <span>

#include "dynamics/dae/system.hpp"

namespace espalier::dynamics {

/// Solves with K = S^-1 K' S^-1, where K' is what was factorized and S are the scales of DeviceMatrix. All
/// vectors have as many numbers as K has rows; several stand one after another. One object serves one matrix, which
/// outlives it. Every call waits unless it says otherwise.
/// @throws Error(device_error, out_of_memory); what a Solve throws goes through
class DeviceVectors {
 public:
  virtual ~DeviceVectors() = default;
  /// Solves with K' in place for the given number of columns in the GPU's memory, when all that was enqueued on
  /// stream() is done. Waits.
  using Solve = std::function<void(double* columns, Index count)>;
  static constexpr Index kMostColumns = 32;  ///< that a Solve gets at a time, and solve() itself
  /// b := K^-1 b for each column.
  virtual void solve(Span b, const Solve& solve) = 0;
  /// The same of one that lies in the GPU's memory.
  virtual void solve_there(double* b, const Solve& solve) = 0;
  /// The scales, in the GPU's memory: always at the same place.
  [[nodiscard]] virtual const double* scale() const = 0;
  /// b := [0; r] in the GPU's memory.
  virtual void put_lower(ConstSpan r, double* b) = 0;
  /// Keeps the columns K^-1 e_r of these rows r in the GPU's memory, instead of those that it kept before.
  virtual void make_columns(std::span<const Index> rows, const Solve& solve) = 0;
  /// x = the sum of factors[c] times column c of those kept.
  virtual void combine_columns(ConstSpan factors, Span x) = 0;
  /// The same in the GPU's memory; does not wait.
  virtual void combine_columns_there(ConstSpan factors, double* x) = 0;
  /// The columns kept, to the host.
  virtual void fetch_columns(Span to) = 0;
  [[nodiscard]] virtual void* stream() const = 0;
};

}  // namespace espalier::dynamics
