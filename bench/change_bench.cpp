// A pattern that changes in one part of its unknowns, followed by Solver::analyze_change() and analyzed anew.
//   espalier_bench_change [N [PERCENT [THREADS [REPEATS [DEVICE]]]]]     default: elasticity 24^3, 1 percent, all
//   cores, 3
// Two sorts of change: contacts (springs between unknowns of neighbouring nodes two apart) that lie on one face, or all
// over the body; 0 percent: one pair of nodes. Seconds are medians of whole calls, which take turns; the factor's
// entries are over those of the fresh analysis. A solve with the factor of the followed analysis is checked. Then
// analyze_change() and factorize() together, there and back: with Options::partial_refactorization, which keeps the
// numbers that the change does not reach, and without. Both solutions must be the same to the last bit.
//   espalier_bench_change SORT [N [PERCENT [CHANGES [THREADS [DEVICE]]]]]
// A hundred changes, one after another, of a body of N^3 bricks (contacts, elements, crack, remesh: ChangingBody), each
// followed, factorized and solved. Every tenth is compared with a fresh analysis.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "espalier/solver.hpp"
#include "in_turns.hpp"
#include "matrix/generators/changing_body.hpp"
#include "matrix/norms.hpp"

namespace {

using namespace espalier;
using bench::check;
using bench::grid_system;
using bench::median;
using bench::seconds_of;

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
  const auto nodes = std::max<Index>(1, static_cast<Index>(percent / 100 * a.cols / 3 + 0.5));
  std::vector<std::pair<Index, Index>> pairs;
  const Index first = on_face ? a.cols - layer : 0, length = a.cols - 2 * row - 3 - first;
  for (Index k = 0; k < nodes; ++k) {
    const Index u = first + 3 * static_cast<Index>(random() % static_cast<std::uint64_t>(length / 3));
    for (Index d = 0; d < 3; ++d) pairs.emplace_back(u + d, u + d + 2 * row);
  }
  return pairs;
}

void measure(Index n, double percent, int repeats, bool on_face, Options options) {
  std::string parts;
  options.log = [&](const std::string& line) {
    if (line.find("was followed") != std::string::npos) parts = line;
  };
  const SparseMatrix a = grid_system("elasticity", n);
  const SparseMatrix b = with_springs(a, contacts(n, a, percent, on_face, 7));
  std::vector<double> full, followed, back;
  ChangeResult change;
  AnalysisResult fresh;
  SolveResult solved;
  for (int k = 0; k <= repeats; ++k) {
    Solver solver(options), other(options);
    const double of_full = seconds_of([&] { fresh = other.analyze(b); });
    check(solver.analyze(a).status);
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
      "elasticity {0}^3, {1} % of the nodes in contact {2}: analyze {3:.4f} s, analyze_change {4:.4f} s ({5:.3f}; "
      "order "
      "{16:.4f}, plan {17:.4f}), "
      "back "
      "{6:.4f} s ({7:.3f}); {8} entries came, {9} unknowns moved, {10} of {11} fronts are the same; entries of the "
      "factor {12:.3f}, work {13:.3f} of the fresh analysis; backward error {14:.1e}{15}\n",
      n, percent, on_face ? "on a face" : "all over", median(full), median(followed), median(followed) / median(full),
      median(back), median(back) / median(full), change.added_entries, change.moved_unknowns, change.kept_fronts,
      change.analysis.fronts,
      static_cast<double>(change.analysis.nonzeros_factor) / static_cast<double>(fresh.nonzeros_factor),
      change.analysis.flops / fresh.flops, solved.backward_error, change.full ? "; ANEW: " + change.why : "",
      change.analysis.ordering_seconds, change.analysis.plan_seconds);
  fmt::print("  back: {}\n", parts);
}

