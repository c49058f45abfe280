#include "dynamics/integrators/vibrations.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/at.hpp"
#include "dense/dense.hpp"
#include "dynamics/integrators/linearised.hpp"
#include "modes/dense_quadratic.hpp"
#include "modes/dense_symmetric.hpp"

namespace espalier::dynamics {

namespace {

// X^T A X.
Eigen::MatrixXd projected(const SparseMatrix& a, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd ax = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  for (Eigen::Index c = 0; c < x.cols(); ++c)
    for (Index j = 0; j < a.cols; ++j)
      for (Offset k = a.col_ptr[at(j)]; k < a.col_ptr[at(j) + 1]; ++k)
        ax(a.row_ind[at(k)], c) += a.values[at(k)] * x(j, c);
  return x.transpose() * ax;
}

std::vector<double> real_shape(const Eigen::VectorXcd& x) {
  Eigen::Index at = 0;
  const double largest = x.size() > 0 ? x.cwiseAbs().maxCoeff(&at) : 0.0;
  std::vector<double> shape(static_cast<std::size_t>(x.size()), 0.0);
  if (!(largest > 0)) return shape;
  const std::complex<double> turn = 1.0 / x[at];
  for (std::size_t i = 0; i < shape.size(); ++i) shape[i] = (turn * x[static_cast<Eigen::Index>(i)]).real();
  return shape;
}

Mode vibration_of(std::complex<double> e, const Eigen::VectorXcd& shape) {
  const double modulus = std::abs(e);
  return {e, std::abs(e.imag()) / (2 * std::numbers::pi), modulus > 0 ? -e.real() / modulus : 0.0, real_shape(shape)};
}

SparseMatrix magnitudes(SparseMatrix a) {
  for (double& v : a.values) v = std::abs(v);
  return a;
}

/// (A - A^T) / 2, without what is rounding of sums.
SparseMatrix skew_part(const SparseMatrix& a) {
  constexpr double kRounding = 1e-11;
  const auto entry = [&](Index i, Index j) {
    const auto first = a.row_ind.begin() + a.col_ptr[at(j)], end = a.row_ind.begin() + a.col_ptr[at(j) + 1];
    const auto found = std::lower_bound(first, end, i);
    return found != end && *found == i ? a.values[static_cast<std::size_t>(found - a.row_ind.begin())] : 0.0;
  };
  std::vector<double> diagonal;
  for (Index j = 0; j < a.cols; ++j) diagonal.push_back(std::sqrt(std::abs(entry(j, j))));
  SparseMatrix out = a;
  for (Index j = 0; j < a.cols; ++j)
    for (Offset k = a.col_ptr[at(j)]; k < a.col_ptr[at(j) + 1]; ++k) {
      const Index i = a.row_ind[at(k)];
      const double half = 0.5 * (a.values[at(k)] - entry(j, i));
      out.values[at(k)] = std::abs(half) <= kRounding * diagonal[at(i)] * diagonal[at(j)] ? 0 : half;
    }
  return out;
}

/// The system in coordinates z of undamped modes x = X z: z'' + D z' + (diag(l) + N) z = 0.
struct ModalSystem {
  Eigen::VectorXd l;         ///< 0 where rounding leaves nothing else
  Eigen::VectorXd rounding;  ///< of l
  Eigen::MatrixXd x, d, n;   ///< N is skew: what is not symmetric of the stiffness
  Eigen::MatrixXd h;         ///< structural damping; without rows: none
  std::string notice;
};

// All modes of a dense system, or `count` of a large one.
void find_undamped(Equations& equations, const TangentMatrices& a, Index count, const Options* solver,
                   ModalSystem& out) {
  const std::vector<Index> rows = kept_constraints(equations);
  const SparsePattern& phi = equations.system().constraint_pattern();
  const SparseMatrix k = bordered(a.stiffness, phi, equations.phi_q(), rows);
  const Index n = a.mass.cols;
  if (solver == nullptr) {
    Eigen::MatrixXd whole = espalier::modes::dense_of(k);
    whole = whole.selfadjointView<Eigen::Lower>();
    const Eigen::MatrixXd m = espalier::modes::dense_of(a.mass);
    const modes::DenseModes found = modes::dense_modes(whole, (m + m.transpose()) / 2, count);
    out.l = found.eigenvalues;
    out.x = found.vectors;
    out.rounding = found.rounding;
    return;
  }
  ModesOptions options;
  options.count = count;
  options.solver = *solver;
  const ModesResult found = find_modes(k, bordered(a.mass, phi, {}, rows), options);
  if (!found.status.ok()) throw Error(found.status.code, "initial.modes: " + found.status.message);
  if (!found.complete) out.notice = "initial.modes: " + found.completeness;
  out.l = Eigen::Map<const Eigen::VectorXd>(found.eigenvalues.data(), found.count());
  out.x = Eigen::Map<const Eigen::MatrixXd>(found.vectors.data(), found.n, found.count()).topRows(n);
  out.rounding =
      0.5 * std::numeric_limits<double>::epsilon() * projected(magnitudes(a.stiffness), out.x.cwiseAbs()).diagonal();
}

ModalSystem modal_system(Equations& equations, const State& state, Index count, const Options* solver) {
  constexpr double kRounding = 4;
  const TangentMatrices a = tangent_matrices(equations.system(), state);
  equations.evaluate_constraints(state.t, state.q, {});
  ModalSystem out;
  find_undamped(equations, a, count, solver, out);
  for (Eigen::Index i = 0; i < out.l.size(); ++i)
    if (std::abs(out.l[i]) <= kRounding * out.rounding[i]) out.l[i] = 0;
  out.n = projected(skew_part(a.stiffness), out.x);
  out.d = projected(a.damping, out.x);
  if (max_norm(a.damping.values) == 0) return out;
  constexpr double kOfTerms = 1e-12;  // of the terms of a sum
  const Eigen::VectorXd terms = projected(magnitudes(a.damping), out.x.cwiseAbs()).diagonal().cwiseSqrt();
  out.d = (out.d.array().abs() <= kOfTerms * (terms * terms.transpose()).array()).select(0.0, out.d);
  return out;
}

/// The size of the eigenvalues that are sought.
double typical_rate(const ModalSystem& s, Index count) {
  const Eigen::Index known = std::min<Eigen::Index>(count, s.l.size());
  const double stiff = std::sqrt(s.l.head(known).cwiseAbs().maxCoeff());
  return stiff > 0 ? stiff : s.d.cwiseAbs().maxCoeff();
}

/// Motions without stiffness are not coupled to others by rounding of their shapes.
void free_unresisted(ModalSystem& s, Index count) {
  constexpr double kOfTerms = 1e-12;
  const double rate = typical_rate(s, count);
  const auto clear = [&](double& x, double least) { x = std::abs(x) <= least ? 0 : x; };
  for (Eigen::Index i = 0; i < s.l.size(); ++i)
    for (Eigen::Index j = 0; s.l[i] == 0 && j < s.l.size(); ++j)
      for (const auto& [r, c] : {std::pair(i, j), std::pair(j, i)}) {
        clear(s.d(r, c), kOfTerms * rate);
        clear(s.n(r, c), kOfTerms * rate * rate);
      }
}

/// Without N where it is that of a state not quite in equilibrium: nothing beside the stiffnesses of the modes.
void drop_small_asymmetry(ModalSystem& s) {
  constexpr double kUnsymmetric = 1e-8;
  double least = std::numeric_limits<double>::infinity();
  for (const double l : s.l)
    if (l != 0) least = std::min(least, std::abs(l));
  if (std::isinf(least)) least = 0;
  const Eigen::VectorXd size = s.l.cwiseAbs().cwiseMax(least).cwiseSqrt();
  if ((s.n.array().abs() <= kUnsymmetric * (size * size.transpose()).array()).all()) s.n.setZero();
}

std::vector<Mode> undamped(const Eigen::VectorXd& eigenvalues, const Eigen::MatrixXd& x) {
  std::vector<Mode> modes;
  for (Eigen::Index i = 0; i < eigenvalues.size(); ++i) {
    const double l = eigenvalues[i];
    const std::complex<double> e = l >= 0 ? std::complex<double>(0, std::sqrt(l)) : std::sqrt(-l);
    modes.push_back(vibration_of(e, x.col(i).cast<std::complex<double>>()));
  }
  return modes;
}

/// A real number next to the slowest eigenvalues that are more than rounding beside the others, and none of them.
double slow_shift(const ModalSystem& s, const std::vector<Eigen::Index>& coupled, double rate) {
  constexpr double kSlowest = 1e-9;
  double slow = std::numeric_limits<double>::infinity();
  for (const Eigen::Index i : coupled) {
    const double stiff = std::sqrt(std::abs(s.l[i])), d = std::abs(s.d(i, i));
    if (stiff > 0 || d > 0) slow = std::min(slow, std::max(kSlowest * rate, stiff > 0 ? stiff : d));
  }
  return std::isinf(slow) ? -1 : -0.1234567 * slow;
}

// Eigenvalues of the first `size` coordinates, by modulus. Modes without stiffness that nothing couples are apart: 0.
std::vector<Mode> damped(const ModalSystem& s, Eigen::Index size, Index count) {
  std::vector<Eigen::Index> coupled, free;
  for (Eigen::Index i = 0; i < size; ++i) {
    const auto any = [&](const Eigen::MatrixXd& a) { return a.row(i).head(size).any() || a.col(i).head(size).any(); };
    (s.l[i] == 0 && !any(s.d) && !any(s.n) ? free : coupled).push_back(i);
  }
  std::vector<Mode> modes;
  for (const Eigen::Index i : free) modes.push_back(vibration_of(0, s.x.col(i).cast<std::complex<double>>()));
  if (!coupled.empty()) {
    const Eigen::MatrixXd l = s.l(coupled).asDiagonal();
    const Eigen::MatrixXd k = l + s.n(coupled, coupled), d = s.d(coupled, coupled),
                          m = Eigen::MatrixXd::Identity(l.rows(), l.rows());
    const double shift = slow_shift(s, coupled, typical_rate(s, count));
    const auto found = espalier::modes::dense_quadratic_modes(k, d, m, shift);
    for (Eigen::Index i = 0; i < found.eigenvalues.size(); ++i) {
      std::complex<double> e = found.eigenvalues[i];
      Eigen::VectorXcd z = found.vectors.col(i);
      if (std::abs(e) <= 1e-12 * std::abs(shift))
        e = 0;
      else if (i < 2 * count)
        espalier::modes::polish_quadratic_pair(k, d, m, e, z);
      modes.push_back(vibration_of(e, s.x(Eigen::all, coupled) * z));
    }
  }
  std::stable_sort(modes.begin(), modes.end(),
                   [](const Mode& a, const Mode& b) { return std::abs(a.eigenvalue) < std::abs(b.eigenvalue); });
  return modes;
}

/// By how much the first eigenvalues of both differ, in parts.
double largest_change(const std::vector<Mode>& a, const std::vector<Mode>& b, Index count) {
  double change = 0;
  for (std::size_t i = 0; i < std::min({at(count), a.size(), b.size()}); ++i)
    change = std::max(change, std::abs(std::abs(b[i].eigenvalue) - std::abs(a[i].eigenvalue)) /
                                  std::max(std::abs(a[i].eigenvalue), 1e-300));
  return change;
}

/// What rounding of the stiffness leaves of the first modes; empty where that is enough.
std::string rounding_notice(const ModalSystem& s, Index count) {
  constexpr double kGood = 1e-6, kApart = 1e-6;  // of l
  double worst = 0, hidden = 0, least = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; i < std::min<Eigen::Index>(count, s.l.size()); ++i) {
    if (s.l[i] == 0) {
      hidden = std::max(hidden, s.rounding[i]);
      continue;
    }
    worst = std::max(worst, s.rounding[i] / std::abs(s.l[i]));
    least = std::min(least, std::abs(s.l[i]));
  }
  std::string text;
  if (hidden > kApart * least || (hidden > 0 && std::isinf(least) && count > 6))
    text = fmt::format(
        "initial.modes: motions slower than {:.3g} per unit of time cannot be told from those that "
        "nothing resists, and are given with frequency 0: rounding of the largest stiffnesses hides them",
        std::sqrt(4 * hidden) / (2 * std::numbers::pi));
  if (worst > kGood)
    text += fmt::format(
        "{}the stiffnesses of the model lie so far apart that rounding may change frequencies by up to "
        "{:.1e} of them",
        text.empty() ? "initial.modes: " : "; ", worst / 2);
  return text;
}

void add_notice(std::string& text, const std::string& more) {
  if (!more.empty()) text += (text.empty() ? "" : "; ") + more;
}

/// Eigenvalues of z'' + D z' + (diag(l) + N + i H) z = 0 with a positive imaginary part, by modulus, in the first
/// `size` coordinates, and 0 for what nothing resists.
std::vector<Mode> hysteretic(const ModalSystem& s, Eigen::Index size) {
  using Eigen::MatrixXcd;
  constexpr double kReal = 1e-9;
  std::vector<Eigen::Index> free, held;
  for (Eigen::Index i = 0; i < size; ++i)
    (s.l[i] == 0 && s.h.row(i).head(size).isZero(1e-300) ? free : held).push_back(i);
  std::vector<Mode> modes;
  for (const Eigen::Index i : free) modes.push_back(vibration_of(0, s.x.col(i).cast<std::complex<double>>()));
  const auto n = static_cast<Eigen::Index>(held.size());
  if (n == 0) return modes;
  const double unit = std::sqrt(s.l(held).cwiseAbs().maxCoeff());
  MatrixXcd a = MatrixXcd::Zero(2 * n, 2 * n);
  MatrixXcd k = (s.n(held, held) + Eigen::MatrixXd(s.l(held).asDiagonal())).cast<std::complex<double>>();
  k += std::complex<double>(0, 1) * s.h(held, held);
  a.topRightCorner(n, n).setIdentity();
  a.bottomLeftCorner(n, n) = -k / (unit * unit);
  a.bottomRightCorner(n, n) = -s.d(held, held).cast<std::complex<double>>() / unit;
  const dense::ComplexSpectrum eigen = dense::general_eigen(a);
  if (!eigen.converged)
    throw Error(StatusCode::accuracy_not_reached, "damped modes: the QR algorithm did not converge");
  for (Eigen::Index i = 0; i < 2 * n; ++i) {
    std::complex<double> e = unit * eigen.values[i];
    if (e.imag() <= kReal * std::abs(e)) continue;
    if (s.n.isZero(0)) {  // symmetric: Rayleigh's quotient has the square of the vector's error
      const Eigen::VectorXcd z = eigen.vectors.col(i).head(n);
      const auto form = [&](const MatrixXcd& m) { return (z.transpose() * m * z).value(); };
      const std::complex<double> half =
          0.5 * form(s.d(held, held).cast<std::complex<double>>()) / form(MatrixXcd::Identity(n, n));
      const std::complex<double> root = std::sqrt(half * half - form(k) / form(MatrixXcd::Identity(n, n)));
      e = std::abs(-half + root - e) < std::abs(-half - root - e) ? -half + root : -half - root;
    }
    modes.push_back(vibration_of(e, s.x(Eigen::all, held) * eigen.vectors.col(i).head(n)));
  }
  std::stable_sort(modes.begin(), modes.end(),
                   [](const Mode& x, const Mode& y) { return std::abs(x.eigenvalue) < std::abs(y.eigenvalue); });
  return modes;
}

constexpr Index kDenseVibrations = 300;

Vibrations structural_vibrations(Equations& equations, const State& state, Index count, const Options* solver,
                                 const SparseMatrix& structural) {
  const Index free = equations.sizes().velocity - static_cast<Index>(kept_constraints(equations).size());
  Vibrations out;
  if (count <= 0 || free <= 0) return out;
  ModalSystem s = modal_system(equations, state, std::min(3 * count + 40, free), solver);
  drop_small_asymmetry(s);
  s.h = projected(structural, s.x);
  out.notice = s.notice;
  add_notice(out.notice, rounding_notice(s, count));
  out.modes = hysteretic(s, std::min<Eigen::Index>(s.l.size(), 3 * count + 40));
  out.modes.resize(std::min(at(count), out.modes.size()));
  return out;
}

}  // namespace

