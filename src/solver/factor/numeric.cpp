#include "solver/factor/numeric.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "analysis/border.hpp"
#include "base/at.hpp"
#include "base/scalar.hpp"
#include "base/stage.hpp"
#include "device/block_diagonal.hpp"
#include "solver/factor/inverse_entries.hpp"
#include "solver/factor/linear_system_arrays.hpp"
#include "solver/factor/pivot_policy.hpp"
#include "solver/factor/reached_fronts.hpp"
#include "solver/options/executor_choice.hpp"
#include "solver/solution/plan_rows.hpp"
#include "solver/solution/plan_vectors.hpp"

namespace espalier::solver {

namespace {

constexpr Index kMostColumnsAtOnce = 32;  // right-hand sides per sweep: 32 doubles are four cache lines per row

// T: scalar of the factor. kRealForm: it is that of a complex system's real form (real_form.hpp), of whose vectors two
// rows, a number's parts, stand for one number.
template <class T, bool kRealForm = false>
class NumericOf final : public Numeric {
  using Value = base::WideOf<T>;
  static constexpr bool kComplex = base::ScalarTraits<T>::is_complex;

 public:
  // followed: an executor for the analysis, which has been another one's; null: there is none. values_before: of its
  // last factorization, in the places of now.
  NumericOf(const Analysis& analysis, std::span<const double> values, std::span<const double> border_values,
            const Context& context, std::unique_ptr<device::Executor<T>> followed = nullptr,
            base::Buffer<T> values_before = {})
      : plan_(&analysis.plan),
        flops_(analysis.flops()),
        predicted_seconds_(analysis.result.predicted_seconds),
        prepared_(analysis.system->prepared),
        real_form_(analysis.system->real_form.get()),
        scales_{prepared_.row_scale, prepared_.col_scale, prepared_.transform_log, prepared_.wide},
        rescale_(context.rescales() && analysis.kind() != Kind::llt),
        matching_(context.matches()),
        given_zero_(prepared_.unmatched ? 0 : context.options.zero_pivot),
        given_(values),
        border_(analysis.plan.tree.border > 0 ? analysis.system->border : nullptr),
        border_values_(border_values),
        pool_(context.pool),
        budget_(context.budget),
        link_(context.link),
        vectors_(prepared_, real_form_, pool_),
        rows_(prepared_, real_form_, budget_),
        rule_{context.options.pivot_threshold, 0},
        executor_(followed ? std::move(followed) : make_executor<T>(analysis, rule_, context)) {
    keeps_fronts_ = plan_->options.keep_contributions;
    // A Cholesky pivot is judged by its diagonal entry.
    const MatrixView factored = analysis.system->factored_pattern();
    if (analysis.kind() == Kind::llt) diagonal_ = diagonal_places(factored, plan_->tree.order, pool_);
    find_own_diagonal();
    if constexpr (!kRealForm) position_ = positions_for(prepared_, plan_->tree.order);
    if constexpr (!kComplex) take_device_system(analysis, context);
    if (device_ != nullptr) {
      diagonal_ = {};
      return;
    }
    const auto of_border = static_cast<Offset>(border_ ? border_->entries.size() : 0);
    factorized_ = values_before.size() > 0;
    values_ = factorized_ ? std::move(values_before)
                          : base::Buffer<T>(plan::values_of(*plan_, factored.nonzeros()) + of_border, &budget_);
    if constexpr (kRealForm) numbers_ = base::Buffer<std::complex<T>>(prepared_.a.nonzeros(), &budget_);
    if (context.options.partial_refactorization) before_ = base::Buffer<T>(values_.size(), &budget_);
    smallest_.resize(diagonal_.size());
  }

