#include "modes/dense_symmetric.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "dense/dense.hpp"
#include "espalier/types.hpp"

namespace espalier::modes {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSymmetricEpsilon = std::numeric_limits<double>::epsilon();

class ShiftedPencil {
 public:
  ShiftedPencil(const MatrixXd& k, const MatrixXd& m) : n_(m.rows()), border_(k.rows() - m.rows()) {
    scale_ = VectorXd::Ones(k.rows());
    for (Eigen::Index i = 0; i < n_; ++i) {
      if (!(m(i, i) > 0)) refuse_mass(i);
      scale_[i] = 1 / std::sqrt(m(i, i));
    }
    k_ = scale_.asDiagonal() * k * scale_.asDiagonal();
    for (Eigen::Index r = n_; r < k.rows(); ++r) {  // rows of constraints: of length one
      const double length = k_.row(r).norm();
      if (!(length > 0)) throw Error(StatusCode::singular, "a constraint holds nothing");
      k_.row(r) /= length;
      k_.col(r) /= length;
    }
    m_ = scale_.head(n_).asDiagonal() * m * scale_.head(n_).asDiagonal();
    std::optional<MatrixXd> factor = dense::cholesky(m_);
    if (!factor) refuse_mass(-1);
    l_ = std::move(*factor);
  }

  [[nodiscard]] Eigen::Index rows() const { return n_; }
  [[nodiscard]] Eigen::Index finite() const { return n_ - border_; }
  /// The estimate of the size of the largest eigenvalue.
  [[nodiscard]] double largest() const {
    const double norm = k_.topLeftCorner(n_, n_).cwiseAbs().rowwise().sum().maxCoeff();
    return norm > 0 ? norm : 1;
  }

  /// What one shift says of all eigenvalues, by their number in ascending order.
  struct Slice {
    VectorXd eigenvalues, errors;  ///< infinite where this shift does not see one
    MatrixXd vectors;              ///< of L^T (K - s M)^-1 L
  };

  /// @param known  eigenvalues by other shifts, ascending; empty: none
  [[nodiscard]] Slice slice(double shift, const VectorXd& known) const {
    MatrixXd a = k_;
    a.topLeftCorner(n_, n_) -= shift * m_;
    const VectorXd e = equilibrate(a);
    MatrixXd right = MatrixXd::Zero(a.rows(), n_);
    right.topRows(n_) = e.head(n_).asDiagonal() * l_;
    const MatrixXd solved = dense::Lu(a).solve(right);
    MatrixXd c = dense::transposed_times(l_, e.head(n_).asDiagonal() * solved.topRows(n_));
    c = ((c + c.transpose()) / 2).eval();
    if (!c.allFinite()) return {};  // on an eigenvalue
    const dense::Spectrum eigen = dense::symmetric_eigen(c);
    return ordered(shift, eigen.values, eigen.vectors, known);
  }

  /// x with x^T M x = 1, from a vector of a slice.
  [[nodiscard]] MatrixXd shapes(const MatrixXd& u) const {
    return scale_.head(n_).asDiagonal() * dense::solve_transposed_lower(l_, u);
  }
  /// By rounding of the entries of K; x as it comes from shapes().
  [[nodiscard]] double entry_rounding(const VectorXd& x) const {
    const VectorXd y = x.cwiseQuotient(scale_.head(n_)).cwiseAbs();
    return kSymmetricEpsilon / 2 * y.dot(dense::times(k_.topLeftCorner(n_, n_).cwiseAbs(), y).col(0));
  }

 private:
  [[noreturn]] static void refuse_mass(Eigen::Index i) {
    throw Error(StatusCode::invalid_input,
                fmt::format("the mass matrix is not positive definite{}: every unknown needs a mass",
                            i < 0 ? "" : fmt::format(", unknown {} has none", i)));
  }

