/// \file
/// A batch of one pattern in chunks, as many systems at a time as fill a device.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "batch/chunk.hpp"
#include "solver/session/session.hpp"

namespace espalier::batch {

/// Chunks go through two teams, each with half of the threads and a factor of its own: while the device works for one,
/// the host is busy with the other. Teams are kept for the next batch with the same analysis.
class Chunks {
 public:
  /// @param session  whose threads work; outlives this
  explicit Chunks(solver::Session& session);
  Chunks(const Chunks&) = delete;
  Chunks& operator=(const Chunks&) = delete;
  /// In the child of a fork() what lies on the parent's GPU is left alone, as Session does.
  ~Chunks();

  /// Nothing is kept of the analysis before.
  void forget();
  /// Solves together what can be, as long as that leaves few systems. @param workers  raised to the most systems that
  /// were in work at a time
  /// @returns which are left, by 1
  /// @throws Error(cancelled), Error(invalid_input) for a wish that is none (Chunk::wished_size())
  std::vector<char> solve(const solver::SharedAnalysis& analysis, const ChunkJob& all, std::span<SystemResult> results,
                          int& workers);

 private:
  Index size_for(const solver::SharedAnalysis& analysis, Index count);
  struct Team;
  void make_teams(const solver::SharedAnalysis& analysis, Index size, int teams);
  std::string solve_in_lanes(const ChunkJob& all, std::span<SystemResult> results, std::span<char> left);
  void log_seconds() const;

  solver::Session& session_;
  std::optional<Index> best_;  // size, by the memory that was free before the first chunk
  std::vector<std::unique_ptr<Team>> teams_;
  int wanted_ = 0;  // teams, when these were made
};

}  // namespace espalier::batch
