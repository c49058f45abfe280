#include "solver/deficiency/dense.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "solver/deficiency/description.hpp"

namespace espalier::solver {

namespace {

// All of B, column by column.
Eigen::MatrixXd dense(const ScaledMatrix& b) {
  const Index n = b.n();
  Block unit(n, n);
  for (Index k = 0; k < n; ++k) unit.column(k)[k] = 1;
  const Block columns = b.product(unit, false);
  return Eigen::Map<const Eigen::MatrixXd>(columns.values.data(), n, n);
}

Block block_of(const Eigen::MatrixXd& m) {
  Block x(static_cast<Index>(m.rows()), static_cast<Index>(m.cols()));
  Eigen::Map<Eigen::MatrixXd>(x.values.data(), m.rows(), m.cols()) = m;
  return x;
}

// diag(row) B diag(col), in units that do not depend on those of B's rows and columns (Curtis and Reid 1972, by
// sweeps), with the norm of B. What one scaling leaves next to nothing, another may show.
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

// What a matrix takes to nothing, by Q R of its transpose with interchanges: the last columns of Q.
// @returns nothing where they are more than `most`, or where R's leading triangle is not surely regular
std::optional<Eigen::MatrixXd> null_space(const Eigen::MatrixXd& transposed, double zero, Eigen::Index most) {
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(transposed);
  const Eigen::Index n = transposed.rows();
  const Eigen::Index rank = (qr.matrixR().diagonal().cwiseAbs().array() > zero).count();
  if (n - rank > most) return {};
  const Eigen::MatrixXd inverse = qr.matrixR()
                                      .topLeftCorner(rank, rank)
                                      .triangularView<Eigen::Upper>()
                                      .solve(Eigen::MatrixXd::Identity(rank, rank));
  if (!(inverse.norm() * zero < 1)) return {};
  Eigen::MatrixXd last = Eigen::MatrixXd::Zero(n, n - rank);
  last.bottomRows(n - rank).setIdentity();
  return qr.householderQ() * last;
}

// What op(B) takes to nothing, by whichever scaling proves the higher rank. @param symmetric  B is, and stays so
// @returns nothing where its rank is not proven
std::optional<Block> null_columns(const NullSpaceIteration& search, const Eigen::MatrixXd& b, bool symmetric,
                                  bool transpose) {
  const auto op = [transpose](const Eigen::MatrixXd& m) { return transpose ? Eigen::MatrixXd(m.transpose()) : m; };
  std::optional<Block> best;
  if (const auto null = null_space(op(b).transpose(), search.zero(), b.rows())) {
    Block x = block_of(*null);
    if (x.columns == 0 || search.vanish(search.matrix().product(x, transpose), x)) best = std::move(x);
  }
  if (best && best->columns == 0) return best;
  const Balanced other = balanced(b, symmetric);
  if (!other.b.allFinite()) return best;
  std::optional<Eigen::MatrixXd> null =
      null_space(op(other.b).transpose(), search.zero(), best ? best->columns - 1 : b.rows());
  if (!null || ((op(other.b) * *null).colwise().norm().array() > search.zero()).any()) return best;
  *null = (transpose ? other.row : other.col).asDiagonal() * *null;
  return block_of(null->colwise().normalized());
}

// The negative eigenvalues of a symmetric matrix. @returns nothing where so many zeros are not among its eigenvalues,
// by either scaling
std::optional<Index> negative_eigenvalues_of(const Eigen::MatrixXd& b, Index zeros, double zero) {
  const auto values_of = [](const Eigen::MatrixXd& m) -> Eigen::VectorXd {
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(m, Eigen::EigenvaluesOnly).eigenvalues();
  };
  const auto zeros_in = [zero](const Eigen::VectorXd& x) { return (x.array().abs() <= zero).count(); };
  Eigen::VectorXd values = values_of(b);
  if (zeros_in(values) != zeros) values = values_of(balanced(b, true).b);
  if (zeros_in(values) != zeros) return {};
  return static_cast<Index>((values.array() < -zero).count());
}

}  // namespace

bool agrees_with_dense(const NullSpaceIteration& search, Index zeros) {
  if (search.matrix().n() > kCheapDense) return true;
  const Eigen::MatrixXd b = dense(search.matrix());
  if (!b.allFinite()) return true;
  const bool symmetric = search.job().kind == Kind::ldlt && !search.matrix().two_sided();
  const std::optional<Block> truth = null_columns(search, b, symmetric, false);
  return !truth || truth->columns == zeros;
}

std::optional<Deficiency> zeros_of_dense(const DeficiencyJob& job) {
  constexpr Index kMost = 1024;  // a second or two
  const Index parts = base::parts_of(job.prepared.numbers);
  if (parts * job.prepared.n() > kMost) return {};
  NullSpaceIteration search(job);
  search.prepare();
  if (!(search.zero() > 0) || !std::isfinite(search.zero())) return {};
  const Eigen::MatrixXd b = dense(search.matrix());
  if (!b.allFinite()) return {};
  const bool symmetric = job.kind == Kind::ldlt && !search.matrix().two_sided();
  std::optional<Block> null = null_columns(search, b, symmetric, false);
  if (!null || null->columns % parts != 0) return {};
  Deficiency found;
  found.smallest = 0;
  found.reduced = found.dense = true;
  found.zeros = null->columns / parts;
  if (symmetric) {
    const std::optional<Index> negative = negative_eigenvalues_of(b, null->columns, search.zero());
    if (!negative) return {};
    found.negative = *negative / parts;
  }
  if (found.zeros == 0) return found;
  Block left(search.matrix().n(), 0);
  if (job.kind == Kind::lu) {
    std::optional<Block> other = null_columns(search, b, false, true);
    if (!other || other->columns != null->columns) return {};
    left = std::move(*other);
  }
  describe_all(search, 0, std::move(*null), std::move(left), found);
  return found;
}

}  // namespace espalier::solver
