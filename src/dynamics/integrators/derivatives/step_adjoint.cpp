#include "dynamics/integrators/derivatives/step_adjoint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "base/at.hpp"
#include "dynamics/dae/linear_solver.hpp"
#include "dynamics/dae/products.hpp"
#include "dynamics/integrators/history.hpp"

namespace espalier::dynamics {
namespace {

constexpr int kMostBackward = 60;
constexpr int kBackwardFirst = 4;         // passes before it may still find the size of the multipliers
constexpr double kLastBackward = 1e-13;   // change of a pass over the largest value
constexpr double kBackwardShrinks = 0.7;  // a pass that does not come below this part of the best gains nothing ...
constexpr int kBackwardStill = 2;         // ... and so many in a row are at rounding: passes may gain in turns
constexpr double kBackwardLeft = 1e-7;    // what they may leave there

Options backward_options(Index unknowns, int threads) {
  Options o = newton_options(unknowns);
  o.kind = Kind::lu;
  o.rescale = Rescale::equilibration;  // h' changes from step to step
  if (o.threads == 0) o.threads = threads;
  return o;
}

Status judged(const FactorResult& factor) {
  if (factor.status.ok() && factor.perturbed > 0)
    return {StatusCode::singular, fmt::format("{} pivots vanished", factor.perturbed), factor.status.row};
  return factor.status;
}

void require_step(const Status& status, double t) {
  if (!status.ok()) throw Error(status.code, fmt::format("adjoint: the step to t = {:g}: {}", t, status.message));
}

}  // namespace

StepAdjoint::StepAdjoint(Equations& equations, const AssembledSystem& system, std::vector<double> steps, int threads)
    : equations_(equations),
      system_(equations.system()),
      rates_(system),
      levels_(equations, std::move(steps)),
      solver_(backward_options(equations.sizes().velocity + equations.sizes().constraints, threads)),
      n_(at(equations.sizes().velocity)),
      m_(at(equations.sizes().constraints)) {}

bool StepAdjoint::dropped(Index row) const {
  return !equations_.dropped().empty() && equations_.dropped()[at(row)] != 0;
}

// K by columns: W with Phi_q below, then Phi_q^T with F_lambda, entries that stand twice, and a one for a dropped row.
void StepAdjoint::layout() {
  const SparsePattern &w = system_.tangent_pattern(), &phi = system_.constraint_pattern();
  const SparsePattern* f_lambda = system_.multiplier_pattern();
  std::vector<std::vector<Index>> rows_of(n_);
  for (Index i = 0; i < phi.rows; ++i)
    for (Offset k = phi.ptr[at(i)]; k < phi.ptr[at(i) + 1]; ++k) rows_of[at(phi.ind[at(k)])].push_back(i);
  const auto n = static_cast<Index>(n_);
  k_ = {};
  k_.rows = k_.cols = static_cast<Index>(n_ + m_);
  k_.col_ptr.assign(1, 0);
  const auto end_column = [&] { k_.col_ptr.push_back(static_cast<Offset>(k_.row_ind.size())); };
  for (std::size_t j = 0; j < n_; ++j) {
    k_.row_ind.insert(k_.row_ind.end(), w.ind.begin() + w.ptr[j], w.ind.begin() + w.ptr[j + 1]);
    for (const Index i : rows_of[j]) k_.row_ind.push_back(n + i);
    end_column();
  }
  for (std::size_t i = 0; i < m_; ++i) {
    k_.row_ind.insert(k_.row_ind.end(), phi.ind.begin() + phi.ptr[i], phi.ind.begin() + phi.ptr[i + 1]);
    if (f_lambda != nullptr)
      k_.row_ind.insert(k_.row_ind.end(), f_lambda->ind.begin() + f_lambda->ptr[i],
                        f_lambda->ind.begin() + f_lambda->ptr[i + 1]);
    if (dropped(static_cast<Index>(i))) k_.row_ind.push_back(static_cast<Index>(n_ + i));
    end_column();
  }
  k_.values.assign(k_.row_ind.size(), 0.0);
  for (auto* x : {&by_a_, &by_v_, &by_q_, &w_}) x->assign(at(w.nonzeros()), 0.0);
  f_lambda_.assign(f_lambda == nullptr ? 0 : at(f_lambda->nonzeros()), 0.0);
  version_ = system_.pattern_version();
  have_layout_ = true;
  analyzed_ = false;
}

void StepAdjoint::tangents(const State& now) {
  system_.update_pattern(now.q);
  if (equations_.update_pattern() || !have_layout_ || version_ != system_.pattern_version()) layout();
  levels_.evaluate(now);
  system_.tangent(now.view(), {1, 0, 0}, by_a_);
  system_.tangent(now.view(), {0, 1, 0}, by_v_);
  system_.tangent(now.view(), {0, 0, 1}, by_q_);
  for (std::size_t k = 0; k < w_.size(); ++k) w_[k] = by_a_[k] + hp_ * (by_v_[k] + hp_ * by_q_[k]);
  if (!f_lambda_.empty()) system_.multiplier_tangent(now.view(), f_lambda_);
}

void StepAdjoint::factorize() {
  const SparsePattern &w = system_.tangent_pattern(), &phi = system_.constraint_pattern();
  const ConstSpan phi_q = equations_.phi_q();
  std::vector<std::size_t> next(n_);  // free place of each column of K
  for (std::size_t j = 0; j < n_; ++j) {
    std::copy(w_.begin() + w.ptr[j], w_.begin() + w.ptr[j + 1], k_.values.begin() + k_.col_ptr[j]);
    next[j] = at(k_.col_ptr[j] + w.ptr[j + 1] - w.ptr[j]);
  }
  for (std::size_t i = 0; i < m_; ++i) {
    const bool out = dropped(static_cast<Index>(i));
    std::size_t place = at(k_.col_ptr[n_ + i]);
    for (Offset k = phi.ptr[i]; k < phi.ptr[i + 1]; ++k) {
      const double value = out ? 0 : phi_q[at(k)];
      k_.values[next[at(phi.ind[at(k)])]++] = value;
      k_.values[place++] = value;
    }
    if (const SparsePattern* p = system_.multiplier_pattern(); p != nullptr)
      for (Offset k = p->ptr[i]; k < p->ptr[i + 1]; ++k) k_.values[place++] = out ? 0 : f_lambda_[at(k)];
    if (out) k_.values[place] = 1;
  }
}

void StepAdjoint::take(const State& now, std::span<const State* const> past) {
  std::vector<double> times;
  std::vector<ConstSpan> q = {now.q};
  for (const State* s : past) {
    times.push_back(s->t);
    q.emplace_back(s->q);
  }
  weights_.assign(past.size() + 1, 0.0);
  derivative_weights(now.t, times, weights_);
  hp_ = 1 / weights_[0];
  rates_.evaluate(q, weights_);
  tangents(now);
  factorize();
  if (!analyzed_) require_step(solver_.analyze(k_).status, now.t);
  Status status = judged(solver_.refactorize(k_.values));
  if (status.code == StatusCode::singular && analyzed_) {  // the values have gone far since the analysis
    require_step(solver_.analyze(k_).status, now.t);
    status = judged(solver_.refactorize(k_.values));
  }
  require_step(status, now.t);
  analyzed_ = true;
}

std::vector<double> StepAdjoint::solve_transposed(const std::vector<double>& r) {
  std::vector<double> x(r.size());
  const SolveResult solved = solver_.solve(r, x, 1, Transpose::yes);
  if (!solved.status.ok()) throw Error(solved.status.code, "adjoint: " + solved.status.message);
  return x;
}

// out += N^T u, nothing in dropped rows. Constraints are the rows of Phi_q and the columns of F_lambda.
void StepAdjoint::add_border(ConstSpan u, Span out) const {
  const auto add = [&](const SparsePattern& p, ConstSpan values) {
    for (std::size_t i = 0; i < m_; ++i) {
      if (dropped(static_cast<Index>(i))) continue;
      for (auto k = at(p.ptr[i]); k < at(p.ptr[i + 1]); ++k) out[i] += values[k] * u[at(p.ind[k])];
    }
  };
  if (m_ == 0) return;
  add(system_.constraint_pattern(), equations_.phi_q());
  if (!f_lambda_.empty()) add(*system_.multiplier_pattern(), f_lambda_);
}

// A^T y; y and the result are [u_1 c_1 u_2 c_2 u_3 c_3], equations and unknowns (dq mu_1, dv mu_2, da dlambda).
std::vector<double> StepAdjoint::times(const std::vector<double>& y) const {
  const SparsePattern &w = system_.tangent_pattern(), &phi = system_.constraint_pattern();
  const std::size_t block = n_ + m_;
  std::vector<double> r(3 * block, 0.0), product(n_);
  const auto upper = [&](auto& x, std::size_t k) { return std::span(x).subspan(k * block, n_); };
  const auto lower = [&](auto& x, std::size_t k) { return std::span(x).subspan(k * block + n_, m_); };
  const auto add = [&](ConstSpan values, std::size_t from, double factor, std::size_t to) {  // of a matrix like W
    multiply_by_rows(w, values, upper(y, from), product);
    for (std::size_t i = 0; i < n_; ++i) r[to * block + i] += factor * product[i];
  };
  multiply_by_rows(w, w_, upper(y, 0), product);
  rates_.add_transposed(0, hp_, product, upper(r, 0));
  add(w_, 0, -hp_, 1);
  add(w_, 1, 1, 1);
  add(w_, 1, -hp_, 2);
  add(by_q_, 2, 1, 0);
  add(by_v_, 2, 1, 1);
  add(by_a_, 2, 1, 2);
  for (std::size_t k = 0; k < 3; ++k) {
    if (m_ > 0) dynamics::add_transposed(phi, equations_.phi_q(), lower(y, k), upper(r, k));
    add_border(upper(y, k), lower(r, k));
  }
  if (m_ == 0) return r;
  dynamics::add_transposed(phi, levels_.velocity_by_q(), lower(y, 1), upper(r, 0));
  dynamics::add_transposed(phi, levels_.acceleration_by_q(), lower(y, 2), upper(r, 0));
  dynamics::add_transposed(phi, levels_.acceleration_by_v(), lower(y, 2), upper(r, 1));
  return r;
}

// The transposed of a pass. With D_0 = w_0 I the matrix is L U^-1 but for what constraints lack,
//   L = [K; X_1 K; X_0 X_2 K] below the diagonal, U = [I hI h^2 I; 0 I hI; 0 0 I] in dq, dv, da,
// where X hold the derivatives of levels and motion by dq and dv; X_2 those along dq = h' dv.
std::vector<double> StepAdjoint::pass(const std::vector<double>& r) {
  const SparsePattern &w = system_.tangent_pattern(), &phi = system_.constraint_pattern();
  const std::size_t block = n_ + m_;
  std::array<std::vector<double>, 3> part;
  for (std::size_t k = 0; k < 3; ++k)
    part[k].assign(r.begin() + static_cast<std::ptrdiff_t>(k * block),
                   r.begin() + static_cast<std::ptrdiff_t>((k + 1) * block));
  for (std::size_t i = 0; i < n_; ++i) {
    part[1][i] += hp_ * part[0][i];
    part[2][i] += hp_ * part[1][i];
  }
  std::vector<double> product(n_);
  const auto take_off = [&](const std::vector<double>& values, const std::vector<double>& y, double factor,
                            std::vector<double>& x) {
    multiply_by_rows(w, values, ConstSpan(y).first(n_), product);
    for (std::size_t i = 0; i < n_; ++i) x[i] -= factor * product[i];
  };
  const auto take_off_level = [&](ConstSpan values, const std::vector<double>& y, double factor,
                                  std::vector<double>& x) {
    if (m_ == 0) return;
    std::vector<double> c(y.begin() + static_cast<std::ptrdiff_t>(n_), y.end());
    for (double& value : c) value *= -factor;
    dynamics::add_transposed(phi, values, c, Span(x).first(n_));
  };
  std::array<std::vector<double>, 3> y;
  y[2] = solve_transposed(part[2]);
  take_off(by_v_, y[2], 1, part[1]);
  take_off(by_q_, y[2], hp_, part[1]);
  take_off_level(levels_.acceleration_by_v(), y[2], 1, part[1]);
  take_off_level(levels_.acceleration_by_q(), y[2], hp_, part[1]);
  y[1] = solve_transposed(part[1]);
  take_off(by_q_, y[2], 1, part[0]);
  take_off_level(levels_.acceleration_by_q(), y[2], 1, part[0]);
  take_off_level(levels_.velocity_by_q(), y[1], 1, part[0]);
  y[0] = solve_transposed(part[0]);
  std::vector<double> all;
  for (const std::vector<double>& x : y) all.insert(all.end(), x.begin(), x.end());
  return all;
}

// What multipliers make of the slopes, the largest part: W^T u and Phi_q^T c, of the equations of q, v and a in the
// units of the latter.
double StepAdjoint::size_of(const std::vector<double>& y) const {
  const std::size_t block = n_ + m_;
  std::vector<double> image(n_);
  double largest = 0, unit = hp_ * hp_;
  for (std::size_t k = 0; k < 3; ++k, unit /= hp_) {
    multiply_by_rows(system_.tangent_pattern(), w_, ConstSpan(y).subspan(k * block, n_), image);
    largest = std::max(largest, unit * max_norm(image));
    if (m_ == 0) continue;
    std::fill(image.begin(), image.end(), 0.0);
    dynamics::add_transposed(system_.constraint_pattern(), equations_.phi_q(), ConstSpan(y).subspan(k * block + n_, m_),
                             image);
    largest = std::max(largest, unit * max_norm(image));
  }
  return largest;
}

StepMultipliers StepAdjoint::solve(const StateSlopes& slopes) {
  const std::size_t block = n_ + m_;
  std::vector<double> b(3 * block, 0.0);
  std::copy(slopes.q.begin(), slopes.q.end(), b.begin());
  std::copy(slopes.v.begin(), slopes.v.end(), b.begin() + static_cast<std::ptrdiff_t>(block));
  std::copy(slopes.a.begin(), slopes.a.end(), b.begin() + static_cast<std::ptrdiff_t>(2 * block));
  for (std::size_t i = 0; i < m_; ++i)
    if (!dropped(static_cast<Index>(i))) b[2 * block + n_ + i] = slopes.lambda[i];
  std::vector<double> y(b.size(), 0.0), r = b;
  double best = std::numeric_limits<double>::infinity();
  int without_gain = 0;
  for (int k = 0; k < kMostBackward; ++k) {
    const std::vector<double> change = pass(r);
    for (std::size_t i = 0; i < y.size(); ++i) y[i] += change[i];
    const double whole = size_of(y), size = whole > 0 ? size_of(change) / whole : 0;
    without_gain = k >= kBackwardFirst && size > kBackwardShrinks * best ? without_gain + 1 : 0;
    best = std::min(best, size);
    const bool still = size <= kLastBackward || without_gain == kBackwardStill;
    if (!std::isfinite(size) || (still && size > kBackwardLeft) || k == kMostBackward - 1)
      throw Error(StatusCode::accuracy_not_reached,
                  fmt::format("adjoint: the equations of a step of {:g} could not be solved backwards (the last change "
                              "was {:.1e} of the largest value); take the forward method",
                              hp_ * weights_[0] * hp_, size));
    left_ = still ? std::max(left_, size) : left_;
    if (still) break;
    r = times(y);
    for (std::size_t i = 0; i < r.size(); ++i) r[i] = b[i] - r[i];
  }
  const auto part = [&](std::size_t first, std::size_t count) {
    const auto begin = y.begin() + static_cast<std::ptrdiff_t>(first);
    return std::vector<double>(begin, begin + static_cast<std::ptrdiff_t>(count));
  };
  StepMultipliers out;
  out.position = part(n_, m_);
  out.velocity = part(block + n_, m_);
  out.motion = part(2 * block, n_);
  out.acceleration = part(2 * block + n_, m_);
  out.formula_q.resize(n_);
  out.formula_v.resize(n_);
  const SparsePattern& w = system_.tangent_pattern();
  multiply_by_rows(w, w_, ConstSpan(y).first(n_), out.formula_q);
  multiply_by_rows(w, w_, ConstSpan(y).subspan(block, n_), out.formula_v);
  for (auto* x : {&out.formula_q, &out.formula_v})
    for (double& value : *x) value *= hp_;
  return out;
}

void StepAdjoint::add_to_past(const StepMultipliers& y, std::size_t j, StateSlopes& slopes) const {
  rates_.add_transposed(j + 1, -1, y.formula_q, slopes.q);
  for (std::size_t i = 0; i < n_; ++i) slopes.v[i] -= weights_[j + 1] * y.formula_v[i];
}

}  // namespace espalier::dynamics