  /// E A E with rows of about length one in the largest norm; the diagonal of E (D. Ruiz, RAL-TR-2001-034).
  static VectorXd equilibrate(MatrixXd& a) {
    VectorXd e = VectorXd::Ones(a.rows());
    for (int pass = 0; pass < 6; ++pass) {
      const VectorXd rows = a.cwiseAbs().rowwise().maxCoeff();
      const VectorXd f = rows.unaryExpr([](double v) { return v > 0 ? 1 / std::sqrt(v) : 1.0; });
      a = f.asDiagonal() * a * f.asDiagonal();
      e = e.cwiseProduct(f);
    }
    return e;
  }

  /// By number. theta = 1 / (l - s) falls as l rises on either side of the shift, from where l is far below it; what is
  /// rounding (infinite eigenvalues, those that are too far away) comes last.
  [[nodiscard]] Slice ordered(double shift, const VectorXd& theta, const MatrixXd& u, const VectorXd& known) const {
    const double norm = theta.cwiseAbs().maxCoeff();
    // No eigenvalue is that much larger than the stiffnesses over their masses: it is an infinite one, of a constraint.
    constexpr double kFar = 1e10;
    const double nothing = std::max(10 * kSymmetricEpsilon * static_cast<double>(n_) * norm, 1 / (kFar * largest()));
    std::vector<Eigen::Index> seen;
    for (Eigen::Index i = 0; i < theta.size(); ++i)
      if (std::abs(theta[i]) > nothing) seen.push_back(i);
    std::sort(seen.begin(), seen.end(), [&](Eigen::Index a, Eigen::Index b) {
      return std::pair(theta[a] > 0, -theta[a]) < std::pair(theta[b] > 0, -theta[b]);
    });
    const Eigen::Index first = (known.array() < shift - 1 / nothing).count();  // too far below to be seen
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    Slice s{VectorXd::Constant(finite(), kInfinity), VectorXd::Constant(finite(), kInfinity),
            MatrixXd::Zero(n_, finite())};
    for (std::size_t j = 0; j < seen.size(); ++j) {
      const Eigen::Index number = first + static_cast<Eigen::Index>(j);
      if (number >= finite()) break;
      const double t = theta[seen[j]];
      s.eigenvalues[number] = shift + 1 / t;
      s.errors[number] = 8 * kSymmetricEpsilon * norm / (t * t);
      s.vectors.col(number) = u.col(seen[j]);
    }
    return s;
  }

  Eigen::Index n_, border_;
  VectorXd scale_;
  MatrixXd k_, m_, l_;
};

/// What some shifts have found, each group of near eigenvalues by the one that gives it best: the directions of modes
/// that share a frequency are those of one shift.
class Spectrum {
 public:
  explicit Spectrum(const ShiftedPencil& pencil) : pencil_(pencil) {
    const Eigen::Index count = pencil.finite();
    values_ = errors_ = VectorXd::Constant(count, std::numeric_limits<double>::infinity());
  }

  /// Down to the lowest eigenvalues that are more than rounding, also of the entries: below that every shift is as good
  /// as zero, and its factors are those of a singular matrix.
  void descend() {
    constexpr double kResolved = 1e3, kNear = 1e-2, kBeyondEntries = 10;
    double distance = pencil_.largest();
    for (bool lower = true; lower;) {
      add_slice(-distance);
      double least = distance;
      const ShiftedPencil::Slice& s = slices_.back();
      const MatrixXd x = pencil_.shapes(s.vectors);
      for (Eigen::Index i = 0; i < values_.size(); ++i) {
        const double size = std::abs(s.eigenvalues[i]);
        if (size < least && size > kResolved * s.errors[i] && size > kBeyondEntries * pencil_.entry_rounding(x.col(i)))
          least = size;
      }
      lower = least < kNear * distance;
      distance = least;
    }
    noise_ = distance / 2;
  }

  /// Up again, until `count` are as good as they can be.
  void ascend(Eigen::Index count) {
    constexpr double kGood = 1e-12;
    for (Eigen::Index i = 0; i < std::min(count, values_.size()); ++i)
      if (values_[i] > noise_ && errors_[i] > kGood * values_[i]) add_slice(gap_near(i));
  }

  [[nodiscard]] DenseModes modes() const {
    DenseModes out{values_, pencil_.shapes(orthonormal(gathered())), errors_};
    for (Eigen::Index i = 0; i < values_.size(); ++i)
      out.rounding[i] = std::max(errors_[i], pencil_.entry_rounding(out.vectors.col(i)));
    return out;
  }