// A pattern that comes and goes, with its numbers.
void measure_numbers(Index n, double percent, int repeats, bool on_face, Options options) {
  const SparseMatrix a = grid_system("elasticity", n);
  const SparseMatrix b = with_springs(a, contacts(n, a, percent, on_face, 7));
  options.refinement_steps = 0;
  Solver whole(options);
  options.partial_refactorization = true;
  Solver kept(options);
  for (Solver* s : {&whole, &kept}) {
    check(s->analyze(a).status);
    check(s->factorize(a).status);
  }
  std::vector<double> of_whole[2], of_kept[2], of_analysis[2];
  double share[2] = {1, 1};
  std::string why;
  const std::vector<double> rhs(static_cast<std::size_t>(a.cols), 1.0);
  std::vector<double> x(rhs.size()), y(rhs.size());
  for (int k = 0; k <= repeats; ++k)
    for (const int back : {0, 1}) {
      const SparseMatrix& now = back != 0 ? a : b;
      const auto one = [&](Solver& s, std::vector<double>& seconds) {
        FactorResult f;
        double analysis = 0;
        const double both = seconds_of([&] {
          analysis = seconds_of([&] { check(s.analyze_change(now).analysis.status); });
          f = s.factorize(now);
        });
        check(f.status);
        if (&s == &kept) {
          share[back] = f.work_share;
          if (!f.whole_reason.empty()) why = "; ALL WAS MADE: " + f.whole_reason;
        }
        if (k == 0) return;  // unknowns have moved into separators since: others follow another tree
        seconds.push_back(both);
        if (&s == &kept) of_analysis[back].push_back(analysis);
      };
      one(whole, of_whole[back]);
      one(kept, of_kept[back]);
      check(whole.solve(rhs, x).status);
      check(kept.solve(rhs, y).status);
      if (std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) != 0)
        throw std::runtime_error("the solutions differ");
    }
  for (const int back : {0, 1})
    fmt::print(
        "  {}: analyze_change and factorize {:.4f} s, with numbers kept {:.4f} s ({:.3f}; analysis {:.4f} s), work "
        "{:.3f}{}\n",
        back != 0 ? "goes" : "comes", median(of_whole[back]), median(of_kept[back]),
        median(of_kept[back]) / median(of_whole[back]), median(of_analysis[back]), share[back], why);
}

// What a hundred changes come to.
void follow(const std::string& word, Index n, double percent, int changes, const Options& options) {
  matrix::ChangingBody body(matrix::parse_body_change(word), n, percent / 100, 1);
  Solver solver(options);
  SparseMatrix a = body.matrix();
  check(solver.analyze(a).status);
  std::vector<double> followed, fresh;
  double fill = 0, work = 0, error = 0;
  int anew = 0, reordered = 0;
  Offset entries = 0;
  std::vector<double> rhs(static_cast<std::size_t>(a.cols)), x(rhs.size());
  for (std::size_t k = 0; k < rhs.size(); ++k) rhs[k] = std::sin(static_cast<double>(k));
  for (int k = 1; k <= changes; ++k) {
    body.change();
    a = body.matrix();
    ChangeResult change;
    followed.push_back(seconds_of([&] { change = solver.analyze_change(a); }));
    check(change.analysis.status);
    anew += change.full ? 1 : 0;
    reordered += change.reordered ? 1 : 0;
    entries += change.added_entries + change.removed_entries;
    if (k % 10 != 0) continue;
    Solver other(options);
    AnalysisResult best;
    fresh.push_back(seconds_of([&] { best = other.analyze(a); }));
    fill = std::max(fill,
                    static_cast<double>(change.analysis.nonzeros_factor) / static_cast<double>(best.nonzeros_factor));
    work = std::max(work, change.analysis.flops / best.flops);
    check(solver.factorize(a).status);
    error = std::max(error, solver.solve(rhs, x).backward_error);
  }
  fmt::print(
      "{} of {}^3 bricks, {} unknowns, {} changes of {} entries: analyze_change {:.4f} s, analyze {:.4f} s ({:.3f}); "
      "{} anew, {} times an order from beside the work; at worst {:.3f} times the entries, {:.3f} times the work of a "
      "fresh analysis; backward error {:.1e}\n",
      word, n, a.cols, changes, entries / changes, median(followed), median(fresh), median(followed) / median(fresh),
      anew, reordered, fill, work, error);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const bool sequence = argc > 1 && std::isalpha(static_cast<unsigned char>(argv[1][0])) != 0;
    const int first = sequence ? 2 : 1;
    const auto number = [&](int k, double usual) { return argc > first + k ? std::atof(argv[first + k]) : usual; };
    const auto n = static_cast<Index>(number(0, 24));
    const double percent = number(1, 1);
    Options options;
    options.threads = static_cast<int>(number(sequence ? 3 : 2, 0));
    if (argc > first + 4) options.device = argv[first + 4];
    if (sequence) {
      follow(argv[1], n, percent, static_cast<int>(number(2, 100)), options);
      return 0;
    }
    for (const bool on_face : {true, false}) {
      measure(n, percent, static_cast<int>(number(3, 3)), on_face, options);
      measure_numbers(n, percent, static_cast<int>(number(3, 3)), on_face, options);
    }
  } catch (const std::exception& e) {
    fmt::print(stderr, "espalier_bench_change: {}\n", e.what());
    return 1;
  }
  return 0;
}
