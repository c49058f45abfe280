/// \file
/// Which ranks are on one machine, as it was when somebody asked.
#pragma once

#include <cstdint>
#include <vector>

#include "base/at.hpp"
#include "ranks/communicator.hpp"

namespace espalier::ranks {

/// Communicator::machine_of() of all ranks, taken once: who has made memory by it keeps it, whatever
/// Communicator::set_machines() says later.
class Machines {
 public:
  /// Collective. @throws Error(invalid_input) on all ranks where two of them have different lists
  static Machines agreed(Communicator& link);

  [[nodiscard]] bool are_near(int rank, int other) const { return of(rank) == of(other); }
  /// Whether all ranks are on one machine.
  [[nodiscard]] bool is_one() const;
  /// Bit r: rank r is on another machine than `rank`. Of the first 32 ranks.
  [[nodiscard]] std::uint32_t apart_from(int rank) const;
  /// Bit r: rank r is on the machine of `rank`, which counts as well. Of the first 32 ranks.
  [[nodiscard]] std::uint32_t near_to(int rank) const;

 private:
  explicit Machines(std::vector<int> machine) : machine_(std::move(machine)) {}
  [[nodiscard]] int first_ranks() const { return machine_.size() < 32 ? static_cast<int>(machine_.size()) : 32; }
  [[nodiscard]] int of(int rank) const { return machine_[at(rank)]; }

  std::vector<int> machine_;  // by rank
};

}  // namespace espalier::ranks
