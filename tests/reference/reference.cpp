#include "reference/reference.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "matrix/generators/random.hpp"

namespace espalier::reference {

namespace {

using Map = Eigen::Map<const Eigen::MatrixXd>;

bool half(const MatrixView& a) {
  return a.storage == Storage::symmetric_lower || a.storage == Storage::symmetric_upper;
}

// Calls use(row, column, value) for every entry of the full matrix.
template <class Use>
void visit(const MatrixView& a, Use&& use) {
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q) {
      const Index r = a.row_ind[static_cast<std::size_t>(q)];
      const double v = a.values.empty() ? 1.0 : a.values[static_cast<std::size_t>(q)];
      use(r, c, v);
      if (half(a) && r != c) use(c, r, v);
    }
}

// The entries of a matrix row by row, each row by columns.
struct Rows {
  struct Entry {
    Index column;
    long double value;
  };
  std::vector<std::vector<Entry>> of;
};

// The rows of op(A); duplicates are summed before anything else happens to them.
Rows summed(const MatrixView& a, bool transpose) {
  Rows rows{std::vector<std::vector<Rows::Entry>>(static_cast<std::size_t>(transpose ? a.cols : a.rows))};
  visit(a, [&](Index r, Index c, double v) {
    rows.of[static_cast<std::size_t>(transpose ? c : r)].push_back({transpose ? r : c, v});
  });
  for (std::vector<Rows::Entry>& row : rows.of) {
    std::stable_sort(row.begin(), row.end(), [](const auto& x, const auto& y) { return x.column < y.column; });
    std::size_t last = 0;
    for (std::size_t k = 1; k < row.size(); ++k)
      if (row[k].column == row[last].column)
        row[last].value += row[k].value;
      else
        row[++last] = row[k];
    row.resize(std::min(row.size(), last + 1));
  }
  return rows;
}

std::vector<double> residual(const Rows& rows, const double* b, const double* x) {
  std::vector<double> out(rows.of.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    long double sum = b[i];
    for (const Rows::Entry& e : rows.of[i]) sum -= e.value * x[e.column];
    out[i] = static_cast<double>(sum);
  }
  return out;
}

class Random {
 public:
  explicit Random(std::uint64_t seed) : seed_(seed) {}
  double unit() { return matrix::random_unit(seed_, count_++); }
  double symmetric() { return 2 * unit() - 1; }
  Index below(Index n) {
    return static_cast<Index>(matrix::random_below(seed_, count_++, static_cast<std::uint64_t>(n)));
  }

 private:
  std::uint64_t seed_, count_ = 0;
};

}  // namespace

std::vector<double> dense(const MatrixView& a) {
  std::vector<double> d(static_cast<std::size_t>(a.rows) * static_cast<std::size_t>(a.cols), 0.0);
  visit(a, [&](Index r, Index c, double v) {
    d[static_cast<std::size_t>(c) * static_cast<std::size_t>(a.rows) + static_cast<std::size_t>(r)] += v;
  });
  return d;
}

std::vector<double> eigenvalues(const MatrixView& a) {
  const std::vector<double> d = dense(a);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(Map(d.data(), a.rows, a.cols), Eigen::EigenvaluesOnly);
  return {solver.eigenvalues().data(), solver.eigenvalues().data() + a.rows};
}

