#include "espalier/changed_system.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <utility>

#include "base/at.hpp"
#include "base/stopwatch.hpp"
#include "changes/given_columns.hpp"
#include "changes/low_rank.hpp"
#include "changes/system.hpp"
#include "solver/session/solver_impl.hpp"
#include "solver/session/status_of.hpp"

namespace espalier {

namespace {

using changes::check_finite;
using changes::columns_of;
using changes::count_of;
using changes::Item;
using changes::SparseVector;

std::size_t area(Index rows, Index columns) { return at(rows) * at(columns); }

void check_size(const char* call, const char* name, std::size_t have, std::size_t need, bool may_be_empty) {
  if (have == need || (may_be_empty && have == 0)) return;
  throw std::invalid_argument(
      fmt::format("ChangedSystem::{}: {} has {} values, {} are needed", call, name, have, need));
}

}  // namespace

template <class T>
struct ChangedSystemOf<T>::Impl {
  Impl(SolverOf<T>& the_solver, bool the_by_rows) : solver(&the_solver), by_rows(the_by_rows) { reset(); }

  void reset() {
    if (solver->state() != Solver::State::factorized)
      throw std::logic_error("ChangedSystem: the solver has no factorization");
    if (session().link() != nullptr)
      throw std::logic_error("ChangedSystem: several ranks share the solver; it works on a solver of one process");
    system.reset();  // its memory first
    system = std::make_unique<changes::System<T>>(*solver);
    system->set_folding(folds);
    stamp = session().factor->stamp();
  }

  [[nodiscard]] solver::Session& session() const { return solver::SolverAccess::session(*solver); }
  void expect_factor(const char* call) const {
    const solver::Session& s = session();
    if (!s.factor || !s.factor->factorized() || s.factor->stamp() != stamp)
      throw std::logic_error(fmt::format(
          "ChangedSystem::{}: the solver has been factorized again, or has lost its factor; call reset()", call));
  }
  template <class Body>
  Status guarded(Body&& body) const {
    return solver::status_of(session().interruption, "keep fewer changes", [&] {
      session().expect_usable();
      body();
    });
  }

  [[nodiscard]] const changes::ChangedMatrix<T>& matrix() const { return system->matrix(); }
  /// By entities, where unknowns of earlier ones are meant.
  [[nodiscard]] SparseVector<T> over_entities(const SparseVector<T>& from) const {
    SparseVector<T> to;
    for (std::size_t q = 0; q < from.size(); ++q) to.push(matrix().entity_of(from.place[q]), from.value[q]);
    to.sort();
    return to;
  }
  void check_known(Index unknown) const {
    if (unknown < 0 || unknown >= matrix().unknowns())
      throw Error(StatusCode::invalid_input,
                  fmt::format("there is no unknown {}; they run from 0 to {}", unknown, matrix().unknowns() - 1),
                  unknown);
  }
  [[nodiscard]] bool is_removed(Index unknown) const { return !matrix().alive(matrix().entity_of(unknown)); }
  void check_list(std::span<const Index> unknowns) const {
    std::vector<Index> sorted(unknowns.begin(), unknowns.end());
    std::sort(sorted.begin(), sorted.end());
    for (const Index v : sorted) check_known(v);
    const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
    if (twice != sorted.end())
      throw Error(StatusCode::invalid_input, fmt::format("unknown {} stands twice in the list", *twice), *twice);
  }
  void check_list(std::span<const Index> unknowns, bool expected) const {
    check_list(unknowns);
    for (const Index v : unknowns)
      if (is_removed(v) != expected)
        throw Error(StatusCode::invalid_input,
                    fmt::format("unknown {} is {}", v, expected ? "not removed" : "removed already"), v);
  }
  void set_alive(std::span<const Index> unknowns, bool alive) {
    for (const Index v : unknowns) system->changing().set_alive(v, alive);
  }

  void add(const std::vector<SparseVector<T>>& columns, const std::vector<SparseVector<T>>& rows,
           std::span<const T> corner);
  void replace(std::span<const Index> unknowns, std::vector<SparseVector<T>> columns,
               std::vector<SparseVector<T>> rows);
  void add_low_rank(const std::vector<SparseVector<T>>& u, std::span<const T> c, std::vector<SparseVector<T>> v);

