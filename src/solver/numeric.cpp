#include "solver/numeric.hpp"

#include <algorithm>

#include "device/cuda/cuda_executor.hpp"
#include "device/host/host_executor.hpp"

namespace espalier::solver {

namespace {

constexpr Index kMostColumnsAtOnce = 32;  // right-hand sides per sweep: 32 doubles are four cache lines per row

template <class T>
std::unique_ptr<device::Executor<T>> make_executor(const analysis::Plan& plan, const NumericOptions& options,
                                                   const device::PivotRule& rule, base::ThreadPool& pool,
                                                   base::MemoryBudget& budget, base::Timeline* timeline) {
  if (options.device.backend == DeviceChoice::Backend::host)
    return device::host::make_host_executor<T>(plan, options.kind, rule, pool, &budget, timeline);
  device::cuda::CudaOptions cuda;
  cuda.device = options.device.gpu;
  cuda.memory_bytes = options.device_memory_bytes;
  return device::cuda::make_cuda_executor<T>(plan, options.kind, rule, cuda);
}

template <class T>
class NumericOf final : public Numeric {
 public:
  NumericOf(const analysis::Plan& plan, const Equations& equations, const NumericOptions& options,
            base::ThreadPool& pool, base::MemoryBudget& budget, base::Timeline* timeline)
      : plan_(plan),
        equations_(equations),
        options_(options),
        pool_(pool),
        budget_(budget),
        values_(equations.a.nonzeros(), &budget),
        rule_{options.threshold, 0},
        executor_(make_executor<T>(plan, options, rule_, pool, budget, timeline)) {}

  device::FactorOutcome factorize() override {
    const double largest = scale_values(equations_, values_.data(), pool_);
    rule_.tiny = options_.smallest_pivot * largest;
    executor_->set_pivot_rule(rule_);
    return executor_->factorize(values_.span());
  }

  void set_smallest_pivot(double smallest_pivot) override { options_.smallest_pivot = smallest_pivot; }

  void solve(const double* b, double* x, Index columns, bool transpose) override {
    const Index n = plan_.tree.n;
    constexpr Index kGroup = static_cast<Index>(64 / sizeof(T));
    for (Index done = 0; done < columns;) {
      const Index now = std::min(columns - done, kMostColumnsAtOnce);
      const Index width = now == 1 ? 1 : (now + kGroup - 1) / kGroup * kGroup;
      if (rhs_.size() < static_cast<Offset>(n) * width) {
        rhs_ = base::Buffer<T>();
        rhs_ = base::Buffer<T>(static_cast<Offset>(n) * width, &budget_);
      }
      gather(b + static_cast<Offset>(done) * n, now, width, transpose);
      executor_->solve(rhs_.data(), width, transpose);
      scatter(x + static_cast<Offset>(done) * n, now, width, transpose);
      done += now;
    }
  }

  [[nodiscard]] std::string device_name() const override { return executor_->name(); }
  [[nodiscard]] Offset device_peak_bytes() const override { return executor_->peak_bytes(); }

 private:
  static double factor_of(const std::vector<double>& scale, Index i) {
    return scale.empty() ? 1.0 : scale[static_cast<std::size_t>(i)];
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
        for (Index c = 0; c < columns; ++c) row[c] = static_cast<T>(s * b[static_cast<Offset>(c) * n + i]);
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
        for (Index c = 0; c < columns; ++c) x[static_cast<Offset>(c) * n + i] = s * static_cast<double>(row[c]);
      }
    });
  }

  static constexpr std::int64_t kRows = 8192;  // rows per piece of work

  const analysis::Plan& plan_;
  const Equations& equations_;
  NumericOptions options_;
  base::ThreadPool& pool_;
  base::MemoryBudget& budget_;
  base::Buffer<T> values_;
  base::Buffer<T> rhs_;
  device::PivotRule rule_;
  std::unique_ptr<device::Executor<T>> executor_;
};

}  // namespace

std::unique_ptr<Numeric> make_numeric(const analysis::Plan& plan, const Equations& equations,
                                      const NumericOptions& options, bool single, base::ThreadPool& pool,
                                      base::MemoryBudget& budget, base::Timeline* timeline) {
  if (single) return std::make_unique<NumericOf<float>>(plan, equations, options, pool, budget, timeline);
  return std::make_unique<NumericOf<double>>(plan, equations, options, pool, budget, timeline);
}

}  // namespace espalier::solver
