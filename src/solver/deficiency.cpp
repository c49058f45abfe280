#include "solver/deficiency.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <mutex>
#include <numeric>
#include <utility>

#include "base/at.hpp"
#include "base/mix.hpp"
#include "solver/small_block.hpp"

namespace espalier::solver {

namespace {

constexpr Index kFirstColumns = 8;  // a substitution takes as many in the time of one
constexpr Index kMostColumns = kMostZerosSought;
constexpr Offset kMostWork = 1 << 28;  // of rows * columns^2: a few tenths of a second
constexpr int kInverseSteps = 3;
constexpr std::int64_t kFactorColumns = 4096, kRowsPerRange = 1 << 15;

// Numbers without pattern (the finalizer of splitmix64, Steele et al. 2014), the same in every run: of both signs, from
// 1/2 to 1 in magnitude.
double random_number(std::uint64_t k) {
  k = base::mix(k + 0x9e3779b97f4a7c15U);
  const double magnitude = 0.5 + static_cast<double>(k >> 12) * 0x1p-53;
  return (k & 1) != 0 ? magnitude : -magnitude;
}

// B = R A C and its inverse as the factor knows it. A complex matrix acts on vectors of twice as many real numbers,
// real and imaginary parts in turn (base::Numbers): its singular values (and the eigenvalues of a Hermitian one) stand
// twice there, and its transpose is A^H.
class ScaledMatrix {
 public:
  explicit ScaledMatrix(const DeficiencyJob& job)
      : job_(job),
        parts_(base::parts_of(job.prepared.numbers)),
        n_(job.prepared.n()),
        row_(job.numeric.scales().row),
        col_(job.numeric.scales().col) {
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
    make_empty_ones_large();
    measure();
  }

  /// Of the real space.
  [[nodiscard]] Index n() const { return parts_ * n_; }
  /// Whether B is not its own transpose there.
  [[nodiscard]] bool two_sided() const {
    return job_.kind == Kind::lu || job_.prepared.numbers == base::Numbers::complex;
  }
  [[nodiscard]] double norm() const { return norm_; }
  /// From B's unknowns to the caller's.
  [[nodiscard]] double unscaled(Index i, double v, bool transpose) const {
    return v * (transpose ? row_ : col_)[static_cast<std::size_t>(i / parts_)];
  }

  // From op(B) to the caller's op(A), a transpose instead of A^H.
  void to_caller(RankCorrection& c, bool transpose) const {
    const auto& of_rows = transpose ? col_ : row_;
    for (Index d = 0; d < c.to.columns; ++d) {
      for (std::size_t k = 0; k < c.places.size(); ++k) c.from.column(d)[k] *= of_rows[at(c.places[k] / parts_)];
      for (Index i = 0; i < c.to.rows; ++i) c.to.column(d)[i] = unscaled(i, c.to.column(d)[i], transpose);
    }
    if (!transpose || job_.prepared.numbers != base::Numbers::complex) return;
    for (Index d = 0; d < c.to.columns; ++d) {
      for (std::size_t k = 0; k < c.places.size(); ++k)
        if (c.places[k] % 2 != 0) c.from.column(d)[k] = -c.from.column(d)[k];
      for (Index i = 1; i < c.to.rows; i += 2) c.to.column(d)[i] = -c.to.column(d)[i];
    }
  }

  // op(B) x in extended precision.
  [[nodiscard]] Block product(const Block& x, bool transpose) const {
    Block in = x, out(n(), x.columns);
    if (transpose) turn(in);
    scale(in, transpose ? row_ : col_, false);
    const std::vector<double> zero(static_cast<std::size_t>(n()), 0.0);
    std::vector<solve::ResidualColumn> columns(static_cast<std::size_t>(x.columns));
    for (Index c = 0; c < x.columns; ++c)
      columns[static_cast<std::size_t>(c)] = {zero.data(), in.column(c), out.column(c), {}};
    job_.residual.compute(columns, transpose);
    scale(out, transpose ? col_ : row_, false);
    for (double& v : out.values) v = -v;
    if (transpose) turn(out);
    return out;
  }

  // op(B)^-1 x by the factor.
  [[nodiscard]] Block inverse(Block x, bool transpose) const {
    if (transpose) turn(x);
    scale(x, transpose ? col_ : row_, true);
    job_.numeric.solve(x.values.data(), x.values.data(), x.columns, transpose);
    scale(x, transpose ? row_ : col_, true);
    if (transpose) turn(x);
    return x;
  }

 private:
  // Nothing measures rows and columns without entries. As large as any, their part of a null vector is not smaller in
  // the caller's units than what rounding leaves of the others.
  void make_empty_ones_large() {
    std::vector<char> row_has(row_.size(), 0), col_has(col_.size(), 0);
    visit([&](std::size_t i, std::size_t j, double v) {
      if (v > 0) row_has[i] = col_has[j] = 1;
    });
    const double most_row = *std::max_element(row_.begin(), row_.end());
    const double most_col = *std::max_element(col_.begin(), col_.end());
    for (std::size_t k = 0; k < row_.size(); ++k) {
      if (row_has[k] == 0) row_[k] = most_row;
      if (col_has[k] == 0) col_[k] = most_col;
    }
  }
  // To the conjugate, where A^H is that of A^T between two of them.
  void turn(Block& x) const {
    if (job_.prepared.numbers != base::Numbers::complex) return;
    for (std::size_t k = 1; k < x.values.size(); k += 2) x.values[k] = -x.values[k];
  }
  [[nodiscard]] double size_of(Offset q) const {
    if (parts_ == 1) return job_.values[static_cast<std::size_t>(q)];
    const auto at = static_cast<std::size_t>(2 * q);
    return std::hypot(job_.values[at], job_.values[at + 1]);
  }

