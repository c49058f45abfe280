/// \file
/// Rank 0 runs a simulation, and all ranks together factorize its Newton matrices: what rank 0 is about to do with its
/// solver is announced to the others, which do the same on theirs.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "espalier/ranks.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics::model {

/// The announcements are collective calls of their own, one before each call of the solver. Those who serve wait for
/// them as long as Ranks' patience.
class SharedNewton {
 public:
  enum class Call : std::int64_t { make, drop, analyze, analyze_change, factorize, solve, end };

  /// On rank 0: the others make a solver on these ranks, with the same options (run_options).
  /// @throws Error where one of them cannot
  SharedNewton(Ranks ranks, const std::vector<std::pair<std::string, std::string>>& options, Index unknowns);
  /// The others give their solver back. Says nothing where a rank is lost.
  ~SharedNewton();
  SharedNewton(const SharedNewton&) = delete;
  SharedNewton& operator=(const SharedNewton&) = delete;

  [[nodiscard]] const Ranks& ranks() const { return ranks_; }
  /// The same call of the solver must follow here. @param columns  of solve
  Status announce(Call call, Index columns = 0) const;

 private:
  Ranks ranks_;
  std::int64_t number_;  // of the solver, among those of this process
};

}  // namespace espalier::dynamics::model