  device::FactorOutcome factorize() override {
    base::Stage stage("factorization", flops_, "flops", predicted_seconds_);
    if (device_ != nullptr) {
      if (auto outcome = factorize_there()) return *outcome;
      std::vector<double> given(given_.size());  // some may be there alone
      device_->read_values(given);
      refuse_entry(prepared_, given);
    }
    if (rescale_ && !restore_) scales_ = scales_for(prepared_, given_, matching_, pool_);
    const bool follows = std::exchange(factorized_, false) && before_.size() > 0;
    if (before_.size() > 0) std::swap(values_, before_);
    const double largest = scale();
    if constexpr (!kComplex) {
      if (border_)
        border_scales_ = scale_border(*border_, scales_, border_values_, values_.data() + prepared_.a.nonzeros());
    }
    rule_.tiny = given_zero_ > 0 ? given_zero_ : smallest_pivot_ * largest;
    rule_.in_place_of_zero = !parts_with_zeros_ ? 0 : largest > 0 ? largest : 1;
    rule_.largest = largest;
    rule_.suspect = suspect_pivot(base::ScalarTraits<T>::epsilon) * largest;
    for (std::size_t k = 0; k < smallest_.size(); ++k)
      if (diagonal_[k] >= 0)
        smallest_[k] = suspect_pivot(base::ScalarTraits<T>::epsilon) * std::real(values_[diagonal_[k]]);
    rule_.smallest = smallest_;
    executor_->set_pivot_rule(rule_);
    const device::ArrayVisit source = std::exchange(restore_, nullptr);
    device::FactorOutcome outcome = source    ? executor_->restore(values_.span(), source)
                                    : follows ? executor_->factorize_changed(values_.span(), before_.span())
                                              : executor_->factorize(values_.span());
    factorized_ = true;
    stage.reach(flops_);
    return outcome;
  }

  [[nodiscard]] bool keeps_fronts() const override { return keeps_fronts_; }
  void expect_changes(std::span<const Offset> places) override {
    if (device_ != nullptr && keeps_fronts_)
      reached_ = fronts_of().of_places(places, base::parts_of(prepared_.numbers));
  }
  [[nodiscard]] std::uint64_t arrays_layout() const override {
    const std::uint64_t layout = device_ == nullptr ? executor_->arrays_layout() : 0;
    return layout == 0 ? 0 : layout ^ (sizeof(T) + (kComplex ? 1 : 0) + (kRealForm ? 2 : 0));
  }
  void visit_arrays(const device::ArrayVisit& visit) override { executor_->visit_arrays(visit); }
  void restore_next(device::ArrayVisit visit) override { restore_ = std::move(visit); }
  void halt_at_failures(bool halt) override { executor_->halt_at_failures(halt); }
  bool change_analysis(const ChangedAnalysis& changed) override {
    if (device_ != nullptr || !diagonal_.empty()) return false;
    auto executor = executor_->with_changed_plan(changed.analysis->plan, changed.fronts);
    if (executor == nullptr) return false;
    executor_ = std::move(executor);
    plan_ = &changed.analysis->plan;
    rows_.forget();
    // Values of a Hermitian matrix turn with the order.
    if (!position_.empty()) position_ = positions_for(prepared_, plan_->tree.order);
    return true;
  }
  std::unique_ptr<Numeric> follow_pattern(const Analysis& analysis, std::span<const double> values,
                                          const FollowedAnalysis::Numbers& stay, const Context& context) override {
    const bool can = factorized_ && keeps_fronts_ && real_form_ == nullptr && !border_ && !analysis.system->real_form &&
                     context.single() == !base::keeps_fp64<T>;
    if (!can) return nullptr;
    const bool there = device_ != nullptr;
    base::Buffer<T> mapped = there ? base::Buffer<T>() : values_in_places_of_now(analysis, stay.entries);
    device_.reset();
    auto executor = executor_->with_changed_plan(analysis.plan, stay.fronts);
    if (executor == nullptr) return nullptr;
    values_ = {};
    auto next = std::make_unique<NumericOf>(analysis, values, std::span<const double>(), context, std::move(executor),
                                            std::move(mapped));
    if (there && next->device_ == nullptr) return nullptr;
    next->factorized_ = true;
    return next;
  }
  device::FactorOutcome factorize_rest() override {
    const base::Stage stage("factorization", flops_, "flops");
    executor_->set_pivot_rule(rule_);
    factorized_ = false;
    if (!position_.empty()) (void)scale();
    device::FactorOutcome outcome = executor_->factorize(values_.span());
    factorized_ = true;
    return outcome;
  }
  [[nodiscard]] bool left_something() const override {
    return base::keeps_fp64<T> && device_ == nullptr && executor_->left_contributions() != nullptr;
  }
  [[nodiscard]] std::optional<std::vector<analysis::PivotMove>> place_pivots(
      const device::Backend& host, const Analysis& analysis, std::span<const Index> failed) const override {
    if constexpr (base::keeps_fp64<T>) {
      const bool hermitian = kComplex && prepared_.numbers == base::Numbers::hermitian;
      const std::span<const Value> values(values_.data(), static_cast<std::size_t>(values_.size()));
      return host.place_pivots(
          device::PlacementJobOf<Value>{analysis.plan, analysis.kind(), hermitian, rule_, values, pool_, &budget_,
                                        failed, failed.empty() ? nullptr : executor_->left_contributions()});
    } else {
      return std::vector<analysis::PivotMove>{};
    }
  }
  void scale_by_matching(bool matching) override { matching_ = matching; }
  device::DeviceLinearSystem* device_system() override { return device_.get(); }
  std::optional<device::FactorOutcome> factorize_device(const double* values) override {
    const base::Stage stage("factorization", flops_, "flops", predicted_seconds_);
    if (keeps_fronts_ && factorized_ && device_->has_values()) {
      std::vector<unsigned char> rows(at(prepared_.n())), columns(rows.size());
      if (device_->mark_differing(values, rows, columns)) reached_ = fronts_of().of_rows_and_columns(rows, columns);
    }
    device_->take_values(values);
    return factorize_there();
  }
  void set_smallest_pivot(double smallest_pivot) override { smallest_pivot_ = smallest_pivot; }

