#include "changes/border.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "base/at.hpp"
#include "changes/change_work.hpp"
#include "changes/dense_entries.hpp"

namespace espalier::changes {

namespace {

using Eigen::VectorXd;

constexpr std::size_t kKept = 64;  // members that are not active, whose columns stay
constexpr Index kRightSlot = 8, kCorrectionSlot = 9;

double inverse_power_of_two(double x) { return x > 0 && std::isfinite(x) ? std::ldexp(1.0, -std::ilogb(x)) : 1.0; }

template <class T>
T product(const SparseVector<T>& w, const T* y) {
  T sum = 0;
  for (std::size_t q = 0; q < w.size(); ++q) sum += w.value[q] * y[w.place[q]];
  return sum;
}

/// W Y for rows W and vectors y of the base's memory.
template <class T>
Dense<T> products_of(const Base<T>& base, const std::vector<const SparseVector<T>*>& rows, const T* y, Index columns) {
  const Offset n = base.order();
  Dense<T> made(static_cast<Eigen::Index>(rows.size()), columns);
  std::vector<T> found;
  if (!base.on_host()) {
    std::vector<Offset> places;
    for (Index c = 0; c < columns; ++c)
      for (const SparseVector<T>* w : rows)
        for (const Index i : w->place) places.push_back(c * n + i);
    found.resize(places.size());
    base.gather(y, places, found.data());
  }
  const T* from = found.data();
  for (Index c = 0; c < columns; ++c)
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const SparseVector<T>& w = *rows[k];
      T& sum = made(static_cast<Eigen::Index>(k), c);
      if (base.on_host()) {
        sum = product(w, y + c * n);
        continue;
      }
      sum = 0;
      for (std::size_t q = 0; q < w.size(); ++q) sum += w.value[q] * *from++;
    }
  return made;
}

/// use(begin, end) for members whose columns stand one after another.
template <class Member, class Use>
void for_each_run(const std::vector<Member>& members, const Use& use) {
  for (std::size_t begin = 0, end = 0; begin < members.size(); begin = end) {
    for (end = begin + 1; end < members.size() && members[end].block == members[begin].block &&
                          members[end].place == members[end - 1].place + 1;)
      ++end;
    use(begin, end);
  }
}

}  // namespace

// The column of an entity in the changed matrix, of the rows that the base has, and its row.
template <class T>
typename Border<T>::Member Border<T>::make(const Base<T>& base, Index entity) const {
  Member m{entity, base.has(entity), {}, {}, true, nullptr, 0};
  if (m.slack) {
    m.column.push(entity, 1);
    m.row.push(entity, 1);
    m.mirrors = true;
    return m;
  }
  const ChangedMatrix<T>& a = *matrix_;
  const auto take = [&](const SparseVector<T>& from, SparseVector<T>& to) {
    for (std::size_t q = 0; q < from.size(); ++q)
      if (base.has(from.place[q])) to.push(from.place[q], from.value[q]);
  };
  if (entity >= a.n()) {
    take(a.item(entity).column, m.column);
    take(a.item(entity).row, m.row);
  } else {
    original_->for_each_in_column(entity, [&](Index row, T v) {
      if (base.has(row)) m.column.push(row, v);
    });
    original_->for_each_in_row(entity, [&](Index column, T v) {
      if (base.has(column)) m.row.push(column, v);
    });
    m.column.sort();
    m.row.sort();
  }
  for (Index later = std::max(a.n(), entity + 1); later < base.order(); ++later) {
    if (!base.has(later)) continue;
    if (const T v = a.item(later).row.at(entity); v != T(0)) m.column.push(later, v);
    if (const T v = a.item(later).column.at(entity); v != T(0)) m.row.push(later, v);
  }
  m.mirrors = m.row == m.column.mirrored(base.hermitian());
  return m;
}

