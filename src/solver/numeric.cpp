#include "solver/numeric.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "device/cuda/executor/cuda_executor.hpp"
#include "solver/executor_choice.hpp"

namespace espalier::solver {

namespace {

constexpr Index kMostColumnsAtOnce = 32;  // right-hand sides per sweep: 32 doubles are four cache lines per row

template <class T>
class NumericOf final : public Numeric {
 public:
  NumericOf(const plan::Plan& plan, const Equations& equations, const solve::ResidualOperator& residual,
            const NumericOptions& options, base::ThreadPool& pool, base::MemoryBudget& budget, base::Timeline* timeline)
      : plan_(plan),
        equations_(equations),
        options_(options),
        pool_(pool),
        budget_(budget),
        rule_{options.threshold, 0},
        executor_(make_executor<T>(plan, options, rule_, pool, budget, timeline)) {
    take_device_system(residual);
    if (device_ != nullptr) return;
    values_ = base::Buffer<T>(equations.a.nonzeros(), &budget);
    if (options.kind == Kind::llt && sizeof(T) == sizeof(double))
      diagonal_ = diagonal_places(equations.a, plan.tree.order, pool);
    smallest_.resize(diagonal_.size());
  }

  device::FactorOutcome factorize() override {
    if (device_ != nullptr) {
      if (auto outcome = device_->factorize(options_.smallest_pivot)) return *outcome;
      refuse_entry(equations_);
    }
    const double largest = scale_values(equations_, values_.data(), pool_);
    rule_.tiny = options_.smallest_pivot * largest;
    for (std::size_t k = 0; k < smallest_.size(); ++k)
      smallest_[k] = kRoundingOfPivot * values_[diagonal_[static_cast<std::size_t>(k)]];
    rule_.smallest = smallest_;
    executor_->set_pivot_rule(rule_);
    return executor_->factorize(values_.span());
  }

  DeviceSystem* device_system() override { return device_.get(); }
  std::optional<device::FactorOutcome> factorize_device(const double* values) override {
    device_->take_values(values);
    return device_->factorize(options_.smallest_pivot);
  }
  void set_smallest_pivot(double smallest_pivot) override { options_.smallest_pivot = smallest_pivot; }

  // One by one where the budget has no room for several right-hand sides.
  void solve(const double* b, double* x, Index columns, bool transpose) override {
    const Offset n = plan_.tree.n;
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
    }
  }

  [[nodiscard]] std::string device_name() const override { return executor_->name(); }
  [[nodiscard]] Offset device_peak_bytes() const override { return executor_->peak_bytes(); }
  [[nodiscard]] device::StreamReport streaming() const override { return executor_->streaming(); }
  [[nodiscard]] std::vector<device::DeviceWork> device_work() const override { return executor_->device_work(); }

 private:
  // One GPU or several keep the equations beside the factor when memory allows; else refinement works on the host.
  void take_device_system(const solve::ResidualOperator& residual) {
    auto* executor = dynamic_cast<device::cuda::CudaExecutor<T>*>(executor_.get());
    if (executor == nullptr || equations_.wide) return;  // a GPU scales by plain products
    Offset left = 0;
    if (const Offset budget = options_.device_memory_bytes.front(); budget > 0)
      left = std::max<Offset>(1, budget - executor->peak_bytes());
    try {
      device_ = make_device_system<T>(plan_, equations_, residual, options_.kind, *executor,
                                      options_.device.gpus.front(), left, pool_);
    } catch (const Error& e) {
      if (e.status().code != StatusCode::out_of_memory) throw;
    }
  }

  static double factor_of(const std::vector<double>& scale, Index i) {
    return scale.empty() ? 1.0 : scale[static_cast<std::size_t>(i)];
  }

  void solve_together(const double* b, double* x, Index columns, bool transpose) {
    constexpr Index kGroup = static_cast<Index>(64 / sizeof(T));
    const Index width = columns == 1 ? 1 : (columns + kGroup - 1) / kGroup * kGroup;
    if (rhs_.size() < static_cast<Offset>(plan_.tree.n) * width) {
      rhs_ = base::Buffer<T>();
      rhs_ = base::Buffer<T>(static_cast<Offset>(plan_.tree.n) * width, &budget_);
    }
    find_units(b, columns, transpose);
    gather(b, columns, width, transpose);
    executor_->solve(rhs_.data(), width, transpose);
    scatter(x, columns, width, transpose);
  }

