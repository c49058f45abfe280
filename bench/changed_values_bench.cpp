// Factorizations after which few values change (Options::partial_refactorization), beside whole ones.
//   espalier_bench_changed_values [N [THREADS [REPEATS [KEY=VALUE ...]]]]      default: elasticity 28^3, all cores, 5
// KEY=VALUE: options of both solvers: device=gpu:0, kind=ldlt, precision=fp32. system=gyroscopic: an unsymmetric matrix
// in the place of elasticity.
// Changed are the entries of one element at the surface, all of a 64th or an eighth of the body, at a corner, or all:
// what it costs then to have asked for parts.
// Seconds are medians of calls that take turns, with all values and with the changed entries alone; the work is that of
// the fronts that were made, over that of all. Both factors' solutions must be the same to the last bit; with budgets
// (host_memory=200MiB scratch=/var/tmp, or device=host:1 device_memory=200MiB) trees are cut otherwise where fronts are
// kept, so that it is a new solver with the same options that must have the same bits.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "espalier/solver.hpp"
#include "in_turns.hpp"
#include "solver/options/option_text.hpp"

namespace {

using namespace espalier;
using bench::check;
using bench::grid_system;
using bench::median;
using bench::seconds_of;

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

// The two solvers of a matrix, one of which makes what has changed alone.
class Pair {
 public:
  Pair(const SparseMatrix& a, Options options) : a_(a) {
    options.refinement_steps = 0;
    whole_ = std::make_unique<Solver>(options);
    options.partial_refactorization = true;
    partial_ = std::make_unique<Solver>(options);
    options_ = options;
    check(whole_->analyze(a).status);
    check(partial_->analyze(a).status);
    check(whole_->factorize(a).status);
    check(partial_->factorize(a).status);
  }

  void measure(const std::string& what, const std::vector<Offset>& places, int repeats) {
    std::vector<double> values = a_.values;
    std::vector<double> of_whole, of_partial, of_entries;
    double share = 1;
    for (int k = 0; k < repeats; ++k) {
      change(places, values);
      of_whole.push_back(seconds_of([&] { check(whole_->refactorize(values).status); }));
      of_partial.push_back(seconds_of([&] { share = share_of(partial_->refactorize(values)); }));
      change(places, values);
      std::vector<double> some;
      for (const Offset q : places) some.push_back(values[static_cast<std::size_t>(q)]);
      of_entries.push_back(seconds_of([&] { share = share_of(partial_->refactorize_entries(places, some)); }));
    }
    const std::vector<double> b(static_cast<std::size_t>(a_.cols), 1.0);
    std::vector<double> y(b.size());
    check(partial_->solve(b, y).status);
    const std::vector<double> x = truth(values, b);
    const bool same = std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) == 0;
    const double all = median(of_whole), part = median(of_partial), entries = median(of_entries);
    fmt::print(
        "{}: {} of {} entries; whole {:.4f} s, partial {:.4f} s, {:.3f} of it, by entries {:.4f} s, {:.3f}; work "
        "{:.3f}; memory {:.3f} of a whole one's; {}\n",
        what, places.size(), a_.nonzeros(), all, part, part / all, entries, entries / all, share,
        static_cast<double>(partial_->analysis().predicted_bytes) /
            static_cast<double>(whole_->analysis().predicted_bytes),
        same ? "same bits" : "OTHER BITS");
    print_traffic(values, places);
    if (!same) throw std::runtime_error("the solutions differ");
  }

