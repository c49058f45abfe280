#include "solver/deficiency.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numeric>
#include <utility>

#include "solver/small_block.hpp"

namespace espalier::solver {

namespace {

constexpr Index kFirstColumns = 8;     // a substitution takes as many in the time of one
constexpr Index kMostColumns = 256;    // sought at most ...
constexpr Offset kMostWork = 1 << 28;  // ... and rows * columns^2: a few tenths of a second
constexpr int kInverseSteps = 3;
constexpr std::int64_t kColumnsPerRange = 4096;

// Numbers without pattern (the finalizer of splitmix64, Steele et al. 2014), the same in every run: of both signs, from
// 1/2 to 1 in magnitude.
double random_number(std::uint64_t k) {
  k += 0x9e3779b97f4a7c15U;
  k = (k ^ (k >> 30)) * 0xbf58476d1ce4e5b9U;
  k = (k ^ (k >> 27)) * 0x94d049bb133111ebU;
  k ^= k >> 31;
  const double magnitude = 0.5 + static_cast<double>(k >> 12) * 0x1p-53;
  return (k & 1) != 0 ? magnitude : -magnitude;
}

// B = R A C and its inverse as the factor knows it.
class ScaledMatrix {
 public:
  explicit ScaledMatrix(const DeficiencyJob& job)
      : job_(job), n_(job.prepared.n()), row_(job.numeric.scales().row), col_(job.numeric.scales().col) {
    if (job.kind == Kind::llt || row_.empty()) by_diagonal();
    measure();
  }

  // Further sweeps of Ruiz (2001) where the scaling of the factorization has left rows or columns uneven, which costs a
  // factor little and a verdict much. A matched scaling needs none.
  void make_even() {
    constexpr int kMostSweeps = 12;
    const auto uneven = [](double m) { return m > 0 && (m < 0.5 || m > 2); };
    for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
      std::vector<double> rows(row_.size(), 0.0), cols(rows);
      visit([&](std::size_t i, std::size_t j, double v) {
        rows[i] = std::max(rows[i], v);
        cols[j] = std::max(cols[j], v);
      });
      if (std::none_of(rows.begin(), rows.end(), uneven) && std::none_of(cols.begin(), cols.end(), uneven)) break;
      for (std::size_t i = 0; i < rows.size(); ++i) {
        if (rows[i] > 0) row_[i] /= std::sqrt(rows[i]);
        if (cols[i] > 0) col_[i] /= std::sqrt(cols[i]);
      }
    }
    measure();
  }

  [[nodiscard]] Index n() const { return n_; }
  [[nodiscard]] double norm() const { return norm_; }
  /// From B's unknowns to the caller's.
  [[nodiscard]] double unscaled(Index i, double v, bool transpose) const {
    return v * (transpose ? row_ : col_)[static_cast<std::size_t>(i)];
  }

  // op(B) x in extended precision.
  [[nodiscard]] Block product(const Block& x, bool transpose) const {
    Block in = x, out(n_, x.columns);
    scale(in, transpose ? row_ : col_, false);
    const std::vector<double> zero(static_cast<std::size_t>(n_), 0.0);
    std::vector<solve::ResidualColumn> columns(static_cast<std::size_t>(x.columns));
    for (Index c = 0; c < x.columns; ++c)
      columns[static_cast<std::size_t>(c)] = {zero.data(), in.column(c), out.column(c), {}};
    job_.residual.compute(columns, transpose);
    scale(out, transpose ? col_ : row_, false);
    for (double& v : out.values) v = -v;
    return out;
  }

  // op(B)^-1 x by the factor.
  [[nodiscard]] Block inverse(Block x, bool transpose) const {
    scale(x, transpose ? col_ : row_, true);
    job_.numeric.solve(x.values.data(), x.values.data(), x.columns, transpose);
    scale(x, transpose ? row_ : col_, true);
    return x;
  }

