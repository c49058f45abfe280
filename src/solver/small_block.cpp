#include "solver/small_block.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace espalier::solver {

namespace {

constexpr int kMostSweeps = 30;
constexpr double kOrthogonal = 1e-10;  // cosine: an error of its square in a singular value

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

void rotate(double* x, double* y, Index n, Rotation r) {
  for (Index i = 0; i < n; ++i) {
    const double a = x[i], b = y[i];
    x[i] = r.c * a - r.s * b;
    y[i] = r.s * a + r.c * b;
  }
}

// @returns whether two columns were rotated
bool sweep(Block& y, Block& q) {
  bool any = false;
  for (Index i = 0; i < y.columns; ++i)
    for (Index j = i + 1; j < y.columns; ++j) {
      const double a = norm_two(y.column(i), y.rows), d = norm_two(y.column(j), y.rows);
      if (a == 0 || d == 0) continue;
      const double cosine = dot(y.column(i), y.column(j), y.rows) / a / d;
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

  explicit Triangular(const Block& y) : z(y), r(y.columns, y.columns) {
    orthonormalize(z);
    for (Index j = 0; j < y.columns; ++j)
      for (Index i = 0; i <= j; ++i) r.column(j)[i] = dot(z.column(i), y.column(j), y.rows);
  }
};

// x m, m square
Block product(const Block& x, const Block& m) {
  Block out(x.rows, m.columns);
  for (Index c = 0; c < m.columns; ++c)
    for (Index k = 0; k < x.columns; ++k) {
      const double factor = m.column(c)[k];
      const double* from = x.column(k);
      double* to = out.column(c);
      for (Index i = 0; i < x.rows; ++i) to[i] += factor * from[i];
    }
  return out;
}

void rotate_all(Block& y, Block& q) {
  for (int k = 0; k < kMostSweeps && sweep(y, q); ++k) {
  }
}

// The rotations are found on the triangle, which is as good: an error of r in a column is one of y relative to the same
// column.
void rotate_triangle(Block& y, Block& q) {
  Triangular t(y);
  Block v(y.columns, y.columns);
  for (Index c = 0; c < v.columns; ++c) v.column(c)[c] = 1;
  rotate_all(t.r, v);
  y = product(t.z, t.r);
  q = product(q, v);
}

void pick(Block& x, const std::vector<Index>& order) {
  const Block from = x;
  for (Index c = 0; c < x.columns; ++c) {
    const double* source = from.column(order[static_cast<std::size_t>(c)]);
    std::copy(source, source + x.rows, x.column(c));
  }
}

}  // namespace

double dot(const double* x, const double* y, Index n) {
  constexpr Index kSums = 8;  // one sum after another would wait for itself
  double sum[kSums] = {};
  Index i = 0;
  for (; i + kSums <= n; i += kSums)
    for (Index k = 0; k < kSums; ++k) sum[k] += x[i + k] * y[i + k];
  for (; i < n; ++i) sum[0] += x[i] * y[i];
  return ((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + (sum[3] + sum[7]));
}

double norm_two(const double* x, Index n) { return std::sqrt(dot(x, x, n)); }

bool normalize(Block& x) {
  for (Index c = 0; c < x.columns; ++c) {
    double most = 0;
    for (Index i = 0; i < x.rows; ++i) {
      const double v = std::abs(x.column(c)[i]);
      if (!(v <= most)) most = v;  // NaN stays
    }
    if (!std::isfinite(most)) return false;
    if (most == 0) continue;
    const int exponent = std::ilogb(most);
    for (Index i = 0; i < x.rows; ++i) x.column(c)[i] = std::ldexp(x.column(c)[i], -exponent);
  }
  return true;
}

void orthonormalize(Block& x) {
  constexpr int kMostPasses = 12, kPassesEach = 4;
  for (Index c = 0; c < x.columns; ++c) {
    double* v = x.column(c);
    double before = norm_two(v, x.rows);
    for (int pass = 1; pass <= kMostPasses; ++pass) {
      for (Index k = 0; k < c; ++k) {
        const double* u = x.column(k);
        const double part = dot(u, v, x.rows);
        for (Index i = 0; i < x.rows; ++i) v[i] -= part * u[i];
      }
      const double length = norm_two(v, x.rows);
      for (Index i = 0; i < x.rows && length > 0; ++i) v[i] /= length;
      if (length > before / 2) break;
      before = 1;
      // What is left of it are rounding errors, and even these may lie among the earlier columns.
      if (length == 0 || pass % kPassesEach == 0)
        std::generate_n(v, x.rows, [k = c + pass]() mutable { return std::sin(static_cast<double>(++k * 7)); });
    }
  }
}

void project_out(const Block& q, Block& x) {
  for (Index c = 0; c < x.columns; ++c)
    for (Index k = 0; k < q.columns; ++k) {
      const double part = dot(q.column(k), x.column(c), x.rows);
      for (Index i = 0; i < x.rows; ++i) x.column(c)[i] -= part * q.column(k)[i];
    }
}

std::vector<double> rotate_apart(Block& y, Block& q) {
  constexpr Index kLong = 4;  // rows over columns
  if (y.rows >= kLong * y.columns)
    rotate_triangle(y, q);
  else
    rotate_all(y, q);
  std::vector<double> length(static_cast<std::size_t>(y.columns));
  for (Index c = 0; c < y.columns; ++c) length[static_cast<std::size_t>(c)] = norm_two(y.column(c), y.rows);
  std::vector<Index> order(length.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) {
    return length[static_cast<std::size_t>(a)] < length[static_cast<std::size_t>(b)];
  });
  pick(y, order);
  pick(q, order);
  std::sort(length.begin(), length.end());
  return length;
}

std::vector<double> ritz_values(const Block& x, const Block& y) {
  const Index p = x.columns;
  Block s(p, p);
  for (Index i = 0; i < p; ++i)
    for (Index j = 0; j <= i; ++j)
      s.column(i)[j] = s.column(j)[i] =
          (dot(x.column(i), y.column(j), x.rows) + dot(x.column(j), y.column(i), x.rows)) / 2;
  for (int k = 0; k < kMostSweeps; ++k)
    for (Index i = 0; i < p; ++i)
      for (Index j = i + 1; j < p; ++j) {
        const double a = s.column(i)[i], b = s.column(j)[i], d = s.column(j)[j];
        if (b == 0) continue;
        const Rotation r = diagonalizing(a, b, d);
        rotate(s.column(i), s.column(j), p, r);
        for (Index c = 0; c < p; ++c) rotate(s.column(c) + i, s.column(c) + j, 1, r);
      }
  std::vector<double> values(static_cast<std::size_t>(p));
  for (Index i = 0; i < p; ++i) values[static_cast<std::size_t>(i)] = s.column(i)[i];
  std::sort(values.begin(), values.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
  return values;
}

}  // namespace espalier::solver