 private:
  void add_slice(double shift) {
    ShiftedPencil::Slice s = pencil_.slice(shift, values_);
    for (int attempt = 0; s.errors.size() == 0 && attempt < 3; ++attempt) s = pencil_.slice(shift *= 1 + 1e-3, values_);
    if (s.errors.size() == 0)
      throw Error(StatusCode::singular, "K - s M is singular for every s: constraints depend on each other");
    for (Eigen::Index i = 0; i < s.errors.size(); ++i) {
      if (!(s.errors[i] < errors_[i])) continue;
      values_[i] = s.eigenvalues[i];
      errors_[i] = s.errors[i];
    }
    slices_.push_back(std::move(s));
  }

  /// Columns by number, of each group from the shift whose largest error in it is least.
  [[nodiscard]] MatrixXd gathered() const {
    constexpr double kTogether = 1e-3;
    MatrixXd vectors = MatrixXd::Zero(pencil_.rows(), values_.size());
    for (Eigen::Index first = 0, end = 0; first < values_.size(); first = end) {
      for (end = first + 1; end < values_.size(); ++end) {
        const double gap = values_[end] - values_[end - 1],
                     size = std::max(std::abs(values_[end]), std::abs(values_[end - 1]));
        if (gap > kTogether * size && gap > 10 * (errors_[end] + errors_[end - 1])) break;
      }
      const auto error = [&](const ShiftedPencil::Slice& s) { return s.errors.segment(first, end - first).maxCoeff(); };
      const auto best = std::min_element(slices_.begin(), slices_.end(),
                                         [&](const auto& a, const auto& b) { return error(a) < error(b); });
      vectors.middleCols(first, end - first) = best->vectors.middleCols(first, end - first);
    }
    return vectors;
  }

  /// Orthogonal to each other also across shifts; those that are known best, in parts of themselves, stay.
  [[nodiscard]] MatrixXd orthonormal(const MatrixXd& vectors) const {
    std::vector<Eigen::Index> order(static_cast<std::size_t>(values_.size()));
    std::iota(order.begin(), order.end(), Eigen::Index{0});
    const auto part = [&](Eigen::Index i) { return errors_[i] / std::max(std::abs(values_[i]), 1e-300); };
    std::stable_sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) { return part(a) < part(b); });
    const dense::QrFactors qr = dense::qr_factors(vectors(Eigen::all, order));
    MatrixXd out(vectors.rows(), vectors.cols());
    for (Eigen::Index j = 0; j < out.cols(); ++j)
      out.col(order[static_cast<std::size_t>(j)]) = (qr.r(j, j) < 0 ? -1.0 : 1.0) * qr.q.col(j);
    return out;
  }

  /// The middle of the widest gap next to an eigenvalue, in parts of what lies above it.
  [[nodiscard]] double gap_near(Eigen::Index i) const {
    constexpr Eigen::Index kNeighbours = 8;
    double best = values_[i] / 2, widest = 0;
    for (Eigen::Index j = std::max<Eigen::Index>(0, i - kNeighbours); j < std::min(values_.size() - 1, i + kNeighbours);
         ++j) {
      const double below = std::max(values_[j], 0.0), above = values_[j + 1];
      if (!(above > noise_) || std::isinf(above) || (above - below) / above <= widest) continue;
      widest = (above - below) / above;
      best = below + (above - below) / 2;
    }
    return best;
  }

  const ShiftedPencil& pencil_;
  VectorXd values_, errors_;  // the best of all shifts
  double noise_ = 0;          // eigenvalues up to that are rounding
  std::vector<ShiftedPencil::Slice> slices_;
};

}  // namespace

DenseModes dense_modes(const MatrixXd& k, const MatrixXd& m, Eigen::Index accurate) {
  const ShiftedPencil pencil(k, m);
  if (pencil.finite() <= 0) return {};
  Spectrum spectrum(pencil);
  spectrum.descend();
  spectrum.ascend(accurate);
  return spectrum.modes();
}

}  // namespace espalier::modes