namespace {

// Columns of some members, one after another, by entries.
template <class T>
void set_columns(Base<T>& base, std::span<const typename Border<T>::Member> some, T* to) {
  std::vector<Offset> places;
  std::vector<T> values;
  for (std::size_t k = 0; k < some.size(); ++k) {
    const SparseVector<T>& u = some[k].column;
    for (const Index i : u.place) places.push_back(static_cast<Offset>(k) * base.order() + i);
    values.insert(values.end(), u.value.begin(), u.value.end());
  }
  base.scatter(places, values, to, static_cast<Index>(some.size()));
}

}  // namespace

// Blocks hold as many columns as go together; taken anew once nobody has one of them.
template <class T>
std::pair<std::shared_ptr<T[]>, Index> Border<T>::room_for(const Base<T>& base, Index columns) {
  for (Block& b : blocks_) {
    if (b.columns.use_count() == 1) b.used = 0;
    if (b.used + columns > kSideBySide) continue;
    b.used += columns;
    return {b.columns, b.used - columns};
  }
  blocks_.push_back({base.memory(kSideBySide), columns});
  return {blocks_.back().columns, 0};
}

// Z of new members, together; refined where the factor alone is not as good as its numbers.
template <class T>
void Border<T>::make_columns(Base<T>& base, std::vector<Member>& made) {
  for (std::size_t first = 0; first < made.size(); first += kSideBySide) {
    const std::size_t count = std::min<std::size_t>(kSideBySide, made.size() - first);
    T* const b = base.vectors(kRightSlot, static_cast<Index>(count));
    const auto [block, place] = room_for(base, static_cast<Index>(count));
    T* const z = block.get() + Offset{place} * base.order();
    set_columns<T>(base, std::span(made).subspan(first, count), b);
    base.substitute(b, z, static_cast<Index>(count));
    if (!checked_) {
      constexpr double kGood = 1e-14;
      refines_ = !(base.residual({{b, z, base.vectors(kCorrectionSlot, 1)}}, false).front() <= kGood);
      checked_ = true;
    }
    for (std::size_t k = 0; k < count; ++k) {
      made[first + k].block = block;
      made[first + k].place = place + static_cast<Index>(k);
    }
  }
  if (refines_) refine(base, made);
}

// Once, by residuals: rounding of Z would stay in S.
template <class T>
void Border<T>::refine(Base<T>& base, std::vector<Member>& some) {
  const Offset n = base.order();
  for (std::size_t first = 0; first < some.size(); first += kSideBySide) {
    const std::size_t count = std::min<std::size_t>(kSideBySide, some.size() - first);
    T* const b = base.vectors(kRightSlot, static_cast<Index>(count));
    T* const r = base.vectors(kCorrectionSlot, static_cast<Index>(count));
    set_columns<T>(base, std::span(some).subspan(first, count), b);
    std::vector<typename Base<T>::Residual> list;
    for (std::size_t k = 0; k < count; ++k) {
      const auto at_k = static_cast<Offset>(k) * n;
      list.push_back({b + at_k, some[first + k].block.get() + some[first + k].place * n, r + at_k});
    }
    const std::vector<double> errors = base.residual(list, false);
    base.substitute(r, r, static_cast<Index>(count));
    for (std::size_t k = 0; k < count; ++k) {
      Member& m = some[first + k];
      if (!m.refined && std::isfinite(errors[k])) base.add(r + static_cast<Offset>(k) * n, m.block.get() + m.place * n);
      m.refined = true;
    }
  }
}

// Most recent ones of those that wait.
template <class T>
void Border<T>::keep_few() {
  std::size_t waiting = members_.size() - active_.size();
  if (waiting <= kKept) return;
  std::vector<Index> left;
  std::vector<Member> kept;
  for (std::size_t k = 0; k < members_.size(); ++k) {
    if (!members_[k].active && waiting > kKept) {
      --waiting;
      continue;
    }
    left.push_back(static_cast<Index>(k));
    kept.push_back(std::move(members_[k]));
  }
  products_ = chosen(products_, left);
  members_ = std::move(kept);
}

