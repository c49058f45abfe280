// Factorizations after which few values change (Options::partial_refactorization), beside whole ones.
//   espalier_bench_changed_values [N [THREADS [REPEATS]]]      default: elasticity 28^3, all cores, 5
// Changed are the entries of one element at the surface, or all of one eighth of the body. Seconds are medians of calls
// that take turns; the work is that of the fronts that were made, over that of all. Both factors' solutions must be the
// same to the last bit.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "espalier/solver.hpp"
#include "matrix/generators/generate.hpp"

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

/// Places of the entries both of whose nodes are among some, in the grid's order: x slowest, z fastest, n + 1 nodes a
/// side.
std::vector<Offset> places_within(const SparseMatrix& a, Index n,
                                  const std::function<bool(Index, Index, Index)>& among) {
  const Index side = n + 1;
  const auto is_among = [&](Index unknown) {
    const Index node = unknown / 3;
    return among(node / (side * side), node / side % side, node % side);
  };
  std::vector<Offset> places;
  for (Index c = 0; c < a.cols; ++c) {
    if (!is_among(c)) continue;
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
      if (is_among(a.row_ind[static_cast<std::size_t>(q)])) places.push_back(q);
  }
  return places;
}

void check(const Status& status) {
  if (!status.ok()) throw std::runtime_error(status.message);
}

void measure(const SparseMatrix& a, const std::string& what, const std::vector<Offset>& places, int threads,
             int repeats) {
  Options options;
  options.threads = threads;
  options.refinement_steps = 0;
  Solver whole(options);
  options.partial_refactorization = true;
  Solver partial(options);
  check(whole.analyze(a).status);
  check(partial.analyze(a).status);
  check(whole.factorize(a).status);
  check(partial.factorize(a).status);
  std::vector<double> values = a.values;
  std::vector<double> of_whole, of_partial;
  double share = 1;
  for (int k = 0; k < repeats; ++k) {
    for (const Offset q : places) values[static_cast<std::size_t>(q)] *= 1 + 1e-9;
    of_whole.push_back(seconds_of([&] { check(whole.refactorize(values).status); }));
    of_partial.push_back(seconds_of([&] {
      const FactorResult f = partial.refactorize(values);
      check(f.status);
      share = f.work_share;
    }));
  }
  const std::vector<double> b(static_cast<std::size_t>(a.cols), 1.0);
  std::vector<double> x(b.size()), y(b.size());
  check(whole.solve(b, x).status);
  check(partial.solve(b, y).status);
  const bool same = std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) == 0;
  fmt::print(
      "{}: {} of {} entries; whole {:.4f} s, partial {:.4f} s, {:.3f} of it; work {:.3f}; memory {:.3f} of a whole "
      "one's; {}\n",
      what, places.size(), a.nonzeros(), median(of_whole), median(of_partial), median(of_partial) / median(of_whole),
      share,
      static_cast<double>(partial.analysis().predicted_bytes) / static_cast<double>(whole.analysis().predicted_bytes),
      same ? "same bits" : "OTHER BITS");
  if (!same) throw std::runtime_error("the solutions differ");
}

}  // namespace

int main(int argc, char** argv) {
  const auto number = [&](int k, int otherwise) { return argc > k ? std::atoi(argv[k]) : otherwise; };
  const int n = number(1, 28), threads = number(2, 0), repeats = std::max(1, number(3, 5));
  if (n < 2 || threads < 0) {
    fmt::print(stderr, "espalier_bench_changed_values [N [THREADS [REPEATS]]], N from 2\n");
    return 2;
  }
  try {
    matrix::GeneratorSpec spec = matrix::parse_generator(std::vector<std::string>{"elasticity", std::to_string(n)});
    spec.numbering = matrix::Numbering::natural;
    const SparseMatrix a = matrix::generate(spec);
    const auto side = static_cast<Index>(n);
    const std::string name = fmt::format("elasticity {}^3, ", n);
    measure(a, name + "one element",
            places_within(a, side, [side](Index x, Index y, Index z) { return x < 2 && y >= side - 1 && z < 2; }),
            threads, repeats);
    measure(a, name + "an eighth of the body",
            places_within(a, side,
                          [side](Index x, Index y, Index z) { return 2 * x < side && 2 * y < side && 2 * z < side; }),
            threads, repeats);
  } catch (const std::exception& e) {
    fmt::print(stderr, "espalier_bench_changed_values: {}\n", e.what());
    return 1;
  }
  return 0;
}
