// Analysis and factorization: from A to the factor of the rest and the dense complement.
#include "schur/condensation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "analysis/matching.hpp"
#include "base/at.hpp"
#include "base/stopwatch.hpp"
#include "matrix/norms.hpp"
#include "matrix/transform.hpp"
#include "matrix/validate.hpp"
#include "solver/session/status_of.hpp"

namespace espalier::schur {

namespace {

base::Interruption::Clock::duration period_of(const Options& o) {
  return std::chrono::duration_cast<base::Interruption::Clock::duration>(
      std::chrono::duration<double>(o.interrupted_every));
}

std::vector<Index> in_full(std::vector<Index> rows, const std::vector<Index>& rest) {
  for (Index& r : rows) r = rest[at(r)];
  return rows;
}

// Vectors of the rest as vectors of A.
std::vector<double> in_full(const std::vector<double>& vectors, const std::vector<Index>& rest, Index n) {
  const std::size_t count = rest.empty() ? 0 : vectors.size() / rest.size();
  std::vector<double> full(count * at(n), 0.0);
  for (std::size_t v = 0; v < count; ++v)
    for (std::size_t k = 0; k < rest.size(); ++k) full[v * at(n) + at(rest[k])] = vectors[v * rest.size() + k];
  return full;
}

Status singular_rest(const std::vector<Index>& rows, Index rank, std::size_t of) {
  return {StatusCode::singular,
          fmt::format("the matrix without the listed unknowns is singular: its rank is {} of {}; {} {} on its other "
                      "rows: add to the list what they lack, or fix them",
                      rank, of, solver::name_rows(rows), rows.size() == 1 ? "depends" : "depend"),
          rows.empty() ? -1 : rows.front()};
}

}  // namespace

Condensation::Condensation(Options options)
    : options_(std::move(options)),
      interruption_(options_.interrupted, period_of(options_)),
      pool_(solver::threads_of(options_), &interruption_) {}

const std::vector<Index>& Condensation::unknowns() const {
  static const std::vector<Index> none;
  return parts_ ? parts_->unknowns() : none;
}

template <class Body>
Status Condensation::guarded(Body&& body) {
  return solver::status_of(interruption_, "use a shorter list or a machine with more memory", body);
}

Options Condensation::options_of_rest(bool symmetric) const {
  Options o = options_;
  o.precision = Precision::fp64;
  o.singular = SingularMatrix::error;
  if (!symmetric) o.kind = Kind::lu;
  o.permutation = parts_->rest_of(o.permutation);
  return o;
}

MatrixView Condensation::rest_view(std::span<const double> rest_values) const {
  MatrixView view = parts_->matrix();
  view.values = rest_values;
  return view;
}

AnalysisResult Condensation::analyze(const MatrixView& given, std::span<const Index> unknowns) {
  factorized_ = false;
  parts_.reset();
  session_.reset();
  residual_.reset();
  analysis_ = AnalysisResult{};
  Status status = guarded([&] {
    if (given.rows != given.cols)
      throw Error(StatusCode::invalid_input,
                  fmt::format("the matrix is {} x {}; a linear system needs a square one", given.rows, given.cols));
    matrix::validate(given, &pool_);
    if (!options_.permutation.empty() && options_.permutation.size() != at(given.cols))
      throw Error(StatusCode::invalid_input, fmt::format("the permutation has {} entries, the matrix {} columns",
                                                         options_.permutation.size(), given.cols));
    MatrixView a = given;
    if (!options_.analyze_values) a.values = {};
    symmetric_ = solver::choose_kind(a, options_.kind, pool_) != Kind::lu;
    parts_.emplace(a, unknowns, !symmetric_);
    a_ = {a.rows, a.cols, {a.col_ptr.begin(), a.col_ptr.end()}, {a.row_ind.begin(), a.row_ind.end()}, {}, a.storage};
    analysis_.kind = symmetric_ ? Kind::ldlt : Kind::lu;
    if (has_rest()) analyze_rest(a, true);
  });
  if (!status.ok()) {
    parts_.reset();
    session_.reset();
    analysis_.status = std::move(status);
  }
  return analysis_;
}

// @param a  A with or without values
void Condensation::analyze_rest(const MatrixView& a, bool with_border) {
  const std::vector<double> values = a.values.empty() ? std::vector<double>{} : parts_->matrix_values(a.values);
  auto session = std::make_unique<solver::Session>(options_of_rest(symmetric_));
  const base::Interruption::Call call(session->interruption);
  try {
    session->analyze(rest_view(values), with_border ? parts_->border() : nullptr);
  } catch (const Error& e) {
    if (e.status().code != StatusCode::singular) throw;
    const SparseMatrix general = matrix::to_general(rest_view(values));
    const std::vector<Index> matched = analysis::maximum_product_matching(general).row_of_col;
    std::vector<char> has_partner(matched.size(), 0);
    for (const Index r : matched)
      if (r >= 0) has_partner[at(r)] = 1;
    std::vector<Index> alone;
    for (std::size_t r = 0; r < has_partner.size(); ++r)
      if (has_partner[r] == 0) alone.push_back(parts_->rest()[r]);
    throw Error(singular_rest(alone, static_cast<Index>(matched.size() - alone.size()), matched.size()));
  }
  session_ = std::move(session);
  analysis_ = session_->analysis;
}

void Condensation::check_values(std::span<const double> values) const {
  for (Index c = 0; c < a_.cols; ++c)
    for (Offset q = a_.col_ptr[at(c)]; q < a_.col_ptr[at(c) + 1]; ++q)
      if (const auto k = at(q); !std::isfinite(values[k]))
        throw Error(StatusCode::invalid_input, fmt::format("entry ({}, {}) is {}", a_.row_ind[k], c, values[k]),
                    a_.row_ind[k]);
  MatrixView now = a_;
  now.values = values;
  if (symmetric_ && !a_.symmetric() && !matrix::values_are_symmetric(now))
    throw Error(StatusCode::invalid_input,
                "the matrix was analyzed as a symmetric one, but its new values are not symmetric; call analyze() "
                "again");
}

SchurResult Condensation::factorize(std::span<const double> values) {
  const double start = base::now_seconds();
  SchurResult result;
  factorized_ = false;
  dense_.reset();
  Status status = guarded([&] {
    check_values(values);
    a_.values.assign(values.begin(), values.end());
    residual_.reset();
    coupling_ = parts_->border_values(values);
    result.rest.inertia = symmetric_ ? Inertia{0, 0, 0} : Inertia{};
    result.rest.rank = 0;
    if (has_rest()) factorize_rest(values, result);
    if (result.rest.status.ok()) form_complement(values, result);
  });
  result.status = status.ok() ? result.rest.status : std::move(status);
  result.seconds = base::now_seconds() - start;
  factorized_ = result.status.ok();
  rest_ = result.rest;
  return result;
}

// Where the devices are too small for a factor that leaves something for the border, the rest is factorized alone.
void Condensation::factorize_rest(std::span<const double> values, SchurResult& result) {
  const std::vector<double> of_rest = parts_->matrix_values(values);
  const auto factorize = [&] {
    session_->expect_usable();
    if (session_->opening.valid()) session_->opening.wait();
    session_->note_devices();
    const bool bordered = session_->current().system->border != nullptr;
    if (bordered) session_->factor->set_border(coupling_);
    const base::Interruption::Call call(session_->interruption);
    session_->factor->factorize(of_rest);
  };
  try {
    factorize();
  } catch (const Error& e) {
    if (e.status().code != StatusCode::out_of_memory || session_->current().plan.tree.border == 0) throw;
    if (options_.log) options_.log("the complement is formed by solves: " + e.status().message);
    MatrixView a = a_;
    analyze_rest(a, false);
    factorize();
  }
  analysis_ = session_->current().result;
  result.rest = session_->factor->result();
  name_in_full(result.rest);
}

void Condensation::name_in_full(FactorResult& rest) const {
  const std::vector<Index>& names = parts_->rest();
  rest.dependent_rows = in_full(std::move(rest.dependent_rows), names);
  rest.dependent_columns = in_full(std::move(rest.dependent_columns), names);
  rest.null_vectors = in_full(rest.null_vectors, names, n());
  rest.left_null_vectors = in_full(rest.left_null_vectors, names, n());
  Status& s = rest.status;
  if (s.row >= 0) s.row = names[at(s.row)];
  if (s.code == StatusCode::singular) s = singular_rest(rest.dependent_rows, rest.rank, names.size());
  if (s.code == StatusCode::not_positive_definite)
    s.message = fmt::format(
        "the matrix without the listed unknowns is not positive definite: the pivot of {} is not "
        "positive; use kind ldlt (or auto)",
        solver::name_rows({s.row}));
}

// Replaced pivots belong to another matrix, whose complement would be another one: refinement has to mend the solves.
void Condensation::form_complement(std::span<const double> values, SchurResult& result) {
  const double start = base::now_seconds();
  s_.assign(at(parts_->size()) * at(parts_->size()), 0.0);
  result.by_elimination = !has_rest() || (session_->current().plan.tree.border > 0 && result.rest.perturbed == 0);
  if (!result.by_elimination)
    subtract_by_solves();
  else if (has_rest())
    add_border_contribution();
  parts_->add_listed(values, s_);
  for (std::size_t k = 0; k < s_.size(); ++k)
    if (!std::isfinite(s_[k]))
      throw Error(StatusCode::accuracy_not_reached,
                  fmt::format("the complement is not finite at unknowns {} and {}: it, or what is multiplied on the "
                              "way, is above the largest number; scale the matrix",
                              parts_->unknowns()[k % at(parts_->size())], parts_->unknowns()[k / at(parts_->size())]));
  result.complement_seconds = base::now_seconds() - start;
}

void Condensation::add_border_contribution() {
  const solver::BorderContribution left = session_->factor->numeric().border_contribution();
  const std::size_t rows = left.rows.size(), size = at(parts_->size());
  pool_.for_each_range(static_cast<std::int64_t>(rows), 16, [&](std::int64_t begin, std::int64_t end) {
    for (auto c = at(begin); c < at(end); ++c)
      for (std::size_t r = 0; r < rows; ++r) {
        const bool above = symmetric_ && r < c;
        s_[at(left.rows[c]) * size + at(left.rows[r])] = above ? left.values[r * rows + c] : left.values[c * rows + r];
      }
  });
}

// S -= A_sr A_rr^-1 A_rs, some columns at a time.
void Condensation::subtract_by_solves() {
  constexpr Index kColumns = 32;
  const auto& entries = parts_->border()->entries;
  const Index size = parts_->size();
  const std::size_t n_rest = parts_->rest().size();
  std::vector<std::vector<std::size_t>> of_column(at(size));  // entries of A_rs
  for (std::size_t k = 0; k < entries.size(); ++k)
    if (symmetric_ || entries[k].upper) of_column[at(entries[k].border)].push_back(k);
  const bool refined = session_->factor->result().perturbed > 0;
  std::vector<double> x;
  for (Index first = 0; first < size; first += kColumns) {
    const Index count = std::min(kColumns, size - first);
    x.assign(n_rest * at(count), 0.0);
    for (Index c = 0; c < count; ++c)
      for (const std::size_t k : of_column[at(first + c)]) x[at(c) * n_rest + at(entries[k].inner)] += coupling_[k];
    if (SolveResult solved = solve_rest(x, count, false, refined); !solved.status.ok())
      throw Error(std::move(solved.status));
    for (Index c = 0; c < count; ++c)
      parts_->subtract_lower(coupling_, x.data() + at(c) * n_rest, s_.data() + at(first + c) * at(size), false);
  }
  if (!symmetric_) return;
  for (std::size_t c = 0; c < at(size); ++c)  // both triangles by rounding alone are not the same
    for (std::size_t r = c + 1; r < at(size); ++r) s_[r * at(size) + c] = s_[c * at(size) + r];
}

}  // namespace espalier::schur
