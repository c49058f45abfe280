#include "verdict/cases.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

#include "matrix/generators/random.hpp"

namespace espalier::verdict {

namespace {

using reference::Triple;

/// A sequence of numbers by a counter.
class Random {
 public:
  explicit Random(std::uint64_t seed) : seed_(seed) {}
  double unit() { return matrix::random_unit(seed_, counter_++); }
  Index below(Index n) { return std::min(n - 1, static_cast<Index>(unit() * n)); }
  /// -most .. most without 0.
  double integer(Index most) { return (1 + below(most)) * (unit() < 0.5 ? -1.0 : 1.0); }

 private:
  std::uint64_t seed_, counter_ = 0;
};

/// Entries that are added up: exact for integers.
class Sum {
 public:
  explicit Sum(Index n) : n_(n) {}
  void add(Index r, Index c, double v) { entries_[{c, r}] += v; }
  void add_symmetric(Index r, Index c, double v) { add(std::max(r, c), std::min(r, c), v); }
  [[nodiscard]] SparseMatrix matrix(Storage storage) const {
    std::vector<Triple> t;
    for (const auto& [at, v] : entries_)
      if (v != 0) t.push_back({at.second, at.first, v});
    return reference::from_triples(n_, t, storage);
  }

 private:
  Index n_;
  std::map<std::pair<Index, Index>, double> entries_;
};

// A weight times the Laplacian of one edge.
void add_edge(Sum& a, Index i, Index j, double weight) {
  a.add(i, i, weight);
  a.add(j, j, weight);
  a.add_symmetric(i, j, -weight);
}

// Trees with further edges: as many zeros as parts, in integers.
Case graph(Index n, std::uint64_t seed, bool spread) {
  Random random(seed);
  const Index parts = 1 + random.below(4);
  Sum a(n);
  for (Index k = parts; k < n; ++k) {
    const auto weight = [&] {
      return spread ? std::ldexp(1.0, static_cast<int>(random.below(20))) : 1 + random.below(3);
    };
    const Index part = k % parts, earlier = k / parts;
    add_edge(a, k, part + parts * random.below(earlier), weight());
    if (earlier > 2) add_edge(a, k, part + parts * random.below(earlier - 1), weight());
  }
  return {spread ? "graph, weights to 2^20" : "graph", a.matrix(Storage::symmetric_lower), parts, true, 0};
}

Case grid(Index n, std::uint64_t seed, bool held) {
  const auto side = std::max<Index>(2, static_cast<Index>(std::sqrt(static_cast<double>(n))));
  Sum a(side * side);
  const auto at = [&](Index x, Index y) { return x + side * y; };
  for (Index y = 0; y < side; ++y)
    for (Index x = 0; x < side; ++x) {
      if (x + 1 < side) add_edge(a, at(x, y), at(x + 1, y), 1);
      if (y + 1 < side) add_edge(a, at(x, y), at(x, y + 1), 1);
    }
  const Index where = at(static_cast<Index>(seed % static_cast<std::uint64_t>(side)), 0);
  if (held) a.add(where, where, 1);
  return {held ? "grid, held at one point" : "grid, free", a.matrix(Storage::symmetric_lower), held ? 0 : 1, true, 0};
}

// Bars between points of a plane, in doubles: three rigid motions where the frame is rigid in itself.
Case truss(Index n, std::uint64_t seed) {
  Random random(seed);
  const Index points = std::max<Index>(3, n / 2);
  std::vector<double> x, y;
  for (Index k = 0; k < points; ++k) {
    x.push_back(k / 2 + 0.3 * random.unit());
    y.push_back(k % 2 + 0.3 * random.unit());
  }
  Sum a(2 * points);
  const auto bar = [&](Index i, Index j) {
    const double dx = x[j] - x[i], dy = y[j] - y[i], length = std::hypot(dx, dy);
    const double d[2] = {dx / length, dy / length}, stiffness = (0.5 + random.unit()) / length;
    for (Index p = 0; p < 2; ++p)
      for (Index q = 0; q < 2; ++q) {
        const double k = stiffness * d[p] * d[q];
        if (p >= q) a.add(2 * i + p, 2 * i + q, k);
        if (p >= q) a.add(2 * j + p, 2 * j + q, k);
        a.add(2 * j + p, 2 * i + q, -k);
      }
  };
  for (Index k = 1; k < points; ++k)
    for (Index back = 1; back <= std::min<Index>(k, 3); ++back) bar(k - back, k);
  return {"truss, free", a.matrix(Storage::symmetric_lower), 3, true, 0};
}

// The same in space: bars from each point to the ten before it, six rigid motions.
Case body(Index n, std::uint64_t seed) {
  Random random(seed);
  const Index points = std::max<Index>(8, n / 3);
  std::vector<std::array<double, 3>> x;
  for (Index k = 0; k < points; ++k)
    x.push_back({k / 4 + 0.3 * random.unit(), k % 2 + 0.3 * random.unit(), k / 2 % 2 + 0.3 * random.unit()});
  Sum a(3 * points);
  for (Index j = 1; j < points; ++j)
    for (Index i = std::max<Index>(0, j - 10); i < j; ++i) {
      std::array<double, 3> d{};
      for (std::size_t p = 0; p < 3; ++p) d[p] = x[static_cast<std::size_t>(j)][p] - x[static_cast<std::size_t>(i)][p];
      const double square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
      const double stiffness = (0.5 + random.unit()) / (square * std::sqrt(square));
      for (Index p = 0; p < 3; ++p)
        for (Index q = 0; q < 3; ++q) {
          const double k = stiffness * d[static_cast<std::size_t>(p)] * d[static_cast<std::size_t>(q)];
          if (p >= q) a.add(3 * i + p, 3 * i + q, k);
          if (p >= q) a.add(3 * j + p, 3 * j + q, k);
          a.add(3 * j + p, 3 * i + q, -k);
        }
    }
  return {"body, free", a.matrix(Storage::symmetric_lower), 6, true, 0};
}

// Second differences with weights in doubles: a beam that is held nowhere. Its softest bending is a 1e11th of the
// stiffest, and the factor's error may be as large as that of a regular matrix.
Case beam(Index n, std::uint64_t seed) {
  Random random(seed);
  Sum a(n);
  for (Index k = 0; k + 2 < n; ++k) {
    const double weight = std::pow(10, 4 * random.unit() - 2);
    const std::array<double, 3> d{1, -2, 1};
    for (Index p = 0; p < 3; ++p)
      for (Index q = 0; q <= p; ++q)
        a.add(k + p, k + q, weight * d[static_cast<std::size_t>(p)] * d[static_cast<std::size_t>(q)]);
  }
  return {"beam, free", a.matrix(Storage::symmetric_lower), 2, true, 0};
}

// [H B^T; B -D] with definite H and D, however small: as many negative eigenvalues as rows of B (Vanderbei 1995).
Case quasi_definite(Index n, std::uint64_t seed) {
  Random random(seed);
  const Index unknowns = std::max<Index>(4, 3 * n / 5), rows = std::max<Index>(2, 2 * n / 5);
  Sum a(unknowns + rows);
  const auto small = [&] { return std::ldexp(1.0, -static_cast<int>(random.below(24))); };
  for (Index k = 0; k < unknowns; ++k) a.add(k, k, random.unit() < 0.3 ? small() : 1 + random.below(5));
  for (Index k = 0; k < rows; ++k) {
    a.add(unknowns + k, unknowns + k, -small());
    for (int entry = 0; entry < 4; ++entry) a.add(unknowns + k, random.below(unknowns), random.integer(3));
  }
  return {"quasi-definite", a.matrix(Storage::symmetric_lower), 0, false, rows};
}

// A basis of a linear program: the product of two triangles with ones on their diagonals and a few more, in integers,
// so that its determinant is 1; rows and columns change places.
Case basis(Index n, std::uint64_t seed) {
  Random random(seed);
  std::vector<std::map<Index, double>> lower(static_cast<std::size_t>(n)), upper(static_cast<std::size_t>(n));
  for (Index k = 0; k < n; ++k) {
    lower[static_cast<std::size_t>(k)][k] = upper[static_cast<std::size_t>(k)][k] = 1;
    if (k > 0 && random.unit() < 0.5) lower[static_cast<std::size_t>(k)][random.below(k)] = random.integer(1);
    if (k + 1 < n && random.unit() < 0.5)
      upper[static_cast<std::size_t>(k)][k + 1 + random.below(n - 1 - k)] = random.integer(1);
  }
  Sum a(n);
  for (Index r = 0; r < n; ++r)
    for (const auto& [k, left] : lower[static_cast<std::size_t>(r)])
      for (const auto& [c, right] : upper[static_cast<std::size_t>(k)]) a.add((r * 11 + 5) % n, c, left * right);
  return {"basis", a.matrix(Storage::general), 0};
}

// [H B^T; B 0] with a definite H and rows of B that repeat or add up: so many zeros.
Case constraints(Index n, std::uint64_t seed) {
  Random random(seed);
  const Index unknowns = std::max<Index>(6, 2 * n / 3), rows = unknowns / 3, redundant = random.below(4);
  Sum a(unknowns + rows + redundant);
  for (Index k = 0; k < unknowns; ++k) {
    a.add(k, k, 1 + random.below(5));
    if (k > 0) add_edge(a, k, random.below(k), 1 + random.below(2));
  }
  std::vector<std::vector<std::pair<Index, double>>> b;
  for (Index k = 0; k < rows; ++k)  // the first entry belongs to this row alone: independent
    b.push_back({{k, random.integer(3)}, {rows + random.below(unknowns - rows), random.integer(3)}});
  for (Index k = 0; k < redundant; ++k) {
    auto sum = b[static_cast<std::size_t>(random.below(rows))];
    for (const auto& entry : b[static_cast<std::size_t>(random.below(rows))]) sum.push_back(entry);
    b.push_back(sum);
  }
  for (Index k = 0; k < static_cast<Index>(b.size()); ++k)
    for (const auto& [c, v] : b[static_cast<std::size_t>(k)]) a.add(unknowns + k, c, v);
  return {"constraints, redundant", a.matrix(Storage::symmetric_lower), redundant, false, rows};
}

// Dominant rows, of which some are replaced by sums of two others: integers, unsymmetric.
Case rows(Index n, std::uint64_t seed) {
  Random random(seed);
  const Index zeros = random.below(4);
  std::vector<std::vector<std::pair<Index, double>>> row(static_cast<std::size_t>(n));
  for (Index r = 0; r < n; ++r) {
    row[static_cast<std::size_t>(r)].push_back({(r + 3) % n, 9 + random.below(9)});
    for (int k = 0; k < 2; ++k) row[static_cast<std::size_t>(r)].push_back({random.below(n), random.integer(3)});
  }
  for (Index k = 0; k < zeros; ++k) {  // the last rows become sums of rows before
    auto& sum = row[static_cast<std::size_t>(n - 1 - k)];
    sum.clear();
    for (int part = 0; part < 2; ++part) {
      const double factor = random.integer(2);
      for (const auto& [c, v] : row[static_cast<std::size_t>(random.below(n - zeros))]) sum.push_back({c, factor * v});
    }
  }
  Sum a(n);
  for (Index r = 0; r < n; ++r)
    for (const auto& [c, v] : row[static_cast<std::size_t>(r)]) a.add(r, c, v);
  return {"rows that are sums", a.matrix(Storage::general), zeros};
}

// A chain with further entries and zeros on the diagonal; then rows and columns of some unknowns become multiples of
// others', so that several zeros meet in one part of the factor. Numbers of 20 bits: exactly singular.
Case combined(Index n, std::uint64_t seed) {
  Random random(seed);
  const auto size = static_cast<std::size_t>(n);
  std::vector<std::vector<double>> m(size, std::vector<double>(size, 0));
  const auto number = [&] { return static_cast<double>(1 + random.below(1 << 20)) * (random.unit() < 0.5 ? -1 : 1); };
  for (std::size_t i = 0; i + 1 < size; ++i) m[i + 1][i] = number();
  for (Index k = 0; k < 3 * n; ++k) {
    const auto i = static_cast<std::size_t>(random.below(n)), j = static_cast<std::size_t>(random.below(n));
    m[i][j] = number();
  }
  for (std::size_t i = 0; i < size; ++i) m[i][i] = i % 4 == 0 ? 0 : number();
  for (std::size_t i = 0; i + 1 < size; ++i) m[i][i + 1] = number();
  const Index zeros = n < 12 ? 0 : random.below(4);
  for (Index k = 0; k < zeros; ++k) {
    const auto from = static_cast<std::size_t>(2 * k + 1), to = static_cast<std::size_t>(n - 1 - k);
    const double factor = 1 + static_cast<double>(random.below(3));
    for (std::size_t j = 0; j < size; ++j) m[to][j] = 0;
    for (auto& row : m) row[to] = factor * row[from];
    for (std::size_t j = 0; j < size; ++j) m[to][j] = factor * m[from][j];
  }
  Sum a(n);
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < n; ++j)
      if (const double v = m[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)]; v != 0) a.add(i, j, v);
  return {"combined on both sides", a.matrix(Storage::general), zeros};
}

