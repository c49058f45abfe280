#include "verdict/exact.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "matrix/generators/random.hpp"

namespace espalier::verdict {

namespace {

using Number = std::complex<double>;
__extension__ using Wide = __int128;

class Random {
 public:
  explicit Random(std::uint64_t seed) : seed_(seed) {}
  double unit() { return matrix::random_unit(seed_, counter_++); }
  bool chance(double p) { return unit() < p; }
  Index below(Index n) { return std::min(n - 1, static_cast<Index>(unit() * n)); }
  /// -most .. most without 0.
  double integer(Index most) { return (1 + below(most)) * (chance(0.5) ? -1.0 : 1.0); }
  Number number(Index most, bool complex) {
    if (!complex) return integer(most);
    const Number z(below(2 * most + 1) - most, below(2 * most + 1) - most);
    return z == 0.0 ? Number(0, 1) : z;
  }
  std::vector<Index> order(Index n) { return matrix::random_permutation(n, matrix::random_bits(seed_, counter_++)); }

 private:
  std::uint64_t seed_, counter_ = 0;
};

Number turned(Number z, Symmetry s) { return s == Symmetry::hermitian ? std::conj(z) : z; }

// ---- exact arithmetic -----------------------------------------------------------------------------------------------

std::uint64_t power(std::uint64_t x, std::uint64_t exponent, std::uint64_t p) {
  std::uint64_t result = 1;
  for (; exponent > 0; exponent /= 2, x = x * x % p)
    if (exponent % 2 == 1) result = result * x % p;
  return result;
}

// p: 1 modulo 4, below 2^31. Some x^((p-1)/4) is a root of -1.
std::uint64_t root_of_minus_one(std::uint64_t p) {
  for (std::uint64_t x = 2;; ++x)
    if (const std::uint64_t r = power(x, (p - 1) / 4, p); r * r % p == p - 1) return r;
}

Index rank_modulo(const IntegerMatrix& a, std::uint64_t p) {
  const std::uint64_t i = root_of_minus_one(p);
  const auto residue = [p](double x) {
    const double r = std::fmod(x, static_cast<double>(p));
    return static_cast<std::uint64_t>(r < 0 ? r + static_cast<double>(p) : r) % p;
  };
  std::vector<std::vector<std::uint64_t>> rows(static_cast<std::size_t>(a.n));
  for (Index r = 0; r < a.n; ++r)
    for (Index c = 0; c < a.n; ++c)
      rows[static_cast<std::size_t>(r)].push_back((residue(a.at(r, c).real()) + i * residue(a.at(r, c).imag())) % p);
  std::size_t rank = 0;
  for (std::size_t c = 0; c < rows.size() && rank < rows.size(); ++c) {
    const auto pivot = std::find_if(rows.begin() + static_cast<std::ptrdiff_t>(rank), rows.end(),
                                    [c](const auto& row) { return row[c] != 0; });
    if (pivot == rows.end()) continue;
    std::swap(*pivot, rows[rank]);
    const std::uint64_t inverse = power(rows[rank][c], p - 2, p);
    for (std::size_t r = rank + 1; r < rows.size(); ++r) {
      const std::uint64_t factor = rows[r][c] * inverse % p;
      if (factor == 0) continue;
      for (std::size_t k = c; k < rows.size(); ++k) rows[r][k] = (rows[r][k] + (p - factor) * rows[rank][k]) % p;
    }
    ++rank;
  }
  return static_cast<Index>(rank);
}

// A symmetric matrix under congruence transformations of determinant +-1, eliminated without fractions (Bareiss 1968):
// what is left are minors of the transformed matrix, and the signs of D those of quotients of the leading ones.
class FractionFree {
 public:
  explicit FractionFree(std::vector<std::vector<Wide>> a) : a_(std::move(a)) {}

  bool run(Index& negative, Index& zeros) {
    negative = zeros = 0;
    const std::size_t n = a_.size();
    for (std::size_t k = 0; k < n; ++k) {
      if (!bring_pivot(k)) {
        zeros = static_cast<Index>(n - k);
        return true;
      }
      negative += (a_[k][k] < 0) != (last_ < 0) ? 1 : 0;
      for (std::size_t i = k + 1; i < n; ++i)
        for (std::size_t j = k + 1; j < n; ++j) a_[i][j] = (a_[i][j] * a_[k][k] - a_[i][k] * a_[k][j]) / last_;
      last_ = a_[k][k];
      if (!in_range()) return false;
    }
    return true;
  }

