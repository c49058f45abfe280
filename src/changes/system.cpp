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

using Eigen::VectorXd;

constexpr Index kGivenSlot = 10, kFoundSlot = 11, kRestSlot = 12;

template <class Solver>
solver::Session& session_of(Solver& s) {
  return solver::SolverAccess::session(s);
}

// NaN where one is.
double largest(const auto& v) { return v.size() == 0 ? 0.0 : v.cwiseAbs().template maxCoeff<Eigen::PropagateNaN>(); }

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
  const ChangeCost so_far = cost();
  const bool pays = so_far.changes + sweep_work(base(), border_.missing(wanted_)) >= so_far.factorization;
  if (folds_ && !refused_ && !wanted_.empty() && pays) {
    try {
      factorize_changed();
    } catch (const Error& e) {  // columns go on, as far as they go
      if (e.status().code == StatusCode::singular || e.status().code == StatusCode::cancelled) throw;
      refused_ = true;
    }
  }
  update();
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
  cost_.factorizations = before + 1;
  cost_.factorization_seconds = base::now_seconds() - start;
}

// The residual of the unknowns that count; those of low rank are what they must be, which x is told.
template <class T>
typename System<T>::Matrix System<T>::residual(const Matrix& b, Matrix& x, bool turned) {
  const auto columns = static_cast<Index>(b.cols());
  const Index m = base().order();
  for (Index e = matrix_.n(); e < matrix_.entities(); ++e) {
    if (!matrix_.auxiliary(e)) continue;
    const Item<T>& item = matrix_.item(e);
    const SparseVector<T>& row = item.row_of(turned);
    for (Index c = 0; c < columns; ++c) {
      T sum = 0;
      for (std::size_t q = 0; q < row.size(); ++q) sum += row.value[q] * x(row.place[q], c);
      x(e, c) = -sum / item.corner;
    }
  }
  Matrix right = b.topRows(m), inside = x.topRows(m);
  for (const Index e : outside_) {
    right.row(e).setZero();
    inside.row(e).setZero();
  }
  for (std::size_t k = 0; k < border_.active().size(); ++k) {
    const typename Border<T>::Member& u = border_.member(k);
    if (u.slack) continue;
    const SparseVector<T>& column = u.column_of(turned);
    for (Index c = 0; c < columns; ++c)
      for (std::size_t q = 0; q < column.size(); ++q) right(column.place[q], c) -= column.value[q] * x(u.entity, c);
  }
  T* const b_there = base().vectors(kGivenSlot, columns);
  T* const x_there = base().vectors(kFoundSlot, columns);
  T* const r_there = base().vectors(kRestSlot, columns);
  base().send(b_there, right.data(), columns);
  base().send(x_there, inside.data(), columns);
  std::vector<typename Base<T>::Residual> list;
  for (Offset c = 0; c < columns; ++c) list.push_back({b_there + c * m, x_there + c * m, r_there + c * m});
  (void)base().residual(list, turned);
  base().fetch(right.data(), r_there, columns);
  Matrix r = Matrix::Zero(b.rows(), columns);
  r.topRows(m) = right;
  for (std::size_t k = 0; k < border_.active().size(); ++k) {
    const typename Border<T>::Member& w = border_.member(k);
    if (w.slack) continue;
    const SparseVector<T>& row = w.row_of(turned);
    for (Index c = 0; c < columns; ++c) {
      T sum = b(w.entity, c);
      for (std::size_t q = 0; q < row.size(); ++q) sum -= row.value[q] * inside(row.place[q], c);
      for (std::size_t j = 0; j < border_.active().size(); ++j)
        if (!border_.member(j).slack)
          sum -= (turned ? border_.corner(j, k) : border_.corner(k, j)) * x(border_.member(j).entity, c);
      r(w.entity, c) = sum;
    }
  }
  for (const Index e : silent_) r.row(e).setZero();
  return r;
}

