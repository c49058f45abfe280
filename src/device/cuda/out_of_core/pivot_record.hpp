/// \file
/// What the pivots of a factorization out of core came to, as it arrives from the GPU unit by unit.
#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "device/cuda/kernels/factor/factor_parameters.hpp"
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
  /// From now on, what units bring is kept, so that a factorization need not make all of them.
  void keep_units(std::size_t count) { units_.resize(count); }
  /// Forgets the last factorization, but for what units brought.
  void begin();
  /// What a unit's scratch brought.
  /// @param bytes  those before ScratchPlaces::flags; empty: what it brought last, if that is kept
  void take(std::size_t unit, const ScratchPlaces& at, const Positions& positions, const PivotRule& rule,
            std::span<const std::byte> bytes);
  /// Whether the pivots that a unit brought last, if any, would be the same by this rule. @pre they are kept
  [[nodiscard]] bool stays(std::size_t unit, const PivotRule& rule) const;
  /// Marks a front of each unit of the plan for which that is not so. Units: its steps, then its groups.
  void mark_others(const out_of_core::OutOfCorePlan& plan, const PivotRule& rule, std::vector<char>& fronts) const;
  /// Copies what solves need (ldlt) of these positions from another device.
  void copy_from(const PivotRecord& other, Index begin, Index count);

  [[nodiscard]] bool stopped() const { return stopped_; }                    ///< a unit was given up
  [[nodiscard]] bool positive() const { return outcome_.not_positive < 0; }  ///< else units may be unfinished (llt)
  /// Lists in ascending order.
  FactorOutcome outcome();
  [[nodiscard]] const std::vector<T>& inverse_d() const { return inverse_d_; }
  [[nodiscard]] const std::vector<T>& inverse_e() const { return inverse_e_; }

 private:
  struct KeptOutputs {
    std::vector<std::byte> bytes;
    PivotLimits<T> limits = {};  // when it was made
    bool firm = false;           // by these: see judged_alike()
  };
  void read_unit(const ScratchPlaces& at, const Positions& positions, const PivotRule& rule,
                 std::span<const std::byte> bytes);
  [[nodiscard]] std::size_t doubtful() const {
    return outcome_.replaced.size() + outcome_.failed.size() + outcome_.small.size();
  }
  void judge(Index position, double pivot, double suspect);
  template <class IsReplaced>
  void judge_blocks(const Positions& positions, double suspect, IsReplaced&& is_replaced);

  Kind kind_;
  FactorOutcome outcome_;
  Determinant determinant_;
  bool stopped_ = false;
  std::vector<KeptOutputs> units_;
  std::vector<T> inverse_d_, inverse_e_;  // n (ldlt), by position
};

}  // namespace espalier::device::cuda
