#include "dynamics/dae/linear_solver.hpp"

namespace espalier::dynamics {
namespace {

class EspalierSolver final : public LinearSolver {
 public:
  explicit EspalierSolver(Options options) : solver_(std::move(options)) {}

  Status analyze(const MatrixView& a) override { return solver_.analyze(a).status; }
  Status factorize(std::span<const double> values) override {
    FactorResult result = solver_.refactorize(values);
    // Perturbed pivots mean a singular K here: redundant constraints that nobody took out.
    if (result.status.ok() && result.perturbed > 0) {
      return {StatusCode::singular, std::to_string(result.perturbed) + " pivots vanished", result.status.row};
    }
    return result.status;
  }
  Status solve(std::span<const double> b, std::span<double> x, Index columns) override {
    return solver_.solve(b, x, columns).status;
  }

 private:
  Solver solver_;
};

}  // namespace

std::unique_ptr<LinearSolver> make_espalier_solver(Options options) {
  // K may be symmetric by chance at its first values (a mechanism at rest) and is not later (gyroscopic terms,
  // rotations).
  if (options.kind == Kind::automatic) options.kind = Kind::lu;
  return std::make_unique<EspalierSolver>(std::move(options));
}

}  // namespace espalier::dynamics
