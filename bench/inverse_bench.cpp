// Entries of the inverse beside factorizations, in turns.
//   espalier_bench_inverse [N [DEVICE [REPEATS [KIND [THREADS [PRECISION [DEVICE_MEMORY]]]]]]]
//   default: elasticity 28^3, cpu, 3, auto, all cores, fp64, what is free
// Seconds are the least of calls that take turns: of a factorization of new values, of the diagonal and of the entries
// where A has some; whole calls, with the comparison that tells their error. CPU seconds stand beside them. The truth:
// 50 columns by refined solves.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "espalier/inverse.hpp"
#include "in_turns.hpp"
#include "solver/options/option_text.hpp"

namespace {

using namespace espalier;
using bench::check;

struct Seconds {
  double wall = 1e300, processor = 1e300;
  void take(const std::function<void()>& body) {
    const auto start = std::chrono::steady_clock::now();
    const std::clock_t clock = std::clock();
    body();
    processor = std::min(processor, static_cast<double>(std::clock() - clock) / CLOCKS_PER_SEC);
    wall = std::min(wall, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
};

void print(const char* what, const Seconds& s, const Seconds& factorization, const InverseResult* r) {
  fmt::print("{:14s} {:8.4f} s {:6.2f}; processor {:8.4f} s {:6.2f}", what, s.wall, s.wall / factorization.wall,
             s.processor, s.processor / factorization.processor);
  if (r != nullptr) fmt::print("; error {:.1e}, of an entry {:.1e}", r->error, r->entry_error);
  fmt::print("\n");
}

// The largest error of 50 columns, of each over its largest entry, and over the entry itself.
void compare(Solver& solver, const SparseMatrix& a, const std::vector<double>& x, const std::vector<double>& diagonal) {
  constexpr Index kColumns = 50;
  const auto n = static_cast<std::size_t>(a.cols);
  std::mt19937_64 random(1);
  std::vector<Index> chosen;
  for (Index k = 0; k < kColumns; ++k) chosen.push_back(static_cast<Index>(random() % n));
  std::vector<double> b(n * kColumns, 0), columns(b.size());
  for (std::size_t k = 0; k < chosen.size(); ++k) b[k * n + static_cast<std::size_t>(chosen[k])] = 1;
  check(solver.solve(b, columns, kColumns).status);
  double error = 0, of_entry = 0;
  std::string first;
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const auto j = static_cast<std::size_t>(chosen[k]);
    double largest = 0;
    for (std::size_t i = 0; i < n; ++i) largest = std::max(largest, std::abs(columns[k * n + i]));
    const auto note = [&](double found, std::size_t i) {
      const double truth = columns[k * n + i], apart = std::abs(found - truth);
      if (!(apart <= 1e-6 * largest) && first.empty())
        first = fmt::format("; first wrong entry ({}, {}): {} instead of {}", i, j, found, truth);
      error = std::isnan(apart) ? apart : std::max(error, apart / largest);
      of_entry = std::max(of_entry, apart / std::abs(truth));
    };
    for (Offset q = a.col_ptr[j]; q < a.col_ptr[j + 1]; ++q)
      note(x[static_cast<std::size_t>(q)], static_cast<std::size_t>(a.row_ind[static_cast<std::size_t>(q)]));
    note(diagonal[j], j);
  }
  fmt::print("50 columns: error {:.1e}, of an entry {:.1e}{}\n", error, of_entry, first);
}

}  // namespace

int main(int argc, char** argv) {
  const auto word = [&](int k, const char* otherwise) { return std::string(argc > k ? argv[k] : otherwise); };
  try {
    const int repeats = std::max(1, std::atoi(word(3, "3").c_str()));
    Options options;
    options.device = word(2, "cpu");
    solver::set_option(options, "kind", word(4, "auto"));
    options.threads = std::atoi(word(5, "0").c_str());
    solver::set_option(options, "precision", word(6, "fp64"));
    if (argc > 7) solver::set_option(options, "device_memory", word(7, ""));
    const SparseMatrix a =
        matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", word(1, "28")}));
    Solver solver(options);
    check(solver.analyze(a).status);
    std::vector<double> values = a.values, x(values.size()), diagonal(static_cast<std::size_t>(a.cols));
    Seconds factorization, of_diagonal, of_pattern;
    InverseResult d, p;
    std::string name;
    for (int turn = 0; turn <= repeats; ++turn) {
      Seconds first;  // takes memory
      for (double& v : values) v *= 1 + 1e-12;
      (turn > 0 ? factorization : first).take([&] {
        const FactorResult f = solver.factorize({a.rows, a.cols, a.col_ptr, a.row_ind, values, a.storage});
        check(f.status);
        name = f.device;
      });
      (turn > 0 ? of_diagonal : first).take([&] { check((d = inverse_diagonal(solver, diagonal)).status); });
      (turn > 0 ? of_pattern : first).take([&] { check((p = selected_inverse(solver, a, x)).status); });
    }
    fmt::print("elasticity {}^3, {} unknowns, {}\n", word(1, "28"), a.cols, name);
    print("factorization", factorization, factorization, nullptr);
    print("diagonal", of_diagonal, factorization, &d);
    print("entries of A", of_pattern, factorization, &p);
    compare(solver, a, x, diagonal);
  } catch (const std::exception& e) {
    fmt::print(stderr, "espalier_bench_inverse: {}\n", e.what());
    return 1;
  }
  return 0;
}
