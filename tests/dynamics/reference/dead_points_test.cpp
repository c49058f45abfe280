// Cost of the factor next to singular positions, where the pivots of weakly held directions are small and true.
#include <gtest/gtest.h>

#include <algorithm>

#include "dynamics/constraints/redundancy.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/reference/four_bar.hpp"

namespace espalier::dynamics {
namespace dead_points_test {

// The library's solver, which remembers how many columns it had to move to later fronts.
class CountingSolver final : public LinearSolver {
 public:
  CountingSolver(Options options, Index& moved) : solver_(std::move(options)), moved_(moved) {}
  Status analyze(const MatrixView& a) override { return solver_.analyze(a).status; }
  Status factorize(std::span<const double> values) override {
    const FactorResult result = solver_.refactorize(values);
    moved_ = std::max(moved_, result.delayed);
    return result.status;
  }
  Status solve(std::span<const double> b, std::span<double> x, Index columns) override {
    return solver_.solve(b, x, columns).status;
  }

 private:
  Solver solver_;
  Index& moved_;
};

struct Passage {
  Index moved = 0;
  double distance_of_tip = 0;
};

// N loops through the first dead point, at 0.72 s, at a tolerance of 1e-8; the tip moves on the unit circle.
Passage pass(int loops, const Options& options) {
  const auto model = four_bar(loops);
  Passage result;
  Equations equations(model->system, std::make_unique<CountingSolver>(options, result.moved));
  State s(model->system.sizes());
  model->system.initial(s.q, s.v);
  RedundancyGuard guard(equations);
  guard.prepare(s);
  BdfOptions bdf_options;
  bdf_options.relative = bdf_options.absolute = 1e-8;
  BdfIntegrator bdf(equations, bdf_options);
  bdf.start(s);
  bdf.integrate(0.75);
  result.distance_of_tip = four_bar_tip(*model, bdf.state().q).norm() - 1;
  return result;
}

// Truth: the pattern alone fixes the fronts, whatever the values; the constraints hold. With the solver's own threshold
// columns do move, so the mechanism does pass near enough.
TEST(DeadPoints, TheFactorKeepsItsFronts) {
  const Index unknowns = 27 * 40 + 11;
  const Passage ours = pass(40, newton_options(unknowns));
  EXPECT_EQ(ours.moved, 0);
  EXPECT_NEAR(ours.distance_of_tip, 0, 1e-10);
  Options strict = newton_options(unknowns);
  strict.pivot_threshold = Options().pivot_threshold;
  EXPECT_GT(pass(40, strict).moved, 20);
}

}  // namespace dead_points_test
}  // namespace espalier::dynamics
