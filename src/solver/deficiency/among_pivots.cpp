// Which of the vanishing pivots stand for zeros, told by what B makes of (B + E)^-1 E: zeros_among_pivots().
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/at.hpp"
#include "solver/deficiency/deficiency.hpp"
#include "solver/deficiency/dense.hpp"
#include "solver/deficiency/description.hpp"
#include "solver/deficiency/null_space_iteration.hpp"

namespace espalier::solver {

namespace {

// Z = (B + E)^-1 E W, where E stands in these rows of op(B), and m = op(B) Z there; its other rows are zero.
class Reduced {
 public:
  // W of all columns.
  static std::optional<Reduced> of_all(const NullSpaceIteration& search, std::span<const Index> rows, bool transpose);
  // W of random columns, more of them until they are more than m has of independent ones: the rank of m is that of
  // samples of it (Halko, Martinsson and Tropp 2011).
  static std::optional<Reduced> of_samples(const NullSpaceIteration& search, std::span<const Index> rows,
                                           bool transpose);

  // The rank of m, surely: zeros and others are far apart.
  [[nodiscard]] Index rank() const { return rank_; }
  // Null vectors of op(B) among all of them.
  [[nodiscard]] std::optional<Block> null_columns() const;
  // By which solutions of op(B) are corrected.
  [[nodiscard]] RankCorrection correction() const;
  // Those rows of E that depend on the others: all but so many as are independent on the other directions.
  [[nodiscard]] std::vector<Index> dependent() const;
  // Negative eigenvalues of a symmetric B on them (samples of a form have its inertia).
  [[nodiscard]] Index negative() const;

 private:
  Reduced(const NullSpaceIteration& search, std::span<const Index> rows, bool transpose);
  bool reduce();