 private:
  std::vector<double> truth(const std::vector<double>& values, const std::vector<double>& b) {
    std::vector<double> x(b.size());
    const bool budgeted = options_.host_memory_bytes > 0 || options_.device_memory_bytes > 0;
    std::unique_ptr<Solver> made;
    if (budgeted) {
      made = std::make_unique<Solver>(options_);
      check(made->analyze(a_).status);
    }
    Solver& solver = budgeted ? *made : *whole_;
    check(solver.refactorize(values).status);
    check(solver.solve(b, x).status);
    return x;
  }
  // What crosses the link by the plan, in a whole run, and what goes to the disk, of both.
  void print_traffic(std::vector<double> values, const std::vector<Offset>& places) {
    if (options_.scratch.empty() && options_.device_memory_bytes == 0) return;
    change(places, values);
    for (Solver* s : {whole_.get(), partial_.get()}) {
      const FactorResult f = s->refactorize(values);
      check(f.status);
      const AnalysisResult& a = s->analysis();
      for (const DeviceReport& d : f.devices) {
        const char* of = s == whole_.get() ? "whole" : "partial";
        if (d.streamed_out_bytes > 0)
          fmt::print("  {}, all: in {:.0f} MiB, out {:.0f} MiB, which takes the link {:.4f} s\n", of,
                     mib(d.streamed_in_bytes), mib(d.streamed_out_bytes), d.link_seconds);
        if (options_.scratch.empty()) continue;
        fmt::print(
            "  {}: file {:.0f} MiB, written {:.0f} MiB, read {:.0f} MiB; predicted for a whole one {:.0f}, {:.0f}\n",
            of, mib(a.predicted_disk_bytes), mib(d.disk_written_bytes), mib(d.disk_read_bytes),
            mib(a.predicted_disk_written_bytes), mib(a.predicted_disk_read_bytes));
      }
    }
  }
  static double mib(Offset bytes) { return static_cast<double>(bytes) / (1 << 20); }
  static void change(const std::vector<Offset>& places, std::vector<double>& values) {
    for (const Offset q : places) values[static_cast<std::size_t>(q)] *= 1 + 1e-9;
  }
  static double share_of(const FactorResult& f) {
    check(f.status);
    return f.work_share;
  }

  const SparseMatrix& a_;
  std::unique_ptr<Solver> whole_, partial_;
  Options options_;  // of the one that makes a part
};

}  // namespace

int main(int argc, char** argv) {
  const auto number = [&](int k, int otherwise) { return argc > k ? std::atoi(argv[k]) : otherwise; };
  const int n = number(1, 28), threads = number(2, 0), repeats = std::max(1, number(3, 5));
  if (n < 2 || threads < 0) {
    fmt::print(stderr, "espalier_bench_changed_values [N [THREADS [REPEATS [KEY=VALUE ...]]]], N from 2\n");
    return 2;
  }
  try {
    std::string system = "elasticity";
    Options options;
    options.threads = threads;
    for (int k = 4; k < argc; ++k) {
      const std::string given = argv[k];
      const std::size_t equals = std::min(given.find('='), given.size());
      const std::string key = given.substr(0, equals), value = given.substr(std::min(equals + 1, given.size()));
      if (key == "system")
        system = value;
      else
        solver::set_option(options, key, value);
    }
    const SparseMatrix a = grid_system(system, n);
    const auto side = static_cast<Index>(n);
    const std::string name = fmt::format("{} {}^3, ", system, n);
    Pair pair(a, options);
    pair.measure(name + "one element",
                 places_within(a, side, [side](Index x, Index y, Index z) { return x < 2 && y >= side - 1 && z < 2; }),
                 repeats);
    const Index quarter = side / 4;
    pair.measure(name + "a 64th of the body",
                 places_within(a, side,
                               [quarter](Index x, Index y, Index z) {
                                 return std::max({x, y, z}) < quarter;
                               }),
                 repeats);
    pair.measure(
        name + "an eighth of the body",
        places_within(a, side,
                      [side](Index x, Index y, Index z) { return 2 * x < side && 2 * y < side && 2 * z < side; }),
        repeats);
    pair.measure(name + "all of the body", places_within(a, side, [](Index, Index, Index) { return true; }), repeats);
  } catch (const std::exception& e) {
    fmt::print(stderr, "espalier_bench_changed_values: {}\n", e.what());
    return 1;
  }
  return 0;
}