// New members with their products. Of a symmetric A and rows that mirror their columns, W A^-1 U is symmetric, too: of
// new rows and columns that are there nothing need be asked for.
template <class T>
void Border<T>::take(const Base<T>& base, std::vector<Member> made) {
  const auto before = static_cast<Eigen::Index>(members_.size()), more = static_cast<Eigen::Index>(made.size());
  std::vector<const SparseVector<T>*> rows, new_rows;
  for (const Member& m : members_) rows.push_back(&m.row);
  for (const Member& m : made) new_rows.push_back(&m.row);
  rows.insert(rows.end(), new_rows.begin(), new_rows.end());
  Matrix all(before + more, before + more);
  for_each_entry(products_, [&](const T& x, auto r, auto c) { all(r, c) = x; });
  const auto multiply = [&](const std::vector<Member>& of, const std::vector<const SparseVector<T>*>& by,
                            Eigen::Index first_row, Eigen::Index first_column) {
    for_each_run(of, [&](std::size_t begin, std::size_t end) {
      const T* z = of[begin].block.get() + Offset{of[begin].place} * base.order();
      const auto count = static_cast<Index>(end - begin);
      Matrix products = products_of(base, by, z, count);
      for_each_entry(products, [&](const T& x, auto r, auto c) {
        all(first_row + r, first_column + static_cast<Eigen::Index>(begin) + c) = x;
      });
    });
  };
  multiply(made, rows, 0, before);
  const auto mirrors = [](const Member& m) { return m.mirrors; };
  if (base.symmetric() && std::all_of(members_.begin(), members_.end(), mirrors) &&
      std::all_of(made.begin(), made.end(), mirrors)) {
    for (Eigen::Index r = 0; r < before; ++r)
      for (Eigen::Index c = before; c < before + more; ++c)
        all(c, r) = base.hermitian() ? base::conjugate(all(r, c)) : all(r, c);
  } else {
    multiply(members_, new_rows, before, 0);
  }
  products_ = std::move(all);
  members_.insert(members_.end(), std::make_move_iterator(made.begin()), std::make_move_iterator(made.end()));
}

template <class T>
std::vector<Index> Border<T>::to_make(const std::set<Index>& wanted) const {
  std::set<Index> missing = wanted;
  for (const Member& m : members_) missing.erase(m.entity);
  return {missing.begin(), missing.end()};
}

template <class T>
Index Border<T>::update(Base<T>& base, const std::set<Index>& wanted) {
  std::vector<Member> made;
  for (const Index e : to_make(wanted)) made.push_back(make(base, e));
  make_columns(base, made);

  const auto more = static_cast<Index>(made.size());
  if (more > 0) take(base, std::move(made));
  for (Member& m : members_) m.active = wanted.count(m.entity) > 0;
  const auto list = [&] {
    active_.clear();
    for (std::size_t k = 0; k < members_.size(); ++k)
      if (members_[k].active) active_.push_back(static_cast<Index>(k));
  };
  list();
  keep_few();
  list();
  return more;
}

template <class T>
T Border<T>::corner(std::size_t row, std::size_t column) const {
  const Member &r = member(row), &c = member(column);
  if (r.slack || c.slack) return 0;
  if (r.entity < matrix_->n() && c.entity < matrix_->n()) return original_->entry(r.entity, c.entity);
  return matrix_->coupling(r.entity, c.entity);
}

// What cancels to rounding is 0.
template <class T>
typename Border<T>::Matrix Border<T>::complement() const {
  constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon();
  Matrix s = chosen(products_, active_);
  for_each_entry(s, [&](T& entry, auto r, auto c) {
    const T d = corner(at(r), at(c));
    const double terms = std::abs(d) + std::abs(entry);
    entry = d - entry;
    if (std::abs(entry) <= kRounding * terms) entry = 0;
  });
  return s;
}

template <class T>
Inertia Border<T>::inertia() const {
  Inertia of_s{0, 0, 0};
  Matrix s = complement();
  if (s.rows() == 0) return of_s;
  VectorXd scale = largest_of_rows(s);
  for (double& x : scale) x = x > 0 && std::isfinite(x) ? std::ldexp(1.0, -std::ilogb(x) / 2) : 1.0;
  Matrix mean(s.rows(), s.rows());
  for_each_entry(mean,
                 [&](T& x, auto r, auto c) { x = (s(r, c) + base::conjugate(s(c, r))) / 2.0 * scale[r] * scale[c]; });
  const VectorXd values = dense::hermitian_eigenvalues(mean);
  const double zero =
      4 * static_cast<double>(values.size()) * std::numeric_limits<double>::epsilon() * values.cwiseAbs().maxCoeff();
  for (const double v : values) ++(std::abs(v) <= zero ? of_s.zero : v > 0 ? of_s.positive : of_s.negative);
  return of_s;
}