 private:
  void by_diagonal() {
    row_.assign(static_cast<std::size_t>(n_), 1.0);
    const auto& a = job_.prepared.a;
    if (job_.kind == Kind::llt)
      job_.pool.for_each_range(n_, kColumnsPerRange, [&](std::int64_t begin, std::int64_t end) {
        for (auto c = begin; c < end; ++c)
          for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q)
            if (a.row_ind[q] == c) row_[static_cast<std::size_t>(c)] = 1 / std::sqrt(job_.values[q]);
      });
    col_ = row_;
  }

  // use(row, column, |b_rc|) for every entry of the full matrix.
  template <class Use>
  void visit(Use&& use) const {
    const auto& a = job_.prepared.a;
    const bool mirrored = a.storage == Storage::symmetric_lower || a.storage == Storage::symmetric_upper;
    for (Index c = 0; c < n_; ++c)
      for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q) {
        const auto i = static_cast<std::size_t>(a.row_ind[q]), j = static_cast<std::size_t>(c);
        use(i, j, std::abs(job_.values[q] * col_[j] * row_[i]));
        if (mirrored && i != j) use(j, i, std::abs(job_.values[q] * col_[i] * row_[j]));
      }
  }

  // In one triangle, what stands in the columns and in the rows makes up a row together.
  void measure() {
    const auto& a = job_.prepared.a;
    const matrix::RowIndex& rows = job_.rows;
    const bool general = a.storage == Storage::general;
    std::mutex mutex;
    double most_row = 0, most_column = 0;
    job_.pool.for_each_range(n_, kColumnsPerRange, [&](std::int64_t begin, std::int64_t end) {
      double row = 0, column = 0;
      for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
        double in_column = 0, in_row = 0;
        for (Offset q = a.col_ptr[k]; q < a.col_ptr[k + 1]; ++q)
          in_column += std::abs(job_.values[q] * col_[k] * row_[a.row_ind[q]]);
        for (Offset q = rows.ptr.empty() ? 0 : rows.ptr[k]; q < (rows.ptr.empty() ? 0 : rows.ptr[k + 1]); ++q)
          in_row += std::abs(job_.values[rows.source[q]] * col_[rows.col[q]] * row_[k]);
        row = std::max(row, general ? in_row : in_row + in_column);
        column = std::max(column, general ? in_column : in_row + in_column);
      }
      const std::lock_guard lock(mutex);
      most_row = std::max(most_row, row);
      most_column = std::max(most_column, column);
    });
    norm_ = std::sqrt(most_row * most_column);
  }

  void scale(Block& x, const std::vector<double>& by, bool inverse) const {
    for (Index c = 0; c < x.columns; ++c) {
      double* v = x.column(c);
      for (Index i = 0; i < n_; ++i) {
        const double s = by[static_cast<std::size_t>(i)];
        v[i] = inverse ? v[i] / s : v[i] * s;
      }
    }
  }

  const DeficiencyJob& job_;
  Index n_;
  std::vector<double> row_, col_;
  double norm_ = 0;
};

// A block of directions that op(B) makes smallest.
struct Directions {
  Block q{0, 0}, y{0, 0};      // orthonormal; y = op(B) q
  std::vector<double> values;  // |y_j|, ascending
  bool found = false;          // false: numbers overflowed

  [[nodiscard]] Index below(double bound) const {
    return static_cast<Index>(std::upper_bound(values.begin(), values.end(), bound) - values.begin());
  }
};

Block first_columns(const Block& q, Index columns) {
  Block part(q.rows, columns);
  std::copy_n(q.values.begin(), part.values.size(), part.values.begin());
  return part;
}

class Search {
 public:
  explicit Search(const DeficiencyJob& job) : job_(job), b_(job) {}

  /// Whether the matrix is surely regular, by a few solutions: no singular value is near the bound of a zero (FP32:
  /// near what it can tell from one).
  [[nodiscard]] bool surely_regular() const { return surely_above((job_.single ? kLeastForFp32 : kZero) * b_.norm()); }
  /// Before all below.
  void prepare() {
    b_.make_even();
    zero_ = kZero * b_.norm();
  }

  [[nodiscard]] Directions find(Index columns, bool transpose) const {
    Directions d{start(columns), Block(0, 0), {}};
    for (int step = 0; step < kInverseSteps; ++step) {
      if (job_.kind == Kind::lu && !iterate(d.q, !transpose)) return d;
      if (!iterate(d.q, transpose)) return d;
    }
    d.found = true;
    improve(d, transpose);
    return d;
  }

