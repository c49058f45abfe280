// What is tried where a factorization is not good enough: another scaling, FP64, L D L^T.
#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "solver/factor/factor.hpp"
#include "solver/options/option_text.hpp"
#include "solver/ranks/whole_plan.hpp"

namespace espalier::solver {

// FP32 cannot tell a matrix of this condition from a singular one, nor would refinement converge.
bool Factor::needs_fp64(device::FactorOutcome& outcome) {
  if (context_.precision() != Precision::mixed) return false;
  // A look at many small pivots takes longer than FP64.
  constexpr Index kFew = 8;
  return outcome.not_positive >= 0 || !outcome.replaced.empty() ||
         analysis_->system->unknowns(outcome.small.size()) > kFew || judge(outcome).smallest < kLeastForFp32;
}

// Values may have moved far from those that the analysis scaled.
bool Factor::lost_to_scaling(device::FactorOutcome& outcome) {
  if (outcome.replaced.empty() || pivots_are_given() || context_.rescales() || analysis_->kind() == Kind::llt)
    return false;
  if (gave_up_) return true;
  const Deficiency& found = judge(outcome);
  return found.zeros < analysis_->system->unknowns(outcome.replaced.size()) &&
         !(found.reduced && !found.dense && found.zeros > 0);
}

bool Factor::weakly_scaled(const device::FactorOutcome& outcome) const {
  const Options& o = context_.options;
  const bool equilibrated = o.rescale == Rescale::equilibration && o.matching && !context_.rescaled;
  return equilibrated && !outcome.replaced.empty() && analysis_->kind() != Kind::llt;
}

void Factor::raise_precision(std::string_view why) {
  context_.log(fmt::format("{} precision: {}; going on in FP64", name_of(context_.options.precision), why));
  context_.raised = true;
  looked_ = false;  // with the eyes of FP32
  change_plan(whole_tree(analysis_->plan, context_.link),
              {analysis_->device, analysis_->moved_pivots, analysis_->free_pivots});
  set_smallest_pivot();
}

void Factor::note(const SolveResult& solve) {
  watch_.add_solve(solve);
  const bool may = context_.options.precision == Precision::automatic && context_.single();
  if (may && solve.status.code == StatusCode::accuracy_not_reached)
    inaccurate_ = fmt::format("a backward error of {:.1e} remains", solve.backward_error);
}

// Before a factorization.
void Factor::raise_where_noted() {
  if (context_.options.precision != Precision::automatic || !context_.single()) return;
  std::string why = std::exchange(inaccurate_, {});
  if (watch_.next_factor() && why.empty())
    why = fmt::format("two factors with their solves took longer than FP64 would (the last {:.3g} s for {:.3g} s)",
                      watch_.seconds(), watch_.seconds_in_fp64());
  if (why.empty()) return;
  raise_precision(why);
}

bool Factor::goes_to_fp64() {
  if (inaccurate_.empty()) return false;
  const double start = base::now_seconds();
  values_.fetch(numeric_->device_system());
  begin();
  values_.send(numeric_->device_system());
  finish(settle_pivots(), start);
  return factorized_;
}

// The matrix that llt gave up is analyzed again from this factor's copy. Values of which no ldlt can be made cost this
// factorization alone: the analysis for llt stands.
void Factor::turn_to_ldlt() {
  context_.log("a pivot is not positive: going on with ldlt");
  numeric_.reset();
  Analyzed made = analyze_for_ldlt(*analysis_, values_.values(), context_);
  FactorValues values(*made.analysis->system, std::move(made.values), context_);  // may be interrupted
  analysis_ = std::move(made.analysis);
  ++changes_;
  harmless_ = 0;
  harmless_growth_ = 0;
  regular_in_fp32_ = false;
  values_ = std::move(values);
}

}  // namespace espalier::solver