// Q D Q^T with rotations Q of neighbours and eigenvalues D: `least` beside 1.
Case rotated(Index n, std::uint64_t seed, double least, double next, bool indefinite) {
  Random random(seed);
  std::vector<std::vector<double>> m(static_cast<std::size_t>(n), std::vector<double>(static_cast<std::size_t>(n), 0));
  Index negative = 0;
  for (Index k = 0; k < n; ++k) {
    double d = 0.3 + random.unit();
    if (k == n / 2) d = least;
    if (k == n / 3) d = next;
    if (indefinite && k % 3 == 1 && k != n / 2) {
      d = -d;
      ++negative;
    }
    m[static_cast<std::size_t>(k)][static_cast<std::size_t>(k)] = d;
  }
  for (int sweep = 0; sweep < 3; ++sweep)
    for (std::size_t k = 0; k + 1 < static_cast<std::size_t>(n); ++k) {
      const std::size_t i = k,
                        j = sweep % 2 == 0 ? k + 1 : std::min<std::size_t>(k + 3, static_cast<std::size_t>(n) - 1);
      if (i == j || (k + static_cast<std::size_t>(sweep)) % 3 == 0) continue;
      const double angle = 6 * random.unit(), c = std::cos(angle), s = std::sin(angle);
      for (std::size_t t = 0; t < m.size(); ++t) {
        const double a = m[i][t], b = m[j][t];
        m[i][t] = c * a - s * b;
        m[j][t] = s * a + c * b;
      }
      for (auto& r : m) {
        const double a = r[i], b = r[j];
        r[i] = c * a - s * b;
        r[j] = s * a + c * b;
      }
    }
  Sum a(n);
  for (Index c = 0; c < n; ++c)
    for (Index r = c; r < n; ++r) a.add(r, c, m[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)]);
  const bool singular = least < 1e-16;
  if (!singular && indefinite && (n / 2) % 3 == 1) negative = -1;
  return {singular ? "rotated, one zero" : "rotated, ill-conditioned", a.matrix(Storage::symmetric_lower),
          singular ? 1 : 0, !indefinite, negative};
}