  void part_with_zeros(bool parts) override { parts_with_zeros_ = parts; }

  // One by one where the budget has no room for several right-hand sides.
  void solve(const double* b, double* x, Index columns, bool transpose) override {
    const Offset n = Offset{plan_->tree.n} * (kComplex ? 2 : 1);
    base::Stage* const stage = base::Stage::current("substitution");
    Index most = kMostColumnsAtOnce;
    for (Index done = 0; done < columns;) {
      const Index now = std::min(columns - done, most);
      try {
        solve_together(b + done * n, x + done * n, now, transpose);
      } catch (const Error& e) {
        if (e.status().code != StatusCode::out_of_memory || now == 1) throw;
        rhs_ = base::Buffer<T>();
        most = 1;
        continue;
      }
      done += now;
      if (stage != nullptr) stage->reach(done);
    }
  }

  std::optional<double> solve_rows(const RowsJob& job) override {
    if (link_ != nullptr) return {};
    return rows_.solve(*plan_, scales_, job, kMostColumnsAtOnce, width_of,
                       [&](const device::PathSolve<T>& one) { return executor_->solve_on_paths(one); });
  }

  bool invert_at(std::span<const Index> unknowns, std::span<const Index> rows, double* values,
                 std::span<char> known) override {
    return entries_of_inverse<kRealForm>(*executor_, {*plan_, prepared_, scales_, pool_, budget_}, unknowns, rows,
                                         reinterpret_cast<Value*>(values), known);
  }

  [[nodiscard]] BorderContribution border_contribution() const override {
    BorderContribution left;
    const analysis::AssemblyTree& t = plan_->tree;
    const Index root = analysis::border_root(t);
    if (root < 0) return left;
    for (Offset r = t.row_ptr[root]; r < t.row_ptr[root + 1]; ++r) left.rows.push_back(t.rows[r] - t.n);
    const std::size_t rows = left.rows.size();
    left.values.resize(rows * rows);
    if constexpr (!kComplex) executor_->border_contribution()->copy(root, left.values.data());
    for (std::size_t c = 0; c < rows; ++c)
      for (std::size_t r = 0; r < rows; ++r)  // powers of two
        left.values[c * rows + r] /= border_scales_.row[static_cast<std::size_t>(left.rows[r])] *
                                     border_scales_.col[static_cast<std::size_t>(left.rows[c])];
    return left;
  }