  const NullSpaceIteration* search_;
  std::span<const Index> rows_;
  std::vector<Index> places_;  // these rows in the real space
  bool transpose_;
  Block z_{0, 0};  // columns of about 1
  Eigen::MatrixXd m_;
  Index rank_ = 0;
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr_;  // of m, or of random combinations of its rows
};

Reduced::Reduced(const NullSpaceIteration& search, std::span<const Index> rows, bool transpose)
    : search_(&search), rows_(rows), transpose_(transpose) {
  const Index parts = search.matrix().parts();
  for (const Index row : rows)
    for (Index part = 0; part < parts; ++part) places_.push_back(parts * row + part);
}

std::optional<Reduced> Reduced::of_all(const NullSpaceIteration& search, std::span<const Index> rows, bool transpose) {
  Reduced r(search, rows, transpose);
  Block unit(search.matrix().n(), static_cast<Index>(r.places_.size()));
  for (Index c = 0; c < unit.columns; ++c) unit.column(c)[r.places_[at(c)]] = 1;
  r.z_ = search.matrix().inverse(std::move(unit), transpose);
  if (!normalize(search.job().pool, r.z_) || !r.reduce()) return {};
  return r;
}

std::optional<Reduced> Reduced::of_samples(const NullSpaceIteration& search, std::span<const Index> rows,
                                           bool transpose) {
  constexpr Index kFirstSamples = 24, kMostSamples = 512, kSpare = 4;
  constexpr double kMostGrowth = 1e6;  // beside what has grown so far, others might not be seen
  const ScaledMatrix& b = search.matrix();
  base::ThreadPool& pool = search.job().pool;
  Reduced r(search, rows, transpose);
  const std::vector<Index>& places = r.places_;
  for (Index samples = kFirstSamples; samples < kMostSamples && at(samples) < places.size(); samples *= 2) {
    r.z_ = Block(b.n(), samples);
    for (Index c = 0; c < samples; ++c)
      for (std::size_t k = 0; k < places.size(); ++k)
        r.z_.column(c)[places[k]] = random_number(at(c) * places.size() + k);
    const double given = norm_two(pool, r.z_.column(0), b.n());
    r.z_ = b.inverse(std::move(r.z_), transpose);
    for (Index c = 0; c < samples; ++c) {
      const double length = norm_two(pool, r.z_.column(c), b.n());
      if (!(length * b.norm() <= kMostGrowth * given)) return {};
      divide(pool, r.z_.column(c), length, b.n());
    }
    if (!r.reduce()) return {};
    if (r.rank_ + kSpare <= samples) return r;
  }
  return {};
}

// m of Z, and its rank. @returns false where other rows do not vanish, or zeros and others are not far apart
bool Reduced::reduce() {
  constexpr double kNothing = 1e-10, kGap = 16;
  constexpr Eigen::Index kMore = 16;
  const ScaledMatrix& b = search_->matrix();
  Block y = b.product(z_, transpose_);
  m_.resize(static_cast<Eigen::Index>(places_.size()), y.columns);
  for (Index c = 0; c < y.columns; ++c) {
    for (std::size_t k = 0; k < places_.size(); ++k)
      m_(static_cast<Eigen::Index>(k), c) = std::exchange(y.column(c)[places_[k]], 0);
    for (Index i = 0; i < y.rows; ++i)
      if (!(std::abs(y.column(c)[i]) <= kNothing * b.norm())) return false;
  }
  const Eigen::Index few = m_.cols() + kMore;
  if (m_.rows() > 2 * few) {
    Eigen::MatrixXd mixed(few, m_.rows());
    for (Eigen::Index k = 0; k < mixed.size(); ++k) mixed.data()[k] = random_number(at(k));
    qr_.compute(mixed * m_ / std::sqrt(static_cast<double>(few)));
  } else {
    qr_.compute(m_);
  }
  const auto sizes = qr_.matrixR().diagonal().cwiseAbs();
  rank_ = static_cast<Index>((sizes.array() > search_->zero()).count());
  return rank_ == 0 || sizes(rank_ - 1) >= kGap * search_->zero();
}

std::optional<Block> Reduced::null_columns() const {
  const Index k = z_.columns;
  Eigen::MatrixXd combined(k, k - rank_);
  combined.bottomRows(k - rank_).setIdentity();
  combined.topRows(rank_) = -qr_.matrixR()
                                 .topLeftCorner(rank_, rank_)
                                 .triangularView<Eigen::Upper>()
                                 .solve(qr_.matrixR().topRightCorner(rank_, k - rank_));
  combined = qr_.colsPermutation() * combined;
  Block x(z_.rows, k - rank_);
  Eigen::Map<Eigen::MatrixXd>(x.values.data(), x.rows, x.columns) =
      Eigen::Map<const Eigen::MatrixXd>(z_.values.data(), z_.rows, k) * combined;
  if (x.columns > 0 && !search_->vanish(search_->matrix().product(x, transpose_), x)) return {};
  return x;
}

RankCorrection Reduced::correction() const {
  const Index n = z_.rows;
  RankCorrection c{places_, Block(static_cast<Index>(m_.rows()), rank_), Block(n, rank_)};
  using Map = Eigen::Map<Eigen::MatrixXd>;
  const auto chosen = qr_.colsPermutation().indices().head(rank_);
  const Eigen::HouseholderQR<Eigen::MatrixXd> range(m_(Eigen::all, chosen));
  Map(c.from.values.data(), m_.rows(), rank_) = range.householderQ() * Eigen::MatrixXd::Identity(m_.rows(), rank_);
  const Eigen::MatrixXd z = Eigen::Map<const Eigen::MatrixXd>(z_.values.data(), n, z_.columns)(Eigen::all, chosen);
  Map(c.to.values.data(), n, rank_) =
      range.matrixQR().topRows(rank_).triangularView<Eigen::Upper>().solve<Eigen::OnTheRight>(z);
  search_->matrix().to_caller(c, transpose_);
  return c;
}

std::vector<Index> Reduced::dependent() const {
  const auto without = [&](const auto& m, Index rank) {
    const Eigen::FullPivLU<std::decay_t<decltype(m)>> lu(m);
    std::vector<char> regular(rows_.size(), 0);
    for (Index k = 0; k < rank; ++k) regular[at(lu.permutationP().transpose().eval().indices()(k))] = 1;
    std::vector<Index> others;
    for (std::size_t k = 0; k < rows_.size(); ++k)
      if (regular[k] == 0) others.push_back(rows_[k]);
    std::sort(others.begin(), others.end());
    return others;
  };
  const Eigen::MatrixXd m = m_(Eigen::all, qr_.colsPermutation().indices().head(rank_));
  if (search_->matrix().parts() == 1) return without(m, rank_);
  Eigen::MatrixXcd complex(m.rows() / 2, m.cols());
  complex.real() = m(Eigen::seqN(0, m.rows() / 2, 2), Eigen::all);
  complex.imag() = m(Eigen::seqN(1, m.rows() / 2, 2), Eigen::all);
  return without(complex, rank_ / 2);
}

Index Reduced::negative() const {
  Eigen::MatrixXd z(m_.rows(), m_.cols());
  for (Index c = 0; c < z_.columns; ++c)
    for (std::size_t i = 0; i < places_.size(); ++i) z(static_cast<Eigen::Index>(i), c) = z_.column(c)[places_[i]];
  const Eigen::MatrixXd h = z.transpose() * m_;
  Eigen::VectorXd values =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>((h + h.transpose()) / 2, Eigen::EigenvaluesOnly).eigenvalues();
  std::sort(values.begin(), values.end(), [](double a, double b) { return std::abs(a) > std::abs(b); });
  return static_cast<Index>((values.head(rank_).array() < 0).count());
}

}  // namespace

std::optional<Deficiency> zeros_among_pivots(const DeficiencyJob& job, std::span<const Index> rows,
                                             std::span<const Index> columns) {
  constexpr double kMost = 0x1p37;  // a minute, for null vectors that are asked for
  const Index parts = base::parts_of(job.prepared.numbers);
  const double pivots = static_cast<double>(parts) * static_cast<double>(rows.size());
  const double work = job.prepared.n() * parts * pivots * pivots;
  const bool all = work <= job.vector_work;
  NullSpaceIteration search(job);
  if (rows.empty() || (all && work > kMost) || !search.surely_regular()) return {};
  search.prepare();
  const bool lu = job.kind == Kind::lu;
  const auto reduced = [&](std::span<const Index> places, bool transpose) {
    return all ? Reduced::of_all(search, places, transpose) : Reduced::of_samples(search, places, transpose);
  };
  const auto right = reduced(rows, false);
  if (!right) return {};
  const Index zeros = static_cast<Index>(pivots) - right->rank();
  if (zeros % parts != 0 || !agrees_with_dense(search, zeros)) return {};
  Deficiency found;
  found.smallest = 0;
  found.reduced = true;
  found.zeros = zeros / parts;
  if (job.kind == Kind::ldlt && !search.matrix().two_sided()) found.negative = right->negative() / parts;
  if (found.zeros == 0) return found;
  const auto left = lu ? reduced(columns, true) : std::nullopt;
  if (lu && (!left || left->rank() != right->rank())) return {};
  if (lu) found.corrections = {right->correction(), left->correction()};
  if (!all) {
    found.rows = right->dependent();
    if (lu) found.columns = left->dependent();
    return found;
  }
  std::optional<Block> null = right->null_columns();
  std::optional<Block> other = lu ? left->null_columns() : Block(search.matrix().n(), 0);
  if (!null || !other) return {};
  describe_all(search, 0, std::move(*null), std::move(*other), found);
  return found;
}

}  // namespace espalier::solver
