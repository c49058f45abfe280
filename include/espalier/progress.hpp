/// \file
/// How far a call is that takes long: of solvers, searches for modes, frequency responses, simulations.
#pragma once

#include <functional>
#include <limits>
#include <string>

namespace espalier {

/// Where a call is. `done` never falls while the phase stays the same one.
struct ProgressReport {
  std::string phase;                                               ///< "factorization", "modes" ...; empty: none
  double done = 0;                                                 ///< of `total`, in `unit`
  double total = 0;                                                ///< 0: nobody knows
  std::string unit;                                                ///< "flops", "modes", "frequencies" ...
  double seconds = 0;                                              ///< since the phase has begun
  double seconds_left = std::numeric_limits<double>::quiet_NaN();  ///< by what is done; NaN: nobody knows
  std::string inside;                                              ///< what the phase is at: "factorization"; empty
  double inside_done = 0, inside_total = 0;                        ///< of that; total 0: nobody knows
  std::string inside_unit;
};

/// As long as it lives, `tell` is called in the thread that made it, when calls of that thread begin a phase or are a
/// little farther. To be made before solvers and simulations are, which else tell between phases alone. A listener made
/// later takes the place of an earlier one until it ends.
class ProgressListener {
 public:
  /// @param tell  must not throw, nor call what is at work; empty: nothing is told, progress() alone tells
  /// @param every  seconds between two calls, at least
  explicit ProgressListener(std::function<void(const ProgressReport&)> tell, double every = 0.1);
  ~ProgressListener();
  ProgressListener(const ProgressListener&) = delete;
  ProgressListener& operator=(const ProgressListener&) = delete;

 private:
  struct Board;
  Board* board_;
};

/// What the calls of this thread are at, while it has a listener: for Options::interrupted and the like.
[[nodiscard]] ProgressReport progress();

}  // namespace espalier
