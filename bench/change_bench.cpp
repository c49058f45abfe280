// A pattern that changes in one part of its unknowns, followed by Solver::analyze_change() and analyzed anew.
//   espalier_bench_change [N [PERCENT [THREADS [REPEATS]]]]      default: elasticity 24^3, 1 percent, all cores, 3
// Two sorts of change: contacts (springs between unknowns of neighbouring nodes two apart) that lie on one face, or all
// over the body. Seconds are medians of whole calls, which take turns; the factor's entries are over those of the fresh
// analysis. A solve with the factor of the followed analysis is checked.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "espalier/solver.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/norms.hpp"

namespace {

using namespace espalier;

template <class Body>
double seconds_of(Body&& body) {
  const auto start = std::chrono::steady_clock::now();
  body();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  return v[v.size() / 2];
}

// A lower triangle with springs between pairs of unknowns.
SparseMatrix with_springs(const SparseMatrix& a, const std::vector<std::pair<Index, Index>>& pairs) {
  double scale = 0;
  for (const double v : a.values) scale = std::max(scale, std::abs(v));
  std::vector<std::map<Index, double>> more(static_cast<std::size_t>(a.cols));
  for (const auto& [u, v] : pairs) {
    more[static_cast<std::size_t>(u)][u] += scale;
    more[static_cast<std::size_t>(v)][v] += scale;
    more[static_cast<std::size_t>(std::min(u, v))][std::max(u, v)] -= scale;
  }
  SparseMatrix b = a;
  b.row_ind.clear();
  b.values.clear();
  b.col_ptr.assign(1, 0);
  for (Index c = 0; c < a.cols; ++c) {
    auto& column = more[static_cast<std::size_t>(c)];
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q) {
      const Index r = a.row_ind[static_cast<std::size_t>(q)];
      double value = a.values[static_cast<std::size_t>(q)];
      if (const auto found = column.find(r); found != column.end()) {
        value += found->second;
        column.erase(found);
      }
      b.row_ind.push_back(r);
      b.values.push_back(value);
    }
    for (const auto& [r, value] : column) {
      b.row_ind.push_back(r);
      b.values.push_back(value);
    }
    b.col_ptr.push_back(static_cast<Offset>(b.row_ind.size()));
  }
  return b;
}

// In the grid's order, x slowest, z fastest: node (x, y, z) and the one two layers further in y; three unknowns each.
std::vector<std::pair<Index, Index>> contacts(Index n, const SparseMatrix& a, double percent, bool on_face,
                                              std::uint64_t seed) {
  const Index row = 3 * (n + 1), layer = row * (n + 1);
  std::mt19937_64 random(seed);
  const auto nodes = static_cast<Index>(percent / 100 * a.cols / 3 + 0.5);
  std::vector<std::pair<Index, Index>> pairs;
  const Index first = on_face ? a.cols - layer : 0, length = a.cols - 2 * row - 3 - first;
  for (Index k = 0; k < nodes; ++k) {
    const Index u = first + 3 * static_cast<Index>(random() % static_cast<std::uint64_t>(length / 3));
    for (Index d = 0; d < 3; ++d) pairs.emplace_back(u + d, u + d + 2 * row);
  }
  return pairs;
}

void measure(Index n, double percent, int threads, int repeats, bool on_face) {
  matrix::GeneratorSpec spec = matrix::parse_generator(std::vector<std::string>{"elasticity", std::to_string(n)});
  spec.numbering = matrix::Numbering::natural;
  const SparseMatrix a = matrix::generate(spec);
  const SparseMatrix b = with_springs(a, contacts(n, a, percent, on_face, 7));
  Options options;
  options.threads = threads;
  std::vector<double> full, followed, back;
  ChangeResult change;
  AnalysisResult fresh;
  SolveResult solved;
  for (int k = 0; k <= repeats; ++k) {
    Solver solver(options), other(options);
    const double of_full = seconds_of([&] { fresh = other.analyze(b); });
    if (!solver.analyze(a).status.ok()) throw std::runtime_error("the analysis failed");
    const double there = seconds_of([&] { change = solver.analyze_change(b); });
    if (k == 0) {
      (void)solver.factorize(b);
      std::vector<double> rhs(static_cast<std::size_t>(a.cols), 1.0), x(rhs.size());
      solved = solver.solve(rhs, x);
      continue;
    }
    full.push_back(of_full);
    followed.push_back(there);
    back.push_back(seconds_of([&] { (void)solver.analyze_change(a); }));
  }
  fmt::print(
      "elasticity {0}^3, {1} % of the nodes in contact {2}: analyze {3:.4f} s, analyze_change {4:.4f} s ({5:.3f}), "
      "back "
      "{6:.4f} s ({7:.3f}); {8} entries came, {9} unknowns moved, {10} of {11} fronts are the same; entries of the "
      "factor {12:.3f}, work {13:.3f} of the fresh analysis; backward error {14:.1e}{15}\n",
      n, percent, on_face ? "on a face" : "all over", median(full), median(followed), median(followed) / median(full),
      median(back), median(back) / median(full), change.added_entries, change.moved_unknowns, change.kept_fronts,
      change.analysis.fronts,
      static_cast<double>(change.analysis.nonzeros_factor) / static_cast<double>(fresh.nonzeros_factor),
      change.analysis.flops / fresh.flops, solved.backward_error, change.full ? "; ANEW: " + change.why : "");
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const Index n = argc > 1 ? std::atoi(argv[1]) : 24;
    const double percent = argc > 2 ? std::atof(argv[2]) : 1;
    const int threads = argc > 3 ? std::atoi(argv[3]) : 0, repeats = argc > 4 ? std::atoi(argv[4]) : 3;
    for (const bool on_face : {true, false}) measure(n, percent, threads, repeats, on_face);
  } catch (const std::exception& e) {
    fmt::print(stderr, "espalier_bench_change: {}\n", e.what());
    return 1;
  }
  return 0;
}
