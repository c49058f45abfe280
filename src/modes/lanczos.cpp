#include "modes/lanczos.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "base/stopwatch.hpp"
#include "dense/dense.hpp"

namespace espalier::modes {

namespace {

using base::Stopwatch;
using Vector = Eigen::VectorXd;

constexpr double kEps = std::numeric_limits<double>::epsilon();
// Rounding of the operator is of the size of its largest eigenvalue: of one that is this part of it two or three digits
// more are right than are asked for.
constexpr double kSmallest = 1e-7;
constexpr double kSettled = 1e-3;

}  // namespace

// Eigenvalues of T and their residuals: negative ones from the smallest, positive ones from the largest.
struct Lanczos::Ritz {
  Vector theta;
  Dense vectors;
  Vector residual;
  std::vector<Index> negative, positive;       // columns, from the end of the spectrum inwards
  Index good_negative = 0, good_positive = 0;  // converged, unbroken from the end
};

Lanczos::Lanczos(const SpectralOperator& op, const Workspace& space, Index known, base::ThreadPool& pool,
                 LanczosClock& clock)
    : op_(op), space_(space), known_(known), pool_(pool), clock_(clock) {}

LanczosResult Lanczos::run(const LanczosOptions& options) {
  options_ = options;
  options_.block = std::min({options.block, space_.block, std::max<Index>(1, options.dimension)});
  capacity_ = std::min<Index>(space_.columns - known_ - options_.block, options_.dimension);
  // Moved in: where there is no memory for another size, Eigen leaves one that is assigned to with what it has freed.
  t_ = Dense(Dense::Zero(capacity_ + options_.block, capacity_ + options_.block));
  coupling_.resize(0, 0);
  j_ = 0;
  still_ = 0;
  Index width = begin();
  if (width == 0) {  // in what is left beside known vectors there may be nothing more
    if (known_ > 0) return result(Ritz{}, true);
    throw Error(StatusCode::accuracy_not_reached,
                fmt::format("nothing is left of a random vector in the product with {} and the solution after it: the "
                            "matrices are too badly scaled, or the shift is too far from all eigenvalues",
                            op_.inner));
  }
  Index look = std::max<Index>(options_.block, options_.wanted.negative + options_.wanted.positive);
  for (;;) {
    pool_.check();
    if (width > 0) width = expand(width);
    const bool full = j_ + width > capacity_, exhausted = width == 0;
    if (j_ < look && !full && !exhausted) continue;
    const Ritz now = ritz(width);
    if (options_.converged)
      options_.converged(std::min(now.good_negative, options_.wanted.negative) +
                         std::min(now.good_positive, options_.wanted.positive));
    look = j_ + std::max(options_.block, j_ / 12);
    if (exhausted || enough(now) || stalled(now) || restarts_ >= options_.restarts) return result(now, exhausted);
    if (!full) continue;
    restart(now, width);
    ++restarts_;
    look = j_ + 2 * options_.block;
  }
}

// Random vectors through OP twice: what belongs to infinite eigenvalues, Jordan blocks of two (rows of constraints)
// included, is gone (K. Meerbergen, A. Spence, "Implicitly restarted Arnoldi with purification for the shift-invert
// transformation", Math. Comp. 66, 1997).
Index Lanczos::begin() { return new_directions(0, options_.block); }

Index Lanczos::new_directions(Index columns, Index width) {
  constexpr int kTimes = 2;
  for (int attempt = 0; attempt < 3; ++attempt) {
    double* w = v(columns);
    space_.blocks.randomize(w, width, options_.seed + 977 * draws_++);
    for (int k = 0; k < kTimes; ++k) {
      const auto& by = op_.a ? op_.a : op_.b;
      by(w, space_.image, width);
      op_.solve(space_.image, w, width);
      clock_.columns += width;
      // By powers of two, which change no digit: of eigenvalues near 1e-70 the squares of OP are beyond all numbers.
      const Vector size = space_.blocks.gram(w, width, w, width).diagonal().cwiseSqrt();
      const Dense scale =
          size.unaryExpr([](double x) { return x > 0 && std::isfinite(x) ? std::exp2(-std::ilogb(x)) : 1; })
              .asDiagonal();
      space_.blocks.combine(w, scale, w);
    }
    if (const Index left = orthonormalize(columns, width, nullptr, nullptr); left > 0) return left;
  }
  return 0;
}

// The images of the `width` columns after the j_ first ones, whose products with B are in image_; returns how many
// new directions they bring.
Index Lanczos::expand(Index width) {
  double* w = v(j_ + width);
  {
    const Stopwatch watch(clock_.solves);
    if (op_.a) op_.a(v(j_), space_.image, width);
    op_.solve(space_.image, w, width);
    clock_.columns += width;
  }
  Dense h, r;
  const Index before = j_ + width;
  Index next = orthonormalize(before, width, &h, &r);
  t_.block(0, j_, before, width) = h;
  t_.block(j_, 0, width, before) = h.transpose();
  const Dense corner = t_.block(j_, j_, width, width);
  t_.block(j_, j_, width, width) = (corner + corner.transpose()) / 2;
  j_ = before;
  const Index room = options_.dimension - j_;
  coupling_ = Dense(Dense::Zero(next, before));
  if (next > 0) coupling_.rightCols(width) = r;
  if (next == 0 && room > 0) {  // an invariant subspace: another one may hold more
    next = new_directions(j_, std::min(options_.block, room));
    coupling_ = Dense(Dense::Zero(next, j_));
  }
  return next;
}

// Makes the `width` columns after `columns` B-orthonormal, among themselves and to those before and to those known:
// W = V H + Q R. Classical Gram-Schmidt by blocks, again until nothing changes (L. Giraud, J. Langou, M. Rozloznik,
// "The loss of orthogonality in the Gram-Schmidt orthogonalization process", Comput. Math. Appl. 50, 2005). A direction
// that is rounding serves as well as another, as long as it can be made orthogonal; else it is dropped. Returns how
// many are left; image_ then holds B Q.
Index Lanczos::orthonormalize(Index columns, Index width, Dense* h, Dense* r) {
  constexpr int kMostPasses = 8;
  const Index room = options_.dimension - columns;  // what is left beyond is rounding
  const Stopwatch watch(clock_.orthogonalization);
  double* w = v(columns);
  double* image = space_.image;
  if (h != nullptr) *h = Dense::Zero(columns, width);
  Dense total = Dense::Identity(width, width);
  double size = 0;  // of the columns as they came
  Index left = width;
  bool settled = false, rough = true;
  for (int pass = 0; pass < kMostPasses && left > 0 && !settled; ++pass) {
    if (rough) op_.b(w, image, left);
    if (pass == 0) {
      size = std::sqrt(space_.blocks.gram(w, left, image, left).diagonal().cwiseAbs().maxCoeff());
    }
    const Dense all = space_.blocks.gram(space_.basis, known_ + columns, image, left);
    space_.blocks.subtract(space_.basis, all, w);
    if (h != nullptr) *h += dense::times(all.bottomRows(columns), total);
    op_.b(w, image, left);
    Dense step;
    left = independent(w, image, left, {size, room, pass == 0, pass + 1 == kMostPasses}, total, step);
    // Small differences of large numbers: the image has lost digits on the way.
    rough = step.size() > 0 && step.rowwise().norm().minCoeff() < 1e-2 * step.rowwise().norm().maxCoeff();
    // What had to be taken away was so little that rounding of it is below that of the vectors.
    settled = pass > 0 && step.rows() == step.cols() && (all.size() == 0 || all.cwiseAbs().maxCoeff() < kSettled) &&
              (step - Dense::Identity(left, left)).cwiseAbs().maxCoeff() < kSettled;
  }
  if (r != nullptr) *r = total;
  return left;
}

// One step to W = Q R by the eigenvectors of W^T B W, small eigenvalues raised: what was small is larger afterwards,
// and orthonormal after some steps; what is rounding becomes ever less. Columns are scaled in the first step alone,
// lest rounding be mixed with the others (A. Stathopoulos, K. Wu, "A block orthogonalization procedure with constant
// synchronization requirements", SIAM J. Sci. Comput. 23, 2002). Q stands in the first columns of w, B Q in those of
// `image`; `total` becomes R total. Directions that are nothing in W are dropped, after the last step those that are
// not orthonormal.
Index Lanczos::independent(double* w, double* image, Index width, const Dropping& dropping, Dense& total, Dense& r) {
  constexpr double kRaised = 1e-12, kRounding = 64 * kEps, kNegative = 1e-8;
  const Dense g = space_.blocks.gram(w, width, image, width);
  const Vector weights = op_.weights(w, width);
  Vector scale = Vector::Zero(width), unscale = Vector::Zero(width);
  for (Index k = 0; k < width; ++k) {
    if (!std::isfinite(g(k, k)) || g(k, k) < -kNegative * weights[k])
      throw Error(StatusCode::invalid_input,
                  fmt::format("{} is not positive semi-definite, or a number is not finite: x^T {} x = {:.3g} for a "
                              "vector x of the search",
                              op_.inner, op_.inner, g(k, k)));
    if (g(k, k) <= kRounding * weights[k]) continue;  // in the null space of B
    unscale[k] = dropping.first ? std::sqrt(g(k, k)) : 1;
    scale[k] = 1 / unscale[k];
  }
  const dense::Spectrum eigen =
      dense::symmetric_eigen(Dense(scale.asDiagonal() * ((g + g.transpose()) / 2) * scale.asDiagonal()));
  const Dense u = eigen.vectors.rowwise().reverse();  // what counts most comes first
  const Vector values = eigen.values.reverse(), root = values.cwiseMax(kRaised).cwiseSqrt();
  Dense to_q = scale.asDiagonal() * u * root.cwiseInverse().asDiagonal();
  Dense from_q = root.asDiagonal() * u.transpose() * unscale.asDiagonal();
  if (values[width - 1] > 0.5 &&
      width <= dropping.room) {  // the polar factor: near the identity where W is nearly orthonormal already
    to_q = dense::times(to_q, u.transpose());
    from_q = dense::times(u, from_q);
  }
  const Dense next = dense::times(from_q, total);
  std::vector<Index> kept;
  for (Index k = 0; k < std::min(width, dropping.room); ++k)
    if ((!dropping.last || values[k] > 0.5) && next.row(k).norm() > 1e-3 * kEps * dropping.size) kept.push_back(k);
  total = next(kept, Eigen::all);
  r = from_q(kept, Eigen::all);
  const Dense chosen = to_q(Eigen::all, kept);
  space_.blocks.combine(w, chosen, w);
  space_.blocks.combine(image, chosen, image);
  return static_cast<Index>(kept.size());
}

Lanczos::Ritz Lanczos::ritz(Index width) const {
  Ritz out;
  dense::Spectrum eigen = dense::symmetric_eigen(Dense(t_.topLeftCorner(j_, j_)));
  out.theta = std::move(eigen.values);
  out.vectors = std::move(eigen.vectors);
  out.residual = Vector::Zero(j_);
  if (width > 0 && coupling_.rows() > 0)
    out.residual = dense::times(coupling_, out.vectors).colwise().norm().transpose();
  const double least = kSmallest * out.theta.cwiseAbs().maxCoeff();
  for (Index k = 0; k < j_ && out.theta[k] < -least; ++k) out.negative.push_back(k);
  for (Index k = j_; k-- > 0 && out.theta[k] > least;) out.positive.push_back(k);
  const auto good = [&](const std::vector<Index>& side) {
    const auto bad = std::find_if(side.begin(), side.end(), [&](Index k) {
      return !(out.residual[k] <= options_.tolerance * std::abs(out.theta[k]));
    });
    return static_cast<Index>(bad - side.begin());
  };
  out.good_negative = good(out.negative);
  out.good_positive = good(out.positive);
  return out;
}

bool Lanczos::enough(const Ritz& ritz) const {
  return ritz.good_negative >= options_.wanted.negative && ritz.good_positive >= options_.wanted.positive;
}

// Nothing is left to converge of what is large enough, and nothing comes up: the others are too far from the shift.
bool Lanczos::stalled(const Ritz& ritz) {
  constexpr int kLooks = 4;
  const Index good = ritz.good_negative + ritz.good_positive;
  const bool all = good == static_cast<Index>(ritz.negative.size() + ritz.positive.size());
  still_ = all && good == last_good_ ? still_ + 1 : 0;
  last_good_ = good;
  return still_ >= kLooks;
}

// Keeps the Ritz vectors that are wanted and about half of the others, from both ends as they are wanted; OP times them
// is known (Wu, Simon).
void Lanczos::restart(const Ritz& ritz, Index width) {
  const Wanted& wanted = options_.wanted;
  const Index most = capacity_ - std::max(2 * options_.block, capacity_ / 4);
  const auto share = [&](Index side, Index other) {
    return side == 0 ? Index{0} : static_cast<Index>(static_cast<std::int64_t>(most) * side / (side + other));
  };
  Index negative = std::min<Index>(static_cast<Index>(ritz.negative.size()), share(wanted.negative, wanted.positive));
  Index positive = std::min<Index>(static_cast<Index>(ritz.positive.size()), share(wanted.positive, wanted.negative));
  negative = std::max(negative, std::min(ritz.good_negative, most - positive));
  std::vector<Index> kept(ritz.negative.begin(), ritz.negative.begin() + negative);
  kept.insert(kept.end(), ritz.positive.begin(), ritz.positive.begin() + positive);
  const auto p = static_cast<Index>(kept.size());
  Dense s(j_, p);
  for (Index k = 0; k < p; ++k) s.col(k) = ritz.vectors.col(kept[static_cast<std::size_t>(k)]);
  space_.blocks.combine(v(0), s, v(0));
  space_.blocks.copy(v(j_), v(p), width);  // p < j_: from the left to the left
  coupling_ = dense::times(coupling_, s);
  t_.setZero();
  for (Index k = 0; k < p; ++k) t_(k, k) = ritz.theta[kept[static_cast<std::size_t>(k)]];
  j_ = p;
}

LanczosResult Lanczos::result(const Ritz& ritz, bool exhausted) const {
  LanczosResult out;
  out.found = {ritz.good_negative, ritz.good_positive};
  out.restarts = restarts_;
  out.exhausted = exhausted;
  out.combination.resize(j_, out.found.negative + out.found.positive);
  const auto take = [&](const std::vector<Index>& side, Index count, double& next) {
    for (Index k = 0; k < count; ++k) {
      const Index at = side[static_cast<std::size_t>(k)];
      out.combination.col(static_cast<Index>(out.theta.size())) = ritz.vectors.col(at);
      out.theta.push_back(ritz.theta[at]);
      out.residual.push_back(ritz.residual[at]);
    }
    if (static_cast<std::size_t>(count) < side.size()) next = ritz.theta[side[static_cast<std::size_t>(count)]];
  };
  take(ritz.negative, out.found.negative, out.next_negative);
  take(ritz.positive, out.found.positive, out.next_positive);
  return out;
}

}  // namespace espalier::modes