  [[nodiscard]] double zero() const { return zero_; }
  [[nodiscard]] const ScaledMatrix& matrix() const { return b_; }

 private:
  // Whether all singular values are surely above a bound. A random vector of unit length has a part of at least
  // 1 / (kUnlucky sqrt(n)) in the direction of the smallest one, s, but for a few of a thousand; k solutions in turn
  // let that part alone grow by s^-k.
  [[nodiscard]] bool surely_above(double bound) const {
    constexpr double kUnlucky = 256;
    constexpr int kMostSolutions = 4;
    Block x = start(1);
    double most = kUnlucky * std::sqrt(static_cast<double>(b_.n()));  // ... times what growth was, over s^-k
    double length = norm_two(x.column(0), b_.n());
    for (int k = 0; k < kMostSolutions; ++k) {
      for (double& v : x.values) v /= length;
      x = b_.inverse(std::move(x), job_.kind == Kind::lu && k % 2 == 1);
      length = norm_two(x.column(0), b_.n());
      most *= length * bound;
      if (most < 1) return true;
      if (!(length * bound < 1)) return false;
    }
    return false;
  }

  [[nodiscard]] Block start(Index columns) const {
    Block x(b_.n(), columns);
    for (std::size_t k = 0; k < x.values.size(); ++k) x.values[k] = random_number(k);
    return x;
  }

  bool iterate(Block& x, bool transpose) const {
    x = b_.inverse(std::move(x), transpose);
    if (!normalize(x)) return false;
    orthonormalize(x);
    return true;
  }

  void inspect(Directions& d, bool transpose) const {
    d.y = b_.product(d.q, transpose);
    d.values = rotate_apart(d.y, d.q);
  }

  // Newton's steps for the null directions, q -= (1 - Q Q^T) B^-1 (1 - U U^T) B q, as long as they help: the error of
  // the factor, which inverse iteration leaves in q, shrinks in each of them by itself over the next singular value. U,
  // the null directions on the left, keeps the inverse from making much of what belongs to the zeros; further ones
  // would keep it from what it is to correct.
  void improve(Directions& d, bool transpose) const {
    const double near = b_.norm() * (job_.single ? 1e-3 : 1e-8);
    const int most = job_.single ? 20 : 6;
    inspect(d, transpose);
    const Index candidates = d.below(near);
    if (candidates == 0) return;
    const Block left = job_.kind == Kind::lu ? left_of(d.q.columns, candidates, transpose) : Block(0, 0);
    for (int step = 0; step < most; ++step) {
      Directions next = d;
      Block part(b_.n(), candidates);
      std::copy_n(d.y.values.begin(), part.values.size(), part.values.begin());
      project_out(left.columns > 0 ? left : first_columns(d.q, candidates), part);
      part = b_.inverse(std::move(part), transpose);
      project_out(d.q, part);
      for (std::size_t k = 0; k < part.values.size(); ++k) next.q.values[k] -= part.values[k];
      orthonormalize(next.q);
      inspect(next, transpose);
      const auto logarithms = [&](const Directions& of) {
        return std::accumulate(of.values.begin(), of.values.begin() + candidates, 0.0,
                               [&](double sum, double v) { return sum + std::log(std::max(v, zero_ / 64)); });
      };
      if (!(logarithms(next) < logarithms(d) - 0.1)) return;
      d = std::move(next);
    }
  }

  // The `keep` smallest directions on the other side, of a block of so many columns.
  [[nodiscard]] Block left_of(Index columns, Index keep, bool transpose) const {
    Directions left{start(columns), Block(0, 0), {}};
    for (int step = 0; step < kInverseSteps; ++step)
      if (!iterate(left.q, transpose) || !iterate(left.q, !transpose)) return {0, 0};
    inspect(left, !transpose);
    return first_columns(left.q, keep);
  }

  const DeficiencyJob& job_;
  ScaledMatrix b_;
  double zero_ = 0;
};

