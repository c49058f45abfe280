#include "solve/refinement.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace espalier::solve {

namespace {

// A Krylov correction reduces the residual by that much per restart; the next residual is computed afresh.
constexpr double kKrylovReduction = 1e-6;

bool finite(const std::vector<double>& v) {
  return std::all_of(v.begin(), v.end(), [](double x) { return std::isfinite(x); });
}

}  // namespace

RefinementResult refine(const ResidualOperator& a, const Preconditioner& m, const double* b, double* x, bool transpose,
                        const RefinementOptions& options) {
  const auto n = static_cast<std::size_t>(a.size());
  std::vector<double> r(n);
  std::vector<double> d(n);
  std::vector<double> best(x, x + n);
  RefinementResult out;
  out.error = a.compute(b, x, r.data(), transpose);
  bool krylov = false;
  const auto worth_going_on = [&] {
    return out.error.componentwise > options.target && out.steps < options.steps &&
           (!krylov || out.krylov_steps < options.krylov_steps);
  };
  while (worth_going_on()) {
    if (krylov) {
      const int left = options.krylov_steps - out.krylov_steps;
      out.krylov_steps += options.positive_definite ? solve_cg(a, m, r, d, kKrylovReduction, left)
                                                    : solve_fgmres(a, m, r, d, transpose, kKrylovReduction, left);
    } else {
      m(r.data(), d.data());
    }
    if (!finite(d)) break;
    for (std::size_t i = 0; i < n; ++i) x[i] = best[i] + d[i];
    ++out.steps;
    const BackwardError now = a.compute(b, x, r.data(), transpose);
    const bool better = now.componentwise < out.error.componentwise ||
                        (now.componentwise == out.error.componentwise && now.normwise < out.error.normwise);
    const bool stalled = !(now.componentwise <= out.error.componentwise / 2);
    if (better) {
      out.error = now;
      std::copy_n(x, n, best.begin());
    } else {
      (void)a.compute(b, best.data(), r.data(), transpose);
    }
    if (!stalled) continue;
    if (krylov || !options.krylov) break;
    krylov = true;
  }
  std::copy(best.begin(), best.end(), x);
  return out;
}

}  // namespace espalier::solve
