#include "changes/base.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>

#include "base/at.hpp"
#include "changes/changed_matrix.hpp"

namespace espalier::changes {

template <class T>
Base<T>::Base(solver::Session& session, std::vector<char> alive) : session_(&session), alive_(std::move(alive)) {}

template <class T>
Index Base<T>::dead() const {
  return static_cast<Index>(std::count(alive_.begin(), alive_.end(), 0));
}

template <class T>
T Base<T>::entry(Index row, Index column) const {
  T found = 0;
  for_each_in_column(column, [&](Index r, T v) { found += r == row ? v : T(0); });
  return found;
}

template <class T>
const std::vector<double>& Base<T>::row_sums(bool turned) {
  std::vector<double>& made = row_sums_[turned ? 1 : 0];
  if (!made.empty() || order() == 0) return made;
  (void)values();  // from a device, if they are there alone
  std::vector<double> sums(at(order()), 0.0);
  session_->pool.for_each_range(order(), 1024, [&](std::int64_t begin, std::int64_t end) {
    for (auto i = begin; i < end; ++i)
      for_each_in_row(static_cast<Index>(i), turned,
                      [&](Index, T v) { sums[static_cast<std::size_t>(i)] += std::abs(v); });
  });
  made = std::move(sums);
  return made;
}

template <class T>
const std::vector<Index>& Base<T>::largest_rows(bool turned) {
  constexpr std::size_t kMost = 8192;
  std::vector<Index>& made = largest_rows_[turned ? 1 : 0];
  if (!made.empty()) return made;
  const std::vector<double>& sums = row_sums(turned);
  std::vector<Index> rows(at(order()));
  std::iota(rows.begin(), rows.end(), 0);
  const auto first = [&](Index a, Index b) { return sums[at(a)] != sums[at(b)] ? sums[at(a)] > sums[at(b)] : a < b; };
  if (rows.size() > kMost) {
    std::nth_element(rows.begin(), rows.begin() + kMost, rows.end(), first);
    rows.resize(kMost);
  }
  std::sort(rows.begin(), rows.end(), first);
  made = std::move(rows);
  return made;
}

template <class T>
const device::ResidualSpace& Base<T>::space() const {
  if (const device::DeviceLinearSystem* d = device(); d != nullptr) return *d;
  return session_->factor->residual();
}

template <class T>
T* Base<T>::vectors(Index slot, Index columns) {
  if constexpr (kParts == 1)
    if (!on_host()) return device()->vectors(slot, columns).data;
  if (slots_.size() <= at(slot)) slots_.resize(at(slot) + 1);
  slots_[at(slot)].resize(at(order()) * at(columns));
  return slots_[at(slot)].data();
}

template <class T>
std::shared_ptr<T[]> Base<T>::memory(Index columns) const {
  if constexpr (kParts == 1)
    return space().memory(columns);
  else
    return std::make_shared_for_overwrite<T[]>(at(order()) * at(columns));
}

template <class T>
void Base<T>::send(T* to, const T* from, Index columns) const {
  const Offset count = Offset{order()} * columns;
  if (on_host())
    std::copy_n(from, count, to);
  else
    device()->send(parts(to), parts(from), count);
}

template <class T>
void Base<T>::fetch(T* to, const T* from, Index columns) const {
  const Offset count = Offset{order()} * columns;
  if (on_host())
    std::copy_n(from, count, to);
  else
    device()->fetch(parts(to), parts(from), count);
}

template <class T>
void Base<T>::scatter(std::span<const Offset> places, std::span<const T> values, T* y, Index cleared) const {
  if constexpr (kParts == 1) return space().scatter(places, values, y, cleared);
  std::fill_n(y, at(order()) * at(cleared), T(0));
  for (std::size_t k = 0; k < places.size(); ++k) y[places[k]] = values[k];
}

template <class T>
void Base<T>::gather(const T* y, std::span<const Offset> places, T* to) const {
  if constexpr (kParts == 1) return space().gather(y, places, to);
  for (std::size_t k = 0; k < places.size(); ++k) to[k] = y[places[k]];
}

template <class T>
void Base<T>::copy(const T* from, T* to) const {
  if constexpr (kParts == 1) return space().copy(from, to);
  std::copy_n(from, order(), to);
}

template <class T>
std::vector<double> Base<T>::largest(const std::vector<const T*>& vectors) const {
  std::vector<double> found(vectors.size(), 0.0);
  if constexpr (kParts == 1)
    space().largest(vectors, found);
  else
    for (std::size_t k = 0; k < vectors.size(); ++k)
      for (Index i = 0; i < order() && !std::isnan(found[k]); ++i)
        if (const double size = std::abs(vectors[k][i]); !(size <= found[k])) found[k] = size;
  return found;
}

template <class T>
void Base<T>::add(const T* from, T* to) const {
  (void)space().add(parts(from), parts(to));
}

// An entry is the sum of its products in their order, whoever makes it.
template <class T>
void Base<T>::add_columns(const T* z, std::span<const T> factors, T* y) const {
  if constexpr (kParts == 1) {
    space().add_columns(z, factors, y);
  } else {
    session_->pool.for_each_range(order(), 4096, [&](std::int64_t begin, std::int64_t end) {
      const T* column = z;
      for (const T& factor : factors) {
        for (auto i = begin; i < end && factor != T(0); ++i) y[i] += factor * column[i];
        column += order();
      }
    });
  }
}

// What the space calls the transpose of a Hermitian matrix is the matrix.
template <class T>
std::vector<double> Base<T>::residual(const std::vector<Residual>& columns, bool turned) const {
  const bool conjugates = turned && hermitian();
  const auto conjugate = [&](T* v) {
    for (Index k = 0; k < order() && conjugates; ++k) v[k] = base::conjugate(v[k]);
  };
  std::vector<device::ResidualColumn> list;
  for (const Residual& c : columns) {
    conjugate(c.b);
    conjugate(c.x);
    list.push_back({parts(c.b), parts(c.x), parts(c.r), {}});
  }
  space().compute(list, turned);
  for (const Residual& c : columns) {
    for (T* const v : {c.b, c.x, c.r}) conjugate(v);
  }
  std::vector<double> errors;
  for (const device::ResidualColumn& c : list) errors.push_back(c.error.normwise);
  return errors;
}

template <class T>
void Base<T>::substitute(const T* b, T* x, Index columns, bool turned) {
  if (!on_host()) return device()->substitute(parts(b), parts(x), columns, turned);
  if (!(turned && hermitian())) return session_->factor->solve(parts(b), parts(x), columns, turned);
  std::vector<T> given(b, b + Offset{order()} * columns);
  for (T& v : given) v = base::conjugate(v);
  session_->factor->solve(parts(given.data()), parts(x), columns, false);
  for (std::size_t k = 0; k < given.size(); ++k) x[k] = base::conjugate(x[k]);
}

#define ESPALIER_INSTANTIATE(T) template class Base<T>;
ESPALIER_FOR_NUMBERS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::changes
