/// \file
/// The numeric part of a solver: values, their factor, and what both need. Several may stand on one analysis.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "base/lazy_vector.hpp"
#include "solve/residual.hpp"
#include "solver/analysis/analysis.hpp"
#include "solver/deficiency/deficiency.hpp"
#include "solver/factor/numeric.hpp"
#include "solver/options/precision_choice.hpp"
#include "solver/session/context.hpp"
#include "solver/solution/substitution.hpp"

namespace espalier::solver {

/// New values on ranks, in the order of the analysed matrix; of complex ones the parts, counted as doubles.
struct RankValues {
  std::span<const double> own;  ///< [first, first + own.size()); those of all ranks are the whole
  Offset first = 0;
  std::function<std::vector<double>()> all;  ///< brings the whole to every rank; collective
  bool on_device = false;                    ///< `own` lies in the memory of the factor's device
};

/// The last values that went into a factor, and the residuals that they make.
class FactorValues {
 public:
  using Places = base::LazyVector<Offset>;

  FactorValues(const System& system, Values values, const Context& context);

  /// Takes new values of the caller; where a device holds the linear system, on to it.
  void load(const System& system, std::span<const double> from, device::DeviceLinearSystem* device,
            base::ThreadPool& pool);
  /// New numbers at some places of values(); of a place that comes twice the last one holds.
  void load(std::span<const Offset> places, std::span<const double> numbers, device::DeviceLinearSystem* device);
  /// The places in values(), ascending, at which the last load() has put other numbers than were there before, on the
  /// device, too; nothing: it may have been anywhere.
  [[nodiscard]] const std::optional<Places>& changed() const { return changed_; }
  /// On ranks. Where their devices hold the linear system, values go from one to the other; what a rank has not given
  /// itself is on its device alone then.
  void load(const System& system, const RankValues& from, device::DeviceLinearSystem* device, base::ThreadPool& pool);
  /// To a device that holds the linear system, if any.
  void send(device::DeviceLinearSystem* device) const;
  /// Values of a pattern before, by its entries, become those of before here, where entries have come with zeros.
  void follow(std::span<const double> before, const plan::SourceMap& now, base::ThreadPool& pool);
  /// The values, which are of no use here then.
  [[nodiscard]] Values leave() { return std::move(values_); }
  /// The last values came from the memory of this device, and are there alone.
  void note_on_device() { on_device_ = true; }
  /// They come here, if they are there alone.
  void fetch(device::DeviceLinearSystem* device);

  [[nodiscard]] std::span<const double> values() const { return values_; }
  /// The residual of all rows, or of those that this rank computes.
  [[nodiscard]] const solve::ResidualOperator& residual() const { return residual_; }
  /// The vectors' space of all rows, as long as this object lives. Collective where ranks share them.
  [[nodiscard]] std::shared_ptr<const solve::ResidualSpace> space() const;
  /// |op(A)|_inf. Likewise.
  [[nodiscard]] double norm(bool transpose) const;

 private:
  void send_range(std::span<const double> from, Offset first, device::DeviceLinearSystem& device,
                  base::ThreadPool& pool);
  [[nodiscard]] bool knows_changes(device::DeviceLinearSystem* device) const;
  void send_changed(std::span<const double> from, device::DeviceLinearSystem& device, base::ThreadPool& pool);

  ranks::Communicator* link_;  // null: there are no other ranks
  bool shared_;                // by them
  bool compares_;              // with the values before
  Values values_;
  solve::ResidualOperator residual_;
  bool on_device_ = false;
  std::optional<Places> changed_;
};

/// The caller's columns and rows at these positions of the plan, ascending, each once.
std::vector<Index> columns_of(const Analysis& analysis, const std::vector<Index>& positions);
std::vector<Index> rows_of(const Analysis& analysis, const std::vector<Index>& positions);

class Factor {
 public:
  /// @param values  as many as the analysed matrix has entries, or none yet
  /// @param context  outlives the factor
  Factor(SharedAnalysis analysis, Values values, const Context& context);
  ~Factor() { context_.budget.give_back(charged_); }
  Factor(const Factor&) = delete;
  Factor& operator=(const Factor&) = delete;

