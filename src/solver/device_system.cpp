#include "solver/device_system.hpp"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

namespace espalier::solver {

namespace {

// Pinning takes 0.4 s per GiB; what it saves each time are 30 ms of copying into pinned buffers.
constexpr int kPinFrom = 16;

template <class T>
class DeviceSystemOf final : public DeviceSystem {
 public:
  using Equations = device::cuda::DeviceEquations<T>;

  DeviceSystemOf(const plan::Plan& plan, const solver::Equations& equations, const solve::ResidualOperator& residual,
                 Kind kind, device::cuda::CudaExecutor<T>& executor, int device, Offset memory_bytes,
                 base::ThreadPool& pool)
      : n_(plan.tree.n), values_(equations.a.values), executor_(executor) {
    device::cuda::EquationArrays arrays;
    const matrix::RowIndex& index = residual.row_index();
    arrays.pattern = equations.a;
    arrays.row_ptr = index.ptr;
    const auto indexed = static_cast<std::size_t>(index.col.size());
    arrays.row_col = {index.col.data(), indexed};
    arrays.row_source = {index.source.data(), indexed};
    arrays.order = plan.tree.order;
    arrays.row_of_col = equations.row_of_col;
    arrays.row_scale = equations.row_scale;
    arrays.col_scale = equations.col_scale;
    std::vector<Offset> diagonal;
    if (kind == Kind::llt && sizeof(T) == sizeof(double))
      diagonal = diagonal_places(equations.a, plan.tree.order, pool);
    arrays.diagonal = diagonal;
    host_copy_ = [&pool](double* to, const double* from, Offset count) {
      constexpr std::int64_t kPiece = 1 << 16;  // doubles
      pool.for_each_piece(count, kPiece, [&](std::int64_t begin, std::int64_t end) {
        std::copy(from + begin, from + end, to + begin);
      });
    };
    equations_ = device::cuda::make_device_equations<T>(arrays, executor, device, memory_bytes);
  }

  void take_values(const double* values) override {
    equations_->take_values(values);
    sent_ = false;
  }
  void send_values(Offset first, Offset count) override {
    if (first == 0 && ++sendings_ == kPinFrom) equations_->pin(values_);
    equations_->send_values(values_.data(), first, count, host_copy_);
    sent_ = true;
  }

  std::optional<device::FactorOutcome> factorize(double smallest_pivot) override {
    if (std::exchange(sent_, false)) equations_->take_sent_values();
    device::cuda::FilledValues values = equations_->filled();
    values.tiny = smallest_pivot;
    values.rounding = kRoundingOfPivot;
    return executor_.factorize_filled(values);
  }

  void read_values(std::span<double> to) const override { equations_->read_values(to); }
  void substitute(const double* b, double* x, Index columns, bool transpose) override {
    equations_->substitute(b, x, columns, transpose);
  }
  double take_substitution_seconds() override { return std::exchange(substitution_seconds_, -1); }
  void finish() override { equations_->finish(); }
  void settle() noexcept override { equations_->settle(); }
  double* right_hand_sides(Index columns) override { return equations_->vectors(2, columns); }
  double* solutions(Index columns) override { return equations_->vectors(3, columns); }
  void copy_vectors(const double* from, double* to, Offset count) override { equations_->copy(from, to, count); }
  void send(double* to, const double* from, Offset count) override { equations_->send(to, from, count, host_copy_); }
  void fetch(double* to, const double* from, Offset count) override { equations_->fetch(to, from, count, host_copy_); }

  void expect_reachable(const double* array, const char* what) const override {
    equations_->expect_reachable(array, what);
  }
  void wait_for(void* stream) override { equations_->wait_for(stream); }

  [[nodiscard]] Index size() const override { return n_; }
  void compute(std::span<solve::ResidualColumn> columns, bool transpose) const override {
    std::vector<typename Equations::Column> work;
    for (const solve::ResidualColumn& c : columns) work.push_back({c.b, c.x, c.r});
    std::vector<device::cuda::DeviceResidual> found(work.size());
    equations_->residuals(work, transpose, found);
    if (substitution_seconds_ < 0) substitution_seconds_ = equations_->substitution_seconds();
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const device::cuda::DeviceResidual& f = found[k];
      columns[k].error = {ratio(f.residual, f.matrix * f.x + f.b), f.componentwise};
    }
  }
  void copy(const double* from, double* to) const override { equations_->copy(from, to, n_); }
  bool add(const double* from, double* to) const override {
    equations_->add(from, to);
    return true;
  }
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
  std::span<const double> values_;  // of the host's equations
  device::cuda::CudaExecutor<T>& executor_;
  device::cuda::HostCopy host_copy_;
  std::unique_ptr<Equations> equations_;
  bool sent_ = false;  // values that are not scaled yet
  int sendings_ = 0;
  mutable double substitution_seconds_ = -1;
};

}  // namespace

template <class T>
std::unique_ptr<DeviceSystem> make_device_system(const plan::Plan& plan, const Equations& equations,
                                                 const solve::ResidualOperator& residual, Kind kind,
                                                 device::cuda::CudaExecutor<T>& executor, int device,
                                                 Offset memory_bytes, base::ThreadPool& pool) {
  return std::make_unique<DeviceSystemOf<T>>(plan, equations, residual, kind, executor, device, memory_bytes, pool);
}

template std::unique_ptr<DeviceSystem> make_device_system(const plan::Plan&, const Equations&,
                                                          const solve::ResidualOperator&, Kind,
                                                          device::cuda::CudaExecutor<double>&, int, Offset,
                                                          base::ThreadPool&);
template std::unique_ptr<DeviceSystem> make_device_system(const plan::Plan&, const Equations&,
                                                          const solve::ResidualOperator&, Kind,
                                                          device::cuda::CudaExecutor<float>&, int, Offset,
                                                          base::ThreadPool&);

}  // namespace espalier::solver
