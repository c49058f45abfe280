#include "modes/quadratic.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "dense/dense.hpp"
#include "matrix/norms.hpp"
#include "modes/dense_quadratic.hpp"
#include "modes/pencil.hpp"
#include "modes/tall.hpp"

namespace espalier::modes {
namespace {

using Eigen::VectorXcd;
using Eigen::VectorXd;

constexpr double kGoodResidual = 1e-6;
constexpr Eigen::Index kFirstLook = 12;  // vectors, to see the size of eigenvalues
constexpr Index kDense = 150;            // rows up to which all eigenvalues are computed: some tenths of a second

std::size_t slot(Offset i) { return static_cast<std::size_t>(i); }

SparseMatrix sum_of(double alpha, const SparseMatrix& a, double beta, const SparseMatrix& b) {
  SparseMatrix out = sum(alpha, a, beta, b);
  out.storage = Storage::general;
  return out;
}

template <class Vector>
Vector product(const SparseMatrix& a, const Vector& x) {
  Vector y = Vector::Zero(a.rows);
  for (Index j = 0; j < a.cols; ++j)
    for (Offset p = a.col_ptr[slot(j)]; p < a.col_ptr[slot(j) + 1]; ++p)
      y[a.row_ind[slot(p)]] += a.values[slot(p)] * x[j];
  return y;
}

/// A little below zero: 1e-4 of a typical frequency.
double shift_below_zero(const SparseMatrix& k, const SparseMatrix& m) {
  std::vector<double> ratio;
  const auto diagonal = [](const SparseMatrix& a, Index j) {
    for (Offset p = a.col_ptr[slot(j)]; p < a.col_ptr[slot(j) + 1]; ++p)
      if (a.row_ind[slot(p)] == j) return std::abs(a.values[slot(p)]);
    return 0.0;
  };
  for (Index j = 0; j < k.cols; ++j)
    if (const double mass = diagonal(m, j), stiffness = diagonal(k, j); mass > 0 && stiffness > 0)
      ratio.push_back(stiffness / mass);
  if (ratio.empty()) return -1;
  std::nth_element(ratio.begin(), ratio.begin() + static_cast<std::ptrdiff_t>(ratio.size() / 2), ratio.end());
  return -1e-4 * std::sqrt(ratio[ratio.size() / 2]);
}

}  // namespace

QuadraticSearch::QuadraticSearch(const MatrixView& k, const MatrixView& c, const MatrixView& m,
                                 const QuadraticModesOptions& options, Resources& shop, QuadraticModesResult& result)
    : options_(options),
      shop_(shop),
      result_(result),
      k_(general_of(k, "K", shop.pool)),
      c_(general_of(c, "C", shop.pool)),
      m_(general_of(m, "M", shop.pool)),
      k_norm_(matrix::norm_inf(k_)),
      c_norm_(matrix::norm_inf(c_)),
      m_norm_(matrix::norm_inf(m_)),
      solver_(factor_options(options.solver, Kind::automatic)) {
  if (k_.rows != c_.rows || k_.rows != m_.rows)
    throw Error(StatusCode::invalid_input,
                fmt::format("K, C and M have {}, {} and {} rows; they must be of one size", k_.rows, c_.rows, m_.rows));
  if (options.count < 1) throw Error(StatusCode::invalid_input, "count: at least one eigenvalue must be asked for");
  if (k_.rows > kDense && options.count > k_.rows)
    throw Error(StatusCode::invalid_input,
                fmt::format("{} eigenvalues are asked for, of {} rows", options.count, k_.rows));
  if (std::isinf(options.shift) || !(options.tolerance > 0))
    throw Error(StatusCode::invalid_input, "shift and tolerance: give a finite number, and one greater than 0");
  result.n = k_.rows;
  shift_ = std::isnan(options.shift) ? shift_below_zero(k_, m_) : options.shift;
  result.shift = shift_;
}

void QuadraticSearch::factorize() {
  shifted_ = sum_of(1, c_, 2 * shift_, m_);
  const SparseMatrix q = sum_of(1, sum_of(1, k_, shift_, c_), shift_ * shift_, m_);
  Status status = solver_.analyze(q).status;
  if (status.ok()) status = solver_.factorize(q).status;
  if (status.code == StatusCode::singular)
    throw Error(status.code, fmt::format("Q({:g}) is singular: the shift is an eigenvalue, or rows depend on each "
                                         "other whatever the shift ({})",
                                         shift_, status.message));
  if (!status.ok()) throw Error(status);
  ++result_.factorizations;
}

void QuadraticSearch::apply(const VectorXd& z, VectorXd& out) {
  const Eigen::Index n = k_.rows;
  const VectorXd x = z.head(n), y = z.tail(n) * scale_;
  VectorXd b = -(product(shifted_, x) + product(m_, y));
  const Status status = solver_.solve({b.data(), slot(n)}, {b.data(), slot(n)}).status;
  if (!status.ok()) throw Error(status);
  ++result_.solved_columns;
  out.resize(2 * n);
  out.head(n) = b;
  out.tail(n) = x / scale_;
}

void QuadraticSearch::begin() {
  const Index n = k_.rows;
  VectorXd z(2 * n), image;
  randomize(shop_.pool, 2 * n, z.data(), 1, options_.seed);
  apply(z, image);  // without the directions of infinite eigenvalues
  basis_.resize(2 * n, 1);
  basis_.col(0) = image.normalized();
  h_.resize(0, 0);
  size_ = 0;
}

bool QuadraticSearch::expand(Eigen::Index columns) {
  basis_.conservativeResize(Eigen::NoChange, columns + 1);
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(columns + 1, columns);
  h.topLeftCorner(h_.rows(), h_.cols()) = h_;
  h_ = std::move(h);
  VectorXd w;
  for (; size_ < columns; ++size_) {
    shop_.interruption.check();
    apply(basis_.col(size_), w);
    const double before = w.norm();
    const auto known = basis_.leftCols(size_ + 1);
    for (int pass = 0; pass < 2; ++pass) {
      const VectorXd share = dense::transposed_times(known, w);
      w -= dense::times(known, share);
      h_.col(size_).head(size_ + 1) += share;
    }
    const double left = w.norm();
    if (!std::isfinite(left))
      throw Error(StatusCode::accuracy_not_reached, "the search met numbers that are not finite");
    if (left <= 1e-14 * before) {
      ++size_;
      return false;
    }
    h_(size_ + 1, size_) = left;
    basis_.col(size_ + 1) = w / left;
  }
  return true;
}

/// The size of the eigenvalues sought, from a few steps with an arbitrary one.
void QuadraticSearch::measure_scale() {
  scale_ = m_norm_ > 0 && k_norm_ > 0 ? std::sqrt(k_norm_ / m_norm_) : 1;
  for (int round = 0; round < 3; ++round) {
    begin();
    expand(std::min<Eigen::Index>(kFirstLook, 2 * k_.rows - 1));
    const double theta =
        dense::general_eigenvalues(Eigen::MatrixXd(h_.topLeftCorner(size_, size_))).cwiseAbs().maxCoeff();
    if (!(theta > 0)) return;
    scale_ = 1 / theta;
  }
}

double QuadraticSearch::residual(std::complex<double> l, const VectorXcd& x) const {
  const VectorXcd r = product(k_, x) + l * product(c_, x) + l * l * product(m_, x);
  const double a = std::abs(l);
  return r.norm() / ((a * a * m_norm_ + a * c_norm_ + k_norm_) * x.norm());
}

void QuadraticSearch::add(std::complex<double> l, VectorXcd x) {
  Eigen::Index largest = 0;
  x.cwiseAbs().maxCoeff(&largest);
  x *= std::conj(x[largest]) / (std::abs(x[largest]) * x.norm());
  result_.vectors.insert(result_.vectors.end(), x.data(), x.data() + x.size());
  result_.residuals.push_back(residual(l, x));
  result_.eigenvalues.push_back(l);  // last: where there is no memory for the others, it is no mode
}

void QuadraticSearch::deliver(const VectorXcd& theta, const Eigen::MatrixXcd& s,
                              const std::vector<Eigen::Index>& chosen) {
  for (const Eigen::Index k : chosen)
    add(shift_ + 1.0 / theta[k], dense::real_times_complex(basis_.topLeftCorner(k_.rows, size_), s.col(k)));
}

void QuadraticSearch::take_all() {
  const DenseQuadraticModes all = dense_quadratic_modes(dense_of(k_), dense_of(c_), dense_of(m_), shift_);
  result_.factorizations = 1;
  if (all.eigenvalues.size() == 0)
    throw Error(StatusCode::invalid_input, "there are no finite eigenvalues: C and M act on nothing that can move");
  for (Eigen::Index i = 0; i < std::min<Eigen::Index>(options_.count, all.eigenvalues.size()); ++i)
    add(all.eigenvalues[i], all.vectors.col(i));
  if (result_.count() < options_.count && all.unseen > 0)
    throw Error(
        StatusCode::accuracy_not_reached,
        fmt::format("{} of {} eigenvalues were found: {} lie so far from the shift that rounding hides them; seek "
                    "next to another shift",
                    result_.count(), options_.count, all.unseen));
}

bool QuadraticSearch::extract_ritz_pairs(bool last) {
  const dense::ComplexSpectrum eigen = dense::general_eigen(Eigen::MatrixXd(h_.topLeftCorner(size_, size_)));
  if (!eigen.converged) throw Error(StatusCode::accuracy_not_reached, "the QR algorithm did not converge");
  const VectorXcd& theta = eigen.values;
  const Eigen::MatrixXcd& s = eigen.vectors;
  const double coupling = h_.rows() > size_ ? h_(size_, size_ - 1) : 0;
  const double largest = theta.cwiseAbs().maxCoeff();
  std::vector<Eigen::Index> order(slot(size_)), chosen;
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  std::sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
    return std::pair(-std::abs(theta[a]), a) < std::pair(-std::abs(theta[b]), b);
  });
  bool good = true;
  for (const Eigen::Index k : order) {
    if (theta[k].imag() > 0 || !(std::abs(theta[k]) > 1e-13 * largest)) continue;  // l above the axis: theta below
    if (static_cast<Index>(chosen.size()) == options_.count) break;
    const double error = coupling * std::abs(s(size_ - 1, k)) / s.col(k).norm();
    if (error > options_.tolerance * std::abs(theta[k])) {
      good = false;
      break;
    }
    chosen.push_back(k);
  }
  const bool all = good && static_cast<Index>(chosen.size()) == options_.count;
  stage_.reach(static_cast<double>(chosen.size()));
  if (all || last) deliver(theta, s, chosen);
  return all;
}