// Blocks of rank one in integers, [1 k; k k^2], beside regular ones: half of all eigenvalues may be zero.
Case many(Index n, std::uint64_t seed) {
  Random random(seed);
  Sum a(n);
  Index zeros = 0;
  for (Index k = 0; k + 1 < n; k += 2) {
    const double f = random.integer(4);
    const bool singular = random.unit() < 0.3;
    a.add(k, k, 1);
    a.add(k + 1, k, f);
    a.add(k + 1, k + 1, f * f + (singular ? 0 : 1));
    zeros += singular ? 1 : 0;
  }
  if (n % 2 == 1) a.add(n - 1, n - 1, 1);
  return {"many blocks", a.matrix(Storage::symmetric_lower), zeros, true, 0};
}

// Unsymmetric and regular, condition below n: a row's own entry outweighs the others by half.
Case dominant(Index n, std::uint64_t seed) {
  Random random(seed);
  Sum a(n);
  for (Index r = 0; r < n; ++r) {
    a.add(r, (r * 7 + 3) % n, 8);  // a permutation where 7 does not divide n; else rows share a column
    for (int k = 0; k < 3; ++k) a.add(r, random.below(n), random.integer(1));
  }
  SparseMatrix made = a.matrix(Storage::general);
  return {"dominant", std::move(made), 0};
}

}  // namespace