  [[nodiscard]] const Scales& scales() const override { return scales_; }
  [[nodiscard]] std::vector<char> negative_pivots() const override {
    if constexpr (!kComplex && !kRealForm) {
      std::vector<T> d(at(plan_->tree.n)), e(d.size());
      if (executor_->copy_inverse_pivots(d, e)) return device::negative_of_inverse<T>(d, e);
    }
    return {};
  }
  [[nodiscard]] std::string device_name() const override { return executor_->name(); }
  [[nodiscard]] Offset device_peak_bytes() const override { return executor_->peak_bytes(); }
  [[nodiscard]] device::OutOfCoreReport out_of_core() const override { return executor_->out_of_core(); }
  [[nodiscard]] std::vector<device::DeviceWork> device_work() const override { return executor_->device_work(); }

 private:
  // Where the values have come to the device. What expect_changes() was told holds once.
  std::optional<device::FactorOutcome> factorize_there() {
    const std::vector<char> reached = std::exchange(reached_, {});
    const bool follows = std::exchange(factorized_, false) && !reached.empty();
    auto outcome = follows ? device_->factorize_changed(smallest_pivot_, reached) : device_->factorize(smallest_pivot_);
    factorized_ = outcome.has_value();
    return outcome;
  }
  const ReachedFronts& fronts_of() {
    if (!fronts_) fronts_.emplace(prepared_, *plan_, kRealForm ? 2 : 1, pool_);
    return *fronts_;
  }
  // The scaled values of the last factorization. What has come is in no front that stays.
  base::Buffer<T> values_in_places_of_now(const Analysis& analysis, const plan::SourceMap& entries) {
    before_ = {};
    base::Buffer<T> mapped(MatrixView(analysis.system->prepared.a).nonzeros(), &budget_);
    std::fill(mapped.begin(), mapped.end(), T(0));
    plan::SourceMap::Cursor now(entries);
    for (Offset k = 0; k < values_.size(); ++k)
      if (const Offset place = now(k); place >= 0) mapped[place] = values_[k];
    return mapped;
  }

  // @returns the largest magnitude. Ranks each scale the values that they assemble, which together are all; of a real
  // form they scale the numbers that it is made of.
  double scale() {
    if constexpr (kRealForm) {
      const double largest = scale_values(prepared_, scales_, given_, numbers_.data(), pool_);
      if (plan_->row_begin.empty())
        real_values(*real_form_, prepared_.a, numbers_.data(), values_.data(), pool_);
      else
        real_values(*real_form_, prepared_.a, numbers_.data(), plan_->sources, values_.data(), pool_);
      return largest;
    } else {
      if (plan_->row_begin.empty()) return scale_values(prepared_, scales_, given_, values_.data(), pool_, position_);
      const double mine = scale_values(prepared_, scales_, given_, plan_->sources, values_.data(), pool_, position_);
      double largest = 0;
      for (const auto& of_rank : link_->all_gather_of(std::span<const double>(&mine, 1)))
        largest = std::max(largest, of_rank.at(0));
      expect_in_range<T>(prepared_, given_, largest);
      return largest;
    }
  }

  // Where the diagonal entries of this rank stand among its values; -1: other ranks have them.
  void find_own_diagonal() {
    if (plan_->row_begin.empty()) return;
    const std::vector<Offset>& own = plan_->sources;
    for (Offset& place : diagonal_) {
      const auto at = std::lower_bound(own.begin(), own.end(), place);
      place = at != own.end() && *at == place ? at - own.begin() : -1;
    }
  }

  // Devices that can keep the linear system beside the factor do when memory allows; else refinement works on the host.
  void take_device_system(const Analysis& analysis, const Context& context) {
    if (border_ || scales_.wide || rescale_) return;  // devices scale by plain products, always the same
    Offset left = 0;
    if (const Offset budget = budgets_of(analysis.device, context.options).front(); budget > 0)
      left = std::max<Offset>(1, budget - executor_->peak_bytes());
    try {
      device_ = executor_->make_linear_system(
          arrays_of(*analysis.system, plan_->tree.order, diagonal_, base::ScalarTraits<T>::epsilon, given_, pool_),
          left);
    } catch (const Error& e) {
      if (e.status().code != StatusCode::out_of_memory) throw;
    }
  }

