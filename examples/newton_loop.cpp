// Newton's method with one analysis and a refactorization per step: the sag of a stretched net under its own weight.
//
// A net of (n + 2) x (n + 2) knots, one unit apart, its border fixed; neighbours are joined by springs of stiffness k
// and rest length r < 1. A spring between knots at distance l, in the direction d, pulls with k (l - r); the derivative
// of its force is k d d^T + k (1 - r / l) (I - d d^T). The unknowns are the three coordinates of the inner knots.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <espalier/espalier.hpp>
#include <map>
#include <vector>

using espalier::Index;
using Vector = std::array<double, 3>;

constexpr int kInner = 60;          // knots along one inner side
constexpr double kStiffness = 1.0;  // force per length
constexpr double kRest = 0.9;       // rest length of a spring
constexpr double kWeight = 1e-3;    // of a knot, downwards

/// Number of the inner knot (i, j), both from 1 to kInner; -1 on the border.
Index knot(int i, int j) {
  const bool inside = i >= 1 && j >= 1 && i <= kInner && j <= kInner;
  return inside ? static_cast<Index>((i - 1) * kInner + j - 1) : -1;
}

struct Net {
  std::vector<Vector> place;                          // of all knots, border included
  std::vector<std::array<int, 4>> springs;            // i, j of both ends
  espalier::SparseMatrix tangent;                     // lower triangle, columns sorted
  std::map<std::pair<Index, Index>, std::size_t> at;  // (row, column) -> position in tangent.values

  Net();
  Vector& of(int i, int j) { return place[static_cast<std::size_t>(i * (kInner + 2) + j)]; }
  /// Fills the tangent and returns the unbalanced force on the inner knots.
  std::vector<double> assemble();
  void add_spring(const std::array<int, 4>& spring, std::vector<double>& force);
};

Net::Net() {
  for (int i = 0; i < kInner + 2; ++i) {
    for (int j = 0; j < kInner + 2; ++j) {
      place.push_back({static_cast<double>(i), static_cast<double>(j), 0.0});
      if (i > 0 && j > 0 && j <= kInner) springs.push_back({i - 1, j, i, j});
      if (j > 0 && i > 0 && i <= kInner) springs.push_back({i, j - 1, i, j});
    }
  }
  for (const auto& [i, j, k, l] : springs) {
    for (const auto& [p, q] : {std::pair{knot(i, j), knot(i, j)}, {knot(k, l), knot(k, l)}, {knot(i, j), knot(k, l)}}) {
      for (Index r = 0; r < 3 && p >= 0 && q >= 0; ++r) {
        for (Index c = 0; c < 3; ++c) {
          const Index row = 3 * p + r, col = 3 * q + c;
          at[{std::max(col, row), std::min(col, row)}] = 0;
        }
      }
    }
  }
  tangent.rows = tangent.cols = 3 * kInner * kInner;
  tangent.storage = espalier::Storage::symmetric_lower;
  std::vector<std::vector<Index>> columns(static_cast<std::size_t>(tangent.cols));
  for (const auto& [entry, position] : at) columns[static_cast<std::size_t>(entry.second)].push_back(entry.first);
  tangent.col_ptr.push_back(0);
  for (std::size_t column = 0; column < columns.size(); ++column) {
    for (const Index row : columns[column]) {
      at[{row, static_cast<Index>(column)}] = tangent.row_ind.size();
      tangent.row_ind.push_back(row);
    }
    tangent.col_ptr.push_back(static_cast<espalier::Offset>(tangent.row_ind.size()));
  }
  tangent.values.resize(tangent.row_ind.size());
}

void Net::add_spring(const std::array<int, 4>& spring, std::vector<double>& force) {
  const auto [i, j, k, l] = spring;
  const Vector a = of(i, j), b = of(k, l);
  Vector d{b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const double length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  for (double& x : d) x /= length;
  const double pull = kStiffness * (length - kRest), across = kStiffness * (1 - kRest / length);
  const Index p = knot(i, j), q = knot(k, l);
  for (Index r = 0; r < 3; ++r) {
    const auto u = static_cast<std::size_t>(r);
    if (p >= 0) force[static_cast<std::size_t>(3 * p) + u] += pull * d[u];
    if (q >= 0) force[static_cast<std::size_t>(3 * q) + u] -= pull * d[u];
    for (Index c = 0; c < 3; ++c) {
      const auto v = static_cast<std::size_t>(c);
      const double stiffness = (kStiffness - across) * d[u] * d[v] + (r == c ? across : 0.0);
      if (p >= 0 && r >= c) tangent.values[at[{3 * p + r, 3 * p + c}]] += stiffness;
      if (q >= 0 && r >= c) tangent.values[at[{3 * q + r, 3 * q + c}]] += stiffness;
      if (p >= 0 && q >= 0) tangent.values[at[{3 * q + r, 3 * p + c}]] -= stiffness;  // q > p
    }
  }
}

std::vector<double> Net::assemble() {
  std::vector<double> force(static_cast<std::size_t>(tangent.rows), 0.0);
  for (std::size_t z = 2; z < force.size(); z += 3) force[z] = -kWeight;
  tangent.values.assign(tangent.values.size(), 0.0);
  for (const auto& spring : springs) add_spring(spring, force);
  return force;
}

double largest(const std::vector<double>& v) {
  double most = 0;
  for (const double x : v) most = std::max(most, std::abs(x));
  return most;
}

int main() {
  Net net;
  espalier::Solver solver;
  std::vector<double> force = net.assemble();
  if (const auto a = solver.analyze(net.tangent); !a.status.ok()) return std::puts(a.status.message.c_str()), 1;
  if (const auto f = solver.factorize(net.tangent); !f.status.ok()) return std::puts(f.status.message.c_str()), 1;

  std::printf("step  unbalanced force  factorization\n");
  for (int step = 1; step <= 30; ++step) {
    std::vector<double> move(force.size());
    if (const auto s = solver.solve(force, move); !s.status.ok()) return std::puts(s.status.message.c_str()), 1;
    // The weight alone moves the flat net far: a step is cut to half the distance of two knots.
    const double cut = std::min(1.0, 0.5 / largest(move));
    for (int i = 1; i <= kInner; ++i) {
      for (int j = 1; j <= kInner; ++j) {
        for (std::size_t c = 0; c < 3; ++c) net.of(i, j)[c] += cut * move[static_cast<std::size_t>(3 * knot(i, j)) + c];
      }
    }
    force = net.assemble();
    const auto factor = solver.refactorize(net.tangent.values);
    if (!factor.status.ok()) return std::puts(factor.status.message.c_str()), 1;
    std::printf("%4d  %16.3e  %10.2f ms\n", step, largest(force), factor.seconds * 1e3);
    if (largest(force) < 1e-12) {
      std::printf("in balance; the middle hangs %.4f below the frame\n", -net.of(kInner / 2, kInner / 2)[2]);
      return 0;
    }
  }
  std::puts("no balance was found");
  return 1;
}