Index structures() { return 17; }

Case make_case(Index structure, Index n, std::uint64_t seed) {
  switch (structure) {
    case 0:
      return graph(n, seed, false);
    case 1:
      return graph(n, seed, true);
    case 2:
      return grid(n, seed, false);
    case 3:
      return grid(n, seed, true);
    case 4:
      return truss(n, seed);
    case 5:
      return constraints(n, seed);
    case 6:
      return rows(n, seed);
    case 7:
      return rotated(std::min<Index>(n, 60), seed, 9e-17, 1e-10, false);
    case 8:
      return rotated(std::min<Index>(n, 60), seed, 5e-17, 4e-12, true);
    case 9:
      return rotated(std::min<Index>(n, 60), seed, 1e-12, 1e-11, true);
    case 10:
      return many(n, seed);
    case 12:
      return body(n, seed);
    case 13:
      return quasi_definite(n, seed);
    case 15:
      return beam(n, seed);
    case 16:
      return combined(n, seed);
    case 14:
      return basis(n % 11 == 0 ? n + 1 : n, seed);
    default:
      return dominant(n % 7 == 0 ? n + 1 : n, seed);
  }
}

SparseMatrix disguised(const SparseMatrix& a, int range, std::uint64_t seed) {
  Random random(seed);
  const Index n = a.rows;
  const bool symmetric = a.storage != Storage::general;
  const auto powers = [&] {
    std::vector<double> p;
    for (Index k = 0; k < n; ++k) p.push_back(std::ldexp(1.0, static_cast<int>(random.below(2 * range + 1)) - range));
    return p;
  };
  const auto order = [&] {
    std::vector<Index> p(static_cast<std::size_t>(n));
    std::iota(p.begin(), p.end(), 0);
    for (Index k = n - 1; k > 0; --k)
      std::swap(p[static_cast<std::size_t>(k)], p[static_cast<std::size_t>(random.below(k + 1))]);
    return p;
  };
  const std::vector<double> row = powers(), col = symmetric ? row : powers();
  const std::vector<Index> to_row = order(), to_col = symmetric ? to_row : order();
  std::vector<Triple> t;
  for (Index c = 0; c < n; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q) {
      const Index r = a.row_ind[static_cast<std::size_t>(q)];
      Index i = to_row[static_cast<std::size_t>(r)], j = to_col[static_cast<std::size_t>(c)];
      if (symmetric && i < j) std::swap(i, j);
      t.push_back({i, j,
                   a.values[static_cast<std::size_t>(q)] * row[static_cast<std::size_t>(r)] *
                       col[static_cast<std::size_t>(c)]});
    }
  return reference::from_triples(n, t, a.storage);
}

SparseMatrix in_units(const SparseMatrix& a, int exponent) {
  SparseMatrix out = a;
  for (double& v : out.values) v = std::ldexp(v, exponent);
  return out;
}

SparseMatrix bordered(const SparseMatrix& a, Index row) {
  std::vector<Triple> t;
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
      t.push_back({a.row_ind[static_cast<std::size_t>(q)], c, a.values[static_cast<std::size_t>(q)]});
  t.push_back({a.rows, row, 1});
  if (a.storage == Storage::general) t.push_back({row, a.rows, 1});
  return reference::from_triples(a.rows + 1, t, a.storage);
}

}  // namespace espalier::verdict
