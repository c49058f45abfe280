#include "changes/row_norm.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "base/at.hpp"

namespace espalier::changes {

namespace {

constexpr std::size_t kMostRows = 4096;  // that are summed anew: those with the largest bounds

template <class T>
double sum_of_magnitudes(const SparseVector<T>& v) {
  double sum = 0;
  for (const T& x : v.value) sum += std::abs(x);
  return sum;
}

/// Rows of the changed matrix, or of its transpose, with what changes of low rank add to them.
template <class T>
class Rows {
 public:
  Rows(const ChangedMatrix<T>& matrix, const Base<T>& base, const Border<T>& border, bool turned)
      : matrix_(matrix), base_(base), border_(border), turned_(turned), sum_(at(matrix.entities()), T(0)) {}

  double sum_of(Index entity) {
    columns_.clear();
    if (base_.has(entity)) {
      base_.for_each_in_row(entity, turned_, [&](Index column, T v) { add(column, v); });
      for (std::size_t k = 0; k < border_.active().size(); ++k)
        if (!border_.member(k).slack) add(border_.member(k).entity, border_.member(k).column_of(turned_).at(entity));
    } else {
      add_own_row(entity);
    }
    double total = 0;
    for (const Index c : columns_) {
      total += std::abs(sum_[at(c)]);
      sum_[at(c)] = 0;
    }
    return total;
  }

 private:
  void add(Index column, T v) {
    if (v == T(0) || !matrix_.alive(column)) return;
    if (!matrix_.auxiliary(column)) return add_one(column, v);
    const Item<T>& i = matrix_.item(column);
    const SparseVector<T>& row = i.row_of(turned_);
    for (std::size_t q = 0; q < row.size(); ++q)
      if (matrix_.alive(row.place[q])) add_one(row.place[q], -v / i.corner * row.value[q]);
  }
  void add_one(Index column, T v) {
    columns_.push_back(column);  // a second time it finds zero
    sum_[at(column)] += v;
  }
  void add_own_row(Index entity) {
    std::size_t me = 0;
    while (border_.member(me).entity != entity) ++me;
    const SparseVector<T>& row = border_.member(me).row_of(turned_);
    for (std::size_t q = 0; q < row.size(); ++q) add(row.place[q], row.value[q]);
    for (std::size_t k = 0; k < border_.active().size(); ++k)
      if (!border_.member(k).slack)
        add(border_.member(k).entity, turned_ ? border_.corner(k, me) : border_.corner(me, k));
  }

  const ChangedMatrix<T>& matrix_;
  const Base<T>& base_;
  const Border<T>& border_;
  bool turned_;
  std::vector<T> sum_;
  std::vector<Index> columns_;
};

}  // namespace

template <class T>
double RowNorm<T>::of(const ChangedMatrix<T>& matrix, Base<T>& base, const Border<T>& border, bool turned) {
  const std::vector<double>& sums = base.row_sums(turned);
  bound_.resize(at(matrix.entities()), 0.0);
  touched_.resize(bound_.size(), 0);
  list_.clear();
  const auto touch = [&](Index row, double more) {
    if (std::exchange(touched_[at(row)], 1) == 0) list_.push_back(row);
    bound_[at(row)] += more;
  };
  const auto touch_all = [&](const SparseVector<T>& column, double factor) {
    for (std::size_t q = 0; q < column.size(); ++q) touch(column.place[q], factor * std::abs(column.value[q]));
  };
  const auto weight = [&](Index entity) {
    if (!matrix.auxiliary(entity)) return 1.0;
    return sum_of_magnitudes(matrix.item(entity).row_of(turned)) / std::abs(matrix.item(entity).corner);
  };
  for (std::size_t k = 0; k < border.active().size(); ++k) {
    const typename Border<T>::Member& m = border.member(k);
    if (m.slack) {
      base.for_each_in_row(m.entity, !turned, [&](Index row, T) { touch(row, 0); });  // its column
      continue;
    }
    touch_all(m.column_of(turned), weight(m.entity));
    touch(m.entity, sum_of_magnitudes(m.row_of(turned)));
  }
  for (Index e = matrix.n(); e < base.order(); ++e)
    if (base.has(e) && matrix.auxiliary(e)) touch_all(matrix.item(e).column_of(turned), weight(e));

  const auto stays = [&](Index row) { return touched_[at(row)] == 0 && base.has(row) && matrix.counts(row); };
  const std::vector<Index>& largest = base.largest_rows(turned);
  const auto first = std::find_if(largest.begin(), largest.end(), stays);
  double most = first == largest.end() ? 0 : sums[at(*first)];
  if (first == largest.end())
    for (Index e = 0; e < base.order(); ++e)
      if (stays(e)) most = std::max(most, sums[at(e)]);
  std::vector<Index> rows;
  for (const Index e : list_) {
    if (!matrix.counts(e)) continue;
    if (base.has(e)) bound_[at(e)] += sums[at(e)];
    rows.push_back(e);
  }
  std::sort(rows.begin(), rows.end(),
            [&](Index a, Index b) { return bound_[at(a)] != bound_[at(b)] ? bound_[at(a)] > bound_[at(b)] : a < b; });
  if (rows.size() > kMostRows) rows.resize(kMostRows);
  std::optional<Rows<T>> changed;
  for (const Index e : rows) {
    if (bound_[at(e)] <= most) break;
    if (!changed) changed.emplace(matrix, base, border, turned);
    most = std::max(most, changed->sum_of(e));
  }
  for (const Index e : list_) {
    bound_[at(e)] = 0;
    touched_[at(e)] = 0;
  }
  return most;
}

#define ESPALIER_INSTANTIATE(T) template class RowNorm<T>;
ESPALIER_FOR_NUMBERS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::changes