// The columns Z are those of A^-1 U. Of the transposed system, [A^T W^T; U^T D^T], there are none: it takes a second
// sweep, x = A^-T (b - W^T t), in the place of products with them.
template <class T>
typename System<T>::Matrix System<T>::substitute(const Matrix& r, bool turned) {
  const auto columns = static_cast<Index>(r.cols());
  const Index m = base().order();
  Matrix inside = r.topRows(m);
  for (const Index e : outside_) inside.row(e).setZero();
  T* const from = base().vectors(kGivenSlot, columns);
  T* const to = base().vectors(kFoundSlot, columns);
  base().send(from, inside.data(), columns);
  base().substitute(from, to, columns, turned);
  Matrix t;
  if (!border_.active().empty()) {
    Matrix right = -border_.rows_times(base(), to, columns, turned);
    for (std::size_t k = 0; k < border_.active().size(); ++k)
      if (!border_.member(k).slack) right.row(static_cast<Eigen::Index>(k)) += r.row(border_.member(k).entity);
    t = border_.solve(right, turned);
    if (!turned) border_.subtract(base(), t, to);
  }
  for (std::size_t k = 0; k < border_.active().size() && turned; ++k) {
    const SparseVector<T>& column = border_.member(k).column_of(turned);
    for (Index c = 0; c < columns; ++c)
      for (std::size_t q = 0; q < column.size(); ++q)
        inside(column.place[q], c) -= column.value[q] * t(static_cast<Eigen::Index>(k), c);
  }
  if (turned && !border_.active().empty()) {
    base().send(from, inside.data(), columns);
    base().substitute(from, to, columns, turned);
    cost_.changes += sweep_work(base(), columns);
  }
  base().fetch(inside.data(), to, columns);
  Matrix x = Matrix::Zero(r.rows(), columns);
  x.topRows(m) = inside;
  for (std::size_t k = 0; k < border_.active().size(); ++k)
    if (!border_.member(k).slack) x.row(border_.member(k).entity) = t.row(static_cast<Eigen::Index>(k));
  for (const Index e : silent_) x.row(e).setZero();
  return x;
}

template <class T>
void System<T>::solve_block(const T* given, T* to, Index columns, bool turned, bool conjugate, SolveResult& result) {
  const Options& o = original_.session().options;
  const Index unknowns = matrix_.unknowns();
  const bool plain = matrix_.plain() && unknowns == matrix_.entities();
  Matrix b = plain ? Matrix(Eigen::Map<const Matrix>(given, unknowns, columns))
                   : Matrix(Matrix::Zero(matrix_.entities(), columns));
  for (Index c = 0; c < columns && !plain; ++c)
    for (Index u = 0; u < unknowns; ++u) b(matrix_.entity_of(u), c) = given[Offset{c} * unknowns + u];
  if (conjugate) b = b.conjugate().eval();
  for (const Index e : silent_) b.row(e).setZero();
  const auto errors_of = [&](const Matrix& r, const Matrix& x) {
    std::vector<double> errors;
    for (Index c = 0; c < columns; ++c) {
      const double scale = norm(turned) * largest(x.col(c)) + largest(b.col(c)), rest = largest(r.col(c));
      const bool finite = std::isfinite(rest) && std::isfinite(scale);
      errors.push_back(!finite ? std::numeric_limits<double>::infinity() : rest == 0 ? 0 : rest / scale);
    }
    return errors;
  };
  const double start = base::now_seconds();
  Matrix x = substitute(b, turned);
  result.solve_seconds += base::now_seconds() - start;
  Matrix r = residual(b, x, turned);
  cost_.changes += product_work(base(), border_.active().size(), columns);
  std::vector<double> errors = errors_of(r, x);
  std::vector<char> open(at(columns), 1);
  int steps = 0;
  const auto any_open = [&] {
    bool any = false;
    for (Index c = 0; c < columns; ++c) {
      open[at(c)] = open[at(c)] != 0 && errors[at(c)] > o.refinement_target && std::isfinite(errors[at(c)]) ? 1 : 0;
      any = any || open[at(c)] != 0;
    }
    return any;
  };
  for (; steps < o.refinement_steps && any_open(); ++steps) {
    Matrix better = x + substitute(r, turned);
    const Matrix left = residual(b, better, turned);
    cost_.changes += product_work(base(), border_.active().size(), columns);
    const std::vector<double> now = errors_of(left, better);
    bool gained = false;
    for (Index c = 0; c < columns; ++c) {
      if (open[at(c)] == 0) continue;
      open[at(c)] = now[at(c)] <= errors[at(c)] / 2 ? 1 : 0;
      if (!(now[at(c)] < errors[at(c)])) continue;
      gained = true;
      x.col(c) = better.col(c);
      r.col(c) = left.col(c);
      errors[at(c)] = now[at(c)];
    }
    if (!gained) break;
  }
  if (conjugate) x = x.conjugate().eval();
  if (plain) Eigen::Map<Matrix>(to, unknowns, columns) = x;
  for (Index c = 0; c < columns && !plain; ++c)
    for (Index u = 0; u < unknowns; ++u) to[Offset{c} * unknowns + u] = x(matrix_.entity_of(u), c);
  result.refinement_steps = std::max(result.refinement_steps, steps);
  for (const double e : errors) result.backward_error = std::max(result.backward_error, e);
}

// The transpose of a Hermitian matrix is its conjugate.
template <class T>
void System<T>::solve(const T* b, T* x, Index columns, bool transpose, bool conjugate, SolveResult& result) {
  const bool same = symmetric(matrix_, original_);
  const bool turned = transpose && !same;
  const bool conjugated = conjugate != (transpose && same && matrix_.hermitian());
  for (Index first = 0; first < columns; first += kSideBySide) {
    const Offset skipped = Offset{first} * matrix_.unknowns();
    solve_block(b + skipped, x + skipped, std::min(kSideBySide, columns - first), turned, conjugated, result);
  }
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
