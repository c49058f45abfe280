#include "solver/deficiency/small_block.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>

#include "base/at.hpp"

namespace espalier::solver {

namespace {

constexpr int kMostSweeps = 30;
constexpr double kOrthogonal = 1e-10;  // cosine: an error of its square in a singular value

constexpr std::int64_t kRowsAtOnce = 1 << 15;  // rows

/// use(begin, end) for ranges of rows.
template <class Use>
void for_rows(base::ThreadPool& pool, Index rows, Use&& use) {
  pool.for_each_range(rows, kRowsAtOnce, [&](std::int64_t begin, std::int64_t end) {
    use(static_cast<Index>(begin), static_cast<Index>(end));
  });
}

double dot_of_range(const double* x, const double* y, Index n) {
  constexpr Index kSums = 8;  // one sum after another would wait for itself
  double sum[kSums] = {};
  Index i = 0;
  for (; i + kSums <= n; i += kSums)
    for (Index k = 0; k < kSums; ++k) sum[k] += x[i + k] * y[i + k];
  for (; i < n; ++i) sum[0] += x[i] * y[i];
  return ((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + (sum[3] + sum[7]));
}

// x += factor y
void add(base::ThreadPool& pool, double* x, double factor, const double* y, Index n) {
  for_rows(pool, n, [=](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) x[i] += factor * y[i];
  });
}

struct Rotation {
  double c, s;
};

// The rotation that makes the matrix [a b; b d] diagonal, by the smaller angle (Golub and Van Loan, section 8.5).
Rotation diagonalizing(double a, double b, double d) {
  const double tau = (d - a) / (2 * b);
  const double t = std::copysign(1.0, tau) / (std::abs(tau) + std::hypot(1.0, tau));
  const double c = 1 / std::hypot(1.0, t);
  return {c, c * t};
}

// A few numbers: the large blocks have been reduced to triangles.
void rotate(double* x, double* y, Index n, Rotation r) {
  for (Index i = 0; i < n; ++i) {
    const double a = x[i], b = y[i];
    x[i] = r.c * a - r.s * b;
    y[i] = r.s * a + r.c * b;
  }
}

// @returns whether two columns were rotated
bool sweep(base::ThreadPool& pool, Block& y, Block& q) {
  bool any = false;
  for (Index i = 0; i < y.columns; ++i)
    for (Index j = i + 1; j < y.columns; ++j) {
      const double a = norm_two(pool, y.column(i), y.rows), d = norm_two(pool, y.column(j), y.rows);
      if (a == 0 || d == 0) continue;
      const double cosine = dot(pool, y.column(i), y.column(j), y.rows) / a / d;
      if (!(std::abs(cosine) > kOrthogonal)) continue;
      const Rotation r = diagonalizing(a / d, cosine, d / a);  // of the Gram matrix over a d
      rotate(y.column(i), y.column(j), y.rows, r);
      rotate(q.column(i), q.column(j), q.rows, r);
      any = true;
    }
  return any;
}

// y = z r, z orthonormal, r upper triangular: r = z^T y to the rounding of each column.
struct Triangular {
  Block z, r;

  Triangular(base::ThreadPool& pool, const Block& y) : z(y), r(y.columns, y.columns) {
    orthonormalize(pool, z);
    for (Index j = 0; j < y.columns; ++j)
      for (Index i = 0; i <= j; ++i) r.column(j)[i] = dot(pool, z.column(i), y.column(j), y.rows);
  }
};

// x m, m square
Block product(base::ThreadPool& pool, const Block& x, const Block& m) {
  Block out(x.rows, m.columns);
  for_rows(pool, x.rows, [&](Index begin, Index end) {
    for (Index c = 0; c < m.columns; ++c)
      for (Index k = 0; k < x.columns; ++k) {
        const double factor = m.column(c)[k];
        const double* from = x.column(k);
        double* to = out.column(c);
        for (Index i = begin; i < end; ++i) to[i] += factor * from[i];
      }
  });
  return out;
}

void rotate_all(base::ThreadPool& pool, Block& y, Block& q) {
  for (int k = 0; k < kMostSweeps && sweep(pool, y, q); ++k) {
  }
}

// The rotations are found on the triangle, which is as good: an error of r in a column is one of y relative to the same
// column.
void rotate_triangle(base::ThreadPool& pool, Block& y, Block& q) {
  Triangular t(pool, y);
  Block v(y.columns, y.columns);
  for (Index c = 0; c < v.columns; ++c) v.column(c)[c] = 1;
  rotate_all(pool, t.r, v);
  y = product(pool, t.z, t.r);
  q = product(pool, q, v);
}

void pick(Block& x, const std::vector<Index>& order) {
  const Block from = x;
  for (Index c = 0; c < x.columns; ++c) {
    const double* source = from.column(order[at(c)]);
    std::copy(source, source + x.rows, x.column(c));
  }
}

}  // namespace

double dot(base::ThreadPool& pool, const double* x, const double* y, Index n) {
  if (n <= kRowsAtOnce) return dot_of_range(x, y, n);
  std::vector<double> parts(at((n + kRowsAtOnce - 1) / kRowsAtOnce));
  for_rows(pool, n, [&](Index begin, Index end) {
    parts[at(begin / kRowsAtOnce)] = dot_of_range(x + begin, y + begin, end - begin);
  });
  return std::accumulate(parts.begin(), parts.end(), 0.0);
}

double norm_two(base::ThreadPool& pool, const double* x, Index n) { return std::sqrt(dot(pool, x, x, n)); }

void divide(base::ThreadPool& pool, double* x, double by, Index n) {
  for_rows(pool, n, [=](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) x[i] /= by;
  });
}