  static Index width_of(Index columns) {
    constexpr Index kGroup = static_cast<Index>(64 / sizeof(T));
    return columns == 1 ? 1 : (columns + kGroup - 1) / kGroup * kGroup;
  }

  void take_room(Index width) {
    if (rhs_.size() >= static_cast<Offset>(plan_->tree.n) * width) return;
    rhs_ = base::Buffer<T>();
    const auto take = [&] { rhs_ = base::Buffer<T>(static_cast<Offset>(plan_->tree.n) * width, &budget_); };
    if (link_ == nullptr) return take();
    try {
      link_->expect_all(take);  // all go on with fewer right-hand sides, or none
    } catch (...) {
      rhs_ = base::Buffer<T>();  // or this rank alone would not take part the next time
      throw;
    }
  }

  void solve_together(const double* b, double* x, Index columns, bool transpose) {
    const Index width = width_of(columns);
    take_room(width);
    vectors_.take(*plan_, scales_, b, columns, width, transpose, rhs_.data());
    executor_->solve(rhs_.data(), width, transpose);
    vectors_.give(*plan_, scales_, rhs_.data(), columns, width, transpose, x);
  }

  const plan::Plan* plan_;
  double flops_, predicted_seconds_;  // of a factorization
  const PreparedMatrix& prepared_;
  const RealForm* real_form_;  // null: there is none
  Scales scales_;
  bool rescale_, matching_;
  double given_zero_;                     // Options::zero_pivot
  std::span<const double> given_;         // the solver's values
  std::shared_ptr<const Border> border_;  // null: the plan has none
  std::span<const double> border_values_;
  BorderScales border_scales_;
  base::ThreadPool& pool_;
  base::MemoryBudget& budget_;
  ranks::Communicator* link_;  // null: there are no other ranks
  double smallest_pivot_ = 0;  // relative to the largest scaled entry
  bool parts_with_zeros_ = false;
  base::Buffer<T> values_;     // scaled; only without device_
  base::Buffer<T> before_;     // of the factorization before, where only what has changed is to be made; else empty
  bool factorized_ = false;    // values_, or the device's, are those of the executor's last factorization
  bool keeps_fronts_ = false;  // the executor may make some fronts again and keep the others
  std::optional<ReachedFronts> fronts_;                  // of plan_, with a device
  std::vector<char> reached_;                            // fronts that the next values reach; empty: not known
  base::Buffer<std::complex<base::RealOf<T>>> numbers_;  // real form: scaled
  base::Buffer<T> rhs_;
  PlanVectors<T, kRealForm> vectors_;
  PlanRows<T, kRealForm> rows_;
  std::vector<Index> position_;   // Hermitian: n, by column
  std::vector<Offset> diagonal_;  // llt, without device_: n, by position
  std::vector<double> smallest_;  // likewise: a pivot below is suspicious
  device::PivotRule rule_;
  std::unique_ptr<device::Executor<T>> executor_;
  device::ArrayVisit restore_;  // null: the next factorization computes
  std::unique_ptr<device::DeviceLinearSystem> device_;
};

}  // namespace

std::unique_ptr<Numeric> make_numeric(const Analysis& analysis, std::span<const double> values,
                                      std::span<const double> border_values, const Context& context) {
  const auto make = [&](auto scalar) -> std::unique_ptr<Numeric> {
    return std::make_unique<NumericOf<decltype(scalar)>>(analysis, values, border_values, context);
  };
  if (analysis.system->real_form) {
    if (context.single()) return std::make_unique<NumericOf<float, true>>(analysis, values, border_values, context);
    return std::make_unique<NumericOf<double, true>>(analysis, values, border_values, context);
  }
  if (analysis.system->complex_factor())
    return context.single() ? make(std::complex<float>()) : make(std::complex<double>());
  return context.single() ? make(float()) : make(double());
}

}  // namespace espalier::solver
