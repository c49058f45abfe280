// Rows and columns that come and go around a factor (ChangedSystem), beside factorizations of the changed matrix.
//   espalier_bench_active_sets [N [FLIPS [DEVICE [THREADS [REPEATS]]]]]   default: elasticity 24^3, 32, cpu, all cores,
//   5
// FLIPS bounds are toggled at a time, at random places, and those before come back: seconds of the columns, and of a
// solve with them; then a hundred flips one by one, each with a solve, without and with factorizations in between.
// Errors are |b - M x| / (|M| |x| + |b|), normwise, formed here in long double from the entries of the changed matrix;
// beside them those of a solver that factorizes that matrix. Medians.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "espalier/changed_system.hpp"
#include "in_turns.hpp"

namespace {

using namespace espalier;
using bench::check;
using bench::grid_system;
using bench::median;
using bench::seconds_of;

/// Rows and columns of the identity in the place of the removed ones; a lower triangle.
std::vector<double> without(const SparseMatrix& a, const ChangedSystem& changed) {
  std::vector<double> values = a.values;
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q) {
      const Index r = a.row_ind[static_cast<std::size_t>(q)];
      double& v = values[static_cast<std::size_t>(q)];
      if (changed.removed(r) || changed.removed(c)) v = r == c ? v : 0;
    }
  return values;
}

double error_of(const SparseMatrix& a, const std::vector<double>& values, const ChangedSystem& changed,
                const std::vector<double>& b, const std::vector<double>& x) {
  const auto n = static_cast<std::size_t>(a.cols);
  std::vector<long double> r(b.begin(), b.end()), sums(n, 0);
  for (std::size_t c = 0; c < n; ++c)
    for (auto q = static_cast<std::size_t>(a.col_ptr[c]); q < static_cast<std::size_t>(a.col_ptr[c + 1]); ++q) {
      const auto row = static_cast<std::size_t>(a.row_ind[q]);
      const long double v = values[q];
      r[row] -= v * x[c];
      sums[row] += std::abs(v);
      if (row == c) continue;
      r[c] -= v * x[row];
      sums[c] += std::abs(v);
    }
  long double rest = 0, norm = 0, size = 0, given = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (changed.removed(static_cast<Index>(i))) continue;
    rest = std::max(rest, std::abs(r[i]));
    norm = std::max(norm, sums[i]);
    size = std::max(size, std::abs(static_cast<long double>(x[i])));
    given = std::max(given, std::abs(static_cast<long double>(b[i])));
  }
  return static_cast<double>(rest / (norm * size + given));
}

void measure(Index n, Index flips, const std::string& device, int threads, int repeats) {
  const SparseMatrix a = grid_system("elasticity", n);
  Options options;
  options.threads = threads;
  options.device = device;
  Solver solver(options), fresh(options);
  check(solver.analyze(a).status);
  check(solver.factorize(a).status);
  check(fresh.analyze(a).status);
  check(fresh.factorize(a).status);
  std::vector<double> factorizations, columns, solves, plain;
  for (int k = 0; k < repeats; ++k) factorizations.push_back(fresh.refactorize(a.values).seconds);
  std::mt19937_64 random(1);
  std::vector<double> b(static_cast<std::size_t>(a.cols)), x(b.size()), y(b.size());
  for (double& v : b) v = static_cast<double>(random() >> 11) * 0x1p-53 - 0.5;
  const auto choose = [&](Index count) {
    std::vector<Index> list;
    while (static_cast<Index>(list.size()) < count) {
      const auto v = static_cast<Index>(random() % static_cast<std::uint64_t>(a.cols));
      if (std::find(list.begin(), list.end(), v) == list.end()) list.push_back(v);
    }
    return list;
  };
  ChangedSystem changed(solver);
  changed.set_folding(false);
  double worst = 0, worst_fresh = 0, reported = 0;
  ChangedSolveResult s;
  std::vector<Index> before;  // come back
  double first = 0;
  for (int k = 0; k < repeats + 1; ++k) {
    check(changed.flip(before));
    before = choose(flips);
    check(changed.flip(before));
    const double of_columns = seconds_of([&] { check(changed.prepare()); });
    const double of_solve = seconds_of([&] { s = changed.solve(b, x); });
    check(s.status);
    const std::vector<double> values = without(a, changed);
    check(fresh.refactorize(values).status);
    SolveResult f;
    const double of_plain = seconds_of([&] { f = fresh.solve(b, y); });
    check(f.status);
    if (k == 0) {  // takes the memory, sums the rows
      first = of_columns;
      continue;
    }
    columns.push_back(of_columns);
    solves.push_back(of_solve);
    plain.push_back(of_plain);
    worst = std::max(worst, error_of(a, values, changed, b, x));
    worst_fresh = std::max(worst_fresh, error_of(a, values, changed, b, y));
    reported = std::max(reported, s.backward_error);
  }
  fmt::print(
      "elasticity {}^3, {} unknowns, {} ({}): {} flips {:.3f} ms (the first time {:.3f}), a solve with them {:.3f} ms "
      "({} steps); "
      "refactorization {:.3f} ms, a solve {:.3f} ms; counted {:.3g} and {:.3g} operations; errors {:.1e} (said: "
      "{:.1e}), fresh {:.1e}\n",
      n, a.cols, device, solver.analysis().device, flips, 1e3 * median(columns), 1e3 * first, 1e3 * median(solves),
      s.refinement_steps, 1e3 * median(factorizations), 1e3 * median(plain), s.cost.changes, s.cost.factorization,
      worst, reported, worst_fresh);

  for (const bool folds : {false, true}) {
    changed.reset();
    changed.set_folding(folds);
    double passed = 0;
    Index crossing = -1, columns_before = 0;
    const double factorization = median(factorizations);
    for (Index k = 0; k < 100; ++k) {
      passed += seconds_of([&] {
        check(changed.flip(choose(1)));
        s = changed.solve(b, x);
        check(s.status);
      });
      passed -= median(plain);
      if (crossing < 0 && passed > factorization) crossing = k + 1;
      columns_before = std::max(columns_before, s.cost.columns);
    }
    const std::vector<double> values = without(a, changed);
    check(fresh.refactorize(values).status);
    check(fresh.solve(b, y).status);
    fmt::print(
        "  100 flips one by one, {}: {:.3f} ms more than solves alone; as much as a refactorization after {} of them; "
        "{} "
        "factorizations, at most {} columns between; error {:.1e} (said: {:.1e}), fresh {:.1e}\n",
        folds ? "with factorizations" : "columns alone", 1e3 * passed, crossing, s.cost.factorizations, columns_before,
        error_of(a, values, changed, b, x), s.backward_error, error_of(a, values, changed, b, y));
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const Index n = argc > 1 ? std::atoi(argv[1]) : 24, flips = argc > 2 ? std::atoi(argv[2]) : 32;
    measure(n, flips, argc > 3 ? argv[3] : "cpu", argc > 4 ? std::atoi(argv[4]) : 0, argc > 5 ? std::atoi(argv[5]) : 5);
  } catch (const std::exception& e) {
    fmt::print(stderr, "espalier_bench_active_sets: {}\n", e.what());
    return 1;
  }
  return 0;
}
