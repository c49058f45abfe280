/// \file
/// The C interface of changes around a factor: the lock and the messages are those of the solver.
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <type_traits>
#include <variant>
#include <vector>

#include "base/at.hpp"
#include "c/handle.hpp"
#include "c/results.hpp"
#include "espalier/changed_system.hpp"

struct espalier_changed {
  espalier_solver* solver;
  std::variant<std::monostate, espalier::ChangedSystem, espalier::ComplexChangedSystem> changed;
};

namespace {

using espalier::ChangedSystemOf;
using espalier::Index;
using espalier::Status;
using espalier::solver::CallerStatus;
using espalier::solver::require;

// body(changes) with those of either sort of numbers.
template <class Body>
int with_changed(espalier_changed* c, const Body& body) noexcept {
  if (c == nullptr) return ESPALIER_MISUSE;
  return espalier::solver::guarded(c->solver, [&](espalier_solver& s) {
    const bool complex = std::holds_alternative<espalier::ComplexChangedSystem>(c->changed);
    require(complex ? s.complex_solver.has_value() : s.solver.has_value(),
            "the solver has another matrix; make the changes anew");
    if (complex) return CallerStatus(body(std::get<espalier::ComplexChangedSystem>(c->changed)));
    return CallerStatus(body(std::get<espalier::ChangedSystem>(c->changed)));
  });
}

// The numbers of a call's changes, and as such the doubles of the caller.
template <class T>
T number_of(const ChangedSystemOf<T>&);
template <class Changes>
using NumberOf = decltype(number_of(std::declval<const Changes&>()));
template <class T>
std::span<const T> numbers(const double* from, std::size_t count) {
  return {reinterpret_cast<const T*>(from), count};
}

// What no index can be is out of range for the system as well.
Index index_of(std::int64_t i) { return static_cast<Index>(std::clamp<std::int64_t>(i, -1, INT32_MAX)); }

template <class T>
struct Columns {
  std::vector<Index> rows;
  espalier::SparseColumnsOf<T> view;

  // @param may_be_null  then there are none
  Columns(const espalier_columns* given, bool may_be_null) {
    if (given == nullptr) {
      require(may_be_null, "the columns are null");
      return;
    }
    require(given->columns >= 0 && given->columns < INT32_MAX && given->begin != nullptr,
            "the columns have no beginnings");
    const std::int64_t count = given->begin[given->columns];
    require(count >= 0 && (count == 0 || (given->rows != nullptr && given->values != nullptr)),
            "the columns have no entries");
    for (std::int64_t k = 0; k < count; ++k) rows.push_back(index_of(given->rows[k]));
    const auto entries = static_cast<std::size_t>(count);
    view = {{given->begin, static_cast<std::size_t>(given->columns) + 1}, rows, numbers<T>(given->values, entries)};
  }
  [[nodiscard]] std::size_t size() const { return view.col_ptr.empty() ? 0 : view.col_ptr.size() - 1; }
  [[nodiscard]] std::span<const T> square(const double* of) const {
    return of == nullptr ? std::span<const T>() : numbers<T>(of, size() * size());
  }
};

template <class Call>
int with_list(espalier_changed* changed, const std::int64_t* unknowns, std::int64_t count, const Call& call) noexcept {
  return with_changed(changed, [&](auto& c) {
    require(count >= 0 && (count == 0 || unknowns != nullptr), "the list of unknowns is null");
    std::vector<Index> list;
    for (std::int64_t k = 0; k < count; ++k) list.push_back(index_of(unknowns[k]));
    return call(c, list);
  });
}

bool holds_transpose(const espalier_solver& s) { return s.transposed || s.conjugated; }

}  // namespace