  void factorize(std::span<const double> values);
  void factorize(const RankValues& values);
  /// The same where the numbers were saved: see Executor::restore(). Another layout than that of the arrays here has
  /// all made anew.
  void restore(std::span<const double> values, std::uint64_t layout, device::ArrayVisit source);
  /// Values of the system's border, in its order, for the factorizations to come.
  void set_border(std::span<const double> values) { std::copy(values.begin(), values.end(), border_values_.begin()); }
  /// New values of some entries; the others stay. Doubles, as many as the entries have. @pre accepts() said so
  void factorize_entries(std::span<const Offset> entries, std::span<const double> values);
  /// Whether factorize_entries() takes these: else values_with() makes all values of them.
  /// @throws Error(invalid_input) for places that there are not
  [[nodiscard]] bool accepts(std::span<const Offset> entries, std::span<const double> values) const;
  /// The values of these entries in the last factorization. @pre accepts() said so
  [[nodiscard]] std::vector<double> values_at(std::span<const Offset> entries);
  void factorize_device(const double* values, Offset count, void* queue);
  /// Whose memory the values of the next factorization may lie in; null: the host's alone. The numeric part is made,
  /// where there is none yet.
  [[nodiscard]] device::DeviceLinearSystem* device_of_values();
  /// The caller's values of the last factorization but for some of them (see Solver::refactorize_entries()); the places
  /// are there.
  /// @throws Error(invalid_input)
  [[nodiscard]] std::vector<double> values_with(std::span<const Offset> places, std::span<const double> values);
  /// @throws Error(invalid_input) for values of the caller that no factorization takes: not finite, not symmetric
  void expect_fit(std::span<const double> values) const;
  /// Gives back all memory of the factor; the values stay.
  void drop();
  /// What a factor leaves to that of a changed pattern.
  struct Left {
    SharedAnalysis analysis;           ///< of `numeric`
    Values values;                     ///< of the last factorization, where a device holds the linear system
    std::unique_ptr<Numeric> numeric;  ///< null: nothing
    std::string why_none = {};         ///< then: the reason, where there was a factor
  };
  /// Whether there is something to leave.
  [[nodiscard]] bool has_numbers() const;
  /// The same of the numbers; this factor has none then.
  [[nodiscard]] Left leave_numbers();
  /// On a device with memory of its own the first factorization takes them over, as it makes tables there.
  /// @pre this factor is new. Where nothing can be kept, its first factorization makes everything, and says why
  void take_numbers(Left left, FollowedAnalysis::Numbers stay);
  /// Why the next factorization makes everything, though there was one before.
  void note_anew(std::string why) { made_anew_ = std::move(why); }
  /// Leaves the memory of the factor to itself: in the child of a fork(), a device of the parent cannot be asked.
  void abandon() noexcept {
    (void)numeric_.release();
    if (taken_) (void)taken_->left.numeric.release();
  }

  /// Where factorizations have moved pivots, changed the kind or the devices, no longer the one that was given.
  [[nodiscard]] const SharedAnalysis& analysis() const { return analysis_; }
  /// A number that no other factorization has, of any factor.
  [[nodiscard]] std::uint64_t stamp() const { return stamp_; }
  /// How often it has become another one.
  [[nodiscard]] int changes() const { return changes_; }
  /// Whether another factor that has just been made on the same analysis would treat the next values as this one will.
  [[nodiscard]] bool like_new() const {
    return changes_ == 0 && !had_zeros_ && harmless_ == 0 && harmless_growth_ == 0 && !context_.rescaled &&
           inaccurate_.empty() && (factorized_ || !numeric_);
  }
  /// The result of the last factorization; null vectors of complex matrices as doubles, determinant_sign 1 where it is
  /// not zero.
  [[nodiscard]] const FactorResult& result() const { return result_; }
  [[nodiscard]] FactorResult& result() { return result_; }
  /// The phase of the last factorization: the determinant over its magnitude; NaN where a real form does not tell it.
  [[nodiscard]] std::complex<double> determinant_phase() const {
    return result_.determinant_sign == 0 ? 0 : result_.determinant_sign * phase_;
  }
  /// Where factorize_device() takes values from; -1: nowhere.
  [[nodiscard]] int gpu() const;
  /// See Solver::gpu_places().
  [[nodiscard]] GpuPlaces gpu_places() const;
  [[nodiscard]] bool factorized() const { return factorized_; }

  /// The precision of this factor; never automatic.
  [[nodiscard]] Precision precision() const { return context_.precision(); }

