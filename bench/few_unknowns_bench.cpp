// Solves for a few unknowns of few loads (solve_rows) beside whole ones of the same loads, in turns.
//   espalier_bench_few_unknowns [N [THREADS [REPEATS [DEVICE [MEMORY_MB]]]]]    default: elasticity 28^3, all cores,
//   15, cpu
// Loads and unknowns are chosen at random in the body, or within two patches of neighbouring nodes at opposite corners.
// Milliseconds are medians: for the rows; for whole solutions without refinement, of the call and of the substitution
// alone; with refinement. `read` is the share of the factor's entries on the paths, which the tree allows. Solutions
// must be those of whole ones without refinement to the last bit, and agree with refined ones.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "espalier/solve_rows.hpp"
#include "espalier/solver.hpp"
#include "in_turns.hpp"

namespace {

using namespace espalier;
using bench::check;
using bench::grid_system;
using bench::median;

struct Loads {
  std::vector<Offset> col_ptr{0};
  std::vector<Index> rows, unknowns;
  std::vector<double> values, dense;
  [[nodiscard]] Index columns() const { return static_cast<Index>(col_ptr.size()) - 1; }
};

// A load a column. patch: near the first and the last node of the grid, else anywhere.
Loads loads_of(Index n, Index side, int loads, int unknowns, bool patch, std::mt19937& random) {
  const auto anywhere = [&] { return static_cast<Index>(random() % static_cast<unsigned>(n)); };
  const auto near = [&] {  // x, y, z of the node below 4
    const Index node = static_cast<Index>(random() % 4) * side * side + static_cast<Index>(random() % 4) * side;
    return 3 * (node + static_cast<Index>(random() % 4)) + static_cast<Index>(random() % 3);
  };
  Loads out;
  out.dense.resize(static_cast<std::size_t>(n) * static_cast<std::size_t>(loads));
  for (int c = 0; c < loads; ++c) {
    const Index row = patch ? std::min(n - 1, near()) : anywhere();
    out.rows.push_back(row);
    out.values.push_back(1 + static_cast<double>(c));
    out.dense[static_cast<std::size_t>(c) * static_cast<std::size_t>(n) + static_cast<std::size_t>(row)] =
        out.values.back();
    out.col_ptr.push_back(c + 1);
  }
  for (int k = 0; k < unknowns; ++k) out.unknowns.push_back(patch ? std::max<Index>(0, n - 1 - near()) : anywhere());
  return out;
}

class Bench {
 public:
  Bench(const SparseMatrix& a, const Options& options) : n_(a.rows), refined_(options), bare_(unrefined(options)) {
    for (Solver* s : {&refined_, &bare_}) {
      check(s->analyze(a).status);
      check(s->factorize(a).status);
    }
    // The first call looks at the factor.
    const std::vector<Offset> one = {0, 1};
    const std::vector<Index> row = {0};
    const std::vector<double> load = {1};
    std::vector<double> x(1);
    const SolveRowsResult r = solve_rows(refined_, {one, row, load}, row, x);
    check(r.status);
    fmt::print("{}; the first call {:.4f} s, errors without refinement {:.0e} and {:.0e}; milliseconds\n",
               refined_.analysis().device, r.seconds, r.backward_error, r.componentwise_error);
    fmt::print("   loads unknowns         rows   whole  substitution  refined  rows/whole  rows/subst   read  bits\n");
  }

  void measure(Index side, int loads, int unknowns, bool patch, int repeats) {
    std::vector<double> rows, whole, substitution, refined;
    double share = 0, error = 0;
    bool same = true;
    for (int k = 0; k <= repeats; ++k) {
      const Loads b = loads_of(n_, side, loads, unknowns, patch, random_);
      std::vector<double> x(b.unknowns.size() * static_cast<std::size_t>(loads)), y(b.dense.size()), z(b.dense.size());
      const SolveRowsResult some = solve_rows(bare_, {b.col_ptr, b.rows, b.values}, b.unknowns, x);
      const SolveResult all = bare_.solve(b.dense, y, b.columns()), best = refined_.solve(b.dense, z, b.columns());
      check(some.status);
      check(all.status);
      check(best.status);
      double largest = 0;
      for (const double v : z) largest = std::max(largest, std::abs(v));
      for (std::size_t c = 0; c < static_cast<std::size_t>(loads); ++c)
        for (std::size_t u = 0; u < b.unknowns.size(); ++u) {
          const std::size_t at = c * static_cast<std::size_t>(n_) + static_cast<std::size_t>(b.unknowns[u]);
          same = same && x[c * b.unknowns.size() + u] == y[at];
          error = std::max(error, std::abs(x[c * b.unknowns.size() + u] - z[at]) / largest);
        }
      if (k == 0) continue;
      share += some.share / repeats;
      rows.push_back(1e3 * some.seconds);
      whole.push_back(1e3 * all.seconds);
      substitution.push_back(1e3 * all.solve_seconds);
      refined.push_back(1e3 * best.seconds);
    }
    const double r = median(rows), w = median(whole), s = median(substitution);
    fmt::print("{:>8} {:>8} {:<7} {:6.2f} {:7.2f} {:13.2f} {:8.2f} {:11.3f} {:11.3f} {:6.3f}  {}, {:.0e}\n", loads,
               unknowns, patch ? "patch" : "random", r, w, s, median(refined), r / w, r / s, share,
               same ? "same" : "OTHER", error);
    if (!(error < 1e-10)) throw std::runtime_error("the solutions differ");
  }

 private:
  static Options unrefined(Options o) {
    o.refinement_steps = 0;
    o.required_backward_error = std::numeric_limits<double>::infinity();
    return o;
  }

  Index n_;
  Solver refined_, bare_;
  std::mt19937 random_{1};
};

}  // namespace

int main(int argc, char** argv) {
  const auto number = [&](int k, int otherwise) { return argc > k ? std::atoi(argv[k]) : otherwise; };
  const int n = number(1, 28), repeats = std::max(1, number(3, 15));
  Options options;
  options.threads = number(2, 0);
  options.device = argc > 4 ? argv[4] : "cpu";
  options.device_memory_bytes = Offset{number(5, 0)} * 1'000'000;
  if (n < 4 || options.threads < 0) {
    fmt::print(stderr, "espalier_bench_few_unknowns [N [THREADS [REPEATS [DEVICE [MEMORY_MB]]]]], N from 4\n");
    return 2;
  }
  try {
    const SparseMatrix a = grid_system("elasticity", n);
    fmt::print("elasticity {}^3, {} unknowns, ", n, a.rows);
    Bench bench(a, options);
    for (const bool patch : {false, true})
      for (const auto& [loads, unknowns] : {std::pair{1, 1}, {1, 10}, {10, 10}, {10, 100}, {32, 32}})
        bench.measure(n + 1, loads, unknowns, patch, repeats);
  } catch (const std::exception& e) {
    fmt::print(stderr, "espalier_bench_few_unknowns: {}\n", e.what());
    return 1;
  }
  return 0;
}
