/// \file
/// Systems of patterns of their own in groups, each as many as fill a device.
#pragma once

#include <atomic>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "batch/chunk.hpp"
#include "espalier/batch.hpp"
#include "solver/analysis/analysis_draft.hpp"
#include "solver/session/session.hpp"

namespace espalier::batch {

/// Systems of a group are ordered one by one, as each would be alone, and then factorized as blocks of one system;
/// those that do not come to an answer there go on alone, on the cores, from their order. Groups go through two teams,
/// each with half of the threads: while the device works for one, the other orders.
class Groups {
 public:
  /// Whether systems with these options may go in groups: on a device with memory of its own that is named or may be
  /// chosen, or by a wish (Chunk::wished_size()).
  static bool serve(const Options& options, const device::Registry& registry);

  /// @param session  whose threads work; outlives this
  explicit Groups(solver::Session& session);
  /// @param results  of all systems. @returns the most systems that were in work at a time
  /// @throws Error(cancelled)
  int solve(std::span<const System> systems, std::span<SystemResult> results);

 private:
  using Numbers = std::vector<Index>;  // of systems

  // Times of teams, which work beside each other.
  struct Seconds {
    double order = 0, plan = 0, solve = 0, others = 0;
    Seconds& operator+=(const Seconds& s) {
      order += s.order, plan += s.plan, solve += s.solve, others += s.others;
      return *this;
    }
  };
  struct Team;
  struct Member;
  Numbers solve_equal(std::span<const System> systems, Numbers numbers, std::span<SystemResult> results);
  void solve_in_lanes(std::span<const System> systems, const std::vector<Numbers>& groups,
                      std::span<SystemResult> results);
  [[nodiscard]] std::vector<Numbers> cut(std::span<const System> systems, const Numbers& numbers) const;
  void solve_group(Team& team, std::span<const System> systems, const Numbers& numbers,
                   std::span<SystemResult> results);
  void solve_together(Team& team, std::span<Member* const> members);
  void solve_chunk(Team& team, std::span<Member* const> members);
  [[nodiscard]] bool fits(const solver::Analysis& joined, Index columns, const solver::Context& context) const;
  void note(const std::string& why);

  solver::Session& session_;
  const Index wished_;  // systems of a group; 0: as many as fill a device
  int teams_;
  Seconds seconds_;
  std::mutex several_devices_;  // their kernels wait for each other: one team's at a time
  std::mutex noting_;
  std::string why_;                 // not all were solved together; empty: no reason
  std::atomic<bool> useful_{true};  // the device has not failed
  std::atomic<Index> together_{0};
};

}  // namespace espalier::batch
