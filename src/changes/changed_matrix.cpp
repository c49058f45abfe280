#include "changes/changed_matrix.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "base/at.hpp"

namespace espalier::changes {

template <class T>
T SparseVector<T>::at(Index i) const {
  const auto found = std::lower_bound(place.begin(), place.end(), i);
  return found == place.end() || *found != i ? T(0) : value[static_cast<std::size_t>(found - place.begin())];
}

template <class T>
void SparseVector<T>::sort() {
  std::vector<std::size_t> order(place.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return place[a] < place[b]; });
  SparseVector sorted;
  for (const std::size_t k : order) {
    if (!sorted.place.empty() && sorted.place.back() == place[k])
      sorted.value.back() += value[k];
    else
      sorted.push(place[k], value[k]);
  }
  *this = std::move(sorted);
}

template <class T>
ChangedMatrix<T>::ChangedMatrix(Index n, bool hermitian)
    : n_(n), hermitian_(hermitian), alive_(espalier::at(n), 1), entity_of_(espalier::at(n)) {
  std::iota(entity_of_.begin(), entity_of_.end(), 0);
}

template <class T>
bool ChangedMatrix<T>::items_are_symmetric() const {
  for (Index e = n_; e < entities(); ++e)
    if (alive(e) && !item(e).symmetric(hermitian_)) return false;
  return true;
}

template <class T>
T ChangedMatrix<T>::coupling(Index row, Index column) const {
  if (row == column) return item(row).corner;
  return row > column ? item(row).row.at(column) : item(column).column.at(row);
}

template <class T>
void ChangedMatrix<T>::add(Item<T> item) {
  plain_ = plain_ && unknowns() == entities();
  entity_of_.push_back(entities());
  add_auxiliary(std::move(item));
}

template <class T>
void ChangedMatrix<T>::add_auxiliary(Item<T> item) {
  touched_.push_back(entities());
  items_.push_back(std::move(item));
  alive_.push_back(1);
}

template <class T>
void ChangedMatrix<T>::replace(Index unknown, Item<T> item) {
  plain_ = false;
  set_alive(unknown, false);
  entity_of_[espalier::at(unknown)] = entities();
  add_auxiliary(std::move(item));
}

#define ESPALIER_INSTANTIATE(T)    \
  template struct SparseVector<T>; \
  template class ChangedMatrix<T>;
ESPALIER_FOR_NUMBERS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::changes