UndampedModes undamped_vibrations(Equations& equations, const State& state, Index count, const Options& solver) {
  const Index free = equations.sizes().velocity - static_cast<Index>(kept_constraints(equations).size());
  if (count <= 0 || free <= 0) return {};
  ModalSystem s = modal_system(equations, state, std::min(count, free),
                               equations.sizes().velocity <= kDenseVibrations ? nullptr : &solver);
  return {std::move(s.l), std::move(s.x)};
}

Vibrations small_vibrations(Equations& equations, const State& state, Index count, const Options& solver,
                            const SparseMatrix* structural) {
  const bool dense = equations.sizes().velocity <= kDenseVibrations;
  if (structural != nullptr)
    return structural_vibrations(equations, state, count, dense ? nullptr : &solver, *structural);
  return small_vibrations_by(equations, state, count, dense ? nullptr : &solver);
}

Vibrations small_vibrations_by(Equations& equations, const State& state, Index count, const Options* solver) {
  const Index free = equations.sizes().velocity - static_cast<Index>(kept_constraints(equations).size());
  Vibrations out;
  if (count <= 0 || free <= 0) return out;
  ModalSystem s = modal_system(equations, state, std::min(count, free), solver);
  drop_small_asymmetry(s);
  free_unresisted(s, count);
  const bool plain = s.d.isZero(0) && s.n.isZero(0);
  if (!plain && solver != nullptr) s = modal_system(equations, state, std::min(3 * count + 40, free), solver);
  out.notice = s.notice;
  add_notice(out.notice, rounding_notice(s, count));
  const Eigen::Index size = s.l.size();
  out.modes = plain ? undamped(s.l, s.x) : damped(s, size, count);
  if (!plain && size < free) {
    const Eigen::Index fewer = std::max<Eigen::Index>(count, 3 * size / 4);
    add_notice(out.notice,
               fmt::format("initial.modes: damping is taken in the space of {} undamped modes; with {} of them "
                           "eigenvalues differ by up to {:.1e}",
                           size, fewer, largest_change(out.modes, damped(s, fewer, count), count)));
  }
  out.modes.resize(std::min(at(count), out.modes.size()));
  return out;
}

}  // namespace espalier::dynamics