 private:
  [[nodiscard]] bool in_range() const {
    constexpr Wide kMost = Wide{1} << 62;  // products of two fit
    for (const auto& row : a_)
      for (const Wide v : row)
        if (v >= kMost || v <= -kMost) return false;
    return true;
  }
  // To (k, k), by an exchange, or where the diagonal is zero by adding an unknown to another one.
  bool bring_pivot(std::size_t k) {
    const std::size_t n = a_.size();
    for (std::size_t i = k; i < n; ++i)
      if (a_[i][i] != 0) return exchange(k, i);
    for (std::size_t i = k; i < n; ++i)
      for (std::size_t j = k; j < n; ++j)
        if (a_[i][j] != 0) {
          for (std::size_t c = k; c < n; ++c) a_[i][c] += a_[j][c];
          for (std::size_t r = k; r < n; ++r) a_[r][i] += a_[r][j];
          return exchange(k, i);
        }
    return false;
  }
  bool exchange(std::size_t k, std::size_t i) {
    std::swap(a_[k], a_[i]);
    for (auto& row : a_) std::swap(row[k], row[i]);
    return true;
  }

  std::vector<std::vector<Wide>> a_;
  Wide last_ = 1;
};

// ---- structures -----------------------------------------------------------------------------------------------------

struct Inertia {
  Index negative = 0, zeros = 0;
};

// L D L^T or L D L^H: D holds zeros, numbers of both signs (Hermitian: real ones) and pairs [0 b; b 0].
IntegerMatrix product_of_factors(Index n, bool complex, Symmetry s, Random& random, Inertia& inertia) {
  IntegerMatrix l(n), d(n), a(n);
  const double share = random.chance(0.3) ? 0 : random.unit() * 0.6;
  for (Index k = 0; k < n; ++k) {
    l.at(k, k) = 1;
    for (Index e = random.below(3); e > 0 && k > 0; --e) l.at(k, random.below(k)) = random.number(1, complex);
    if (random.chance(share)) {
      ++inertia.zeros;
    } else if (k > 0 && d.at(k - 1, k - 1) == 0.0 && (k < 2 || d.at(k - 1, k - 2) == 0.0) && random.chance(0.5)) {
      const Number b = random.number(3, complex);
      d.at(k, k - 1) = b;
      d.at(k - 1, k) = turned(b, s);
      --inertia.zeros;  // that of k - 1
      ++inertia.negative;
    } else {
      const Number z = random.number(4, complex && s != Symmetry::hermitian);
      d.at(k, k) = z;
      inertia.negative += z.real() < 0 ? 1 : 0;
    }
  }
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < n; ++j)
      for (Index p = 0; p <= i; ++p)
        for (Index q = std::max<Index>(0, p - 1); q <= std::min(j, p + 1); ++q)
          a.at(i, j) += l.at(i, p) * d.at(p, q) * turned(l.at(j, q), s);
  return a;
}

IntegerMatrix scattered(Index n, bool complex, Symmetry s, Random& random) {
  IntegerMatrix a(n);
  const auto entries = static_cast<Index>(n * (0.4 + 2 * random.unit()));
  for (Index e = 0; e < entries; ++e) {
    const Index i = random.below(n), j = random.below(n);
    const Number z = random.number(3, complex && !(s == Symmetry::hermitian && i == j));
    a.at(i, j) = z;
    if (s != Symmetry::general) a.at(j, i) = turned(z, s);
  }
  return a;
}

// S A S^H (symmetric: S A S^T; general: S A R) of size n >= A's, S and R of full column rank: rows and columns that are
// copies, or small combinations, of others.
IntegerMatrix repeated(const IntegerMatrix& a, Index n, Symmetry s, Random& random) {
  const auto combination = [&] {
    IntegerMatrix m(n);  // the first a.n columns count
    for (Index k = 0; k < n; ++k) {
      if (k < a.n) m.at(k, k) = 1;
      if (k >= a.n)
        for (Index e = random.below(3); e > 0; --e) m.at(k, random.below(a.n)) = random.integer(2);
    }
    return m;
  };
  const IntegerMatrix left = combination(), right = s == Symmetry::general ? combination() : left;
  IntegerMatrix out(n);
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < n; ++j)
      for (Index p = 0; p < a.n; ++p) {
        if (left.at(i, p) == 0.0) continue;
        for (Index q = 0; q < a.n; ++q) out.at(i, j) += left.at(i, p) * a.at(p, q) * turned(right.at(j, q), s);
      }
  return out;
}

