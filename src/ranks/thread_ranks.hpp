/// \file
/// Ranks as threads of one process, behind the same table of functions: for tests of everything that ranks do, without
/// any communication library, and with faults that a real one shows rarely.
#pragma once

#include <cstdint>
#include <memory>

#include "espalier/ranks.h"

namespace espalier::ranks {

/// What goes wrong.
struct Faults {
  std::uint64_t seed = 1;
  double most_delay = 0;         ///< seconds; a message is on its way for a random part of it
  bool reorder = false;          ///< receipts end in random order
  int credits = 0;               ///< so many messages from one rank to another may wait to be received; 0: any number
  int dead_rank = -1;            ///< this one dies ...
  std::int64_t dies_at = 0;      ///< ... when it sends its message of this number, from 1
  bool deaths_are_told = false;  ///< functions of the others return an error then (as with ULFM); else there is silence
};

/// The shared memory of the ranks. Each rank takes one table, for its thread. What is sent is copied at once.
class ThreadRanks {
 public:
  explicit ThreadRanks(int ranks, const Faults& faults = {});
  /// The table keeps what the ranks share alive until its release().
  [[nodiscard]] espalier_rank_functions table(int rank) const;

  class Shared;

 private:
  int ranks_;
  std::shared_ptr<Shared> shared_;
};

}  // namespace espalier::ranks