Signs signs(const MatrixView& a, double tolerance) {
  const std::vector<double> d = dense(a);
  Eigen::MatrixXd m = Map(d.data(), a.rows, a.cols);
  for (int sweep = 0; sweep < 20; ++sweep) {  // Ruiz; a congruence keeps the signs (Sylvester)
    const Eigen::VectorXd most = m.cwiseAbs().rowwise().maxCoeff();
    const Eigen::VectorXd s = most.unaryExpr([](double x) { return x > 0 ? 1 / std::sqrt(x) : 1; });
    m = s.asDiagonal() * m * s.asDiagonal();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(m, Eigen::EigenvaluesOnly);
  const double most = solver.eigenvalues().cwiseAbs().maxCoeff();
  Signs out;
  for (const double x : solver.eigenvalues())
    ++(std::abs(x) <= tolerance * most ? out.zero : x > 0 ? out.positive : out.negative);
  return out;
}

Determinant determinant(const MatrixView& a) {
  const std::vector<double> d = dense(a);
  const Eigen::FullPivLU<Eigen::MatrixXd> lu(Map(d.data(), a.rows, a.cols));
  Determinant out;
  for (Index k = 0; k < a.rows; ++k) {
    out.log += std::log(std::abs(lu.matrixLU()(k, k)));
    if (lu.matrixLU()(k, k) < 0) out.sign = -out.sign;
  }
  out.sign *= lu.permutationP().determinant() * lu.permutationQ().determinant();
  return out;
}

double condition(const MatrixView& a) {
  const std::vector<double> d = dense(a);
  const Eigen::MatrixXd m = Map(d.data(), a.rows, a.cols);
  return m.cwiseAbs().colwise().sum().maxCoeff() * m.inverse().cwiseAbs().colwise().sum().maxCoeff();
}

std::vector<double> solve(const MatrixView& a, const std::vector<double>& b, Index columns, bool transpose) {
  const std::vector<double> d = dense(a);
  Eigen::MatrixXd m = Map(d.data(), a.rows, a.cols);
  if (transpose) m.transposeInPlace();
  const Eigen::MatrixXd x = m.fullPivLu().solve(Map(b.data(), a.rows, columns));
  return {x.data(), x.data() + x.size()};
}

std::vector<double> residual(const MatrixView& a, const double* b, const double* x, bool transpose) {
  return residual(summed(a, transpose), b, x);
}

double backward_error(const MatrixView& a, const std::vector<double>& b, const std::vector<double>& x, Index columns,
                      bool transpose) {
  const Rows rows = summed(a, transpose);
  long double norm = 0;
  for (const std::vector<Rows::Entry>& row : rows.of) {
    long double sum = 0;
    for (const Rows::Entry& e : row) sum += std::abs(e.value);
    norm = std::max(norm, sum);
  }
  double worst = 0;
  for (Index k = 0; k < columns; ++k) {
    const double* bk = b.data() + static_cast<std::ptrdiff_t>(k) * a.rows;
    const double* xk = x.data() + static_cast<std::ptrdiff_t>(k) * a.rows;
    const std::vector<double> r = residual(rows, bk, xk);
    long double most_r = 0, most_x = 0, most_b = 0;
    for (Index i = 0; i < a.rows; ++i) {
      if (!std::isfinite(xk[i])) return std::numeric_limits<double>::infinity();
      most_r = std::max(most_r, static_cast<long double>(std::abs(r[static_cast<std::size_t>(i)])));
      most_x = std::max(most_x, static_cast<long double>(std::abs(xk[i])));
      most_b = std::max(most_b, static_cast<long double>(std::abs(bk[i])));
    }
    if (most_r > 0) worst = std::max(worst, static_cast<double>(most_r / (norm * most_x + most_b)));
  }
  return worst;
}

SparseMatrix from_triples(Index n, const std::vector<Triple>& triples, Storage storage) {
  SparseMatrix a{n, n, std::vector<Offset>(static_cast<std::size_t>(n) + 1, 0), {}, {}, storage};
  for (const Triple& t : triples) ++a.col_ptr[static_cast<std::size_t>(t.col) + 1];
  for (std::size_t c = 0; c < static_cast<std::size_t>(n); ++c) a.col_ptr[c + 1] += a.col_ptr[c];
  a.row_ind.resize(triples.size());
  a.values.resize(triples.size());
  std::vector<Offset> next(a.col_ptr.begin(), a.col_ptr.end() - 1);
  for (const Triple& t : triples) {
    const auto at = static_cast<std::size_t>(next[static_cast<std::size_t>(t.col)]++);
    a.row_ind[at] = t.row;
    a.values[at] = t.value;
  }
  return a;
}

SparseMatrix random_system(Index n, int per_row, Values values, std::uint64_t seed) {
  Random random(seed);
  std::map<std::pair<Index, Index>, double> entries;  // (column, row)
  std::vector<double> sum(static_cast<std::size_t>(n), 0);
  const int count = n * per_row / 2;
  for (int k = 0; k < count; ++k) {
    Index r = random.below(n), c = random.below(n);
    if (r == c) continue;
    if (values != Values::general && r < c) std::swap(r, c);
    const double v = random.symmetric();
    entries[{c, r}] = v;
  }
  for (const auto& [at, v] : entries) {
    sum[static_cast<std::size_t>(at.first)] += std::abs(v);
    sum[static_cast<std::size_t>(at.second)] += std::abs(v);
  }
  // A cyclic shift keeps a general system structurally regular without a strong diagonal.
  for (Index i = 0; i < n; ++i) {
    const double s = sum[static_cast<std::size_t>(i)];
    if (values == Values::positive) entries[{i, i}] = 1.05 * s + 0.1;
    if (values == Values::indefinite) entries[{i, i}] = (random.unit() < 0.5 ? -1 : 1) * (0.2 * s + 0.1);
    if (values == Values::general) entries[{i, (i + 1) % n}] = 2 + random.unit();
  }
  std::vector<Triple> triples;
  for (const auto& [at, v] : entries) triples.push_back({at.second, at.first, v});
  return from_triples(n, triples, values == Values::general ? Storage::general : Storage::symmetric_lower);
}

SparseMatrix saddle_point(Index n, Index m, std::uint64_t seed) {
  const SparseMatrix k = random_system(n, 6, Values::positive, seed);
  Random random(seed + 1000);
  const std::vector<Index> name = matrix::random_permutation(n + m, seed + 2000);
  std::map<std::pair<Index, Index>, double> entries;
  const auto add = [&](Index r, Index c, double v) {
    const Index pr = name[static_cast<std::size_t>(r)], pc = name[static_cast<std::size_t>(c)];
    entries[{std::min(pr, pc), std::max(pr, pc)}] = v;
  };
  for (Index c = 0; c < n; ++c)
    for (Offset q = k.col_ptr[static_cast<std::size_t>(c)]; q < k.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
      add(k.row_ind[static_cast<std::size_t>(q)], c, k.values[static_cast<std::size_t>(q)]);
  for (Index i = 0; i < m; ++i) {
    add(n + i, i % n, 1 + random.unit());  // an own column: B has full rank
    add(n + i, m + random.below(n - m), random.symmetric());
    add(n + i, m + random.below(n - m), random.symmetric());
  }
  std::vector<Triple> triples;
  for (const auto& [at, v] : entries) triples.push_back({at.second, at.first, v});
  return from_triples(n + m, triples, Storage::symmetric_lower);
}

SparseMatrix stored_as(const MatrixView& a, Storage storage, bool split) {
  std::vector<Triple> triples;
  const auto keep = [&](Index r, Index c) {
    return storage == Storage::symmetric_lower ? r >= c : storage == Storage::symmetric_upper ? r <= c : true;
  };
  visit(a, [&](Index r, Index c, double v) {
    if (!keep(r, c)) return;
    if (split && triples.size() % 3 == 0) {
      triples.push_back({r, c, v / 2});
      v /= 2;  // exact: both triangles stay equal
    }
    triples.push_back({r, c, v});
  });
  if (split) std::reverse(triples.begin(), triples.end());
  return from_triples(a.rows, triples, storage);
}

std::vector<double> random_vector(std::int64_t size, std::uint64_t seed) {
  Random random(seed);
  std::vector<double> x(static_cast<std::size_t>(size));
  for (double& e : x) e = random.symmetric();
  return x;
}

}  // namespace espalier::reference