// As many copies side by side.
IntegerMatrix copies(const IntegerMatrix& a, Index count) {
  IntegerMatrix out(a.n * count);
  for (Index k = 0; k < count; ++k)
    for (Index i = 0; i < a.n; ++i)
      for (Index j = 0; j < a.n; ++j) out.at(k * a.n + i, k * a.n + j) = a.at(i, j);
  return out;
}

// [I A^H; A 0], A of more rows than columns or fewer: what least squares start from.
IntegerMatrix least_squares(Index n, bool complex, Symmetry s, Random& random, Inertia& inertia) {
  const Index columns = 1 + random.below(n), rows = n - columns;
  IntegerMatrix out(n), a(n);
  for (Index j = 0; j < columns; ++j) out.at(j, j) = 1;
  for (Index i = 0; i < rows; ++i)
    for (Index e = random.below(4); e > 0; --e) a.at(i, random.below(columns)) = random.number(2, complex);
  for (Index i = 0; i < rows; ++i)
    for (Index j = 0; j < columns; ++j) {
      out.at(columns + i, j) = a.at(i, j);
      out.at(j, columns + i) = turned(a.at(i, j), s);
    }
  inertia.negative = exact_rank(a);
  inertia.zeros = rows - inertia.negative;
  return out;
}

// Singular values of the equilibrated matrix: the largest over the smallest of those that are not zero.
double condition_of(const IntegerMatrix& a, Index zeros) {
  if (zeros == a.n) return 1;
  Eigen::MatrixXcd m(a.n, a.n);
  for (Index j = 0; j < a.n; ++j)
    for (Index i = 0; i < a.n; ++i) m(i, j) = a.at(i, j);
  for (int sweep = 0; sweep < 4; ++sweep)
    for (Index k = 0; k < a.n; ++k) {
      const double row = m.row(k).cwiseAbs().maxCoeff();
      if (row > 0) m.row(k) /= std::sqrt(row);
      const double column = m.col(k).cwiseAbs().maxCoeff();
      if (column > 0) m.col(k) /= std::sqrt(column);
    }
  const Eigen::VectorXd s = Eigen::JacobiSVD<Eigen::MatrixXcd>(m).singularValues();
  return s(0) / s(a.n - 1 - zeros);
}

}  // namespace

Index exact_rank(const IntegerMatrix& a) {
  constexpr std::array<std::uint64_t, 2> kPrimes = {2147483629, 2147483549};
  return std::max(rank_modulo(a, kPrimes[0]), rank_modulo(a, kPrimes[1]));
}

bool exact_inertia(const IntegerMatrix& a, Index& negative, Index& zeros) {
  const bool complex = std::any_of(a.entries.begin(), a.entries.end(), [](Number z) { return z.imag() != 0; });
  const Index twice = complex ? 2 : 1;
  std::vector<std::vector<Wide>> m(static_cast<std::size_t>(twice * a.n));
  for (Index i = 0; i < twice * a.n; ++i)
    for (Index j = 0; j < twice * a.n; ++j) {  // [Re -Im; Im Re]
      const Number z = a.at(i % a.n, j % a.n);
      const double part = (i < a.n) == (j < a.n) ? z.real() : i < a.n ? -z.imag() : z.imag();
      m[static_cast<std::size_t>(i)].push_back(static_cast<Wide>(part));
    }
  const bool good = FractionFree(std::move(m)).run(negative, zeros);
  negative /= twice;
  zeros /= twice;
  return good;
}

