#include "solver/options/precision_choice.hpp"

#include <algorithm>

namespace espalier::solver {

namespace {

constexpr double kShort = 1e-3;  // seconds: what refinement costs besides its arithmetic counts here

}  // namespace

double gain_of_single(const device::Backend& backend, const analysis::AssemblyTree& tree, device::PlanWish wish,
                      int devices) {
  const auto seconds = [&](Precision precision) {
    wish.precision = precision;
    return backend.predict(tree, wish).on(devices);
  };
  const double single = seconds(Precision::mixed), fp64 = seconds(Precision::fp64);
  return fp64 > kShort ? fp64 / single : 1;
}

void PrecisionWatch::add_factorization(double seconds) {
  single_ = seconds;
  fp64_ = gain_ * seconds;
  solved_ = false;
}

void PrecisionWatch::add_solve(const SolveResult& solve) {
  // seconds = (steps + 1) (substitution + residual)
  const double pass = solve.seconds / (1 + solve.refinement_steps);
  const double substitution = std::min(solve.solve_seconds, pass);
  single_ += solve.seconds;
  fp64_ += 2 * (pass + substitution);
  solved_ = true;
}

bool PrecisionWatch::next_factor() {
  if (!solved_) return false;
  losses_ = single_ > fp64_ ? losses_ + 1 : 0;
  return losses_ >= 2;
}

}  // namespace espalier::solver