void QuadraticSearch::search() {
  const Eigen::Index whole = 2 * Eigen::Index{k_.rows};
  const Eigen::Index most = std::min(
      whole - 1, options_.basis_size > 0 ? Eigen::Index{options_.basis_size} : 20 * Eigen::Index{options_.count} + 200);
  stage_.expect(options_.count);
  factorize();
  measure_scale();
  begin();
  bool found = false, grows = true;
  for (Eigen::Index columns = 2 * options_.count + 20; !found; columns += columns / 2) {
    columns = std::max<Eigen::Index>(1, std::min(columns, most));
    grows = expand(columns);
    found = extract_ritz_pairs(!grows || columns == most);
    if (!grows || columns == most) break;
  }
  if (!found && grows)
    throw Error(StatusCode::accuracy_not_reached,
                fmt::format("{} of {} eigenvalues were found with {} vectors; allow a larger basis, ask for fewer, or "
                            "seek next to another shift",
                            result_.count(), options_.count, size_));
}

void QuadraticSearch::run() {
  if (k_.rows <= kDense)
    take_all();
  else
    search();
  for (const double r : result_.residuals)
    if (!(r <= kGoodResidual)) throw Error(StatusCode::accuracy_not_reached, fmt::format("a residual is {:.1e}", r));
}

}  // namespace espalier::modes

namespace espalier {

QuadraticModesResult find_quadratic_modes(const MatrixView& k, const MatrixView& c, const MatrixView& m,
                                          const QuadraticModesOptions& options) {
  QuadraticModesResult result;
  modes::Resources shop(options.solver);
  result.status = modes::guarded(shop, [&] { modes::QuadraticSearch(k, c, m, options, shop, result).run(); });
  return result;
}

}  // namespace espalier