ExactCase make_exact_case(std::uint64_t seed) {
  Random random(seed);
  ExactCase c;
  c.complex = random.chance(0.4);
  const Index sort = random.below(5);
  c.symmetry = sort == 0 || (sort == 1 && !c.complex) ? Symmetry::general
               : c.complex && sort % 2 == 0           ? Symmetry::hermitian
                                                      : Symmetry::symmetric;
  const bool signs = c.symmetry != Symmetry::general && !(c.complex && c.symmetry == Symmetry::symmetric);
  Inertia inertia;
  const Index structure = random.below(3), n = 1 + random.below(14);
  if (structure == 0 || (structure == 1 && c.symmetry == Symmetry::general)) {
    c.a = scattered(n, c.complex, c.symmetry, random);
    c.name = "scattered";
    if (signs && !exact_inertia(c.a, inertia.negative, inertia.zeros)) inertia.negative = -1;
  } else if (structure == 1) {
    c.a = least_squares(n, c.complex, c.symmetry, random, inertia);
    c.name = "least squares";
    if (c.symmetry == Symmetry::general || !signs) inertia = {};
  } else {
    const Symmetry s = c.symmetry;
    c.a = product_of_factors(2 * n, c.complex, s, random, inertia);
    c.name = "factors";
  }
  Index times = 1;
  if (random.chance(0.3)) {
    const Index more = 1 + random.below(2 + c.a.n);
    c.a = repeated(c.a, c.a.n + more, c.symmetry, random);
    inertia.zeros += more;
    c.name += ", repeated";
  }
  if (random.chance(0.2) && c.a.n <= 20) {
    times = 2 + random.below(3);
    c.a = copies(c.a, times);
    c.name += ", copies";
  }
  c.zeros = c.a.n - exact_rank(c.a);
  if (signs && inertia.negative >= 0) {
    c.negative = times * inertia.negative;
    if (c.zeros != times * inertia.zeros) c.zeros = -1;  // the two truths contradict each other
  }
  if (c.zeros >= 0) c.condition = condition_of(c.a, c.zeros);
  return c;
}

ComplexSparseMatrix disguised(const ExactCase& c, const Disguise& d, std::uint64_t seed) {
  Random random(seed ^ 0x5bd1e995);
  const Index n = c.a.n;
  const bool alike = c.symmetry != Symmetry::general;
  std::vector<Index> row(static_cast<std::size_t>(n)), col;
  std::iota(row.begin(), row.end(), 0);
  if (d.renumber) row = random.order(n);
  col = d.renumber && !alike ? random.order(n) : row;
  std::vector<int> of_row(row.size()), of_col;
  for (int& e : of_row) e = d.range > 0 ? static_cast<int>(random.below(2 * d.range + 1)) - d.range : 0;
  of_col = of_row;
  if (!alike)
    for (int& e : of_col) e = d.range > 0 ? static_cast<int>(random.below(2 * d.range + 1)) - d.range : 0;
  const auto stored = [&](Index i, Index j) {
    switch (d.storage) {
      case Storage::symmetric_lower:
      case Storage::hermitian_lower:
        return i >= j;
      case Storage::symmetric_upper:
      case Storage::hermitian_upper:
        return i <= j;
      default:
        return true;
    }
  };
  ComplexSparseMatrix a;
  a.rows = a.cols = n;
  a.storage = d.storage;
  a.col_ptr.push_back(0);
  for (Index j = 0; j < n; ++j) {
    std::vector<std::pair<Index, Number>> column;
    for (Index i = 0; i < n; ++i) {
      if (!stored(i, j)) continue;
      const Index r = row[static_cast<std::size_t>(i)], s = col[static_cast<std::size_t>(j)];
      const int e = d.units + of_row[static_cast<std::size_t>(r)] + of_col[static_cast<std::size_t>(s)];
      Number z = c.a.at(r, s);
      z = {std::ldexp(z.real(), e), std::ldexp(z.imag(), e)};
      // Whether a zero is stored must not depend on the triangle.
      const bool zero =
          d.zeros &&
          matrix::random_unit(seed, static_cast<std::uint64_t>(Offset{std::max(r, s)} * n + std::min(r, s))) < 0.1;
      if (z == 0.0 && !zero) continue;
      const bool twice = d.split && !alike && random.chance(0.2);
      if (twice) column.emplace_back(i, 3.0 * z);
      column.emplace_back(i, twice ? -2.0 * z : z);
    }
    if (d.split) std::reverse(column.begin(), column.end());
    for (const auto& [i, z] : column) {
      a.row_ind.push_back(i);
      a.values.push_back(z);
    }
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  return a;
}

}  // namespace espalier::verdict