bool normalize(base::ThreadPool& pool, Block& x) {
  for (Index c = 0; c < x.columns; ++c) {
    double* v = x.column(c);
    std::atomic<double> largest{0};
    for_rows(pool, x.rows, [&](Index begin, Index end) {
      double most = 0;
      for (Index i = begin; i < end; ++i)
        if (!(std::abs(v[i]) <= most)) most = std::abs(v[i]);  // NaN stays
      double before = largest.load();
      while (!(most <= before) && !std::isnan(before) && !largest.compare_exchange_weak(before, most)) {
      }
    });
    const double most = largest;
    if (!std::isfinite(most)) return false;
    if (most == 0) continue;
    const int exponent = std::ilogb(most);
    for_rows(pool, x.rows, [=](Index begin, Index end) {
      // In two steps: 2^-exponent alone may overflow.
      const double half = std::ldexp(1.0, -exponent / 2), rest = std::ldexp(1.0, -exponent + exponent / 2);
      for (Index i = begin; i < end; ++i) v[i] = v[i] * half * rest;
    });
  }
  return true;
}

void orthonormalize(base::ThreadPool& pool, Block& x) {
  constexpr int kMostPasses = 12, kPassesEach = 4;
  for (Index c = 0; c < x.columns; ++c) {
    double* v = x.column(c);
    double before = norm_two(pool, v, x.rows);
    for (int pass = 1; pass <= kMostPasses; ++pass) {
      for (Index k = 0; k < c; ++k) add(pool, v, -dot(pool, x.column(k), v, x.rows), x.column(k), x.rows);
      const double length = norm_two(pool, v, x.rows);
      if (length > 0) divide(pool, v, length, x.rows);
      if (length > before / 2) break;
      before = 1;
      // What is left of it are rounding errors, and even these may lie among the earlier columns.
      if (length == 0 || pass % kPassesEach == 0)
        std::generate_n(v, x.rows, [k = c + pass]() mutable { return std::sin(static_cast<double>(++k * 7)); });
    }
  }
}

void project_out(base::ThreadPool& pool, const Block& q, Block& x) {
  for (Index c = 0; c < x.columns; ++c)
    for (Index k = 0; k < q.columns; ++k)
      add(pool, x.column(c), -dot(pool, q.column(k), x.column(c), x.rows), q.column(k), x.rows);
}

std::vector<double> rotate_apart(base::ThreadPool& pool, Block& y, Block& q) {
  constexpr Index kLong = 4;  // rows over columns
  if (y.rows >= kLong * y.columns)
    rotate_triangle(pool, y, q);
  else
    rotate_all(pool, y, q);
  std::vector<double> length(at(y.columns));
  for (Index c = 0; c < y.columns; ++c) length[at(c)] = norm_two(pool, y.column(c), y.rows);
  std::vector<Index> order(length.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return length[at(a)] < length[at(b)]; });
  pick(y, order);
  pick(q, order);
  std::sort(length.begin(), length.end());
  return length;
}

std::vector<double> ritz_values(base::ThreadPool& pool, const Block& x, const Block& y) {
  const Index p = x.columns;
  Block s(p, p);
  for (Index i = 0; i < p; ++i)
    for (Index j = 0; j <= i; ++j)
      s.column(i)[j] = s.column(j)[i] =
          (dot(pool, x.column(i), y.column(j), x.rows) + dot(pool, x.column(j), y.column(i), x.rows)) / 2;
  for (int k = 0; k < kMostSweeps; ++k)
    for (Index i = 0; i < p; ++i)
      for (Index j = i + 1; j < p; ++j) {
        const double a = s.column(i)[i], b = s.column(j)[i], d = s.column(j)[j];
        if (b == 0) continue;
        const Rotation r = diagonalizing(a, b, d);
        rotate(s.column(i), s.column(j), p, r);
        for (Index c = 0; c < p; ++c) rotate(s.column(c) + i, s.column(c) + j, 1, r);
      }
  std::vector<double> values(at(p));
  for (Index i = 0; i < p; ++i) values[at(i)] = s.column(i)[i];
  std::sort(values.begin(), values.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
  return values;
}

}  // namespace espalier::solver
