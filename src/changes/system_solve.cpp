// Solves with a changed matrix. Vectors stay where the factor is; the host has the few rows around it.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/at.hpp"
#include "base/stopwatch.hpp"
#include "changes/change_work.hpp"
#include "changes/folding.hpp"
#include "changes/system.hpp"

namespace espalier::changes {

namespace {

constexpr Index kGivenSlot = 10, kFoundSlot = 11, kRestSlot = 12, kBetterSlot = 13, kLeftSlot = 14, kTermsSlot = 15;

/// The larger of two magnitudes; NaN if one is.
double larger(double a, double b) { return a >= b || std::isnan(a) ? a : b; }

}  // namespace

/// The active member of an entity that is no slack; -1: it has none.
template <class T>
Eigen::Index System<T>::place_around(Index entity) const {
  for (std::size_t k = 0; k < border_.active().size(); ++k)
    if (!border_.member(k).slack && border_.member(k).entity == entity) return static_cast<Eigen::Index>(k);
  return -1;
}

template <class T>
void System<T>::clear_silent(T* v, Index columns) {
  std::vector<Offset> places;
  for (Index c = 0; c < columns; ++c)
    for (const Index e : silent_)
      if (base().has(e)) places.push_back(Offset{c} * base().order() + e);
  if (places.empty()) return;
  base().scatter(places, std::vector<T>(places.size(), T(0)), v, 0);
}

// Right-hand sides of the caller's; what does not count is zero.
template <class T>
typename System<T>::Vectors System<T>::send(const T* given, Index columns, bool conjugate) {
  const Index unknowns = matrix_.unknowns(), m = base().order(), both = std::min(unknowns, m);
  Vectors b{base().vectors(kGivenSlot, columns),
            Matrix::Zero(static_cast<Eigen::Index>(border_.active().size()), columns)};
  staged_.setZero(m, columns);
  for (Index c = 0; c < columns; ++c) {
    const T* const from = given + Offset{c} * unknowns;
    if (matrix_.plain()) {
      std::copy_n(from, both, staged_.col(c).data());
      for (std::size_t k = 0; k < border_.active().size(); ++k)
        if (const typename Border<T>::Member& u = border_.member(k); !u.slack && u.entity < unknowns)
          b.around(static_cast<Eigen::Index>(k), c) = from[u.entity];
      continue;
    }
    for (Index u = 0; u < unknowns; ++u)
      if (const Index e = matrix_.entity_of(u); base().has(e))
        staged_(e, c) = from[u];
      else if (const Eigen::Index k = place_around(e); k >= 0)
        b.around(k, c) = from[u];
  }
  for (const Index e : outside_) staged_.row(e).setZero();
  for (const Index e : silent_)
    if (e < m) staged_.row(e).setZero();
  if (conjugate) {
    staged_ = staged_.conjugate().eval();
    b.around = b.around.conjugate().eval();
  }
  base().send(b.inside, staged_.data(), columns);
  return b;
}

template <class T>
void System<T>::fetch(const Vectors& x, T* to, Index columns, bool conjugate) {
  const Index unknowns = matrix_.unknowns(), m = base().order(), both = std::min(unknowns, m);
  base().fetch(staged_.data(), x.inside, columns);
  for (Index c = 0; c < columns; ++c, to += unknowns) {
    std::fill_n(to, unknowns, T(0));
    if (matrix_.plain()) {
      std::copy_n(staged_.col(c).data(), both, to);
      for (std::size_t k = 0; k < border_.active().size(); ++k)
        if (const typename Border<T>::Member& u = border_.member(k); !u.slack && u.entity < unknowns)
          to[u.entity] = x.around(static_cast<Eigen::Index>(k), c);
    } else {
      for (Index u = 0; u < unknowns; ++u)
        if (const Index e = matrix_.entity_of(u); base().has(e))
          to[u] = staged_(e, c);
        else if (const Eigen::Index k = place_around(e); k >= 0)
          to[u] = x.around(k, c);
    }
    for (Index u = 0; u < unknowns && conjugate; ++u) to[u] = base::conjugate(to[u]);
  }
}

// Unknowns of low rank are what the others make them.
template <class T>
void System<T>::set_auxiliary(Vectors& x, bool turned) {
  const auto columns = static_cast<Index>(x.around.cols());
  const Offset m = base().order();
  std::vector<Index> list;
  std::vector<Offset> places, own;
  for (Index e = matrix_.n(); e < matrix_.entities(); ++e) {
    if (!matrix_.auxiliary(e) || (!base().has(e) && place_around(e) < 0)) continue;
    list.push_back(e);
    for (Index c = 0; c < columns; ++c)
      for (const Index p : matrix_.item(e).row_of(turned).place)
        if (base().has(p)) places.push_back(c * m + p);
  }
  if (list.empty()) return;
  std::vector<T> found(places.size()), values;
  base().gather(x.inside, places, found.data());
  const T* next = found.data();
  for (const Index e : list) {
    const Eigen::Index around = place_around(e);
    const SparseVector<T>& row = matrix_.item(e).row_of(turned);
    for (Index c = 0; c < columns; ++c) {
      T sum = 0;
      for (std::size_t q = 0; q < row.size(); ++q)
        if (base().has(row.place[q]))
          sum += row.value[q] * *next++;
        else if (const Eigen::Index k = place_around(row.place[q]); k >= 0)
          sum += row.value[q] * x.around(k, c);
      const T value = -sum / matrix_.item(e).corner;
      if (around >= 0) {
        x.around(around, c) = value;
      } else {
        own.push_back(c * m + e);
        values.push_back(value);
      }
    }
  }
  base().scatter(own, values, x.inside, 0);
}

// The residual of the unknowns that count; x is told those of low rank.
template <class T>
typename System<T>::Vectors System<T>::residual(const Vectors& b, Vectors& x, T* rest, bool turned) {
  const auto columns = static_cast<Index>(x.around.cols());
  const Offset m = base().order();
  set_auxiliary(x, turned);
  Vectors r{rest, Matrix::Zero(x.around.rows(), columns)};
  const bool others = std::any_of(border_.active().begin(), border_.active().end(),
                                  [&](Index k) { return !border_.members()[at(k)].slack; });
  T* terms = b.inside;
  if (others) {
    terms = base().vectors(kTermsSlot, columns);
    for (Index c = 0; c < columns; ++c) base().copy(b.inside + c * m, terms + c * m);
    (void)take_from(terms, x.around, turned, false);
  }
  std::vector<typename Base<T>::Residual> list;
  for (Offset c = 0; c < columns; ++c) list.push_back({terms + c * m, x.inside + c * m, rest + c * m});
  (void)base().residual(list, turned);
  if (others) {
    r.around = b.around - border_.rows_times(base(), x.inside, columns, turned);
    for (std::size_t k = 0; k < border_.active().size(); ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      if (border_.member(k).slack || !matrix_.counts(border_.member(k).entity)) {
        r.around.row(row).setZero();
        continue;
      }
      for (std::size_t j = 0; j < border_.active().size(); ++j)
        if (!border_.member(j).slack)
          r.around.row(row) -=
              (turned ? border_.corner(j, k) : border_.corner(k, j)) * x.around.row(static_cast<Eigen::Index>(j));
    }
  }
  clear_silent(rest, columns);
  return r;
}

// Takes the columns of the border times t from vectors of the base. @returns what stood where they have entries
template <class T>
typename System<T>::Entries System<T>::take_from(T* v, const Matrix& t, bool turned, bool with_slacks) {
  Entries before;
  const Offset m = base().order();
  for (std::size_t k = 0; k < border_.active().size(); ++k) {
    const typename Border<T>::Member& u = border_.member(k);
    for (const Index place : u.column_of(turned).place)
      if (with_slacks || !u.slack) before.places.push_back(place);
  }
  std::sort(before.places.begin(), before.places.end());
  before.places.erase(std::unique(before.places.begin(), before.places.end()), before.places.end());
  const std::size_t rows = before.places.size();
  for (Offset c = 1; c < t.cols(); ++c)
    for (std::size_t q = 0; q < rows; ++q) before.places.push_back(before.places[q] + c * m);
  before.values.resize(before.places.size());
  base().gather(v, before.places, before.values.data());
  std::vector<T> now = before.values;
  for (std::size_t k = 0; k < border_.active().size(); ++k) {
    const typename Border<T>::Member& u = border_.member(k);
    if (u.slack && !with_slacks) continue;
    const SparseVector<T>& column = u.column_of(turned);  // ascends, as the list does
    auto at_place = before.places.begin();
    for (std::size_t q = 0; q < column.size(); ++q) {
      at_place = std::lower_bound(at_place, before.places.begin() + static_cast<std::ptrdiff_t>(rows),
                                  Offset{column.place[q]});
      const auto row = static_cast<std::size_t>(at_place - before.places.begin());
      for (Eigen::Index c = 0; c < t.cols(); ++c)
        now[static_cast<std::size_t>(c) * rows + row] -= column.value[q] * t(static_cast<Eigen::Index>(k), c);
    }
  }
  base().scatter(before.places, now, v, 0);
  return before;
}

// The columns Z are those of A^-1 U. Of the transposed system, [A^T W^T; U^T D^T], there are none: it takes a second
// sweep, x = A^-T (b - W^T t), in the place of products with them.
template <class T>
typename System<T>::Vectors System<T>::substitute(const Vectors& r, T* to, bool turned) {
  const auto columns = static_cast<Index>(r.around.cols());
  base().substitute(r.inside, to, columns, turned);
  Vectors x{to, r.around};
  if (!border_.active().empty()) {
    x.around = border_.solve(r.around - border_.rows_times(base(), to, columns, turned), turned);
    if (!turned) {
      border_.subtract(base(), x.around, to);
    } else {
      const Entries before = take_from(r.inside, x.around, true, true);
      base().substitute(r.inside, to, columns, true);
      base().scatter(before.places, before.values, r.inside, 0);
      count_spared(sweep_work(base(), columns));
    }
  }
  for (std::size_t k = 0; k < border_.active().size(); ++k)
    if (border_.member(k).slack || !matrix_.counts(border_.member(k).entity))
      x.around.row(static_cast<Eigen::Index>(k)).setZero();
  clear_silent(to, columns);
  return x;
}

template <class T>
std::vector<double> System<T>::errors_of(const Vectors& r, const Vectors& x, const std::vector<double>& given,
                                         bool turned) {
  const std::size_t columns = given.size();
  std::vector<const T*> list;
  for (const Vectors* v : {&r, &x})
    for (std::size_t c = 0; c < columns; ++c) list.push_back(v->inside + c * at(base().order()));
  const std::vector<double> most = base().largest(list);
  std::vector<double> errors;
  for (std::size_t c = 0; c < columns; ++c) {
    double rest = most[c], size = most[columns + c];
    for (Eigen::Index k = 0; k < r.around.rows(); ++k) {
      rest = larger(rest, std::abs(r.around(k, static_cast<Eigen::Index>(c))));
      size = larger(size, std::abs(x.around(k, static_cast<Eigen::Index>(c))));
    }
    const double scale = norm(turned) * size + given[c];
    const bool finite = std::isfinite(rest) && std::isfinite(scale);
    errors.push_back(!finite ? std::numeric_limits<double>::infinity() : rest == 0 ? 0 : rest / scale);
  }
  return errors;
}

template <class T>
void System<T>::solve_block(const T* given, T* to, Index columns, bool turned, bool conjugate, SolveResult& result) {
  const Options& o = original_.session().options;
  const Offset m = base().order();
  const Vectors b = send(given, columns, conjugate);
  std::vector<double> size_of_b;
  for (Index c = 0; c < columns; ++c) {
    size_of_b.push_back(m == 0 ? 0.0 : staged_.col(c).cwiseAbs().maxCoeff());
    for (Eigen::Index k = 0; k < b.around.rows(); ++k)
      size_of_b.back() = larger(size_of_b.back(), std::abs(b.around(k, c)));
  }
  const double start = base::now_seconds();
  Vectors x = substitute(b, base().vectors(kFoundSlot, columns), turned);
  result.solve_seconds += base::now_seconds() - start;
  Vectors r = residual(b, x, base().vectors(kRestSlot, columns), turned);
  count_spared(product_work(base(), border_.active().size(), columns));
  std::vector<double> errors = errors_of(r, x, size_of_b, turned);
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
    Vectors better = substitute(r, base().vectors(kBetterSlot, columns), turned);
    for (Index c = 0; c < columns; ++c) base().add(x.inside + c * m, better.inside + c * m);
    better.around += x.around;
    const Vectors left = residual(b, better, base().vectors(kLeftSlot, columns), turned);
    count_spared(product_work(base(), border_.active().size(), columns));
    const std::vector<double> now = errors_of(left, better, size_of_b, turned);
    bool gained = false;
    for (Index c = 0; c < columns; ++c) {
      if (open[at(c)] == 0) continue;
      open[at(c)] = now[at(c)] <= errors[at(c)] / 2 ? 1 : 0;
      if (!(now[at(c)] < errors[at(c)])) continue;
      gained = true;
      base().copy(better.inside + c * m, x.inside + c * m);
      base().copy(left.inside + c * m, r.inside + c * m);
      x.around.col(c) = better.around.col(c);
      r.around.col(c) = left.around.col(c);
      errors[at(c)] = now[at(c)];
    }
    if (!gained) break;
  }
  fetch(x, to, columns, conjugate);
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

#define ESPALIER_INSTANTIATE(T) template void System<T>::solve(const T*, T*, Index, bool, bool, SolveResult&);
ESPALIER_FOR_NUMBERS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::changes
