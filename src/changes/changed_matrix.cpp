#include "changes/changed_matrix.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "base/at.hpp"

namespace espalier::changes {

double SparseVector::at(Index i) const {
  const auto found = std::lower_bound(place.begin(), place.end(), i);
  return found == place.end() || *found != i ? 0 : value[static_cast<std::size_t>(found - place.begin())];
}

void SparseVector::sort() {
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

ChangedMatrix::ChangedMatrix(Index n) : n_(n), alive_(espalier::at(n), 1), entity_of_(espalier::at(n)) {
  std::iota(entity_of_.begin(), entity_of_.end(), 0);
}

double ChangedMatrix::coupling(Index row, Index column) const {
  if (row == column) return item(row).corner;
  return row > column ? item(row).row.at(column) : item(column).column.at(row);
}

void ChangedMatrix::add(Item item) {
  plain_ = plain_ && unknowns() == entities();
  entity_of_.push_back(entities());
  add_auxiliary(std::move(item));
}

void ChangedMatrix::add_auxiliary(Item item) {
  touched_.push_back(entities());
  items_.push_back(std::move(item));
  alive_.push_back(1);
}

void ChangedMatrix::replace(Index unknown, Item item) {
  plain_ = false;
  set_alive(unknown, false);
  entity_of_[espalier::at(unknown)] = entities();
  add_auxiliary(std::move(item));
}

}  // namespace espalier::changes