extern "C" {

int espalier_changed_create(espalier_solver* solver, espalier_changed** changed) {
  if (changed == nullptr) return ESPALIER_MISUSE;
  *changed = nullptr;
  return espalier::solver::guarded(solver, [&](espalier_solver& s) {
    const auto factorized = espalier::Solver::State::factorized;
    require(
        (s.solver && s.solver->state() == factorized) || (s.complex_solver && s.complex_solver->state() == factorized),
        "call espalier_factorize first");
    auto made = std::make_unique<espalier_changed>(espalier_changed{solver, {}});
    if (s.solver)
      made->changed.emplace<espalier::ChangedSystem>(*s.solver, holds_transpose(s));
    else
      made->changed.emplace<espalier::ComplexChangedSystem>(*s.complex_solver, holds_transpose(s));
    *changed = made.release();
    return CallerStatus(Status());
  });
}

void espalier_changed_destroy(espalier_changed* changed) {
  if (changed == nullptr) return;
  (void)espalier::solver::guarded(changed->solver, [&](espalier_solver&) {
    changed->changed.emplace<std::monostate>();
    return CallerStatus(Status());
  });
  delete changed;
}

int espalier_changed_reset(espalier_changed* changed) {
  return with_changed(changed, [&](auto& c) {
    c.reset(holds_transpose(*changed->solver));
    return Status();
  });
}

int espalier_changed_add(espalier_changed* changed, const espalier_columns* columns, const espalier_columns* rows,
                         const double* corner) {
  return with_changed(changed, [&](auto& c) {
    const Columns<NumberOf<decltype(c)>> u(columns, false), w(rows, true);
    return c.add(u.view, w.view, u.square(corner));
  });
}

int espalier_changed_replace(espalier_changed* changed, const int64_t* unknowns, int64_t count,
                             const espalier_columns* columns, const espalier_columns* rows) {
  return with_list(changed, unknowns, count, [&](auto& c, const std::vector<Index>& list) {
    const Columns<NumberOf<decltype(c)>> u(columns, false), w(rows, true);
    return c.replace(list, u.view, w.view);
  });
}

int espalier_changed_remove(espalier_changed* changed, const int64_t* unknowns, int64_t count) {
  return with_list(changed, unknowns, count, [](auto& c, const std::vector<Index>& list) { return c.remove(list); });
}

int espalier_changed_restore(espalier_changed* changed, const int64_t* unknowns, int64_t count) {
  return with_list(changed, unknowns, count, [](auto& c, const std::vector<Index>& list) { return c.restore(list); });
}

int espalier_changed_flip(espalier_changed* changed, const int64_t* unknowns, int64_t count) {
  return with_list(changed, unknowns, count, [](auto& c, const std::vector<Index>& list) { return c.flip(list); });
}

int espalier_changed_add_low_rank(espalier_changed* changed, const espalier_columns* u, const double* c,
                                  const espalier_columns* v) {
  return with_changed(changed, [&](auto& system) {
    const Columns<NumberOf<decltype(system)>> left(u, false), right(v, true);
    return system.add_low_rank(left.view, left.square(c), right.view);
  });
}

int espalier_changed_prepare(espalier_changed* changed) {
  return with_changed(changed, [](auto& c) { return c.prepare(); });
}

int espalier_changed_fold(espalier_changed* changed) {
  return with_changed(changed, [](auto& c) { return c.fold(); });
}

int espalier_changed_set_folding(espalier_changed* changed, int automatic) {
  return with_changed(changed, [&](auto& c) {
    c.set_folding(automatic != 0);
    return Status();
  });
}

int espalier_changed_size(espalier_changed* changed, int64_t* size) {
  return with_changed(changed, [&](auto& c) {
    require(size != nullptr, "the size is null");
    *size = c.size();
    return Status();
  });
}

int espalier_changed_solve(espalier_changed* changed, const double* b, double* x, int64_t count, int64_t columns,
                           int transpose, espalier_solve_info* info) {
  return with_changed(changed, [&](auto& c) {
    require(transpose >= ESPALIER_NO_TRANSPOSE && transpose <= ESPALIER_CONJUGATE_TRANSPOSE,
            "the transposition is none of espalier_transpose");
    require(columns >= 1 && columns <= INT32_MAX, "the number of right-hand sides is not positive");
    require(count == c.size() * columns, "the number of values is not that of the unknowns times the columns");
    require(count == 0 || (b != nullptr && x != nullptr), "the right-hand sides or the solutions are null");
    const auto size = static_cast<std::size_t>(count);
    using T = NumberOf<decltype(c)>;
    const espalier::ChangedSolveResult r =
        c.solve(numbers<T>(b, size), {reinterpret_cast<T*>(x), size}, static_cast<Index>(columns),
                static_cast<espalier::Transpose>(transpose));
    espalier::solver::hand_out(static_cast<const espalier::SolveResult&>(r), info);
    return r.status;
  });
}

int espalier_changed_inertia(espalier_changed* changed, int64_t inertia[3]) {
  return with_changed(changed, [&](auto& c) {
    require(inertia != nullptr, "the inertia is null");
    const espalier::Inertia i = c.inertia();
    inertia[0] = i.positive;
    inertia[1] = i.negative;
    inertia[2] = i.zero;
    return Status();
  });
}

int espalier_changed_cost(espalier_changed* changed, espalier_change_cost* cost) {
  return with_changed(changed, [&](auto& c) {
    require(cost != nullptr && cost->size >= sizeof(std::size_t),
            "the cost's field 'size' must be sizeof of its struct");
    const espalier::ChangeCost of = c.cost();
    const espalier_change_cost all{cost->size,        of.changes,        of.factorization,        of.columns,
                                   of.factorizations, of.column_seconds, of.factorization_seconds};
    std::memcpy(cost, &all, std::min(cost->size, sizeof all));
    return Status();
  });
}

}  // extern "C"
