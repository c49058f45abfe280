#include "solver/device_system.hpp"

#include <algorithm>
#include <limits>
#include <vector>

namespace espalier::solver {

namespace {

template <class T>
class DeviceSystemOf final : public DeviceSystem {
 public:
  using Equations = device::cuda::DeviceEquations<T>;

  DeviceSystemOf(const analysis::Plan& plan, const solver::Equations& equations,
                 const solve::ResidualOperator& residual, Kind kind, double threshold,
                 device::cuda::CudaExecutor<T>& executor, int device, Offset memory_bytes)
      : n_(plan.tree.n), executor_(executor), rule_{threshold, 0} {
    device::cuda::EquationArrays arrays;
    const solve::ResidualOperator::RowIndex index = residual.row_index();
    arrays.pattern = equations.a;
    arrays.row_ptr = index.ptr;
    arrays.row_col = index.col;
    arrays.row_source = index.source;
    arrays.order = plan.tree.order;
    arrays.row_of_col = equations.row_of_col;
    arrays.row_scale = equations.row_scale;
    arrays.col_scale = equations.col_scale;
    std::vector<Offset> diagonal;
    if (kind == Kind::llt && sizeof(T) == sizeof(double)) diagonal = diagonal_places(equations.a, plan.tree.order);
    arrays.diagonal = diagonal;
    smallest_.resize(diagonal.size());
    equations_ = device::cuda::make_device_equations<T>(arrays, executor, device, memory_bytes);
    equations_->pin(equations.a.values);
  }

  std::optional<device::FactorOutcome> factorize(const double* values, double smallest_pivot) override {
    norms_ = equations_->take_values(values);
    if (!norms_.finite) return std::nullopt;
    rule_.tiny = smallest_pivot * norms_.largest;
    if (!smallest_.empty()) {
      equations_->read_diagonal(smallest_);
      for (double& s : smallest_) s *= kRoundingOfPivot;
    }
    rule_.smallest = smallest_;
    executor_.set_pivot_rule(rule_);
    return executor_.factorize_device(equations_->scaled_values());
  }

  void read_values(std::span<double> to) const override { equations_->read_values(to); }
  void substitute(const double* b, double* x, Index columns, bool transpose) override {
    equations_->substitute(b, x, columns, transpose);
  }
  double* right_hand_sides(Index columns) override { return equations_->vectors(2, columns); }
  double* solutions(Index columns) override { return equations_->vectors(3, columns); }
  void transfer(double* to, const double* from, Offset count) override { equations_->transfer(to, from, count); }

  void wait_for(void* stream) override { equations_->wait_for(stream); }

  [[nodiscard]] Index size() const override { return n_; }
  void compute(std::span<solve::ResidualColumn> columns, bool transpose) const override {
    std::vector<typename Equations::Column> work;
    for (const solve::ResidualColumn& c : columns) work.push_back({c.b, c.x, c.r});
    std::vector<device::cuda::DeviceResidual> found(work.size());
    equations_->residuals(work, transpose, found);
    const double norm = transpose ? norms_.norm_one : norms_.norm_inf;
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const device::cuda::DeviceResidual& f = found[k];
      columns[k].error = {ratio(f.residual, norm * f.x + f.b), f.componentwise};
    }
  }
  void copy(const double* from, double* to) const override { equations_->copy(from, to); }
  bool add(const double* from, double* to) const override { return equations_->add(from, to); }
  [[nodiscard]] Vectors vectors(Index slot, Index columns) const override {
    return {equations_->vectors(slot, columns), nullptr};
  }

 private:
  static double ratio(double above, double below) {
    const double infinity = std::numeric_limits<double>::infinity();
    if (above == infinity) return infinity;
    if (below > 0) return above / below;
    return above == 0 ? 0 : infinity;
  }

  Index n_;
  device::cuda::CudaExecutor<T>& executor_;
  device::PivotRule rule_;
  std::vector<double> smallest_;  // n, by position; empty: no pivot is judged
  std::unique_ptr<Equations> equations_;
  typename Equations::Values norms_;
};

}  // namespace

template <class T>
std::unique_ptr<DeviceSystem> make_device_system(const analysis::Plan& plan, const Equations& equations,
                                                 const solve::ResidualOperator& residual, Kind kind, double threshold,
                                                 device::cuda::CudaExecutor<T>& executor, int device,
                                                 Offset memory_bytes) {
  return std::make_unique<DeviceSystemOf<T>>(plan, equations, residual, kind, threshold, executor, device,
                                             memory_bytes);
}

template std::unique_ptr<DeviceSystem> make_device_system(const analysis::Plan&, const Equations&,
                                                          const solve::ResidualOperator&, Kind, double,
                                                          device::cuda::CudaExecutor<double>&, int, Offset);
template std::unique_ptr<DeviceSystem> make_device_system(const analysis::Plan&, const Equations&,
                                                          const solve::ResidualOperator&, Kind, double,
                                                          device::cuda::CudaExecutor<float>&, int, Offset);

}  // namespace espalier::solver
