#include "changes/system.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/at.hpp"
#include "base/stopwatch.hpp"
#include "changes/change_work.hpp"
#include "changes/folding.hpp"
#include "solver/session/solver_impl.hpp"

namespace espalier::changes {

namespace {

template <class Solver>
solver::Session& session_of(Solver& s) {
  return solver::SolverAccess::session(s);
}

}  // namespace

template <class T>
System<T>::System(SolverOf<T>& solver)
    : solver_(&solver),
      original_(session_of(solver), std::vector<char>(at(session_of(solver).current().n()), 1)),
      matrix_(original_.order(), original_.hermitian()),
      border_(matrix_, original_) {
  cost_.factorization_seconds = original_.session().factor->result().seconds;
}

template <class T>
Index System<T>::changes() const {
  Index count = 0;
  for (Index e = 0; e < matrix_.entities(); ++e) count += base().has(e) != matrix_.alive(e) ? 1 : 0;
  return count;
}

template <class T>
ChangeCost System<T>::cost() const {
  ChangeCost c = cost_;
  c.factorization = factorization_work(base(), matrix_.entities() == base().order());
  return c;
}

// Which entities belong into the border, by those that were touched.
template <class T>
void System<T>::find_wanted() {
  const auto look_at = [&](Index e) {
    if (base().has(e) != matrix_.alive(e))
      wanted_.insert(e);
    else
      wanted_.erase(e);
    if (matrix_.counts(e))
      silent_.erase(e);
    else
      silent_.insert(e);
  };
  const std::vector<Index> touched = matrix_.take_touched();
  if (updated_) {
    for (const Index e : touched) look_at(e);
  } else {
    wanted_.clear();
    silent_.clear();
    outside_.clear();
    for (Index e = 0; e < matrix_.entities(); ++e) look_at(e);
    for (Index e = 0; e < base().order(); ++e)
      if (!base().has(e)) outside_.push_back(e);
  }
  updated_ = true;
}

template <class T>
void System<T>::update() {
  find_wanted();
  const double start = base::now_seconds();
  const Index made = border_.update(base(), wanted_);
  if (made == 0) return;
  cost_.column_seconds += base::now_seconds() - start;
  cost_.columns += made;
  cost_.changes += sweep_work(base(), made);
}

template <class T>
void System<T>::prepare() {
  if (!stale_) return;
  find_wanted();
  // Columns of changes to come have to be made either way, and those that were made are spent.
  const bool pays = spared_ + sweep_work(base(), border_.missing(wanted_)) >= cost().factorization;
  if (folds_ && !refused_ && !wanted_.empty() && pays) {
    try {
      factorize_changed();
    } catch (const Error& e) {  // columns go on, as far as they go
      if (e.status().code == StatusCode::singular || e.status().code == StatusCode::cancelled) throw;
      refused_ = true;
    }
  }
  update();
  count_spared(dense_work(base(), border_.active().size()));
  bool regular = border_.factorize(base());
  // S may be singular to rounding where the factor of the base is near to it: a factor of its own knows better.
  if (!regular && folds_) {
    factorize_changed();
    update();
    regular = border_.factorize(base());
  }
  if (!regular)
    throw Error(
        StatusCode::singular,
        fmt::format("the changed matrix is singular: so are the {} rows of its changes, condensed; constraints that "
                    "depend on others must go, or fold() tells whether a factorization finds it regular",
                    border_.active().size()));
  norms_[0] = norms_[1] = std::nullopt;
  stale_ = false;
}

template <class T>
double System<T>::norm(bool turned) {
  std::optional<double>& made = norms_[turned ? 1 : 0];
  if (!made) made = row_norm_.of(matrix_, base(), border_, turned);
  return *made;
}

template <class T>
void System<T>::fold() {
  factorize_changed();
  refused_ = false;
  prepare();
}

template <class T>
void System<T>::back_to_original() {
  border_.clear();
  folded_.reset();
  own_.reset();
  updated_ = false;
  stale_ = true;
}

// Beside the solver's own factor. The analysis is that of the factor before, followed where the pattern has changed.
template <class T>
void System<T>::factorize_changed() {
  const double start = base::now_seconds();
  const bool is_symmetric = symmetric(matrix_, original_);
  const Options& given = original_.session().options;
  const bool as_given = is_symmetric == original_.symmetric() && given.permutation.empty() &&
                        (given.kind == Kind::automatic || given.kind == original_.session().current().kind()) &&
                        (given.kind != Kind::llt || matrix_.entities() == matrix_.n());
  const SparseMatrixOf<T> a = folded(matrix_, original_, as_given);
  const auto expect = [](const Status& s) {
    if (!s.ok()) throw Error(s);
  };
  std::vector<char> alive;
  for (Index e = 0; e < matrix_.entities(); ++e) alive.push_back(matrix_.alive(e) ? 1 : 0);
  border_.clear();  // the memory of its columns
  updated_ = false;
  stale_ = true;
  try {
    if (own_ && !as_given && own_->options().kind == Kind::llt) own_.reset();
    if (!own_ && as_given) own_ = std::make_unique<SolverOf<T>>(solver_->clone());
    if (own_ && (own_->analysis().kind != Kind::lu) != is_symmetric) own_.reset();
    if (!own_) {
      Options o = given;
      o.permutation.clear();
      o.kind = is_symmetric ? Kind::automatic : Kind::lu;
      own_ = std::make_unique<SolverOf<T>>(std::move(o));
      expect(own_->analyze(a).status);
    } else if (!own_->has_pattern(a)) {
      expect(own_->analyze_change(a).analysis.status);
    }
    const auto factor = own_->factorize(a);
    expect(factor.status);
    if (factor.rank >= 0 && factor.rank < matrix_.entities())  // where singular matrices are no errors
      throw Error(StatusCode::singular,
                  fmt::format("the changed matrix is singular: it has rank {} of {}", factor.rank, matrix_.entities()));
  } catch (const Error&) {
    back_to_original();
    throw;
  }
  folded_.emplace(session_of(*own_), std::move(alive));
  const Index before = cost_.factorizations;
  cost_ = {};
  spared_ = 0;
  cost_.factorizations = before + 1;
  cost_.factorization_seconds = base::now_seconds() - start;
}

// In [A U; W D] = In A + In S. Of low rank, [A u; u^T -1/l]: one eigenvalue of the sign of -l besides those of
// A + l u u^T. A removed unknown and its slack: one of either sign besides those of the rest.
template <class T>
Inertia System<T>::inertia() {
  if (!symmetric(matrix_, original_) || !base().symmetric()) return {};
  if (base::ScalarTraits<T>::is_complex && !(matrix_.hermitian() && base().hermitian())) return {};
  update();
  (void)border_.factorize(base());  // refines columns where that matters
  Inertia all = base().inertia();
  all.positive -= base().dead();
  for (Index e = matrix_.n(); e < matrix_.entities(); ++e)
    if (matrix_.auxiliary(e)) --(std::real(matrix_.item(e).corner) > 0 ? all.positive : all.negative);
  for (std::size_t k = 0; k < border_.active().size(); ++k) {
    all.positive -= border_.member(k).slack ? 1 : 0;
    all.negative -= border_.member(k).slack ? 1 : 0;
  }
  const Inertia of_s = border_.inertia();
  all.positive += of_s.positive;
  all.negative += of_s.negative;
  all.zero += of_s.zero;
  return all;
}

#define ESPALIER_INSTANTIATE(T) template class System<T>;
ESPALIER_FOR_NUMBERS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::changes