  /// @pre factorized(), for all below
  [[nodiscard]] Numeric& numeric() { return *numeric_; }
  /// What came of a solve with this factor. Precision::automatic: where it was not accurate enough, the next
  /// factorization is in FP64.
  void note(const SolveResult& solve);
  /// Does so at once, with the same values. @returns whether there is a factor in FP64 that was not there before
  [[nodiscard]] bool goes_to_fp64();
  /// op(A)^-1 B by the factor, or by substitution; n numbers each, column-major.
  void solve(const double* b, double* x, Index columns, bool transpose);
  /// Backward errors of a solution that nobody refines, by make(), once for each factorization.
  const solve::BackwardError& error_without_refinement(bool transpose,
                                                       const std::function<solve::BackwardError()>& make) {
    Unrefined& u = unrefined_[transpose ? 1 : 0];
    if (u.stamp != stamp_) u = {stamp_, make()};
    return u.error;
  }
  /// Whether solve() does without the factor.
  [[nodiscard]] bool substitutes() const { return substitution_.has_value(); }
  /// Does so from now on where the matrix is triangular in some order of its rows and columns. Looked at once for each
  /// factorization. @returns whether it did not before
  [[nodiscard]] bool goes_to_substitution();
  /// Singularity that no pivot has shown: a solution that is far larger than its right-hand side (n values each, on the
  /// host) has the matrix judged, once for each factorization.
  Status second_look(const double* b, const double* x, bool transpose);
  /// See Solver::values().
  [[nodiscard]] std::vector<double> values_by_caller();
  /// The linear system in the host's memory, of one process.
  [[nodiscard]] const solve::ResidualOperator& residual();
  /// The values of the last factorization in the order of the prepared matrix, there.
  [[nodiscard]] std::span<const double> values_of_entries();
  /// The same on ranks, too. Its calls are collective there.
  [[nodiscard]] std::shared_ptr<const solve::ResidualSpace> residual_space();
  /// |op(A)|_inf. Collective.
  [[nodiscard]] double norm(bool transpose);

 private:
  void begin();
  void return_to_device();
  void follow_numbers();
  void make_numeric();
  void charge_analysis();
  void again(device::FactorOutcome& outcome);
  void complete(device::FactorOutcome& outcome);
  void change_plan(analysis::AssemblyTree tree, Changes changes);
  void go_on_with(std::span<const analysis::PivotMove> moves);
  [[nodiscard]] bool follow(const analysis::AssemblyTree& tree, std::vector<Index> front_before, Index moved_pivots);
  void set_smallest_pivot();
  [[nodiscard]] bool parts_with_zeros() const;
  [[nodiscard]] bool looks() const;
  [[nodiscard]] bool searches_on_host(device::FactorOutcome& outcome);
  [[nodiscard]] bool small_pivots_are_zeros(const device::FactorOutcome& outcome);
  [[nodiscard]] bool proves_zeros(device::FactorOutcome& outcome);
  [[nodiscard]] bool zeros_beside_others(const device::FactorOutcome& outcome);
  [[nodiscard]] std::optional<Deficiency> zeros_among(const device::FactorOutcome& outcome);
  [[nodiscard]] bool zeros_without_search(const device::FactorOutcome& outcome);
  device::FactorOutcome settle_pivots();
  device::FactorOutcome settle_pivots(device::FactorOutcome outcome);
  enum class Moved { nowhere, one_up, searched };
  Moved move_pivots(const std::vector<Index>& failing, bool near);
  [[nodiscard]] double search_seconds() const;
  [[nodiscard]] bool search_pays() const;
  [[nodiscard]] bool search_is_short() const;
  [[nodiscard]] std::optional<std::vector<analysis::PivotMove>> place_pivots(std::span<const Index> failed);
  void choose_pivots_freely();
  void turn_to_ldlt();
  [[nodiscard]] bool factor_solves() const;
  const Deficiency& judge(device::FactorOutcome& outcome);
  [[nodiscard]] Deficiency deficiency(bool replaced, Index suspects, bool surely_alone);
  /// With a job of this factor, whose values are fetched.
  template <class Use>
  auto with_deficiency_job(Use&& use);
  void with_larger_pivots(const std::function<bool()>& search);
  [[nodiscard]] bool pivots_are_given() const {
    const Options& o = context_.options;
    return o.perturbation > 0 || (o.zero_pivot > 0 && !analysis_->system->prepared.unmatched);
  }
  [[nodiscard]] bool zeros_explain(device::FactorOutcome& outcome);
  [[nodiscard]] bool needs_fp64(device::FactorOutcome& outcome);
  bool lost_to_scaling(device::FactorOutcome& outcome);
  [[nodiscard]] bool weakly_scaled(const device::FactorOutcome& outcome) const;
  [[nodiscard]] bool is_triangular();
  void raise_precision(std::string_view why);
  void raise_where_noted();
  [[nodiscard]] bool narrow_tiles() const;
  void finish(device::FactorOutcome outcome, double start);

