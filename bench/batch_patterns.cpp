#include "batch_patterns.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <random>
#include <stdexcept>
#include <vector>

#include "base/thread_pool.hpp"
#include "espalier/batch.hpp"

namespace espalier::bench {

namespace {

// A grid with some couplings across it, at random: no two patterns are equal. A third each: diagonally dominant (llt),
// with constraints for a fifth of the unknowns (ldlt), with a wind (lu).
SparseMatrix random_grid(Index n, int sort, std::mt19937_64& random) {
  const Index m = sort == 1 ? n / 6 : 0, k = n - m;
  const auto side = static_cast<Index>(std::sqrt(k));
  std::vector<std::map<Index, double>> column(static_cast<std::size_t>(n));
  const auto of = [&](Index c) -> std::map<Index, double>& { return column[static_cast<std::size_t>(c)]; };
  const auto couple = [&](Index i, Index j, double v) {
    of(std::min(i, j))[std::max(i, j)] = v;
    if (sort == 2) of(std::max(i, j))[std::min(i, j)] = 0.5 * v;
  };
  const auto number = [&] { return 0.5 + static_cast<double>(random() % 1000) / 1000; };
  for (Index c = 0; c < k; ++c) {
    of(c)[c] = 8;
    if (c + 1 < k && (c + 1) % side != 0) couple(c, c + 1, -number());
    if (c + side < k) couple(c, c + side, -number());
    const auto far = static_cast<Index>(random() % static_cast<std::uint64_t>(k));
    if (random() % 20 == 0 && far != c) couple(c, far, -number());
  }
  for (Index j = 0; j < m; ++j)
    for (const Index c : {4 * j % k, (4 * j + 1) % k}) couple(c, k + j, number());
  SparseMatrix a;
  a.rows = a.cols = n;
  a.storage = sort == 2 ? Storage::general : Storage::symmetric_lower;
  a.col_ptr.push_back(0);
  for (const auto& entries : column) {
    for (const auto& [row, value] : entries) {
      a.row_ind.push_back(row);
      a.values.push_back(value);
    }
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  return a;
}

double backward_error(const SparseMatrix& a, const std::vector<double>& b, const std::vector<double>& x) {
  std::vector<double> r(b), row(b.size(), 0.0);
  const auto add = [&](Index i, Index j, double v) {
    r[static_cast<std::size_t>(i)] -= v * x[static_cast<std::size_t>(j)];
    row[static_cast<std::size_t>(i)] += std::abs(v);
  };
  for (Index c = 0; c < a.cols; ++c)
    for (auto q = static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(c)]);
         q < static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(c) + 1]); ++q) {
      add(a.row_ind[q], c, a.values[q]);
      if (a.symmetric() && a.row_ind[q] != c) add(c, a.row_ind[q], a.values[q]);
    }
  const auto largest = [](const std::vector<double>& v) {
    double most = 0;
    for (const double e : v) most = std::isnan(e) ? INFINITY : std::max(most, std::abs(e));
    return most;
  };
  return largest(r) / (largest(row) * largest(x) + largest(b));
}

struct Problem {
  explicit Problem(const ManyPatterns& wish) {
    std::mt19937_64 random(1);
    for (Index s = 0; s < wish.count; ++s) {
      const auto span = static_cast<std::uint64_t>(wish.most - wish.least + 1);
      a.push_back(random_grid(wish.least + static_cast<Index>(random() % span), static_cast<int>(s % 3), random));
      std::vector<double>& of = b.emplace_back(static_cast<std::size_t>(a.back().cols));
      for (double& v : of) v = static_cast<double>(random() % 2000) / 1000 - 1;
      x.emplace_back(of.size());
      unknowns += a.back().cols;
    }
    for (std::size_t s = 0; s < a.size(); ++s) systems.push_back({a[s], b[s], x[s]});
  }
  [[nodiscard]] double worst_error() const {
    double most = 0;
    for (std::size_t s = 0; s < a.size(); ++s) most = std::max(most, backward_error(a[s], b[s], x[s]));
    return most;
  }

  std::vector<SparseMatrix> a;
  std::vector<std::vector<double>> b, x;
  std::vector<System> systems;
  Offset unknowns = 0;
};

}  // namespace

int run_many_patterns(const ManyPatterns& wish) {
  if (wish.count < 1 || wish.least < 12 || wish.most < wish.least)
    throw std::runtime_error("give a number of systems, and from 12 unknowns on");
  Problem p(wish);
  fmt::print(
      "{} systems of {} to {} unknowns, {} in all, with {} patterns; a third each llt, ldlt and lu; {} threads\n",
      wish.count, wish.least, wish.most, p.unknowns, wish.count, wish.threads);
  double error = 0;
  std::vector<Index> negative;  // eigenvalues, by the cores
  for (const std::string& device : {std::string("cpu"), wish.device, std::string("auto")}) {
    Options options;
    options.threads = wish.threads;
    options.device = device;
    std::vector<double> times;
    std::string said;
    Index differing = 0;
    for (int round = 0; round < 4; ++round) {
      for (auto& of : p.x) std::fill(of.begin(), of.end(), NAN);
      options.log = [&](const std::string& line) { said = line; };
      const BatchResult result = solve_systems(p.systems, options);
      if (!result.status.ok()) throw std::runtime_error(result.status.message);
      if (round > 0) times.push_back(result.seconds);
      differing = 0;
      for (std::size_t s = 0; s < result.systems.size(); ++s) {
        const Index found = result.systems[s].inertia.negative;
        if (negative.size() < result.systems.size()) negative.push_back(found);
        if (found != negative[s]) ++differing;
      }
      error = differing > 0 ? INFINITY : std::max(error, p.worst_error());
    }
    std::sort(times.begin(), times.end());
    const double median = times[times.size() / 2];
    fmt::print("solve_systems on {}: {:.4f} s, {:.2f} us a system; backward errors {:.1e}, {} other inertias\n", device,
               median, 1e6 * median / wish.count, error, differing);
    if (!said.empty()) fmt::print("  {}\n", said);
  }
  return error < 1e-12 ? 0 : 1;
}

}  // namespace espalier::bench
