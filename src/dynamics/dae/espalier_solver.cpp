#include "dynamics/dae/linear_solver.hpp"

namespace espalier::dynamics {
namespace {

class EspalierSolver final : public LinearSolver {
 public:
  explicit EspalierSolver(Options options) : solver_(std::move(options)) {}

  Status analyze(const MatrixView& a) override { return solver_.analyze(a).status; }
  Status factorize(std::span<const double> values) override { return solver_.refactorize(values).status; }
  Status solve(std::span<const double> b, std::span<double> x, Index columns) override {
    return solver_.solve(b, x, columns).status;
  }

 private:
  Solver solver_;
};

}  // namespace

std::unique_ptr<LinearSolver> make_espalier_solver(Options options) {
  return std::make_unique<EspalierSolver>(std::move(options));
}

}  // namespace espalier::dynamics
