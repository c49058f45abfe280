#include <cmath>
#include <limits>

#include "dynamics/dae/linear_solver.hpp"

namespace espalier::dynamics {
namespace {

class EspalierSolver final : public LinearSolver {
 public:
  explicit EspalierSolver(Options options) : solver_(std::move(options)) {}

  Status analyze(const MatrixView& a) override { return take(solver_.analyze(a)); }
  Status analyze_change(const MatrixView& a) override { return take(solver_.analyze_change(a).analysis); }
  Status factorize(std::span<const double> values) override { return take(solver_.refactorize(values)); }
  [[nodiscard]] int gpu() const override { return solver_.gpu(); }
  [[nodiscard]] GpuPlaces gpu_places() const override { return solver_.gpu_places(); }
  Status factorize_device(const double* values, Offset count, void* stream) override {
    return take(solver_.refactorize_device(values, count, stream));
  }
  Status solve_device(double* b, Index columns, void* stream) override {
    return solver_.solve_device(b, b, columns, Transpose::no, stream).status;
  }
  [[nodiscard]] int determinant_sign() const override { return sign_; }
  [[nodiscard]] FactorWork work() const override { return work_; }
  Status solve(std::span<const double> b, std::span<double> x, Index columns) override {
    return solver_.solve(b, x, columns).status;
  }

 private:
  Status take(AnalysisResult result) {
    work_ = work_of(result);
    return std::move(result.status);
  }
  Status take(const FactorResult& result) {
    sign_ = static_cast<int>(result.determinant_sign);
    // Perturbed pivots mean a singular K here: redundant constraints that nobody took out.
    if (result.status.ok() && result.perturbed > 0) {
      return {StatusCode::singular, std::to_string(result.perturbed) + " pivots vanished", result.status.row};
    }
    return result.status;
  }
  Solver solver_;
  int sign_ = 0;
  FactorWork work_;
};

}  // namespace

FactorWork work_of(const AnalysisResult& analysis) {
  const Offset numbers = analysis.kind == Kind::lu ? analysis.nonzeros_factor : 2 * analysis.nonzeros_factor;
  return {analysis.flops, analysis.fronts, numbers};
}

Status LinearSolver::factorize_device(const double*, Offset, void*) {
  return {StatusCode::device_error, "this solver takes no values from a GPU", -1};
}

Status LinearSolver::solve_device(double*, Index, void*) {
  return {StatusCode::device_error, "this solver takes no right-hand sides from a GPU", -1};
}

std::unique_ptr<LinearSolver> make_espalier_solver(Options options) {
  return std::make_unique<EspalierSolver>(std::move(options));
}

Options newton_options(Index unknowns, Precision precision) {
  constexpr Index kOneThread = 20000;
  Options options;
  options.kind = Kind::lu;
  options.precision = precision;
  options.threads = unknowns < kOneThread ? 1 : 0;
  const bool corrected = precision == Precision::fp64;
  options.refinement_steps = corrected ? 0 : options.refinement_steps;
  if (corrected) options.required_backward_error = std::numeric_limits<double>::infinity();
  options.pivot_threshold = std::sqrt(corrected ? std::numeric_limits<double>::epsilon()
                                                : static_cast<double>(std::numeric_limits<float>::epsilon()));
  return options;
}

}  // namespace espalier::dynamics
