/// \file
/// What the pivots of a factorization out of core came to, as it arrives from the GPU unit by unit.
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "device/cuda/out_of_core/unit_tables.hpp"
#include "device/determinant.hpp"
#include "device/executor.hpp"

namespace espalier::device::cuda {

/// Ranges [begin, end) of elimination positions, in the order of a unit's pivots.
using Positions = std::vector<std::pair<Index, Index>>;

template <class T>
class PivotRecord {
 public:
  /// @param n  of the matrix
  PivotRecord(Kind kind, Index n);
  /// Forgets the last factorization.
  void begin();
  /// What a unit's scratch brought. @param bytes  those before ScratchPlaces::flags
  void take(const ScratchPlaces& at, const Positions& positions, const PivotRule& rule,
            std::span<const std::byte> bytes);
  /// Copies what solves need (ldlt) of these positions from another device.
  void copy_from(const PivotRecord& other, Index begin, Index count);

  [[nodiscard]] bool stopped() const { return stopped_; }  ///< a unit was given up
  /// Lists in ascending order.
  FactorOutcome outcome();
  [[nodiscard]] const std::vector<T>& inverse_d() const { return inverse_d_; }
  [[nodiscard]] const std::vector<T>& inverse_e() const { return inverse_e_; }

 private:
  void judge(Index position, double pivot, double suspect);
  template <class IsReplaced>
  void judge_blocks(const Positions& positions, double suspect, IsReplaced&& is_replaced);

  Kind kind_;
  FactorOutcome outcome_;
  Determinant determinant_;
  bool stopped_ = false;
  std::vector<T> inverse_d_, inverse_e_;  // n (ldlt), by position
};

}  // namespace espalier::device::cuda
