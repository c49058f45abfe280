/// \file
/// What follows a factorization whose pivots failed or vanished. Decisions alone: solver/factor.cpp carries them out.
#pragma once

#include <functional>
#include <vector>

#include "device/factor_outcome.hpp"
#include "plan/plan.hpp"

namespace espalier::solver {

/// Delayed pivoting by re-analysis: the positions of pivots that could not be eliminated stably in their fronts and had
/// better go to their parents. Only the lowest failures are among them: what failed above them was computed from their
/// debris. Ascending.
std::vector<Index> pivots_to_move(const plan::Plan& plan, const device::FactorOutcome& outcome);

/// Whether a matrix taken for positive definite by our choice (kind automatic) turned out to be none.
bool turns_to_ldlt(Kind kind, bool kind_may_change, const device::FactorOutcome& outcome);

/// Whether tiles of at most this width (0: any) leave pivots fewer partners to choose from than the narrowest of the
/// host's own (plan/front_layout.cpp).
bool is_narrow(Index widest_tile);

/// A pivot below this, relative to the largest scaled entry, carries no digit: it is rounding error of a zero.
double zero_pivot(Index n, double epsilon);

/// Steps from one factorization of ldlt or lu to the next, until it is as good as it gets.
class PivotPolicy {
 public:
  enum class Step {
    stop,        ///< the outcome stands
    move,        ///< the movable pivots go to later fronts
    widen,       ///< the host goes on with its own widths of tiles
    raise_zero,  ///< the matrix is singular: more pivots count as zero, see kSingularFactor
  };

  /// Most rounds of moving failed pivots to later fronts: each lifts the lowest failures by one front. After fewer,
  /// tiles in which a pivot has more partners to choose from are better, where there are any.
  static constexpr int kMostMoves = 40;
  static constexpr int kMovesInNarrowTiles = 16;
  /// Once a zero pivot has shown that the matrix is singular, the pivots of its other zero eigenvalues may stand above
  /// the rounding error of one: measured on free bodies, whose six vanish within a factor of 50 of each other, but
  /// within 14,000 (the next pivot 20,000 further up) where tiles of 32 leave less choice of pivots, as on a GPU.
  static constexpr double kSingularFactor = 1e5;

  /// @param narrow  see is_narrow()
  /// @param zero_given  the caller has said which pivots count as zero
  PivotPolicy(bool narrow, bool zero_given) : narrow_(narrow), zero_given_(zero_given) {}

  /// @param movable  pivots_to_move() found some
  /// @param factor_solves  whether refinement can mend what failed pivots have done to the factor; asked once at most
  Step next(const device::FactorOutcome& outcome, bool movable, const std::function<bool()>& factor_solves);

 private:
  bool narrow_, zero_given_;
  bool raised_ = false;
  int round_ = 0;
};

}  // namespace espalier::solver