  // FP32: a right-hand side may be far from 1 where the scaled matrix is not. It is measured in a power of two, which
  // changes no digit.
  void find_units(const double* b, Index columns, bool transpose) {
    if (sizeof(T) == sizeof(double)) return;
    unit_.assign(static_cast<std::size_t>(columns), 1);
    const Index n = plan_.tree.n;
    pool_.for_each_piece(columns, 1, [&](std::int64_t c, std::int64_t) {
      double most = 0;
      for (Index k = 0; k < n; ++k) {
        const Index i = transpose ? k : equations_.row_of(k);
        const double v = std::abs(factor_of(transpose ? equations_.col_scale : equations_.row_scale, i) *
                                  b[static_cast<Offset>(c) * n + i]);
        if (v > most) most = v;
      }
      if (most > 0 && std::isfinite(most) && (most > kFar || most < 1 / kFar))
        unit_[static_cast<std::size_t>(c)] = std::ldexp(1.0, std::clamp(std::ilogb(most), -1000, 1000));
    });
  }

  [[nodiscard]] T in_unit(double v, Index c) const {
    return static_cast<T>(sizeof(T) == sizeof(double) ? v : v / unit_[static_cast<std::size_t>(c)]);
  }
  [[nodiscard]] double from_unit(T v, Index c) const {
    return sizeof(T) == sizeof(double) ? v : static_cast<double>(v) * unit_[static_cast<std::size_t>(c)];
  }

  // Scaled right-hand sides in elimination order; columns that pad the width are zero.
  void gather(const double* b, Index columns, Index width, bool transpose) {
    const Index n = plan_.tree.n;
    pool_.for_each_piece(n, kRows, [&](std::int64_t begin, std::int64_t end) {
      for (auto k = begin; k < end; ++k) {
        const Index col = plan_.tree.order[static_cast<std::size_t>(k)];
        const Index i = transpose ? col : equations_.row_of(col);
        const double s = factor_of(transpose ? equations_.col_scale : equations_.row_scale, i);
        T* row = rhs_.data() + k * width;
        for (Index c = 0; c < columns; ++c) row[c] = in_unit(s * b[static_cast<Offset>(c) * n + i], c);
        std::fill(row + columns, row + width, T(0));
      }
    });
  }

  void scatter(double* x, Index columns, Index width, bool transpose) {
    const Index n = plan_.tree.n;
    pool_.for_each_piece(n, kRows, [&](std::int64_t begin, std::int64_t end) {
      for (auto k = begin; k < end; ++k) {
        const Index col = plan_.tree.order[static_cast<std::size_t>(k)];
        const Index i = transpose ? equations_.row_of(col) : col;
        const double s = factor_of(transpose ? equations_.row_scale : equations_.col_scale, i);
        const T* row = rhs_.data() + k * width;
        for (Index c = 0; c < columns; ++c) x[static_cast<Offset>(c) * n + i] = s * from_unit(row[c], c);
      }
    });
  }

  static constexpr std::int64_t kRows = 8192;  // rows per piece of work
  static constexpr double kFar = 0x1p40;       // from 1: then a right-hand side gets a unit of its own

  const plan::Plan& plan_;
  const Equations& equations_;
  NumericOptions options_;
  base::ThreadPool& pool_;
  base::MemoryBudget& budget_;
  base::Buffer<T> values_;  // scaled; only without device_
  base::Buffer<T> rhs_;
  std::vector<double> unit_;      // FP32: of the right-hand sides in work
  std::vector<Offset> diagonal_;  // llt in FP64: n, by position
  std::vector<double> smallest_;  // llt in FP64: n, by position: a pivot below counts as zero
  device::PivotRule rule_;
  std::unique_ptr<device::Executor<T>> executor_;
  std::unique_ptr<DeviceSystem> device_;
};

}  // namespace

std::unique_ptr<Numeric> make_numeric(const plan::Plan& plan, const Equations& equations,
                                      const solve::ResidualOperator& residual, const NumericOptions& options,
                                      bool single, base::ThreadPool& pool, base::MemoryBudget& budget,
                                      base::Timeline* timeline) {
  if (single) return std::make_unique<NumericOf<float>>(plan, equations, residual, options, pool, budget, timeline);
  return std::make_unique<NumericOf<double>>(plan, equations, residual, options, pool, budget, timeline);
}

}  // namespace espalier::solver