  /// As the solver has it.
  [[nodiscard]] Item<T> held(Item<T> item) const {
    if (by_rows) std::swap(item.column, item.row);
    return item;
  }

  SolverOf<T>* solver;
  bool by_rows;
  std::unique_ptr<changes::System<T>> system;
  std::uint64_t stamp = 0;
  bool folds = true;
};

// In the corner, what stands between two new ones belongs to the later one.
template <class T>
void ChangedSystemOf<T>::Impl::add(const std::vector<SparseVector<T>>& columns,
                                   const std::vector<SparseVector<T>>& rows, std::span<const T> corner) {
  const std::size_t count = columns.size();
  const Index first = matrix().entities();
  std::vector<Item<T>> items;
  for (std::size_t k = 0; k < count; ++k) {
    Item<T> item;
    item.column = over_entities(columns[k]);
    item.row = rows.empty() ? item.column.mirrored(matrix().hermitian()) : over_entities(rows[k]);
    for (std::size_t i = 0; i < k && !corner.empty(); ++i) {
      const Index earlier = first + static_cast<Index>(i);
      if (const T v = corner[k * count + i]; v != T(0)) item.column.push(earlier, v);
      if (const T v = corner[i * count + k]; v != T(0)) item.row.push(earlier, v);
    }
    if (!corner.empty()) item.corner = corner[k * count + k];
    items.push_back(std::move(item));
  }
  for (Item<T>& item : items) system->changing().add(held(std::move(item)));
}

// Unknowns of the list that come later say what stands between two of it; entities of those are known one by one.
template <class T>
void ChangedSystemOf<T>::Impl::replace(std::span<const Index> unknowns, std::vector<SparseVector<T>> columns,
                                       std::vector<SparseVector<T>> rows) {
  const bool same = rows.empty();
  for (std::size_t k = 0; k < unknowns.size(); ++k) {
    const auto own = [&](SparseVector<T>& from) {
      T found = 0;
      SparseVector<T> others;
      for (std::size_t q = 0; q < from.size(); ++q) {
        const Index place = from.place[q];
        if (place == unknowns[k]) found = from.value[q];
        const auto later = std::find(unknowns.begin() + static_cast<std::ptrdiff_t>(k) + 1, unknowns.end(), place);
        if (place != unknowns[k] && later == unknowns.end()) others.push(place, from.value[q]);
      }
      from = std::move(others);
      return found;
    };
    Item<T> item;
    item.corner = own(columns[k]);
    item.column = over_entities(columns[k]);
    if (!same) (void)own(rows[k]);
    item.row = same ? item.column.mirrored(matrix().hermitian()) : over_entities(rows[k]);
    system->changing().replace(unknowns[k], held(std::move(item)));
  }
}

template <class T>
void ChangedSystemOf<T>::Impl::add_low_rank(const std::vector<SparseVector<T>>& u, std::span<const T> c,
                                            std::vector<SparseVector<T>> v) {
  const bool hermitian = matrix().hermitian();
  if (v.empty())
    for (const SparseVector<T>& column : u) v.push_back(column.mirrored(hermitian));
  std::vector<Item<T>> items = changes::low_rank_items(u, c, v, hermitian);
  for (Item<T>& item : items) {
    item.column = over_entities(item.column);
    item.row = over_entities(item.row);
    system->changing().add_auxiliary(held(std::move(item)));
  }
}

template <class T>
ChangedSystemOf<T>::ChangedSystemOf(SolverOf<T>& solver, bool by_rows)
    : impl_(std::make_unique<Impl>(solver, by_rows)) {}
template <class T>
ChangedSystemOf<T>::~ChangedSystemOf() = default;
template <class T>
ChangedSystemOf<T>::ChangedSystemOf(ChangedSystemOf&&) noexcept = default;
template <class T>
ChangedSystemOf<T>& ChangedSystemOf<T>::operator=(ChangedSystemOf&&) noexcept = default;

template <class T>
void ChangedSystemOf<T>::reset() {
  impl_->reset();
}
template <class T>
void ChangedSystemOf<T>::reset(bool by_rows) {
  impl_->reset();
  impl_->by_rows = by_rows;
}
template <class T>
bool ChangedSystemOf<T>::hermitian() const {
  return impl_->matrix().hermitian();
}
template <class T>
Index ChangedSystemOf<T>::size() const {
  return impl_->matrix().unknowns();
}
template <class T>
Index ChangedSystemOf<T>::changes() const {
  return impl_->system->changes();
}
template <class T>
ChangeCost ChangedSystemOf<T>::cost() const {
  return impl_->system->cost();
}
template <class T>
bool ChangedSystemOf<T>::removed(Index unknown) const {
  if (unknown < 0 || unknown >= size())
    throw std::out_of_range(fmt::format("ChangedSystem::removed: there is no unknown {}, of {}", unknown, size()));
  return impl_->is_removed(unknown);
}
template <class T>
void ChangedSystemOf<T>::set_folding(bool automatic) {
  impl_->folds = automatic;
  impl_->system->set_folding(automatic);
}

template <class T>
Status ChangedSystemOf<T>::add(std::span<const T> columns, Index count, std::span<const T> rows,
                               std::span<const T> corner) {
  Impl& m = *impl_;
  const Index n = m.matrix().n();
  m.expect_factor("add");
  if (count < 1) throw std::invalid_argument(fmt::format("ChangedSystem::add: {} unknowns", count));
  check_size("add", "columns", columns.size(), area(n, count), false);
  check_size("add", "rows", rows.size(), area(n, count), true);
  check_size("add", "corner", corner.size(), area(count, count), true);
  return m.guarded([&] {
    check_finite<T>(corner, "the corner");
    m.add(columns_of(columns, n, "the columns"), columns_of(rows, n, "the rows"), corner);
  });
}

template <class T>
Status ChangedSystemOf<T>::add(const SparseColumnsOf<T>& columns, const SparseColumnsOf<T>& rows,
                               std::span<const T> corner) {
  Impl& m = *impl_;
  m.expect_factor("add");
  const Index count = count_of(columns);
  if (count < 1) throw std::invalid_argument("ChangedSystem::add: 0 unknowns");
  check_size("add", "rows", at(count_of(rows)), at(count), true);
  check_size("add", "corner", corner.size(), area(count, count), true);
  return m.guarded([&] {
    check_finite<T>(corner, "the corner");
    const Index most = m.matrix().unknowns();
    m.add(columns_of(columns, most, "the columns"), columns_of(rows, most, "the rows"), corner);
  });
}

template <class T>
Status ChangedSystemOf<T>::replace(std::span<const Index> unknowns, const SparseColumnsOf<T>& columns,
                                   const SparseColumnsOf<T>& rows) {
  Impl& m = *impl_;
  m.expect_factor("replace");
  check_size("replace", "columns", at(count_of(columns)), unknowns.size(), false);
  check_size("replace", "rows", at(count_of(rows)), unknowns.size(), true);
  return m.guarded([&] {
    m.check_list(unknowns, false);
    const Index most = m.matrix().unknowns();
    m.replace(unknowns, columns_of(columns, most, "the columns"), columns_of(rows, most, "the rows"));
  });
}

template <class T>
Status ChangedSystemOf<T>::remove(std::span<const Index> unknowns) {
  impl_->expect_factor("remove");
  return impl_->guarded([&] {
    impl_->check_list(unknowns, false);
    impl_->set_alive(unknowns, false);
  });
}

template <class T>
Status ChangedSystemOf<T>::restore(std::span<const Index> unknowns) {
  impl_->expect_factor("restore");
  return impl_->guarded([&] {
    impl_->check_list(unknowns, true);
    impl_->set_alive(unknowns, true);
  });
}

template <class T>
Status ChangedSystemOf<T>::flip(std::span<const Index> unknowns) {
  impl_->expect_factor("flip");
  return impl_->guarded([&] {
    impl_->check_list(unknowns);
    for (const Index v : unknowns) impl_->system->changing().set_alive(v, impl_->is_removed(v));
  });
}

template <class T>
Status ChangedSystemOf<T>::add_low_rank(std::span<const T> u, Index rank, std::span<const T> c, std::span<const T> v) {
  Impl& m = *impl_;
  const Index n = m.matrix().n();
  m.expect_factor("add_low_rank");
  if (rank < 1) throw std::invalid_argument(fmt::format("ChangedSystem::add_low_rank: rank {}", rank));
  check_size("add_low_rank", "u", u.size(), area(n, rank), false);
  check_size("add_low_rank", "v", v.size(), area(n, rank), true);
  check_size("add_low_rank", "c", c.size(), area(rank, rank), true);
  return m.guarded([&] {
    check_finite<T>(c, "c");
    m.add_low_rank(columns_of(u, n, "u"), c, columns_of(v, n, "v"));
  });
}

template <class T>
Status ChangedSystemOf<T>::add_low_rank(const SparseColumnsOf<T>& u, std::span<const T> c,
                                        const SparseColumnsOf<T>& v) {
  Impl& m = *impl_;
  m.expect_factor("add_low_rank");
  const Index rank = count_of(u), n = m.matrix().n();
  if (rank < 1) throw std::invalid_argument("ChangedSystem::add_low_rank: rank 0");
  check_size("add_low_rank", "v", at(count_of(v)), at(rank), true);
  check_size("add_low_rank", "c", c.size(), area(rank, rank), true);
  return m.guarded([&] {
    check_finite<T>(c, "c");
    m.add_low_rank(columns_of(u, n, "u"), c, columns_of(v, n, "v"));
  });
}

template <class T>
Status ChangedSystemOf<T>::prepare() {
  impl_->expect_factor("prepare");
  return impl_->guarded([&] { impl_->system->prepare(); });
}

template <class T>
Status ChangedSystemOf<T>::fold() {
  impl_->expect_factor("fold");
  return impl_->guarded([&] { impl_->system->fold(); });
}

template <class T>
ChangedSolveResult ChangedSystemOf<T>::solve(std::span<const T> b, std::span<T> x, Index columns, Transpose transpose) {
  Impl& m = *impl_;
  m.expect_factor("solve");
  if (columns < 1) throw std::invalid_argument(fmt::format("ChangedSystem::solve: {} right-hand sides", columns));
  check_size("solve", "b", b.size(), area(size(), columns), false);
  check_size("solve", "x", x.size(), area(size(), columns), false);
  const double start = base::now_seconds();
  ChangedSolveResult result;
  result.componentwise_error = std::numeric_limits<double>::quiet_NaN();
  Status status = m.guarded([&] {
    for (std::size_t k = 0; k < b.size(); ++k)
      if (const auto row = static_cast<Index>(k % at(size())); !changes::is_finite(b[k]) && !m.is_removed(row))
        throw Error(StatusCode::invalid_input,
                    fmt::format("row {} of a right-hand side is {}", row, changes::shown(b[k])), row);
    m.system->prepare();
    std::vector<T> kept;  // where b and x overlap and a second attempt may need b
    const std::less<> before;
    if (m.folds && before(b.data(), x.data() + x.size()) && before(x.data(), b.data() + b.size()))
      kept.assign(b.begin(), b.end());
    const bool transposed = (transpose != Transpose::no) != m.by_rows;
    const bool conjugated = transpose == Transpose::conjugate;
    m.system->solve(b.data(), x.data(), columns, transposed, conjugated, result);
    const double limit = m.session().options.required_backward_error;
    if (!(result.backward_error <= limit) && m.folds && m.system->changes() > 0) {
      result.backward_error = 0;
      m.system->fold();
      m.system->solve(kept.empty() ? b.data() : kept.data(), x.data(), columns, transposed, conjugated, result);
    }
    if (!(result.backward_error <= limit))
      throw Error(
          StatusCode::accuracy_not_reached,
          fmt::format("the backward error is {:.1e} after {} steps of refinement, above the {:.1e} asked for: the "
                      "changes are too large beside the matrix; fold() them, or factorize the changed one",
                      result.backward_error, result.refinement_steps, limit));
  });
  if (!status.ok()) result.status = std::move(status);
  result.cost = m.system->cost();
  result.seconds = base::now_seconds() - start;
  return result;
}

template <class T>
Inertia ChangedSystemOf<T>::inertia() const {
  impl_->expect_factor("inertia");
  impl_->session().expect_usable();
  return impl_->system->inertia();
}

template class ChangedSystemOf<double>;
template class ChangedSystemOf<std::complex<double>>;

}  // namespace espalier
