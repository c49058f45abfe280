#include "solver/factor/factor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "analysis/relocation.hpp"
#include "base/at.hpp"
#include "base/scalar.hpp"
#include "solver/factor/pivot_policy.hpp"
#include "solver/options/executor_choice.hpp"
#include "solver/options/option_text.hpp"
#include "solver/ranks/whole_plan.hpp"

namespace espalier::solver {

namespace {

std::uint64_t next_stamp() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

Status no_place(std::size_t replaced, bool matching) {
  return {StatusCode::accuracy_not_reached,
          fmt::format("pivots fail nearly everywhere in this order, {} had to be replaced: this factor gives neither "
                      "solutions nor a rank; {}",
                      replaced,
                      matching ? "analyze with the values to be factorized, scale the matrix, or use kind ldlt where "
                                 "it is symmetric"
                               : "turn matching on, which brings large entries to the diagonal"),
          -1};
}

}  // namespace

Error not_on_device(const Numeric& numeric, const char* instead) {
  return {StatusCode::device_error,
          "the factor is not in the memory of a GPU (" + numeric.device_name() + "); use " + instead};
}

Factor::Factor(SharedAnalysis analysis, Values values, const Context& context)
    : context_(context),
      watch_(analysis->gain_of_single),
      analysis_(std::move(analysis)),
      values_(*analysis_->system, std::move(values), context),
      border_values_(analysis_->system->border ? analysis_->system->border->entries.size() : 0) {
  context_.raised = analysis_->fp64;
}

void Factor::drop() {
  numeric_.reset();
  taken_.reset();
  factorized_ = false;
}

bool Factor::has_numbers() const {
  return context_.options.partial_refactorization && (numeric_ != nullptr || taken_) && !context_.rescaled;
}

Factor::Left Factor::leave_numbers() {
  follow_numbers();
  Left left{analysis_, {}, nullptr, made_anew_};
  if (numeric_ && context_.rescaled) left.why_none = "the scaling of the last values was one of their own";
  if (has_numbers()) {
    if (device::DeviceLinearSystem* const device = numeric_->device_system()) {
      values_.fetch(device);
      left.values = values_.leave();
    }
    left.numeric = std::move(numeric_);
  }
  drop();
  return left;
}

void Factor::take_numbers(Left left, FollowedAnalysis::Numbers stay) {
  if (!left.numeric) return note_anew(std::move(left.why_none));
  if (!stay.why_none.empty()) return note_anew(std::move(stay.why_none));
  taken_ = Taken{std::move(left), std::move(stay)};
  if (!analysis_->device.backend->limits().own_memory) follow_numbers();
}

// What is not there can be made: no error of it is one of the caller's.
void Factor::follow_numbers() {
  if (!taken_) return;
  const base::SpareMemory::Use use(context_.spare);
  Taken taken = std::move(*taken_);
  taken_.reset();
  try {
    if (!taken.left.values.empty()) values_.follow(taken.left.values, taken.stay.entries, context_.pool);
    numeric_ = taken.left.numeric->follow_pattern(*analysis_, values_.values(), taken.stay, context_);
    taken.left.numeric.reset();
    if (!numeric_) return note_anew("only a whole factor in core goes on in a changed pattern");
    charge_analysis();
    values_.send(numeric_->device_system());
  } catch (const std::exception& error) {
    numeric_.reset();
    note_anew(fmt::format("the numbers of the pattern before could not be kept: {}", error.what()));
  }
}

const solve::ResidualOperator& Factor::residual() {
  values_.fetch(numeric_->device_system());
  return values_.residual();
}

std::span<const double> Factor::values_of_entries() {
  (void)residual();
  return values_.values();
}

std::shared_ptr<const solve::ResidualSpace> Factor::residual_space() {
  values_.fetch(numeric_->device_system());
  return values_.space();
}

double Factor::norm(bool transpose) {
  values_.fetch(numeric_->device_system());
  return values_.norm(transpose);
}

void Factor::factorize(std::span<const double> values) {
  const double start = base::now_seconds();
  begin();
  values_.load(*analysis_->system, values, numeric_->device_system(), context_.pool);
  if (values_.changed()) numeric_->expect_changes(*values_.changed());
  finish(settle_pivots(), start);
}

void Factor::restore(std::span<const double> values, std::uint64_t layout, device::ArrayVisit source) {
  const double start = base::now_seconds();
  begin();
  values_.load(*analysis_->system, values, numeric_->device_system(), context_.pool);
  if (layout != 0 && layout == numeric_->arrays_layout()) numeric_->restore_next(std::move(source));
  finish(settle_pivots(), start);
}

void Factor::factorize(const RankValues& values) {
  const double start = base::now_seconds();
  begin();
  values_.load(*analysis_->system, values, numeric_->device_system(), context_.pool);
  finish(settle_pivots(), start);
}

// New values that lie on the device of the factor stay there, unless pivots fail: what follows then works on the host's
// copy.
void Factor::factorize_device(const double* values, Offset count, void* queue) {
  const double start = base::now_seconds();
  device::DeviceLinearSystem* device = device_of_values();
  if (device == nullptr) throw not_on_device(*numeric_, "refactorize()");
  device->expect_reachable(values, "Solver::refactorize_device: the values");
  device->wait_for(queue);
  if (!analysis_->system->prepared.keeps_order()) {
    std::vector<double> copy(at(count));
    device->fetch(copy.data(), values, count);
    return factorize(copy);
  }
  set_smallest_pivot();
  const std::optional<device::FactorOutcome> outcome = numeric_->factorize_device(values);
  values_.note_on_device();
  const bool llt = analysis_->kind() == Kind::llt;
  if (outcome && outcome->not_positive < 0 && (llt || outcome->replaced.empty()) && outcome->failed.empty())
    return finish(llt ? with_suspects(*outcome) : *outcome, start);
  values_.fetch(device);
  finish(settle_pivots(), start);
}

device::DeviceLinearSystem* Factor::device_of_values() {
  begin();
  return numeric_->device_system();
}

std::vector<double> Factor::values_by_caller() {
  values_.fetch(numeric_->device_system());
  return solver::values_by_caller(analysis_->system->prepared, values_.values());
}

int Factor::gpu() const {
  const device::DeviceLinearSystem* device = numeric_ ? numeric_->device_system() : nullptr;
  return device == nullptr ? -1 : device->number();
}

GpuPlaces Factor::gpu_places() const {
  const int first = gpu();
  if (first < 0) return {};
  const DeviceChoice& device = analysis_->device;
  const plan::Plan& plan = analysis_->plan;
  if (device.one_a_rank || device.devices() == 1 || plan.ownership.devices != device.devices()) return {{first}, {}};
  GpuPlaces places{device.numbers, std::vector<Index>(at(analysis_->n()))};
  for (Index f = 0; f < plan.fronts(); ++f)
    for (Index k = plan.tree.first[at(f)]; k < plan.tree.first[at(f) + 1]; ++k)
      places.of_unknown[at(analysis_->system->unknown_of(plan.tree.order[at(k)]))] = plan.ownership.owner(f, 0);
  return places;
}

void Factor::begin() {
  return_to_device();
  changes_before_ = changes_;
  factorized_ = false;
  result_ = FactorResult{};
  deficiency_.reset();
  looked_ = gave_up_ = matched_ = follows_ = ordered_ = false;
  substitution_.reset();
  // Values that were singular a moment ago leave pivots without a place again.
  halts_ = !had_zeros_;
  parts_ = true;
  if (context_.timeline != nullptr) context_.timeline->clear();
  raise_where_noted();
  follow_numbers();
  if (!numeric_) make_numeric();
  numeric_->scale_by_matching(context_.matches());
  numeric_->halt_at_failures(halts_);
  on_device_ = numeric_->device_system() != nullptr ? analysis_ : nullptr;
}

// What was tried for singular values may have left the device, in vain; regular ones begin where those did.
void Factor::return_to_device() {
  if (had_zeros_ && on_device_ && numeric_ && numeric_->device_system() == nullptr) {
    context_.log("the last values were singular: back to the device on which they came");
    numeric_.reset();
    analysis_ = on_device_;
    context_.rescaled = false;
    ++changes_;
  }
  on_device_.reset();
}

void Factor::finish(device::FactorOutcome outcome, double start) {
  if (needs_fp64(outcome)) {
    raise_precision("FP32 does not tell this matrix from a singular one");
    again(outcome);
    outcome = settle_pivots(std::move(outcome));
  }
  if (weakly_scaled(outcome)) {
    context_.log("pivots vanish after equilibration: going on with the scaling of a matching");
    matched_ = true;
    numeric_->scale_by_matching(true);
    outcome = settle_pivots();
  }
  if (lost_to_scaling(outcome)) {
    context_.log("pivots vanish in the scaling of the analysis, in a scaling of their own the values are regular");
    context_.rescaled = true;
    gave_up_ = false;
    parts_ = true;
    again(outcome);
    outcome = settle_pivots(std::move(outcome));
  }
  if (turns_to_ldlt(analysis_->kind(), analysis_->system->kind_may_change, outcome) ||
      small_pivots_are_zeros(outcome)) {
    turn_to_ldlt();
    make_numeric();
    values_.send(numeric_->device_system());
    outcome = settle_pivots();
  }
  had_zeros_ = !outcome.replaced.empty();
  const bool hopeless = gave_up_ && !outcome.replaced.empty();
  result_ = report_factor(*analysis_, *numeric_, outcome, hopeless ? Deficiency{} : judge(outcome), context_.options,
                          context_.budget.peak());
  if (hopeless) forget_rank(result_);
  if (hopeless) result_.status = no_place(outcome.replaced.size(), context_.options.matching);
  result_.work_share = changes_ == changes_before_ ? outcome.share : 1;
  if (context_.options.partial_refactorization) result_.whole_reason = whole_reason(*analysis_, *numeric_);
  if (std::string why = std::exchange(made_anew_, {}); result_.whole_reason.empty())
    result_.whole_reason = std::move(why);
  result_.precision = context_.precision();
  if (analysis_->system->numbers() != base::Numbers::real) {
    phase_ = analysis_->system->real_form ? phase_of_real_form(*analysis_, result_)
                                          : outcome.determinant_phase * analysis_->system->prepared.transform_sign;
    result_.determinant_sign = std::abs(result_.determinant_sign);
  }
  result_.seconds = base::now_seconds() - start;
  watch_.add_factorization(result_.seconds);
  result_.flops_per_second = analysis_->flops() / result_.seconds;
  factorized_ = result_.status.ok();
  stamp_ = next_stamp();
}

// Where the choice of devices was ours and they fail, others take over.
void Factor::make_numeric() {
  numeric_.reset();  // its memory goes before new memory comes
  while (!numeric_) {
    try {
      charge_analysis();
      numeric_ = solver::make_numeric(*analysis_, values_.values(), border_values_, context_);
    } catch (const Error& e) {
      if (e.status().code == StatusCode::cancelled) throw;
      auto next = take_over(analysis_->device, e.what(), context_.registry);
      if (!next) throw;
      context_.log(fmt::format("the {} cannot take the factorization: going on with {}",
                               analysis_->device.backend->noun(), next->reason));
      change_plan(whole_tree(analysis_->plan, context_.link),
                  {std::move(*next), analysis_->moved_pivots, analysis_->free_pivots});
    }
  }
  numeric_->set_smallest_pivot(smallest_pivot_);
  numeric_->part_with_zeros(parts_with_zeros());
  numeric_->scale_by_matching(matched_ || context_.matches());
  numeric_->halt_at_failures(halts_);
}

// @throws Error(out_of_memory) where the budget is too small for the factorization as it is planned
void Factor::charge_analysis() {
  context_.budget.give_back(std::exchange(charged_, 0));
  const std::vector<Offset> budgets = budgets_of(analysis_->device, context_.options);
  const bool budgeted = std::any_of(budgets.begin(), budgets.end(), [](Offset b) { return b > 0; });
  const bool on_host = !analysis_->device.backend->limits().own_memory, disk = !context_.options.scratch.empty();
  const Offset limit = context_.budget.limit();
  const Offset needed = on_host && !budgeted && !disk ? predicted_host_bytes(*analysis_, context_) : analysis_->bytes();
  if (limit > 0 && needed > limit) {
    const Offset least = !on_host ? needed
                         : disk   ? least_budget_on_disk(*analysis_, context_)
                                  : predicted_host_bytes(*analysis_, context_);
    throw Error(
        StatusCode::out_of_memory,
        fmt::format(
            "the factorization needs {} on the host, its budget is {}; a budget of at least {} bytes would do, or "
            "fewer threads",
            base::format_bytes(least), base::format_bytes(limit), least));
  }
  context_.budget.take(analysis_->bytes());
  charged_ = analysis_->bytes();
}

void Factor::change_plan(analysis::AssemblyTree tree, Changes changes) {
  numeric_.reset();
  analysis_ = lay_out_again(*analysis_, std::move(tree), std::move(changes), context_);
  ++changes_;
  harmless_ = 0;
  harmless_growth_ = 0;
  regular_in_fp32_ = false;
}

void Factor::again(device::FactorOutcome& outcome) {
  deficiency_.reset();
  if (std::exchange(follows_, false)) {
    try {
      outcome = numeric_->factorize_rest();
    } catch (...) {
      numeric_.reset();  // what it has taken over holds for these values alone
      throw;
    }
    return;
  }
  make_numeric();
  values_.send(numeric_->device_system());
  outcome = numeric_->factorize();
}

// The caller's, or what rounding makes of a zero.
void Factor::set_smallest_pivot() {
  const double epsilon = context_.single() ? base::ScalarTraits<float>::epsilon : base::ScalarTraits<double>::epsilon;
  const double given = context_.options.perturbation;
  smallest_pivot_ = given > 0 ? given : zero_pivot(analysis_->n(), epsilon);
  if (!numeric_) return;
  numeric_->set_smallest_pivot(smallest_pivot_);
  numeric_->part_with_zeros(parts_with_zeros());
}

device::FactorOutcome Factor::settle_pivots() {
  deficiency_.reset();
  set_smallest_pivot();
  device::FactorOutcome outcome = numeric_->factorize();
  const bool clean =
      outcome.not_positive < 0 && outcome.replaced.empty() && outcome.failed.empty() && outcome.small.empty();
  if (!clean) values_.fetch(numeric_->device_system());  // what follows works on the host's copy
  return settle_pivots(std::move(outcome));
}

}  // namespace espalier::solver
