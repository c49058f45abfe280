// Pivots of ldlt and lu that fail: they move to later fronts until none does, or nothing helps.
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "analysis/relocation.hpp"
#include "solver/factor/factor.hpp"
#include "solver/factor/pivot_policy.hpp"
#include "solver/factor/pivot_search.hpp"
#include "solver/ranks/whole_plan.hpp"

namespace espalier::solver {

// A factorization that halted at its failures goes on without regard to them: there is no better factor.
void Factor::complete(device::FactorOutcome& outcome) {
  if (!outcome.halted) return;
  halts_ = false;
  numeric_->halt_at_failures(false);
  deficiency_.reset();
  outcome = numeric_->factorize();
}

device::FactorOutcome Factor::settle_pivots(device::FactorOutcome outcome) {
  corrections_.clear();
  if (analysis_->kind() == Kind::llt) return with_suspects(std::move(outcome));
  PivotPolicy policy(narrow_tiles());
  if (zeros_explain(outcome)) return outcome;
  for (;;) {
    const bool zeros_stay = parts_with_zeros();
    const std::vector<Index> movable = pivots_to_move(analysis_->plan, outcome, zeros_stay);
    const auto solves = [&] {
      complete(outcome);
      return factor_solves();
    };
    switch (policy.next(static_cast<Index>(movable.size()), solves)) {
      case PivotPolicy::Step::stop:
        complete(outcome);
        if (zeros_stay && !outcome.replaced.empty() && !proves_zeros(outcome)) {
          // A search finds no more zeros, and takes minutes.
          gave_up_ = analysis_->system->unknowns(outcome.replaced.size()) > kMostZerosSought;
          break;
        }
        return outcome;
      case PivotPolicy::Step::move: {
        const bool near = policy.near(outcome.halted) && (outcome.halted || !search_is_short());
        const Moved moved = move_pivots(movable, near);
        if (moved == Moved::nowhere) halts_ = false;
        again(outcome);
        if (moved == Moved::nowhere) {
          gave_up_ = outcome.replaced.empty() || !proves_zeros(outcome);
          return outcome;
        }
        if (moved == Moved::searched) policy.note_search();
        break;
      }
      case PivotPolicy::Step::widen:
        choose_pivots_freely();
        again(outcome);
        break;
    }
  }
}

// A singular matrix leaves pivots for which no other front has better partners.
bool Factor::zeros_explain(device::FactorOutcome& outcome) {
  if (outcome.replaced.empty() || pivots_are_given()) return false;
  // With a replaced pivot of lu, its row failed as well. Other failures spoil the factor that is to be asked.
  const auto spoilt = [&] {
    if (parts_with_zeros()) return !unstable_pivots(outcome).empty();
    return outcome.failed.size() > (analysis_->kind() == Kind::lu ? outcome.replaced.size() : 0);
  };
  if (spoilt()) return false;
  complete(outcome);
  if (spoilt()) return false;
  if (parts_with_zeros()) {
    if (!outcome.failed.empty()) return zeros_without_search(outcome) || zeros_beside_others(outcome);
    if (proves_zeros(outcome)) return true;
    if (spoilt() || outcome.replaced.empty()) return false;
  }
  return judge(outcome).zeros >= analysis_->system->unknowns(outcome.replaced.size());
}

bool Factor::narrow_tiles() const {
  if (analysis_->free_pivots) return false;
  return is_narrow(context_.options.max_block_size) || is_narrow(analysis_->device.backend->limits().widest_tile);
}

// A solution of A x = A 1 has half of the digits.
bool Factor::factor_solves() const {
  constexpr double kHalfOfTheDigits = 1e-8;
  const auto n = static_cast<std::size_t>(analysis_->doubles());
  const std::vector<double> ones(n, 1.0);
  std::vector<double> b(n), x(n);
  const std::shared_ptr<const solve::ResidualSpace> space = values_.space();
  space->multiply(ones.data(), b.data(), false);
  numeric_->solve(b.data(), x.data(), 1, false);
  solve::ResidualColumn solved{b.data(), x.data(), nullptr, {}};
  space->compute(std::span(&solved, 1), false);
  return solved.error.normwise <= kHalfOfTheDigits;
}

// As far as they must, all at once; where finding that out takes too much time or memory, those that fail go one front
// up. At first only the fronts are asked in which the lowest failures are, and those that they reach: most of what
// fails above was made of their debris.
// Nowhere: most pivots fail, and no search ends: another matching is needed, or another threshold.
auto Factor::move_pivots(const std::vector<Index>& failing, bool near) -> Moved {
  const analysis::AssemblyTree& tree = analysis_->plan.tree;
  std::vector<Index> below;
  std::vector<analysis::PivotMove> moves;
  bool searched = false;
  if (near) {
    for (const analysis::PivotMove& up : analysis::one_front_up(tree, failing)) {
      const bool in_root = up.position >= tree.first[up.front];
      // The end of a root is all that is left to its pivots.
      if (in_root)
        moves.push_back(up);
      else
        below.push_back(up.position);
    }
  }
  if (moves.empty() || !below.empty()) {
    std::optional<std::vector<analysis::PivotMove>> found = place_pivots(below);
    if (!found) {
      context_.log("pivots fail nearly everywhere: the search for their places is given up");
      gave_up_ = true;
      return Moved::nowhere;
    }
    searched = !found->empty();
    if (found->empty()) found = analysis::one_front_up(tree, below.empty() ? failing : below);
    moves.insert(moves.end(), found->begin(), found->end());
  }
  context_.log(fmt::format("{} pivot{} moved to a later front", moves.size(), moves.size() == 1 ? " is" : "s are"));
  go_on_with(moves);
  return searched ? Moved::searched : Moved::one_up;
}

void Factor::go_on_with(std::span<const analysis::PivotMove> moves) {
  analysis::AssemblyTree changed = whole_tree(analysis_->plan, context_.link);
  std::vector<Index> front_before = analysis::relocate_pivots(changed, moves);
  const Index all = analysis_->moved_pivots + static_cast<Index>(moves.size());
  if (!follow(changed, std::move(front_before), all))
    change_plan(std::move(changed), {analysis_->device, all, analysis_->free_pivots});
}

// In a plan that is made of this one, with the memory of the factor, and what is right of it.
bool Factor::follow(const analysis::AssemblyTree& tree, std::vector<Index> front_before, Index moved_pivots) {
  if (!numeric_) return false;
  try {
    ChangedAnalysis changed =
        change_analysis(*analysis_, analysis::AssemblyTree(tree), std::move(front_before), moved_pivots, context_);
    if (!changed.analysis || !numeric_->change_analysis(changed)) return false;
    std::swap(analysis_, changed.analysis);
    follows_ = true;
    charge_analysis();
  } catch (const Error& error) {
    if (error.status().code != StatusCode::out_of_memory) throw;
    if (!follows_) return false;
    follows_ = false;
    numeric_.reset();
    return false;
  }
  ++changes_;
  harmless_ = 0;
  harmless_growth_ = 0;
  regular_in_fp32_ = false;
  return true;
}

// Over the whole tree, on the host.
double Factor::search_seconds() const {
  device::PlanWish wish;
  wish.kind = analysis_->kind();
  wish.complex = analysis_->system->complex_factor();
  wish.threads = context_.threads();
  wish.machine = plan::machine_with(context_.options.machine);
  return context_.registry.host().predict(analysis_->plan.tree, wish).on(1);
}

// It would be slower than many rounds on the fastest devices.
bool Factor::search_pays() const {
  constexpr double kRounds = 20, kSeconds = 1;
  return search_seconds() <= std::max(kSeconds, kRounds * analysis_->result.predicted_seconds);
}

// Then a plan that is laid out anew and a factorization of everything cost more than what a search near the failures
// spares.
bool Factor::search_is_short() const {
  constexpr double kSeconds = 0.02;
  return search_seconds() <= kSeconds;
}

std::optional<std::vector<analysis::PivotMove>> Factor::place_pivots(std::span<const Index> failed) {
  const std::vector<analysis::PivotMove> unknown;
  if (!search_pays()) return unknown;
  if (numeric_->left_something()) {
    try {
      return numeric_->place_pivots(context_.registry.host(), *analysis_, failed);
    } catch (const Error& error) {
      if (error.status().code != StatusCode::out_of_memory) throw;
    }
  }
  const Scales scales = numeric_->scales();
  numeric_.reset();  // its memory is not needed any more
  try {
    return solver::place_pivots(*analysis_, scales, values_.values(), border_values_,
                                {smallest_pivot_, parts_with_zeros()}, failed, context_);
  } catch (const Error& error) {
    if (error.status().code != StatusCode::out_of_memory) throw;
    return unknown;
  }
}

// One front a round, CONT-201 of the collection moves 444 pivots in 40 rounds in tiles of 32 and 64 columns, and is no
// nearer to a factor; in the host's it moves four. So the host goes on, with its own widths, until the next analysis.
void Factor::choose_pivots_freely() {
  const std::string why =
      fmt::format("pivots failed in {} rounds of moving them to later fronts, for want of partners in their tiles",
                  PivotPolicy::kMovesInNarrowTiles);
  const bool elsewhere = analysis_->device.backend != &context_.registry.host();
  context_.log(fmt::format("{}: going on {}with the host's widths of tiles", why, elsewhere ? "on the host " : ""));
  DeviceChoice device = elsewhere ? whole_host(context_.registry, "host: " + why) : analysis_->device;
  change_plan(whole_tree(analysis_->plan, context_.link), {std::move(device), analysis_->moved_pivots, true});
}

}  // namespace espalier::solver