  void by_diagonal() {
    row_.assign(static_cast<std::size_t>(n_), 1.0);
    const auto& a = job_.prepared.a;
    if (job_.kind == Kind::llt)
      job_.pool.for_each_range(n_, kFactorColumns, [&](std::int64_t begin, std::int64_t end) {
        for (auto c = begin; c < end; ++c)
          for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q)
            if (a.row_ind[q] == c) row_[static_cast<std::size_t>(c)] = 1 / std::sqrt(job_.values[parts_ * q]);
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
        use(i, j, std::abs(size_of(q) * col_[j] * row_[i]));
        if (mirrored && i != j) use(j, i, std::abs(size_of(q) * col_[i] * row_[j]));
      }
  }

  // In one triangle, what stands in the columns and in the rows makes up a row together.
  void measure() {
    const auto& a = job_.prepared.a;
    const matrix::RowIndex& rows = job_.rows;
    const bool general = a.storage == Storage::general;
    std::mutex mutex;
    double most_row = 0, most_column = 0;
    job_.pool.for_each_range(n_, kFactorColumns, [&](std::int64_t begin, std::int64_t end) {
      double row = 0, column = 0;
      for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
        double in_column = 0, in_row = 0;
        for (Offset q = a.col_ptr[k]; q < a.col_ptr[k + 1]; ++q)
          in_column += std::abs(size_of(q) * col_[k] * row_[a.row_ind[q]]);
        for (Offset q = rows.ptr.empty() ? 0 : rows.ptr[k]; q < (rows.ptr.empty() ? 0 : rows.ptr[k + 1]); ++q)
          in_row += std::abs(size_of(rows.source[q]) * col_[rows.col[q]] * row_[k]);
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
    job_.pool.for_each_range(n_, kRowsPerRange, [&](std::int64_t begin, std::int64_t end) {
      for (Index c = 0; c < x.columns; ++c) {
        double* v = x.column(c);
        for (auto i = parts_ * begin; i < parts_ * end; ++i) {
          const double s = by[static_cast<std::size_t>(i / parts_)];
          v[i] = inverse ? v[i] / s : v[i] * s;
        }
      }
    });
  }

  const DeficiencyJob& job_;
  Index parts_;  // real numbers in one
  Index n_;
  std::vector<double> row_, col_;
  double norm_ = 0;
};

// A block of directions that op(B) makes smallest.
struct Directions {
  Block q{0, 0}, y{0, 0};      // orthonormal; y = op(B) q
  std::vector<double> values;  // |y_j|, ascending
  bool found = false;          // false: numbers overflowed
  bool solved = true;          // false: the factor's last solutions solve nothing

  [[nodiscard]] Index below(double bound) const {
    return static_cast<Index>(std::upper_bound(values.begin(), values.end(), bound) - values.begin());
  }
};

Block first_columns(const Block& q, Index columns) {
  Block part(q.rows, columns);
  std::copy_n(q.values.begin(), part.values.size(), part.values.begin());
  return part;
}

/// diag(row) B diag(col), in units that do not depend on those of B's rows and columns (Curtis and Reid 1972, by
/// sweeps), with the norm of B. What one scaling leaves next to nothing, another may show.
struct Balanced {
  Eigen::MatrixXd b;
  Eigen::VectorXd row, col;
};

Balanced balanced(const Eigen::MatrixXd& b, bool symmetric) {
  constexpr int kSweeps = 60, kSweepsOfMaxima = 8;
  constexpr double kMostLog = 500;
  const Eigen::Index n = b.rows();
  const Eigen::ArrayXXd logs = b.array().abs().log2();
  Eigen::ArrayXd row = Eigen::ArrayXd::Zero(n), col = row, sums(n), counts(n);
  const auto sweep = [&](bool rows, const auto& use) {
    for (Eigen::Index j = 0; j < n; ++j)
      for (Eigen::Index i = 0; i < n; ++i)
        if (b(i, j) != 0) use(rows ? i : j, logs(i, j) + row[i] + col[j]);
  };
  for (int k = 0; k < 2 * kSweeps; ++k) {
    sums.setZero();
    counts.setConstant(1e-300);
    sweep(k % 2 == 0, [&](Eigen::Index at, double log) {
      sums[at] += log;
      ++counts[at];
    });
    (k % 2 == 0 ? row : col) -= sums / counts;
  }
  for (int k = 0; k < 2 * kSweepsOfMaxima; ++k) {
    sums.setConstant(-std::numeric_limits<double>::infinity());
    sweep(k % 2 == 0, [&](Eigen::Index at, double log) { sums[at] = std::max(sums[at], log); });
    (k % 2 == 0 ? row : col) -= sums.isFinite().select(0.5 * sums, 0.0);
  }
  if (symmetric) row = col = (0.5 * (row + col)).eval();
  const auto factor = [=](const Eigen::ArrayXd& log) {
    return Eigen::VectorXd(log.max(-kMostLog).min(kMostLog).unaryExpr([](double x) { return std::exp2(x); }));
  };
  Balanced out{b, factor(row), factor(col)};
  out.b = out.row.asDiagonal() * b * out.col.asDiagonal();
  const double norm = out.b.norm();
  if (norm > 0) out.row *= b.norm() / norm;
  if (norm > 0) out.b *= b.norm() / norm;
  return out;
}

class Search {
 public:
  explicit Search(const DeficiencyJob& job)
      : job_(job), b_(job), share_(zero_singular_value(job.kind, job.prepared.n())) {}

  /// Whether the matrix is surely regular, by a few solutions: no singular value is near the bound of a zero (FP32:
  /// near what it can tell from one).
  [[nodiscard]] bool surely_regular() const { return surely_above((job_.rough ? kLeastForFp32 : share_) * b_.norm()); }
  /// Before all below.
  void prepare() {
    b_.make_even();
    zero_ = share_ * b_.norm();
  }

  [[nodiscard]] Directions find(Index columns, bool transpose) const {
    Directions d{start(columns), Block(0, 0), {}};
    for (int step = 0; step < kInverseSteps; ++step) {
      if (b_.two_sided() && !iterate(d.q, !transpose)) return d;
      const Block before = step + 1 == kInverseSteps ? d.q : Block(0, 0);
      d.q = b_.inverse(std::move(d.q), transpose);
      if (before.columns > 0) d.solved = solves(d.q, before, transpose);
      if (!make_orthonormal(d.q)) return d;
    }
    d.found = true;
    improve(d, transpose);
    return d;
  }

  // A matrix has as many null directions on the one side as on the other. Where the two searches disagree, or both came
  // near only, each corrects its own with what the other has found.
  void agree(Directions& right, Directions& left) const {
    constexpr int kTurns = 2;
    for (int turn = 0; turn < kTurns; ++turn) {
      const Index candidates = std::max(right.below(near()), left.below(near()));
      if (std::min(right.below(zero_), left.below(zero_)) == candidates) return;
      correct(left, first_columns(right.q, candidates), true);
      correct(right, first_columns(left.q, candidates), false);
    }
  }

  /// Vectors of op(B)'s null space, by a factor of B + E (zeros_of_pivots()): what B makes of random vectors is taken
  /// off them.
  /// @param polished  once more than it takes
  /// @returns none where they are no null vectors to rounding
  [[nodiscard]] Block null_columns(Index columns, bool transpose, bool polished) const {
    constexpr int kMostSteps = 4;
    Block x = start(columns);
    bool vanished = false;
    for (int step = 0; step < kMostSteps; ++step) {
      Block y = b_.product(x, transpose);
      // Further steps would take away what is none of the null space as well as what rounding has left.
      if (step == 1 && !below(y, x, near())) break;
      if (step > 0 && vanish(y, x)) {
        if (vanished || !polished) return x;
        vanished = true;
      }
      y = b_.inverse(std::move(y), transpose);
      for (std::size_t k = 0; k < y.values.size(); ++k) x.values[k] -= y.values[k];
    }
    return {b_.n(), 0};
  }

  /// What rounding has added to null vectors in other directions.
  void clean(Block& x, bool transpose) const {
    const Block y = b_.inverse(b_.product(x, transpose), transpose);
    for (std::size_t k = 0; k < y.values.size(); ++k) x.values[k] -= y.values[k];
  }

  /// What op(B) makes of Z = (B + E)^-1 E W, where E stands in these rows (of op(B)).
  struct Reduced {
    Block z{0, 0};                                   // columns of about 1
    Eigen::MatrixXd m;                               // op(B) Z in the rows of E; the others are zero
    Index rank = 0;                                  // of m, surely: zeros and others are far apart
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;  // of m, or of random combinations of its rows
  };
  /// W of all columns.
  [[nodiscard]] std::optional<Reduced> reduce(std::span<const Index> rows, bool transpose) const {
    Reduced r{b_.inverse(unit_vectors(rows), transpose), {}, 0, {}};
    if (!normalize(job_.pool, r.z) || !reduce(r, rows, transpose)) return {};
    return r;
  }
  /// W of random columns, more of them until they are more than m has of independent ones: the rank of m is that of
  /// samples of it (Halko, Martinsson and Tropp 2011).
  [[nodiscard]] std::optional<Reduced> sample(std::span<const Index> rows, bool transpose) const {
    constexpr Index kFirstSamples = 24, kMostSamples = 512, kSpare = 4;
    constexpr double kMostGrowth = 1e6;  // beside what has grown so far, others might not be seen
    const std::vector<Index> places = real_places(rows);
    for (Index samples = kFirstSamples; samples < kMostSamples && at(samples) < places.size(); samples *= 2) {
      Reduced r{Block(b_.n(), samples), {}, 0, {}};
      for (Index c = 0; c < samples; ++c)
        for (std::size_t k = 0; k < places.size(); ++k)
          r.z.column(c)[places[k]] = random_number(at(c) * places.size() + k);
      const double given = norm_two(job_.pool, r.z.column(0), b_.n());
      r.z = b_.inverse(std::move(r.z), transpose);
      for (Index c = 0; c < samples; ++c) {
        const double length = norm_two(job_.pool, r.z.column(c), b_.n());
        if (!(length * b_.norm() <= kMostGrowth * given)) return {};
        divide(job_.pool, r.z.column(c), length, b_.n());
      }
      if (!reduce(r, rows, transpose)) return {};
      if (r.rank + kSpare <= samples) return r;
    }
    return {};
  }
  /// Null vectors of op(B) among all of them.
  [[nodiscard]] std::optional<Block> null_columns(const Reduced& r, bool transpose) const {
    const Index k = r.z.columns;
    Eigen::MatrixXd combined(k, k - r.rank);
    combined.bottomRows(k - r.rank).setIdentity();
    combined.topRows(r.rank) = -r.qr.matrixR()
                                    .topLeftCorner(r.rank, r.rank)
                                    .triangularView<Eigen::Upper>()
                                    .solve(r.qr.matrixR().topRightCorner(r.rank, k - r.rank));
    combined = r.qr.colsPermutation() * combined;
    Block x(r.z.rows, k - r.rank);
    Eigen::Map<Eigen::MatrixXd>(x.values.data(), x.rows, x.columns) =
        Eigen::Map<const Eigen::MatrixXd>(r.z.values.data(), r.z.rows, k) * combined;
    if (x.columns > 0 && !vanish(b_.product(x, transpose), x)) return {};
    return x;
  }
  /// By which solutions of op(B) are corrected.
  [[nodiscard]] RankCorrection correction(const Reduced& r, std::span<const Index> rows, bool transpose) const {
    RankCorrection c{real_places(rows), Block(static_cast<Index>(r.m.rows()), r.rank), Block(b_.n(), r.rank)};
    using Map = Eigen::Map<Eigen::MatrixXd>;
    const auto chosen = r.qr.colsPermutation().indices().head(r.rank);
    const Eigen::HouseholderQR<Eigen::MatrixXd> range(r.m(Eigen::all, chosen));
    Map(c.from.values.data(), r.m.rows(), r.rank) =
        range.householderQ() * Eigen::MatrixXd::Identity(r.m.rows(), r.rank);
    const Eigen::MatrixXd z =
        Eigen::Map<const Eigen::MatrixXd>(r.z.values.data(), b_.n(), r.z.columns)(Eigen::all, chosen);
    Map(c.to.values.data(), b_.n(), r.rank) =
        range.matrixQR().topRows(r.rank).triangularView<Eigen::Upper>().solve<Eigen::OnTheRight>(z);
    b_.to_caller(c, transpose);
    return c;
  }
  /// Those of the rows of E that depend on the others: all but so many as are independent on the other directions.
  [[nodiscard]] std::vector<Index> dependent(const Reduced& r, std::span<const Index> rows) const {
    const auto without = [&](const auto& m, Index rank) {
      const Eigen::FullPivLU<std::decay_t<decltype(m)>> lu(m);
      std::vector<char> regular(rows.size(), 0);
      for (Index k = 0; k < rank; ++k) regular[at(lu.permutationP().transpose().eval().indices()(k))] = 1;
      std::vector<Index> others;
      for (std::size_t k = 0; k < rows.size(); ++k)
        if (regular[k] == 0) others.push_back(rows[k]);
      std::sort(others.begin(), others.end());
      return others;
    };
    const Eigen::MatrixXd m = r.m(Eigen::all, r.qr.colsPermutation().indices().head(r.rank));
    if (job_.prepared.numbers == base::Numbers::real) return without(m, r.rank);
    Eigen::MatrixXcd complex(m.rows() / 2, m.cols());
    complex.real() = m(Eigen::seqN(0, m.rows() / 2, 2), Eigen::all);
    complex.imag() = m(Eigen::seqN(1, m.rows() / 2, 2), Eigen::all);
    return without(complex, r.rank / 2);
  }
  /// Whether vectors that are perpendicular to these null vectors lead to others: some that vanishing pivots make much
  /// larger drown the rest of a block, as if it were no part of the null space.
  [[nodiscard]] bool hides_more(const Block& right, const Block& left) const {
    Block x = start(std::min(kFirstColumns, b_.n() - right.columns));
    if (x.columns <= 0) return false;
    const auto go = [&](const Block& before, const Block& after, bool transpose) {
      project_out(job_.pool, before, x);
      x = b_.inverse(std::move(x), transpose);
      if (!normalize(job_.pool, x)) return false;
      project_out(job_.pool, after, x);
      return make_orthonormal(x);
    };
    for (int step = 0; step < kInverseSteps; ++step) {
      if (b_.two_sided() && !go(right, left, true)) return true;
      if (!go(left, right, false)) return true;
    }
    Directions d{std::move(x), Block(0, 0), {}};
    inspect(d, false);
    return !(d.values.front() > near());
  }

  /// All of B, column by column.
  [[nodiscard]] Eigen::MatrixXd dense() const {
    const Index n = b_.n();
    Block unit(n, n);
    for (Index k = 0; k < n; ++k) unit.column(k)[k] = 1;
    const Block columns = b_.product(unit, false);
    return Eigen::Map<const Eigen::MatrixXd>(columns.values.data(), n, n);
  }
  /// What a dense op(B) takes to nothing, by Q R of the other one with interchanges: the last columns of Q.
  /// @returns nothing where its rank is not proven: R's leading triangle is regular, and B takes the vectors to nothing
  [[nodiscard]] std::optional<Block> null_columns(const Eigen::MatrixXd& other, bool transpose) const {
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(other);
    const auto n = static_cast<Index>(other.rows());
    const auto rank = static_cast<Index>((qr.matrixR().diagonal().cwiseAbs().array() > zero_).count());
    const Eigen::MatrixXd inverse = qr.matrixR()
                                        .topLeftCorner(rank, rank)
                                        .triangularView<Eigen::Upper>()
                                        .solve(Eigen::MatrixXd::Identity(rank, rank));
    if (rank > 0 && !(inverse.norm() * zero_ < 1)) return {};
    Eigen::MatrixXd last = Eigen::MatrixXd::Zero(n, n - rank);
    last.bottomRows(n - rank).setIdentity();
    Block x(n, n - rank);
    Eigen::Map<Eigen::MatrixXd>(x.values.data(), n, n - rank) = qr.householderQ() * last;
    if (x.columns > 0 && !vanish(b_.product(x, transpose), x)) return {};
    return x;
  }

  /// Likewise, by whichever scaling proves the higher rank. @param symmetric  B is, and stays so
  [[nodiscard]] std::optional<Block> null_columns_of_dense(bool symmetric, bool transpose) const {
    const Eigen::MatrixXd b = dense();
    std::optional<Block> best = null_columns(transpose ? b : Eigen::MatrixXd(b.transpose()), transpose);
    if (!b.allFinite() || (best && best->columns == 0)) return best;
    const Balanced other = balanced(b, symmetric);
    if (!other.b.allFinite()) return best;
    const Eigen::MatrixXd op = transpose ? Eigen::MatrixXd(other.b.transpose()) : other.b;
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(op.transpose());
    const Eigen::Index n = op.rows();
    const Eigen::Index rank = (qr.matrixR().diagonal().cwiseAbs().array() > zero_).count();
    if (best && n - rank >= best->columns) return best;
    const Eigen::MatrixXd inverse = qr.matrixR()
                                        .topLeftCorner(rank, rank)
                                        .triangularView<Eigen::Upper>()
                                        .solve(Eigen::MatrixXd::Identity(rank, rank));
    if (!(inverse.norm() * zero_ < 1)) return best;
    Eigen::MatrixXd last = Eigen::MatrixXd::Zero(n, n - rank);
    last.bottomRows(n - rank).setIdentity();
    Eigen::MatrixXd null = qr.householderQ() * last;
    if (((op * null).colwise().norm().array() > zero_).any()) return best;
    null = (transpose ? other.row : other.col).asDiagonal() * null;
    Block x(static_cast<Index>(n), static_cast<Index>(n - rank));
    Eigen::Map<Eigen::MatrixXd>(x.values.data(), n, n - rank) = null.colwise().normalized();
    return x;
  }

  /// Small matrices are asked themselves: a factor of poor pivots may look regular.
  [[nodiscard]] bool agrees_with_dense(Index zeros) const {
    if (b_.n() > kCheapDense) return true;
    const std::optional<Block> truth = null_columns_of_dense(job_.kind == Kind::ldlt && !b_.two_sided(), false);
    return !truth || truth->columns == zeros;
  }

  /// Negative eigenvalues of a symmetric B on them (samples of a form have its inertia).
  [[nodiscard]] Index negative(const Reduced& r, std::span<const Index> rows) const {
    const std::vector<Index> places = real_places(rows);
    Eigen::MatrixXd z(r.m.rows(), r.m.cols());
    for (Index c = 0; c < r.z.columns; ++c)
      for (std::size_t i = 0; i < places.size(); ++i) z(static_cast<Eigen::Index>(i), c) = r.z.column(c)[places[i]];
    const Eigen::MatrixXd h = z.transpose() * r.m;
    Eigen::VectorXd values =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>((h + h.transpose()) / 2, Eigen::EigenvaluesOnly).eigenvalues();
    std::sort(values.begin(), values.end(), [](double a, double b) { return std::abs(a) > std::abs(b); });
    return static_cast<Index>((values.head(r.rank).array() < 0).count());
  }

  [[nodiscard]] double zero() const { return zero_; }
  [[nodiscard]] const ScaledMatrix& matrix() const { return b_; }

 private:
  [[nodiscard]] std::vector<Index> real_places(std::span<const Index> rows) const {
    const Index parts = base::parts_of(job_.prepared.numbers);
    std::vector<Index> places;
    for (const Index row : rows)
      for (Index part = 0; part < parts; ++part) places.push_back(parts * row + part);
    return places;
  }
  [[nodiscard]] Block unit_vectors(std::span<const Index> rows) const {
    const std::vector<Index> places = real_places(rows);
    Block u(b_.n(), static_cast<Index>(places.size()));
    for (Index c = 0; c < u.columns; ++c) u.column(c)[places[at(c)]] = 1;
    return u;
  }
  // m of Z, and its rank. @returns false where other rows do not vanish, or zeros and others are not far apart
  bool reduce(Reduced& r, std::span<const Index> rows, bool transpose) const {
    constexpr double kNothing = 1e-10, kGap = 16;
    constexpr Eigen::Index kMore = 16;
    const std::vector<Index> places = real_places(rows);
    Block y = b_.product(r.z, transpose);
    r.m.resize(static_cast<Eigen::Index>(places.size()), y.columns);
    for (Index c = 0; c < y.columns; ++c) {
      for (std::size_t k = 0; k < places.size(); ++k)
        r.m(static_cast<Eigen::Index>(k), c) = std::exchange(y.column(c)[places[k]], 0);
      for (Index i = 0; i < y.rows; ++i)
        if (!(std::abs(y.column(c)[i]) <= kNothing * b_.norm())) return false;
    }
    const Eigen::Index few = r.m.cols() + kMore;
    if (r.m.rows() > 2 * few) {
      Eigen::MatrixXd mixed(few, r.m.rows());
      for (Eigen::Index k = 0; k < mixed.size(); ++k) mixed.data()[k] = random_number(at(k));
      r.qr.compute(mixed * r.m / std::sqrt(static_cast<double>(few)));
    } else {
      r.qr.compute(r.m);
    }
    const auto sizes = r.qr.matrixR().diagonal().cwiseAbs();
    r.rank = static_cast<Index>((sizes.array() > zero_).count());
    return r.rank == 0 || sizes(r.rank - 1) >= kGap * zero_;
  }

  // Whether all singular values are surely above a bound. A random vector of unit length has a part of at least
  // 1 / (kUnlucky sqrt(n)) in the direction of the smallest one, s, but for a few of a thousand; k solutions in turn
  // let that part alone grow by s^-k. That is said of the factor. Where s is not far above the bound (a long plate has
  // 2.5 bounds), it may be the error of a factor whose matrix is singular (seen at 3 bounds in lu), and the matrix has
  // to bear it out.
  [[nodiscard]] bool surely_above(double bound) const {
    constexpr double kUnlucky = 256;
    constexpr int kMostSolutions = 16;
    constexpr double kFar = 1.0 / 256;
    Block x = start(1);
    double most = kUnlucky * std::sqrt(static_cast<double>(b_.n()));  // ... times what growth was, over s^-k
    double length = norm_two(job_.pool, x.column(0), b_.n());
    for (int k = 1; k <= kMostSolutions; ++k) {
      const bool transpose = b_.two_sided() && k % 2 == 0;
      divide(job_.pool, x.column(0), length, b_.n());
      x = b_.inverse(std::move(x), transpose);
      length = norm_two(job_.pool, x.column(0), b_.n());
      const double growth = length * bound;
      most *= growth;
      if (most < 1) return growth <= kFar || returns(std::move(x), transpose);
      if (!(most * std::pow(growth, kMostSolutions - k) < 1)) return false;  // it never gets less
    }
    return false;
  }

  // Whether op(B)^-1 op(B) x is about x: what the factor makes of a direction that the matrix takes to nothing is its
  // own error, and does not lead back.
  [[nodiscard]] bool returns(Block x, bool transpose) const {
    constexpr double kAbout = 0.125;
    normalize(job_.pool, x);
    Block again = b_.inverse(b_.product(x, transpose), transpose);
    for (std::size_t k = 0; k < x.values.size(); ++k) again.values[k] -= x.values[k];
    return norm_two(job_.pool, again.column(0), b_.n()) <= kAbout * norm_two(job_.pool, x.column(0), b_.n());
  }

  // Each column of y beside that of x. A few entries that are no zeros would drown in the length of y.
  [[nodiscard]] bool vanish(const Block& y, const Block& x) const {
    const auto largest = [&](const double* v) {
      double most = 0;
      for (Index i = 0; i < x.rows; ++i)
        if (!(std::abs(v[i]) <= most)) most = std::abs(v[i]);  // NaN stays
      return most;
    };
    for (Index c = 0; c < x.columns; ++c) {
      const double* to = y.column(c);
      const double* from = x.column(c);
      if (!(norm_two(job_.pool, to, x.rows) <= zero_ * norm_two(job_.pool, from, x.rows))) return false;
      if (!(largest(to) <= zero_ * largest(from))) return false;
    }
    return true;
  }

  // Lengths of columns.
  [[nodiscard]] bool below(const Block& y, const Block& x, double ratio) const {
    for (Index c = 0; c < x.columns; ++c)
      if (!(norm_two(job_.pool, y.column(c), x.rows) <= ratio * norm_two(job_.pool, x.column(c), x.rows))) return false;
    return true;
  }

  // What may be a null direction that the factor's errors have blurred.
  [[nodiscard]] double near() const { return b_.norm() * (job_.rough ? 1e-3 : 1e-8); }

  [[nodiscard]] Block start(Index columns) const {
    Block x(b_.n(), columns);
    for (std::size_t k = 0; k < x.values.size(); ++k) x.values[k] = random_number(k);
    return x;
  }

  bool iterate(Block& x, bool transpose) const {
    x = b_.inverse(std::move(x), transpose);
    return make_orthonormal(x);
  }

  bool make_orthonormal(Block& x) const {
    if (!normalize(job_.pool, x)) return false;
    orthonormalize(job_.pool, x);
    return true;
  }

  // Whether op(B) x is about y. Two vanishing pivots, one after the other, make inverses of tiles with numbers of 1e30,
  // whose rounding errors drown a solution of 1e15.
  [[nodiscard]] bool solves(const Block& x, const Block& y, bool transpose) const {
    const double about = (job_.rough ? 1e-2 : 1e-9) * b_.norm();
    Block r = b_.product(x, transpose);
    for (Index c = 0; c < x.columns; ++c) {
      double* of = r.column(c);
      const double* from = y.column(c);
      for (Index i = 0; i < x.rows; ++i) of[i] -= from[i];
      if (!(norm_two(job_.pool, of, x.rows) <= about * norm_two(job_.pool, x.column(c), x.rows))) return false;
    }
    return true;
  }

  void inspect(Directions& d, bool transpose) const {
    d.y = b_.product(d.q, transpose);
    d.values = rotate_apart(job_.pool, d.y, d.q);
  }

  // Directions that may be null ones are corrected.
  void improve(Directions& d, bool transpose) const {
    inspect(d, transpose);
    const Index candidates = d.below(near());
    if (candidates == 0) return;
    correct(d, b_.two_sided() ? left_of(d.q.columns, candidates, transpose) : first_columns(d.q, candidates),
            transpose);
  }

  // Newton's steps for null directions, q -= (1 - Q Q^T) B^-1 (1 - U U^T) B q, as long as they help: the error of the
  // factor, which inverse iteration leaves in q, shrinks in each of them by itself over the next singular value. U, as
  // many null directions on the other side, keeps the inverse from making much of what belongs to the zeros; further
  // ones would keep it from what it is to correct.
  void correct(Directions& d, const Block& other, bool transpose) const {
    const int most = job_.rough ? 20 : 6;
    const Index candidates = other.columns;
    for (int step = 0; step < most; ++step) {
      Directions next = d;
      Block part(b_.n(), candidates);
      std::copy_n(d.y.values.begin(), part.values.size(), part.values.begin());
      project_out(job_.pool, other, part);
      part = b_.inverse(std::move(part), transpose);
      project_out(job_.pool, d.q, part);
      for (std::size_t k = 0; k < part.values.size(); ++k) next.q.values[k] -= part.values[k];
      orthonormalize(job_.pool, next.q);
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
      if (!iterate(left.q, transpose) || !iterate(left.q, !transpose)) return {b_.n(), 0};
    inspect(left, !transpose);
    return first_columns(left.q, keep);
  }

  const DeficiencyJob& job_;
  ScaledMatrix b_;
  double share_;  // of |B|, that stands for a zero
  double zero_ = 0;
};

// Vectors of numbers, column by column.
template <class Value>
struct Columns {
  Index rows = 0, columns = 0;
  std::vector<Value> values;

  Value* column(Index c) { return values.data() + Offset{c} * rows; }
};

// One row for each null vector, by elimination with complete pivoting: without these rows (and as many columns) the
// rest is regular.
template <class Value>
std::vector<Index> leading_rows(Columns<Value> v) {
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
      const Value factor = v.column(c)[at] / v.column(k)[at];
      for (Index i = 0; i < v.rows; ++i) v.column(c)[i] -= factor * v.column(k)[i];
      v.column(c)[at] = 0;
    }
    rows.push_back(static_cast<Index>(at));
  }
  std::sort(rows.begin(), rows.end());
  return rows;
}

// Complex vectors that span what the real ones (twice as many, in the real space) span: the longest rest of them next.
Columns<std::complex<double>> complex_basis(const Block& q, Index columns) {
  using Value = std::complex<double>;
  Columns<Value> rest{q.rows / 2, q.columns, {}}, basis{q.rows / 2, columns, {}};
  rest.values.assign(base::as_complex(q.values.data()), base::as_complex(q.values.data()) + q.values.size() / 2);
  const auto dot = [&](const Value* x, const Value* y) {
    Value sum = 0;
    for (Index i = 0; i < rest.rows; ++i) sum += std::conj(x[i]) * y[i];
    return sum;
  };
  for (Index k = 0; k < columns; ++k) {
    Index next = 0;
    double most = -1;
    for (Index c = 0; c < rest.columns; ++c)
      if (const double length = std::real(dot(rest.column(c), rest.column(c))); length > most) {
        most = length;
        next = c;
      }
    std::vector<Value> chosen(rest.column(next), rest.column(next) + rest.rows);
    for (Value& v : chosen) v /= std::sqrt(most);
    basis.values.insert(basis.values.end(), chosen.begin(), chosen.end());
    for (Index c = 0; c < rest.columns; ++c) {
      const Value part = dot(chosen.data(), rest.column(c));
      for (Index i = 0; i < rest.rows; ++i) rest.column(c)[i] -= part * chosen[static_cast<std::size_t>(i)];
    }
  }
  return basis;
}

Columns<double> real_basis(const Block& q) { return {q.rows, q.columns, q.values}; }

// In the caller's units, the largest number 1 in magnitude.
template <class Value>
std::vector<double> callers_vectors(const ScaledMatrix& b, Columns<Value> q, bool transpose) {
  constexpr Index kParts = base::ScalarTraits<Value>::is_complex ? 2 : 1;
  for (Index c = 0; c < q.columns; ++c) {
    double most = 0;
    for (Index i = 0; i < q.rows; ++i) {
      q.column(c)[i] *= b.unscaled(kParts * i, 1, transpose);
      most = std::max(most, std::abs(q.column(c)[i]));
    }
    for (Index i = 0; i < q.rows && most > 0; ++i) q.column(c)[i] /= most;
  }
  const double* parts = reinterpret_cast<const double*>(q.values.data());
  return {parts, parts + q.values.size() * kParts};
}

// Null vectors, and the rows or columns that they name. `left`, of lu: those of B^T (complex: of B^H), else empty.
template <class Value>
void describe(const ScaledMatrix& b, Columns<Value> null, Columns<Value> left, Deficiency& found) {
  found.null_vectors = callers_vectors(b, null, false);
  if (left.columns == 0) {
    found.rows = leading_rows(std::move(null));
    return;
  }
  for (Value& v : left.values) v = base::conjugate(v);
  found.left_vectors = callers_vectors(b, left, true);
  found.rows = leading_rows(std::move(left));
  found.columns = leading_rows(std::move(null));
}

}  // namespace

Deficiency find_deficiency(const DeficiencyJob& job) {
  Deficiency found;
  Search search(job);
  if (!job.replaced && search.surely_regular()) return found;
  if (!job.replaced && job.surely_alone) {
    found.smallest = 0;
    return found;
  }
  search.prepare();
  const Index parts = base::parts_of(job.prepared.numbers);
  const Index n = search.matrix().n(), suspects = parts * job.suspects;
  const auto affordable = static_cast<Index>(std::sqrt(static_cast<double>(kMostWork) / n));
  const Index most = std::min(n, std::clamp(affordable, kFirstColumns, kMostColumns));
  const Index for_all = std::min(most, std::max(kFirstColumns, (suspects + 2 + 7) / 8 * 8));
  // Small pivots may be many where none is a zero.
  Index columns = job.replaced ? for_all : std::min(most, kFirstColumns);
  Directions d = search.find(columns, false);
  while (d.found && columns < most && d.below(search.zero()) > 0 &&
         (columns < for_all || d.below(search.zero()) == columns)) {
    columns = columns < for_all ? for_all : std::min(most, 4 * columns);
    d = search.find(columns, false);
  }
  if (!d.found) {  // nothing can be said of a factor whose solutions overflow; zeros that it met are zeros
    found.smallest = 0;
    found.complete = false;
    found.doubtful = true;
    found.worst = std::numeric_limits<double>::infinity();
    found.zeros = job.replaced ? job.suspects : 0;
    return found;
  }
  const auto whole = [parts](Index directions) { return (directions + parts - 1) / parts; };
  found.doubtful = !d.solved;
  found.zeros = std::max(job.proven, whole(d.below(search.zero())));
  found.smallest = d.values.front() / search.matrix().norm();
  if (job.kind == Kind::ldlt && !search.matrix().two_sided()) {
    const std::vector<double> ritz = ritz_values(job.pool, d.q, d.y);
    const Index end = std::min(columns, suspects);
    Index negative = 0;
    for (Index k = parts * found.zeros; k < end; ++k) negative += ritz[static_cast<std::size_t>(k)] < 0 ? 1 : 0;
    found.negative = whole(negative);
  }
  if (found.zeros == 0) return found;
  Directions other;
  if (search.matrix().two_sided()) {
    other = search.find(columns, true);
    if (other.found)
      search.agree(d, other);
    else
      found.doubtful = true;
    // One side proves what the factor's errors blur on the other.
    found.zeros = std::max(found.zeros, whole(std::max(d.below(search.zero()), other.below(search.zero()))));
    // Singular values are those of both sides; where estimates of the first that is none of zero differ, another zero
    // may hide between them.
    constexpr double kAlike = 1.5;
    const auto next = static_cast<std::size_t>(parts * found.zeros);
    const bool alike = !other.found || next >= d.values.size() ||
                       (d.values[next] < kAlike * other.values[next] && other.values[next] < kAlike * d.values[next]);
    found.doubtful = found.doubtful || !other.solved || !alike;
  }
  const Index taken = std::min(columns, parts * found.zeros);
  const auto last = static_cast<std::size_t>(taken - 1);
  constexpr double kBlurred = 16;
  found.worst = std::max(d.values[last], other.found ? other.values[last] : 0) / search.matrix().norm();
  found.doubtful = found.doubtful || found.worst > kBlurred * zero_singular_value(job.kind, job.prepared.n());
  const Block null = first_columns(d.q, taken);
  if (job.replaced && found.zeros < job.suspects && taken < columns && (!search.matrix().two_sided() || other.found))
    found.doubtful =
        found.doubtful || search.hides_more(null, search.matrix().two_sided() ? first_columns(other.q, taken) : null);
  const bool with_left = job.kind == Kind::lu && other.found;
  found.complete = with_left || job.kind != Kind::lu;  // else nothing tells the rows
  const Block left = with_left ? first_columns(other.q, taken) : Block(0, 0);
  if (parts == 1)
    describe(search.matrix(), real_basis(null), real_basis(left), found);
  else
    describe(search.matrix(), complex_basis(null, found.zeros),
             with_left ? complex_basis(left, found.zeros) : Columns<std::complex<double>>{}, found);
  if (taken == columns && columns < n) {
    found.complete = false;
    found.zeros = std::max(found.zeros, job.suspects);
  }
  return found;
}

bool surely_regular(const DeficiencyJob& job) { return Search(job).surely_regular(); }

namespace {

// What a matrix with so many zeros takes to nothing, and its rows. Of very many vectors no better basis is made.
void describe_all(const DeficiencyJob& job, const Search& search, double work, Block null, Block left,
                  Deficiency& found) {
  found.by_pivots = work > static_cast<double>(kMostWork);
  const auto make_orthonormal = [&](Block& x, bool transpose) {
    (void)normalize(job.pool, x);
    if (found.by_pivots || x.columns == 0) return;
    orthonormalize(job.pool, x);
    if (!found.reduced) search.clean(x, transpose);
  };
  make_orthonormal(null, false);
  make_orthonormal(left, true);
  const auto describe_as = [&](const auto& basis) {
    if (!found.by_pivots) return describe(search.matrix(), basis(null), basis(left), found);
    found.null_vectors = callers_vectors(search.matrix(), basis(null), false);
    found.left_vectors = callers_vectors(search.matrix(), basis(left), true);
  };
  if (job.prepared.numbers == base::Numbers::real)
    describe_as(real_basis);
  else
    describe_as([&](const Block& x) { return complex_basis(x, x.columns > 0 ? found.zeros : 0); });
}

}  // namespace

std::optional<Deficiency> zeros_of_pivots(const DeficiencyJob& job, Index zeros) {
  const Index parts = base::parts_of(job.prepared.numbers);
  if (zeros % parts != 0) return {};
  Search search(job);
  if (!search.surely_regular()) return {};
  search.prepare();
  const double work = static_cast<double>(search.matrix().n()) * zeros * zeros;
  const bool all = zeros <= parts * kFirstColumns || work <= job.vector_work;
  constexpr Index kProof = 2;  // of one, a part that is none of a null vector might be small by chance
  const Index columns = all ? zeros : kProof;
  Block null = search.null_columns(columns, false, all);
  if (null.columns == 0) return {};
  if (!search.agrees_with_dense(zeros)) return {};
  Deficiency found;
  found.zeros = zeros / parts;
  found.smallest = 0;
  found.by_pivots = true;
  if (!all) return found;
  Block left(search.matrix().n(), 0);
  if (job.kind == Kind::lu) left = search.null_columns(columns, true, true);
  if (job.kind == Kind::lu && left.columns == 0) return {};
  describe_all(job, search, work, std::move(null), std::move(left), found);
  return found;
}

std::optional<Deficiency> zeros_among_pivots(const DeficiencyJob& job, std::span<const Index> rows,
                                             std::span<const Index> columns) {
  constexpr double kMost = 0x1p37;  // a minute, for null vectors that are asked for
  const Index parts = base::parts_of(job.prepared.numbers);
  const double pivots = static_cast<double>(parts) * static_cast<double>(rows.size());
  const double work = job.prepared.n() * parts * pivots * pivots;
  const bool all = work <= job.vector_work;
  Search search(job);
  if (rows.empty() || (all && work > kMost) || !search.surely_regular()) return {};
  search.prepare();
  const bool lu = job.kind == Kind::lu;
  const auto reduced = [&](std::span<const Index> places, bool transpose) {
    return all ? search.reduce(places, transpose) : search.sample(places, transpose);
  };
  const auto right = reduced(rows, false);
  if (!right) return {};
  const Index zeros = static_cast<Index>(pivots) - right->rank;
  if (zeros % parts != 0 || !search.agrees_with_dense(zeros)) return {};
  Deficiency found;
  found.smallest = 0;
  found.reduced = true;
  found.zeros = zeros / parts;
  if (job.kind == Kind::ldlt && !search.matrix().two_sided()) found.negative = search.negative(*right, rows) / parts;
  if (found.zeros == 0) return found;
  const auto left = lu ? reduced(columns, true) : std::nullopt;
  if (lu && (!left || left->rank != right->rank)) return {};
  if (lu) found.corrections = {search.correction(*right, rows, false), search.correction(*left, columns, true)};
  if (!all) {
    found.rows = search.dependent(*right, rows);
    if (lu) found.columns = search.dependent(*left, columns);
    return found;
  }
  std::optional<Block> null = search.null_columns(*right, false);
  std::optional<Block> other = lu ? search.null_columns(*left, true) : Block(search.matrix().n(), 0);
  if (!null || !other) return {};
  describe_all(job, search, 0, std::move(*null), std::move(*other), found);
  return found;
}

std::optional<Deficiency> zeros_of_dense(const DeficiencyJob& job) {
  constexpr Index kMost = 512;  // tenths of a second
  const Index parts = base::parts_of(job.prepared.numbers);
  if (parts * job.prepared.n() > kMost) return {};
  Search search(job);
  search.prepare();
  if (!(search.zero() > 0) || !std::isfinite(search.zero())) return {};
  const Eigen::MatrixXd b = search.dense();
  if (!b.allFinite()) return {};
  const bool symmetric = job.kind == Kind::ldlt && !search.matrix().two_sided();
  std::optional<Block> null = search.null_columns_of_dense(symmetric, false);
  if (!null || null->columns % parts != 0) return {};
  Deficiency found;
  found.smallest = 0;
  found.reduced = found.dense = true;
  found.zeros = null->columns / parts;
  if (symmetric) {
    const auto values_of = [](const Eigen::MatrixXd& m) -> Eigen::VectorXd {
      return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(m, Eigen::EigenvaluesOnly).eigenvalues();
    };
    const auto zeros_in = [&](const Eigen::VectorXd& x) { return (x.array().abs() <= search.zero()).count(); };
    Eigen::VectorXd values = values_of(b);
    if (zeros_in(values) != null->columns) values = values_of(balanced(b, true).b);
    if (zeros_in(values) != null->columns) return {};
    found.negative = static_cast<Index>((values.array() < -search.zero()).count()) / parts;
  }
  if (found.zeros == 0) return found;
  Block left(search.matrix().n(), 0);
  if (job.kind == Kind::lu) {
    std::optional<Block> other = search.null_columns_of_dense(false, true);
    if (!other || other->columns != null->columns) return {};
    left = std::move(*other);
  }
  describe_all(job, search, 0, std::move(*null), std::move(left), found);
  return found;
}

}  // namespace espalier::solver