  Context context_;         ///< a copy: this factor may be raised to FP64
  PrecisionWatch watch_;    ///< Precision::automatic
  std::string inaccurate_;  ///< why the next factorization is in FP64; empty: no reason
  SharedAnalysis analysis_;
  int changes_ = 0;
  int changes_before_ = 0;  // this factorization
  FactorValues values_;
  std::vector<double> border_values_;
  Offset charged_ = 0;                // of the analysis and the values, in the budget
  std::unique_ptr<Numeric> numeric_;  // made by the first factorization; of analysis_ and values_
  struct Taken {
    Left left;
    FollowedAnalysis::Numbers stay;
  };
  std::optional<Taken> taken_;            // from which the first factorization makes numeric_; empty: from nothing
  double smallest_pivot_ = 0;             // relative; a smaller pivot counts as zero
  std::optional<Deficiency> deficiency_;  // of the last numeric factorization; empty: not judged
  Index harmless_ = 0;                    // so many small pivots were no sign of singularity, in this plan
  double harmless_growth_ = 0;            // largest entries of a solution over those of its right-hand side: likewise
  bool regular_in_fp32_ = false;          // a factor in FP32 told the matrix from a singular one, in this plan
  bool looked_ = false;                   // at the matrix itself, whatever the pivots say
  std::optional<Substitution> substitution_;  // of the values of this factorization
  bool ordered_ = false;                      // it was looked for
  bool matched_ = false;                      // this factorization has turned from equilibration to a matching
  bool halts_ = true;                         // factorizations end where pivots fail
  bool parts_ = true;                         // vanishing pivots count as zeros, until that proves wrong
  SharedAnalysis on_device_;                  // with which the last factorization began; null: not on a device
  bool had_zeros_ = false;                    // the last factorization ended with replaced pivots
  bool follows_ = false;                      // numeric_ goes on with what the last factorization has left
  std::vector<RankCorrection> corrections_;   // of solutions: vanishing pivots of lu stand for more than zeros
  bool gave_up_ = false;                      // no place was found for failing pivots
  std::string made_anew_;                     // why the next factorization makes everything; empty: see whole_reason()
  FactorResult result_;
  struct Unrefined {
    std::uint64_t stamp = 0;
    solve::BackwardError error;
  };
  std::array<Unrefined, 2> unrefined_;  // with A, with A^T
  std::uint64_t stamp_ = 0;
  std::complex<double> phase_ = 1;  // complex: the determinant over its magnitude and sign
  bool factorized_ = false;
};

/// That `numeric` has no memory of a device for arrays of the caller. @param instead  the call for those of the host
Error not_on_device(const Numeric& numeric, const char* instead);

/// Largest entries of a right-hand side and of its solution in the scaled system.
struct Growth {
  double given = 0, found = 0;
  /// A random right-hand side of a singular matrix grows by 1e15 / sqrt(n), in FP32 by 1e7 / sqrt(n) at first.
  [[nodiscard]] bool is_far(bool single) const { return found > (single ? 1e5 : 1e11) * given && std::isfinite(found); }
};
/// @param b, x  doubles of op(A) x = b, as many; `parts` of them in a number
/// @param norm  of op(A); read where the matrix is not scaled
Growth growth_of(std::span<const double> b, std::span<const double> x, Index parts, const Scales& scales, double norm,
                 bool transpose);

/// The status of a matrix whose rank is n - zeros. @param rows  that depend on the others
Status singular(const std::vector<Index>& rows, Index zeros, Index n);

/// det A over its magnitude of a complex matrix whose real form was factorized: known of Hermitian ones, by their
/// inertia. The determinant of the real form is +-|det A|^2, which does not tell it: NaN.
std::complex<double> phase_of_real_form(const Analysis& analysis, const FactorResult& result);

/// Clears the rank of a matrix that is singular in a way that nothing has told: no rank, inertia or determinant.
void forget_rank(FactorResult& r);
/// Why it makes everything again with each factorization; empty: it need not.
std::string whole_reason(const Analysis& analysis, const Numeric& numeric);
/// What `numeric` came to, as the caller reads it. @param held_bytes  by the solver, on the host
FactorResult report_factor(const Analysis& analysis, const Numeric& numeric, const device::FactorOutcome& outcome,
                           Deficiency deficiency, const Options& options, Offset held_bytes);

}  // namespace espalier::solver