// Singular: a condition, rows and columns scaled to 1, at which rounding may leave no digit.
template <class T>
bool Border<T>::factorize_once() {
  Matrix s = complement();
  const Eigen::Index k = s.rows();
  smallest_ = 1;
  if (k == 0) return true;
  smallest_ = 0;
  if (!s.allFinite()) return false;
  const VectorXd before = largest_of_rows(s);
  row_ = VectorXd(before);  // moved in (modes/lanczos.cpp)
  for (double& x : row_) x = inverse_power_of_two(x);
  s = scaled_rows(row_, std::move(s));
  col_ = VectorXd(VectorXd::Zero(k));
  for_each_entry(s, [&](const T& x, auto, auto c) { col_[c] = std::max(col_[c], std::abs(x)); });
  for (double& x : col_) x = inverse_power_of_two(x);
  for_each_entry(s, [&](T& x, auto, auto c) { x *= col_[c]; });
  factor_.compute(s);
  // Where a pivot is zero, the estimate of the condition may come out finite.
  if (!factor_.regular()) return false;
  const double least = 4 * static_cast<double>(k) * std::numeric_limits<double>::epsilon();
  s = chosen(products_, active_);
  const VectorXd terms = largest_of_rows(s);
  smallest_ = factor_.rcond();
  if (!(smallest_ > least)) return false;
  for (Eigen::Index r = 0; r < k; ++r)
    if (terms[r] > 0) smallest_ = std::min(smallest_, before[r] / terms[r]);
  return true;
}

template <class T>
bool Border<T>::factorize(Base<T>& base) {
  constexpr double kSuspicious = 1e-8;
  const bool regular = factorize_once();
  const auto trusted = [](const Member& m) { return m.refined; };
  if ((regular && smallest_ > kSuspicious) || std::all_of(members_.begin(), members_.end(), trusted)) return regular;
  refine(base, members_);
  std::vector<Member> all = std::move(members_);
  members_.clear();
  products_.resize(0, 0);
  take(base, std::move(all));
  return factorize_once();
}

template <class T>
typename Border<T>::Matrix Border<T>::solve(const Matrix& right, bool turned) const {
  if (active_.empty()) return right;
  if (turned) return scaled_rows(row_, factor_.solve_transposed(scaled_rows(col_, right)));
  return scaled_rows(col_, factor_.solve(scaled_rows(row_, right)));
}

template <class T>
typename Border<T>::Matrix Border<T>::rows_times(const Base<T>& base, const T* y, Index columns, bool turned) const {
  std::vector<const SparseVector<T>*> rows;
  for (std::size_t k = 0; k < active_.size(); ++k) rows.push_back(&member(k).row_of(turned));
  return products_of(base, rows, y, columns);
}

template <class T>
void Border<T>::subtract(const Base<T>& base, const Matrix& t, T* y) const {
  std::vector<Eigen::Index> number(members_.size(), -1);
  for (std::size_t k = 0; k < active_.size(); ++k) number[at(active_[k])] = static_cast<Eigen::Index>(k);
  std::vector<T> factors;
  for (Eigen::Index c = 0; c < t.cols(); ++c, y += base.order())
    for_each_run(members_, [&](std::size_t begin, std::size_t end) {
      factors.assign(end - begin, T(0));
      for (std::size_t k = begin; k < end; ++k)
        if (number[k] >= 0) factors[k - begin] = -t(number[k], c);
      base.add_columns(members_[begin].block.get() + Offset{members_[begin].place} * base.order(), factors, y);
    });
}

#define ESPALIER_INSTANTIATE(T) template class Border<T>;
ESPALIER_FOR_NUMBERS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::changes
