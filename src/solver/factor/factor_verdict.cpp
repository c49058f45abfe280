// Singular or not: how a factorization is judged, and what a verdict takes.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "solver/factor/factor.hpp"
#include "solver/factor/pivot_policy.hpp"
#include "solver/ranks/whole_plan.hpp"

namespace espalier::solver {

template <class Use>
auto Factor::with_deficiency_job(Use&& use) {
  constexpr double kLittle = 1 << 22, kWorkShare = 1.0 / 16;  // of the factorization's operations
  looked_ = true;
  values_.fetch(numeric_->device_system());
  const System& s = *analysis_->system;
  const std::shared_ptr<const solve::ResidualSpace> space = values_.space();
  const std::shared_ptr<const matrix::RowIndex> rows = s.index_of_all(context_.pool);
  DeficiencyJob job{s.prepared, values_.values(), *space, *numeric_, context_.pool, *rows, analysis_->kind()};
  job.rough = context_.single();
  job.vector_work = context_.options.singular == SingularMatrix::null_vectors
                        ? std::numeric_limits<double>::infinity()
                        : std::max(kLittle, kWorkShare * analysis_->flops());
  return use(job);
}

// Looked at once for each factor, where its pivots give cause: once for as many small pivots as belong to this matrix,
// which large plates always have. Should it become singular later, solutions show it, and a report is always exact. The
// caller's own bound of pivots is a verdict by itself.
const Deficiency& Factor::judge(device::FactorOutcome& outcome) {
  if (deficiency_) return *deficiency_;
  deficiency_.emplace();
  const Options& o = context_.options;
  const Index suspects = analysis_->system->unknowns(outcome.replaced.size() + outcome.small.size());
  // Rounding in FP32 may leave a zero as large as other pivots: the first factor of a plan is looked at in any case.
  const bool first_in_fp32 = context_.single() && !regular_in_fp32_;
  if ((suspects == 0 && !first_in_fp32) || (!looks() && outcome.replaced.empty()) || outcome.not_positive >= 0 ||
      pivots_are_given())
    return *deficiency_;
  const bool known = outcome.replaced.empty() && suspects <= harmless_ && o.singular == SingularMatrix::error;
  if (known && !first_in_fp32) return *deficiency_;
  // A doubt is enough to go to FP64.
  const bool surely_alone = context_.precision() == Precision::mixed;
  if (!surely_alone && proves_zeros(outcome)) return *deficiency_;
  if (!surely_alone && searches_on_host(outcome)) return judge(outcome);
  if (is_triangular()) return *deficiency_;  // and its pivots are no zeros
  deficiency_ = deficiency(!outcome.replaced.empty(),
                           analysis_->system->unknowns(outcome.replaced.size() + outcome.small.size()), surely_alone);
  regular_in_fp32_ = regular_in_fp32_ || (first_in_fp32 && deficiency_->zeros == 0);
  if (deficiency_->zeros == 0 && outcome.replaced.empty()) harmless_ = std::max(harmless_, suspects);
  return *deficiency_;
}

// Who asks for no residual (Newton's methods) pays for no look at small pivots either, unless for a report.
bool Factor::looks() const {
  const Options& o = context_.options;
  return o.singular != SingularMatrix::error || o.refinement_steps > 0 || std::isfinite(o.required_backward_error);
}

// A search for many zeros takes far longer than a factorization on the host, which parts with them.
bool Factor::searches_on_host(device::FactorOutcome& outcome) {
  constexpr Index kFew = 32;
  if (analysis_->device.backend->limits().parts_with_zeros || context_.link != nullptr) return false;
  if (analysis_->kind() == Kind::llt || analysis_->system->unknowns(outcome.replaced.size()) <= kFew) return false;
  const std::string why = "so many pivots vanish that the host tells faster what the rank is";
  context_.log(why + ": going on there");
  change_plan(whole_tree(analysis_->plan, context_.link),
              {whole_host(context_.registry, "host: " + why), analysis_->moved_pivots, analysis_->free_pivots});
  again(outcome);
  outcome = settle_pivots(std::move(outcome));
  return true;
}

// L L^T says nothing of zeros but that pivots are small; L D L^T parts with them.
bool Factor::small_pivots_are_zeros(const device::FactorOutcome& outcome) {
  constexpr Index kFew = 8;  // these are looked at one by one
  const Index suspects = analysis_->system->unknowns(outcome.small.size());
  if (analysis_->kind() != Kind::llt || !analysis_->system->kind_may_change || context_.single()) return false;
  if (suspects <= std::max(kFew, harmless_) || !looks() || pivots_are_given()) return false;
  return !with_deficiency_job([](DeficiencyJob& job) { return surely_regular(job); });
}

bool Factor::parts_with_zeros() const {
  return parts_ && analysis_->kind() != Kind::llt && !pivots_are_given() &&
         analysis_->device.backend->limits().parts_with_zeros;
}

bool Factor::zeros_without_search(const device::FactorOutcome& outcome) {
  if (outcome.replaced.empty() || !unstable_pivots(outcome).empty()) return false;
  const Index parts = analysis_->system->complex_factor() ? 2 : 1;
  return with_deficiency_job([&](DeficiencyJob& job) {
    std::optional<Deficiency> found = zeros_of_pivots(job, parts * static_cast<Index>(outcome.replaced.size()));
    if (found) deficiency_ = std::move(*found);
    return found.has_value();
  });
}

// Whether vanishing pivots, or these and small ones, all stand for zeros and nothing else does. Where that is not sure,
// they stand as small numbers from now on, with which a factor finds what has been missed.
bool Factor::proves_zeros(device::FactorOutcome& outcome) {
  constexpr double kInPlaceOfZero = 1e-9;  // what rounding leaves of zeros in large matrices is smaller
  constexpr std::size_t kFew = 8;          // small pivots are looked at one by one
  if (!parts_with_zeros()) return false;
  if (zeros_without_search(outcome)) return true;
  const auto regular = [&] { return with_deficiency_job([](DeficiencyJob& job) { return surely_regular(job); }); };
  if (outcome.replaced.empty() && (outcome.small.size() <= kFew || regular())) return false;
  std::optional<Deficiency> found = zeros_among(outcome);
  deficiency_.reset();
  numeric_->halt_at_failures(false);
  const bool small = unstable_pivots(outcome).empty() && !outcome.small.empty();
  if (small) {
    numeric_->set_smallest_pivot(kInPlaceOfZero);
    outcome = numeric_->factorize();
  }
  const bool proven = small && zeros_without_search(outcome);
  if (!proven) {
    parts_ = false;
    set_smallest_pivot();
    outcome = numeric_->factorize();
    deficiency_ = std::move(found);
  }
  numeric_->halt_at_failures(halts_);
  return deficiency_.has_value();
}

// More pivots of lu vanish than there are zeros. Where the others are few, solutions are corrected in as many
// directions, and no better places are sought.
bool Factor::zeros_beside_others(const device::FactorOutcome& outcome) {
  constexpr Index kFew = 256;
  if (analysis_->kind() != Kind::lu || context_.link != nullptr) return false;
  std::optional<Deficiency> found = zeros_among(outcome);
  if (!found || found->zeros == 0) return false;  // a regular matrix deserves a better factor
  if (analysis_->system->unknowns(outcome.replaced.size()) - found->zeros > kFew) return false;
  corrections_ = std::move(found->corrections);
  deficiency_ = std::move(found);
  return true;
}

// The zeros among columns that vanish for want of rows that others have taken.
std::optional<Deficiency> Factor::zeros_among(const device::FactorOutcome& outcome) {
  if (outcome.replaced.empty()) return {};
  const std::vector<Index> columns = columns_of(*analysis_, outcome.replaced);
  const bool lu = analysis_->kind() == Kind::lu;
  const std::vector<Index> rows = lu ? rows_of(*analysis_, outcome.replaced_rows) : columns;
  const auto pivots = static_cast<std::size_t>(analysis_->system->unknowns(outcome.replaced.size()));
  if (columns.size() != pivots || rows.size() != pivots) return {};
  return with_deficiency_job([&](DeficiencyJob& job) {
    std::optional<Deficiency> found = zeros_among_pivots(job, rows, columns);
    if (found) found->negative += outcome.negative / (analysis_->system->real_form ? 2 : 1);
    return found;
  });
}

Deficiency Factor::deficiency(bool replaced, Index suspects, bool surely_alone) {
  const auto find = [&](bool some_replaced, bool rough, Index proven) {
    return with_deficiency_job([&](DeficiencyJob& job) {
      job.rough = rough;
      job.replaced = some_replaced;
      job.suspects = suspects;
      job.proven = proven;
      job.surely_alone = surely_alone;
      return find_deficiency(job);
    });
  };
  const auto dense = [&] { return with_deficiency_job([](const DeficiencyJob& job) { return zeros_of_dense(job); }); };
  // A search for many zeros with a factor of which they prove nothing is slow, and may miss or invent some.
  constexpr Index kFew = 32;
  const bool many = replaced && suspects > kFew;
  if (many)
    if (std::optional<Deficiency> asked = dense()) return std::move(*asked);
  Deficiency found = find(replaced, context_.single(), 0);
  if (replaced && !many && (found.doubtful || found.zeros < suspects || analysis_->doubles() <= kCheapDense))
    if (std::optional<Deficiency> asked = dense()) return std::move(*asked);
  if (!found.doubtful || analysis_->kind() == Kind::llt || pivots_are_given()) return found;
  with_larger_pivots([&] {
    Deficiency again = find(true, true, found.complete ? found.zeros : 0);
    const bool settled = !again.doubtful;
    const bool says_more = again.zeros > found.zeros || again.worst < found.worst;
    if (settled || (says_more && (again.complete || !found.complete))) found = std::move(again);
    return settled;
  });
  return found;
}

// Larger pivots in the place of vanishing ones make other factors for a search, each as rough as one in FP32, until it
// is content. Whoever interrupts it finds no factor.
void Factor::with_larger_pivots(const std::function<bool()>& search) {
  // In the order in which they serve: of 1,194 matrices with one to three zeros 2 were wrong with the first alone.
  static constexpr std::array<double, 3> kInFp64 = {1e-7, 1e-5, 1e-9};
  static constexpr std::array<double, 2> kInFp32 = {1e-5, 1e-3};
  const auto sizes = context_.single() ? std::span<const double>(kInFp32) : std::span<const double>(kInFp64);
  try {
    numeric_->halt_at_failures(false);
    for (const double size : sizes) {
      numeric_->set_smallest_pivot(size);
      (void)numeric_->factorize();
      if (search()) break;
    }
    set_smallest_pivot();
    numeric_->halt_at_failures(halts_);
    (void)numeric_->factorize();
  } catch (...) {
    drop();
    throw;
  }
}

Growth growth_of(std::span<const double> b, std::span<const double> x, Index parts, const Scales& scales, double norm,
                 bool transpose) {
  const auto& of_b = transpose ? scales.col : scales.row;
  const auto& of_x = transpose ? scales.row : scales.col;
  Growth g;
  for (std::size_t i = 0; i < b.size(); ++i) {
    const std::size_t row = i / at(parts);
    g.given = std::max(g.given, std::abs(of_b.empty() ? b[i] : b[i] * of_b[row]));
    g.found = std::max(g.found, std::abs(of_x.empty() ? x[i] : x[i] / of_x[row]));
  }
  if (of_x.empty()) g.found *= norm;
  return g;
}

Status Factor::second_look(const double* b, const double* x, bool transpose) {
  if (looked_ || pivots_are_given()) return {};
  const bool llt = analysis_->kind() == Kind::llt;
  if (llt && numeric_->device_system() != nullptr && !context_.single()) return {};  // a GPU has looked at all pivots
  const Index n = analysis_->n();
  const auto size = static_cast<std::size_t>(analysis_->doubles());
  const Scales& scales = numeric_->scales();
  const double norm = (transpose ? scales.row : scales.col).empty() ? this->norm(transpose) : 1;
  const Growth growth = growth_of({b, size}, {x, size}, analysis_->system->parts(), scales, norm, transpose);
  if (!growth.is_far(context_.single()) || is_triangular()) return {};
  constexpr double kMore = 2;  // a matrix that became singular makes far more of it
  if (growth.found <= kMore * harmless_growth_ * growth.given) return {};
  Deficiency d = deficiency(false, 0, false);
  if (d.zeros == 0) {
    harmless_growth_ = growth.found / growth.given;
    return {};
  }
  result_.rank = n - d.zeros;
  result_.dependent_rows = d.rows;
  result_.null_vectors = std::move(d.null_vectors);
  result_.dependent_columns = std::move(d.columns);
  result_.left_null_vectors = std::move(d.left_vectors);
  if (context_.options.singular != SingularMatrix::error) return {};
  return singular(d.rows, d.zeros, n);
}

bool Factor::is_triangular() {
  if (std::exchange(ordered_, true)) return substitutes();
  if (analysis_->kind() != Kind::lu || context_.link != nullptr || pivots_are_given()) return false;
  const System& s = *analysis_->system;
  values_.fetch(numeric_->device_system());
  substitution_ = Substitution::find(s.prepared, values_.values(), *s.index_of_all(context_.pool));
  if (substitution_)
    context_.log(
        "the matrix is triangular in some order of its rows and columns: it is regular, and is solved by "
        "substitution");
  return substitutes();
}

bool Factor::goes_to_substitution() { return !substitutes() && is_triangular(); }

void Factor::solve(const double* b, double* x, Index columns, bool transpose) {
  if (substitution_) return substitution_->solve(b, x, columns, transpose);
  if (corrections_.empty()) return numeric_->solve(b, x, columns, transpose);
  const std::vector<double> given(b, b + Offset{columns} * analysis_->doubles());
  numeric_->solve(b, x, columns, transpose);
  corrections_[transpose ? 1 : 0].add(*residual_space(), given.data(), x, columns, transpose);
}

}  // namespace espalier::solver
