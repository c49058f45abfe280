/// \file
/// What follows a factorization whose pivots failed or vanished. Decisions alone: solver/factor/factor.cpp carries them
/// out.
#pragma once

#include <functional>
#include <limits>
#include <vector>

#include "device/factor_outcome.hpp"
#include "plan/plan.hpp"

namespace espalier::solver {

/// Delayed pivoting by re-analysis: the positions of pivots that could not be eliminated stably in their fronts and had
/// better go to their parents. Only the lowest failures are among them: what failed above them was computed from their
/// debris. Ascending.
/// @param zeros_stay  pivots that were replaced have not failed by that alone: no other front has better partners for
///                    them
std::vector<Index> pivots_to_move(const plan::Plan& plan, const device::FactorOutcome& outcome,
                                  bool zeros_stay = false);

/// Positions that failed for other reasons than that columns, or the rows that they took, are not quite zeros: then a
/// factor is not stable. Ascending.
std::vector<Index> unstable_pivots(const device::FactorOutcome& outcome);

/// An outcome of llt, which reports its suspicious pivots as replaced, and has replaced none.
device::FactorOutcome with_suspects(device::FactorOutcome llt);

/// Whether a matrix taken for positive definite by our choice (kind automatic) turned out to be none.
bool turns_to_ldlt(Kind kind, bool kind_may_change, const device::FactorOutcome& outcome);

/// Whether tiles of at most this width (0: any) leave pivots fewer partners to choose from than the narrowest of the
/// host's own (plan/front_layout.cpp).
bool is_narrow(Index widest_tile);

/// A pivot below this, relative to the largest scaled entry, carries no digit and is replaced. Whether it stands for a
/// zero is another question: solver/deficiency/deficiency.hpp.
double zero_pivot(Index n, double epsilon);

/// A pivot below this (llt: relative to its diagonal entry, else to the largest scaled entry) makes a matrix
/// suspicious. The pivot of a zero was seen at 14,000 eps (free bodies in tiles of 32); where a null vector fades
/// towards the last unknown, several share what is missing. FP64: 2e-6; FP32 has no room for more than 1e4 eps.
inline double suspect_pivot(double epsilon) { return (epsilon > 1e-10 ? 1e4 : 1e10) * epsilon; }

/// Steps from one factorization of ldlt or lu to the next, until it is as good as it gets.
class PivotPolicy {
 public:
  enum class Step {
    stop,   ///< the outcome stands
    move,   ///< the movable pivots go to later fronts
    widen,  ///< the host goes on with its own widths of tiles
  };

  /// Most rounds of moving failed pivots to later fronts. One round is enough where a search finds all their places at
  /// once (device::Backend::place_pivots()); where that takes too long, each lifts the lowest failures by one front.
  /// After fewer, tiles in which a pivot has more partners to choose from are better, where there are any.
  static constexpr int kMostMoves = 40;
  static constexpr int kMovesInNarrowTiles = 16;
  /// Where more than a few pivots fail, and no fewer after so many rounds in turn, further ones are in vain, too.
  static constexpr Index kFew = 20;
  static constexpr int kMostInVain = 6;
  /// A search finds all places at once. Where its tiles and the plan's disagree again and again, further ones are in
  /// vain.
  static constexpr int kMostSearches = 8;

  /// @param narrow  see is_narrow()
  explicit PivotPolicy(bool narrow) : narrow_(narrow) {}

  /// @param movable  how many pivots_to_move() found
  /// @param factor_solves  whether refinement can mend what failed pivots have done to the factor; asked once at most
  Step next(Index movable, const std::function<bool()>& factor_solves);
  /// The move that next() asked for was found by a search.
  void note_search() { ++searches_; }
  /// Whether the move that next() asked for is to be looked for near the failures first: most of what fails above them
  /// was made of their debris.
  /// @param clean  it was not made at all: then some more rounds are worth it
  [[nodiscard]] bool near(bool clean) const { return round_ <= (clean ? 3 : 1); }

 private:
  bool narrow_;
  int round_ = 0;
  int searches_ = 0;
  int in_vain_ = 0;  // rounds in turn that did not lessen the failures
  Index fewest_ = std::numeric_limits<Index>::max();
};

}  // namespace espalier::solver
