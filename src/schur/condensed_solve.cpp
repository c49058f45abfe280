// Right-hand sides condensed, solutions expanded, whole systems solved.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/at.hpp"
#include "base/stopwatch.hpp"
#include "schur/condensation.hpp"
#include "solve/refinement.hpp"
#include "solver/session/status_of.hpp"
#include "solver/solution/solution.hpp"

namespace espalier::schur {

namespace {

// @throws Error(invalid_input) naming a row that is not finite
void check_finite(const double* b, Index rows, Index columns, const char* what) {
  for (std::size_t k = 0; k < at(rows) * at(columns); ++k)
    if (!std::isfinite(b[k]))
      throw Error(StatusCode::invalid_input,
                  fmt::format("row {} of {} {} is {}", k % at(rows), what, k / at(rows), b[k]),
                  static_cast<Index>(k % at(rows)));
}

void take_worse(SolveResult& all, const SolveResult& one) {
  all.refinement_steps = std::max(all.refinement_steps, one.refinement_steps);
  all.backward_error = std::max(all.backward_error, one.backward_error);
  all.componentwise_error = std::max(all.componentwise_error, one.componentwise_error);
  all.solve_seconds += one.solve_seconds;
  if (all.status.ok()) all.status = one.status;
}

}  // namespace

template <class Body>
SolveResult Condensation::solve_by(Body&& body) {
  const double start = base::now_seconds();
  SolveResult result;
  Status status = solver::status_of(interruption_, "solve for fewer right-hand sides at a time", [&] { body(result); });
  if (!status.ok()) result.status = std::move(status);
  result.seconds = base::now_seconds() - start;
  return result;
}

// x := op(A_rr)^-1 x. Without refinement, the errors are not computed.
SolveResult Condensation::solve_rest(std::vector<double>& x, Index columns, bool transpose, bool refined) {
  session_->expect_usable();
  const base::Interruption::Call call(session_->interruption);
  if (refined) return solver::solve(*session_->factor, {x.data(), x.data(), columns, transpose}, session_->context);
  session_->factor->numeric().solve(x.data(), x.data(), columns, transpose);
  return {};
}

std::vector<double> Condensation::rest_of(const double* b, Index columns) const {
  const std::vector<Index>& rest = parts_->rest();
  std::vector<double> x(rest.size() * at(columns));
  for (std::size_t c = 0; c < at(columns); ++c)
    for (std::size_t k = 0; k < rest.size(); ++k) x[c * rest.size() + k] = b[c * at(n()) + at(rest[k])];
  return x;
}

void Condensation::condense(const Sides& s, bool refined, SolveResult& result) {
  const std::size_t size = at(parts_->size()), n_rest = parts_->rest().size();
  for (std::size_t c = 0; c < at(s.columns); ++c)
    for (std::size_t k = 0; k < size; ++k) s.g[c * size + k] = s.b[c * at(n()) + at(parts_->unknowns()[k])];
  if (!has_rest()) return;
  std::vector<double> y = rest_of(s.b, s.columns);
  take_worse(result, solve_rest(y, s.columns, s.transpose, refined));
  for (std::size_t c = 0; c < at(s.columns); ++c)
    parts_->subtract_lower(coupling_, y.data() + c * n_rest, s.g + c * size, s.transpose);
}

void Condensation::expand(const Sides& s, bool refined, SolveResult& result) {
  const std::size_t size = at(parts_->size());
  const std::vector<Index>& rest = parts_->rest();
  std::vector<double> y = rest_of(s.b, s.columns);
  for (std::size_t c = 0; c < at(s.columns); ++c)
    parts_->subtract_upper(coupling_, s.xs + c * size, y.data() + c * rest.size(), s.transpose);
  if (has_rest()) take_worse(result, solve_rest(y, s.columns, s.transpose, refined));
  for (std::size_t c = 0; c < at(s.columns); ++c) {
    double* x = s.x + c * at(n());
    for (std::size_t k = 0; k < rest.size(); ++k) x[at(rest[k])] = y[c * rest.size() + k];
    for (std::size_t k = 0; k < size; ++k) x[at(parts_->unknowns()[k])] = s.xs[c * size + k];
  }
}

SolveResult Condensation::condense(const Sides& sides) {
  return solve_by([&](SolveResult& result) {
    check_finite(sides.b, n(), sides.columns, "right-hand side");
    condense(sides, true, result);
  });
}

SolveResult Condensation::expand(const Sides& sides) {
  return solve_by([&](SolveResult& result) {
    check_finite(sides.b, n(), sides.columns, "right-hand side");
    check_finite(sides.xs, parts_->size(), sides.columns, "solution of the complement");
    expand(sides, true, result);
  });
}

// @throws Error(singular)
DenseFactor& Condensation::dense_factor() {
  if (!dense_) dense_.emplace(s_, parts_->size(), symmetric_, options_);
  if (!dense_->status().ok()) throw Error(dense_->status());
  return *dense_;
}

// Errors are those of the solution of A x = b, whatever the steps to it have lost.
SolveResult Condensation::solve(const Sides& sides) {
  return solve_by([&](SolveResult& result) {
    check_finite(sides.b, n(), sides.columns, "right-hand side");
    DenseFactor& dense = dense_factor();
    if (const Index rank = dense.result().rank; rank < parts_->size()) {
      std::vector<Index> rows;
      for (const Index r : dense.result().dependent_rows) rows.push_back(parts_->unknowns()[at(r)]);
      throw Error(solver::singular(rows, parts_->size() - rank, n()));
    }
    const double start = base::now_seconds();
    std::vector<double> g(at(parts_->size()) * at(sides.columns));
    const solve::Preconditioner apply = [&](const double* from, double* to, Index columns) {
      SolveResult ignored;
      const Sides one{from, g.data(), to, g.data(), columns, sides.transpose};
      condense(one, false, ignored);
      const std::span<double> some(g.data(), at(parts_->size()) * at(columns));
      if (Status s = dense.solve(some, columns, sides.transpose ? Transpose::yes : Transpose::no); !s.ok())
        throw Error(std::move(s));
      expand(one, false, ignored);
    };
    const std::vector<double> b(sides.b, sides.b + at(n()) * at(sides.columns));
    apply(b.data(), sides.x, sides.columns);
    result.solve_seconds = base::now_seconds() - start;
    if (!residual_) residual_.emplace(a_, pool_);
    const solve::RefinementResult r =
        solve::refine(*residual_, apply, {b.data(), sides.x, sides.columns, sides.transpose},
                      {options_.refinement_steps, false, false, 100, options_.refinement_target});
    result.refinement_steps = r.steps;
    result.backward_error = r.error.normwise;
    result.componentwise_error = r.error.componentwise;
    if (!(result.backward_error <= options_.required_backward_error))
      throw Error(StatusCode::accuracy_not_reached,
                  fmt::format("the backward error is {:.1e} after {} steps of refinement, above the {:.1e} asked for; "
                              "another choice of unknowns, or a Solver for all of them, may do better",
                              result.backward_error, result.refinement_steps, options_.required_backward_error));
  });
}

SchurInertia Condensation::inertia() {
  SchurInertia inertia;
  inertia.rest = rest_.inertia;
  inertia.status = solver::status_of(interruption_, "use a shorter list", [&] {
    const FactorResult& of_s = dense_factor().result();
    if (symmetric_) inertia.complement = of_s.inertia;
  });
  return inertia;
}

}  // namespace espalier::schur
