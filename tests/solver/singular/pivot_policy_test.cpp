// Decisions after a factorization, one by one. Truth: the rules in pivot_policy.hpp, with outcomes made by hand.
#include "solver/factor/pivot_policy.hpp"

#include <gtest/gtest.h>

namespace espalier::solver {
namespace pivot_policy_test {

using Step = PivotPolicy::Step;

device::FactorOutcome outcome(std::vector<Index> failed, std::vector<Index> replaced = {}) {
  device::FactorOutcome o;
  o.failed = std::move(failed);
  o.replaced = std::move(replaced);
  return o;
}

bool never_asked() {
  ADD_FAILURE() << "nobody needs to know whether the factor solves";
  return true;
}

int moves(PivotPolicy& policy, const std::function<bool()>& solves, Step& after) {
  for (int count = 0;; ++count)
    if ((after = policy.next(3, solves)) != Step::move) return count;
}

TEST(PivotPolicy, AGoodFactorStands) {
  PivotPolicy policy(false);
  EXPECT_EQ(policy.next(0, never_asked), Step::stop);
}

TEST(PivotPolicy, FailuresAreMovedFortyTimesAtMost) {
  PivotPolicy policy(false);
  Step after = Step::move;
  EXPECT_EQ(moves(policy, never_asked, after), 40);
  EXPECT_EQ(after, Step::stop);
}

TEST(PivotPolicy, ManyThatFailAgainAndAgainAreLeft) {
  PivotPolicy policy(false);
  int rounds = 0;
  for (const Index failing : {300, 200, 100, 100, 90, 99, 95, 98, 97, 96, 94, 93, 92, 91})
    if (policy.next(failing, never_asked) == PivotPolicy::Step::move) ++rounds;
  EXPECT_EQ(rounds, 4 + 1 + PivotPolicy::kMostInVain - 1);
  EXPECT_EQ(policy.next(91, never_asked), PivotPolicy::Step::stop);
}

TEST(PivotPolicy, EightSearchesAreEnough) {
  PivotPolicy policy(false);
  int rounds = 0;
  for (; rounds < 40 && policy.next(3, never_asked) == Step::move; ++rounds) policy.note_search();
  EXPECT_EQ(rounds, PivotPolicy::kMostSearches);
}

TEST(PivotPolicy, NarrowTilesBecomeWideWhereTheFactorDoesNotSolve) {
  PivotPolicy policy(true);
  Step after = Step::move;
  EXPECT_EQ(moves(
                policy, [] { return false; }, after),
            16);
  EXPECT_EQ(after, Step::widen);
  EXPECT_EQ(moves(policy, never_asked, after), 40) << "it begins anew in wide tiles";
  EXPECT_EQ(after, Step::stop);
}

TEST(PivotPolicy, NarrowTilesStayWhereTheFactorSolves) {
  PivotPolicy policy(true);
  Step after = Step::move;
  EXPECT_EQ(moves(
                policy, [] { return true; }, after),
            16);
  EXPECT_EQ(after, Step::stop);
}

TEST(PivotPolicy, OnlyAChoiceOfOursTurnsToLdlt) {
  device::FactorOutcome indefinite;
  indefinite.not_positive = 4;
  EXPECT_TRUE(turns_to_ldlt(Kind::llt, true, indefinite));
  EXPECT_FALSE(turns_to_ldlt(Kind::llt, true, outcome({}, {4}))) << "a small pivot is judged";
  EXPECT_FALSE(turns_to_ldlt(Kind::llt, false, indefinite));
  EXPECT_FALSE(turns_to_ldlt(Kind::llt, true, outcome({})));
  EXPECT_FALSE(turns_to_ldlt(Kind::ldlt, true, outcome({}, {4})));
}

TEST(PivotPolicy, NarrowMeansNarrowerThanTheHostsOwnTiles) {
  EXPECT_FALSE(is_narrow(0));
  EXPECT_TRUE(is_narrow(64));
  EXPECT_FALSE(is_narrow(128));
}

// Three fronts in a chain, 0 below 1 below 2 (the root), with positions 0-1, 2-3, 4-7; the root in tiles of two.
plan::Plan chain() {
  plan::Plan plan;
  plan.tree.n = 8;
  plan.tree.first = {0, 2, 4, 8};
  plan.tree.parent = {1, 2, -1};
  plan.tree.row_ptr = {0, 2, 4, 4};
  for (const Index pivots : {2, 2, 4}) {
    plan::FrontLayout l;
    l.pivots = pivots;
    l.rows = pivots == 4 ? 4 : 4;
    l.pivot_width = 2;
    l.below_width = 2;
    l.pivot_tiles = pivots / 2;
    l.tiles = 2;
    plan.layout.push_back(l);
  }
  return plan;
}

TEST(PivotsToMove, OnlyTheLowestFailuresMove) {
  EXPECT_EQ(pivots_to_move(chain(), outcome({1, 3, 5})), (std::vector<Index>{1}));
  EXPECT_EQ(pivots_to_move(chain(), outcome({2}, {3})), (std::vector<Index>{2, 3})) << "two of one front";
  EXPECT_TRUE(pivots_to_move(chain(), outcome({})).empty());
}

TEST(PivotsToMove, TheLastTileOfARootHasNowhereToGo) {
  EXPECT_EQ(pivots_to_move(chain(), outcome({4, 7})), (std::vector<Index>{4}));
  EXPECT_TRUE(pivots_to_move(chain(), outcome({6, 7})).empty());
}

// A column of lu that vanished with a row that others may need goes behind them in a root, with that row to a parent.
TEST(PivotsToMove, ZerosThatTookRowsStandLast) {
  device::FactorOutcome o = outcome({0}, {0});
  o.replaced_rows = {1};
  EXPECT_EQ(pivots_to_move(chain(), o, true), (std::vector<Index>{0, 1}));
  o = outcome({6}, {6, 7});
  o.replaced_rows = {6, 7};
  EXPECT_EQ(pivots_to_move(chain(), o, true), (std::vector<Index>{6}));
  o = outcome({7}, {7});
  o.replaced_rows = {7};
  EXPECT_TRUE(pivots_to_move(chain(), o, true).empty());
  EXPECT_TRUE(pivots_to_move(chain(), outcome({}, {2}), true).empty()) << "nothing that others need";
  EXPECT_TRUE(unstable_pivots(o).empty());
}

}  // namespace pivot_policy_test
}  // namespace espalier::solver