// One row for each null vector, by elimination with complete pivoting: without these rows (and as many columns) the
// rest is regular.
std::vector<Index> leading_rows(Block v) {
  std::vector<Index> rows;
  for (Index k = 0; k < v.columns; ++k) {
    Index column = k;
    Offset at = -1;
    double most = -1;
    for (Index c = k; c < v.columns; ++c)
      for (Index i = 0; i < v.rows; ++i)
        if (std::abs(v.column(c)[i]) > most) {
          most = std::abs(v.column(c)[i]);
          at = i;
          column = c;
        }
    if (!(most > 0)) break;
    std::swap_ranges(v.column(k), v.column(k) + v.rows, v.column(column));
    for (Index c = k + 1; c < v.columns; ++c) {
      const double factor = v.column(c)[at] / v.column(k)[at];
      for (Index i = 0; i < v.rows; ++i) v.column(c)[i] -= factor * v.column(k)[i];
      v.column(c)[at] = 0;
    }
    rows.push_back(static_cast<Index>(at));
  }
  std::sort(rows.begin(), rows.end());
  return rows;
}

std::vector<double> callers_vectors(const ScaledMatrix& b, const Block& q, bool transpose) {
  std::vector<double> out(q.values.size());
  for (Index c = 0; c < q.columns; ++c) {
    double* v = out.data() + Offset{c} * q.rows;
    double most = 0;
    for (Index i = 0; i < q.rows; ++i) {
      v[i] = b.unscaled(i, q.column(c)[i], transpose);
      most = std::max(most, std::abs(v[i]));
    }
    for (Index i = 0; i < q.rows && most > 0; ++i) v[i] /= most;
  }
  return out;
}

}  // namespace

Deficiency find_deficiency(const DeficiencyJob& job) {
  Deficiency found;
  Search search(job);
  if (!job.replaced && search.surely_regular()) return found;
  search.prepare();
  const Index n = job.prepared.n();
  const auto affordable = static_cast<Index>(std::sqrt(static_cast<double>(kMostWork) / n));
  const Index most = std::min(n, std::clamp(affordable, kFirstColumns, kMostColumns));
  Index columns = std::min(most, std::max(kFirstColumns, (job.suspects + 2 + 7) / 8 * 8));
  Directions d = search.find(columns, false);
  while (d.found && d.below(search.zero()) == columns && columns < most) {
    columns = std::min(most, 4 * columns);
    d = search.find(columns, false);
  }
  if (!d.found) {  // nothing can be said of a factor whose solutions overflow; zeros that it met are zeros
    found.smallest = 0;
    found.complete = false;
    found.zeros = job.replaced ? job.suspects : 0;
    return found;
  }
  found.zeros = d.below(search.zero());
  found.smallest = d.values.front() / search.matrix().norm();
  if (job.kind == Kind::ldlt) {
    const std::vector<double> ritz = ritz_values(d.q, d.y);
    const Index end = std::min(columns, job.suspects);
    for (Index k = found.zeros; k < end; ++k) found.negative += ritz[static_cast<std::size_t>(k)] < 0 ? 1 : 0;
  }
  if (found.zeros == 0) return found;
  // As many directions on the left as on the right: one side proves what the factor's errors blur a little on the
  // other.
  constexpr double kBlurred = 16;
  const Directions other = job.kind == Kind::lu ? search.find(columns, true) : Directions{};
  if (other.found)
    found.zeros = std::max(found.zeros, std::min(other.below(search.zero()), d.below(kBlurred * search.zero())));
  const Block null = first_columns(d.q, found.zeros);
  found.null_vectors = callers_vectors(search.matrix(), null, false);
  if (job.kind == Kind::lu) {
    const Block left = first_columns(other.q, found.zeros);
    found.left_vectors = callers_vectors(search.matrix(), left, true);
    found.rows = leading_rows(left);
    found.columns = leading_rows(null);
  } else {
    found.rows = leading_rows(null);
  }
  if (found.zeros == columns && columns < n) {
    found.complete = false;
    found.zeros = std::max(found.zeros, job.suspects);
  }
  return found;
}

}  // namespace espalier::solver
