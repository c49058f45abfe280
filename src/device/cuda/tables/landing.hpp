/// \file
/// To which rank of a machine a message goes that several of its ranks need. As plain C++.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "ranks/machines.hpp"

namespace espalier::device::cuda {

/// The numbers of the bits that are set, ascending.
[[nodiscard]] std::vector<int> ranks_of(unsigned bits);

/// A message crosses the network once for each machine: it goes to one of the ranks there that need it, the *landing
/// rank*, whose copy engine brings it into the memory of the others. Sender and receivers choose alike.
class Landing {
 public:
  Landing(const ranks::Machines& machines, int rank);

  /// Bit r: rank r is on another machine.
  [[nodiscard]] std::uint32_t apart() const { return apart_; }
  /// Bit r: rank r is another one on this machine.
  [[nodiscard]] std::uint32_t beside() const { return near_ & ~(1U << rank_); }
  /// The landing ranks of all other machines that have receivers.
  /// @param receivers  by bits, of any machines. @param key  spreads messages over a machine's receivers
  [[nodiscard]] std::vector<int> elsewhere(std::uint32_t receivers, std::size_t key) const;
  /// The landing rank of this machine; -1: it has no receiver.
  [[nodiscard]] int here(std::uint32_t receivers, std::size_t key) const;

 private:
  int rank_;
  std::uint32_t near_, apart_;
  std::vector<std::uint32_t> others_;  // by other machine: its ranks
};

/// What comes to a machine in a run of an exchange, as one of its ranks sees it.
struct Arrivals {
  std::int64_t missing = 0;       ///< what lands on this rank
  std::uint32_t for_others = 0;   ///< bits: ranks beside it for which something lands here
  std::uint32_t from_others = 0;  ///< bits: ranks beside it on which something for this one lands

  /// Counts what another machine sends. @param self  this rank
  void add(const Landing& landing, int self, std::uint32_t receivers, std::size_t key);
};

}  // namespace espalier::device::cuda
