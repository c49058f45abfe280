// Schur complements, changes around a factor, batches. Private: espalier/_linear/changes.py gives them types, checks
// and exceptions. Matrices come in compressed columns.
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <type_traits>
#include <utility>
#include <variant>

#include "arrays.hpp"
#include "bindings.hpp"
#include "espalier/batch.hpp"
#include "espalier/changed_system.hpp"
#include "espalier/schur.hpp"
#include "host.hpp"
#include "solver/options/environment.hpp"
#include "solver/options/option_text.hpp"
#include "solver_handle.hpp"

namespace espalier::python {

namespace {

using namespace nb::literals;

using OptionTexts = std::vector<std::pair<std::string, std::string>>;

MatrixView columns_of(const Pointers& pointers, const Indices& indices, const Values* values, int storage) {
  MatrixView view;
  view.rows = view.cols = static_cast<Index>(pointers.size()) - 1;
  view.col_ptr = {pointers.data(), pointers.size()};
  view.row_ind = {indices.data(), indices.size()};
  if (values != nullptr) view.values = {values->data(), values->size()};
  view.storage = static_cast<Storage>(storage);
  return view;
}

std::span<const double> span_of(const Values& v) { return {v.data(), v.size()}; }

Options options_of(const OptionTexts& texts, const std::shared_ptr<Host>& host) {
  solver::Environment environment = solver::read_environment();
  if (!environment.status.ok()) throw Error(environment.status);
  Options o = std::move(environment.options);
  for (const auto& [key, value] : texts) solver::set_option(o, key, value);
  o.interrupted = &Host::interrupted;
  o.interrupted_every = 0.1;  // the global lock may take 5 ms to come
  o.log = [host](const std::string& line) { host->write(line); };
  return o;
}

// Without the global lock, one call at a time; what Python raised meanwhile goes on.
template <class Body>
void released(Turns& turns, Body&& body) {
  (void)turns.call([&] {
    body();
    return true;
  });
}

nb::tuple inertia_of(const Inertia& i) { return nb::make_tuple(i.positive, i.negative, i.zero); }

nb::tuple solved(const SolveResult& r, nb::object x) {
  return nb::make_tuple(
      status_of(r.status), std::move(x),
      nb::make_tuple(r.seconds, r.solve_seconds, r.refinement_steps, r.backward_error, r.componentwise_error));
}

class SchurHandle {
 public:
  SchurHandle(const OptionTexts& options, nb::object log)
      : host_(std::make_shared<Host>(Host{std::move(log)})), schur_(options_of(options, host_)) {}

  nb::tuple factorize(const Pointers& p, const Indices& i, const Values& v, int storage, const Indices& unknowns,
                      bool analyze) {
    const MatrixView view = columns_of(p, i, &v, storage);
    SchurResult r;
    Status status;
    released(turns_, [&] {
      if (analyze || !analyzed_) {
        analyzed_ = false;  // also where it is interrupted
        status = schur_.analyze(view, {unknowns.data(), unknowns.size()}).status;
        analyzed_ = status.ok();
      }
      if (status.ok()) r = schur_.factorize(view.values);
      if (status.ok()) status = r.status;
    });
    n_ = view.cols;
    return nb::make_tuple(status_of(status), r.seconds, r.complement_seconds, r.by_elimination,
                          inertia_of(r.rest.inertia), r.rest.rank, nb::cast(r.rest.dependent_rows));
  }
  nb::object complement() {
    const std::span<const double> s = factorized().complement();
    const std::size_t size = unknowns();
    return array_of(std::vector<double>(s.begin(), s.end()), {size, size});  // the transpose, by rows
  }
  nb::tuple condense(const Values& b, Index columns, bool transpose) {
    std::vector<double> g(unknowns() * static_cast<std::size_t>(columns));
    SolveResult r;
    released(turns_, [&] { r = factorized().condense(span_of(b), g, columns, way(transpose)); });
    return solved(r, array_of(std::move(g), {static_cast<std::size_t>(columns), unknowns()}));
  }
  nb::tuple expand(const Values& b, const Values& xs, Index columns, bool transpose) {
    std::vector<double> x(b.size());
    SolveResult r;
    released(turns_, [&] { r = factorized().expand(span_of(b), span_of(xs), x, columns, way(transpose)); });
    return solved(r, array_of(std::move(x), {static_cast<std::size_t>(columns), static_cast<std::size_t>(n_)}));
  }
  nb::tuple solve(const Values& b, Index columns, bool transpose) {
    std::vector<double> x(b.size());
    SolveResult r;
    released(turns_, [&] { r = factorized().solve(span_of(b), x, columns, way(transpose)); });
    return solved(r, array_of(std::move(x), {static_cast<std::size_t>(columns), static_cast<std::size_t>(n_)}));
  }
  nb::tuple inertia() {
    SchurInertia i;
    released(turns_, [&] { i = factorized().inertia(); });
    return nb::make_tuple(status_of(i.status), inertia_of(i.rest), inertia_of(i.complement));
  }

 private:
  static Transpose way(bool transpose) { return transpose ? Transpose::yes : Transpose::no; }
  [[nodiscard]] std::size_t unknowns() const { return static_cast<std::size_t>(schur_.size()); }
  SchurComplement& factorized() {
    if (!schur_.factorized())
      throw std::logic_error("there is no factorization: call factorize(A) with an A whose rest is regular");
    return schur_;
  }

  std::shared_ptr<Host> host_;
  SchurComplement schur_;
  bool analyzed_ = false;
  Index n_ = 0;
  Turns turns_{"a solver was called from its own log handler"};
};

// Statuses by system, and the fields of BatchSolve.
nb::tuple fields_of(const BatchResult& r, std::vector<double> x) {
  nb::list statuses;
  std::vector<double> errors;
  std::vector<Index> negative;
  for (const SystemResult& s : r.systems) {
    statuses.append(status_of(s.status));
    errors.push_back(s.backward_error);
    negative.push_back(s.inertia.negative);
  }
  const std::size_t systems = errors.size(), numbers = x.size();
  return nb::make_tuple(status_of(r.status), array_of(std::move(x), {numbers}), nb::tuple(statuses),
                        array_of(std::move(errors), {systems}), array_of(std::move(negative), {systems}), r.seconds,
                        r.workers);
}

// Systems of patterns of their own; b and x one system after another, column by column.
nb::tuple solve_many(const std::vector<nb::tuple>& matrices, const Values& b, const std::vector<Index>& columns,
                     bool transpose, const OptionTexts& texts, nb::object log) {
  const auto host = std::make_shared<Host>(Host{std::move(log)});
  const Options options = options_of(texts, host);
  std::vector<double> x(b.size());
  std::vector<Pointers> pointers;
  std::vector<Indices> indices;
  std::vector<Values> values;
  std::vector<System> systems;
  std::size_t at = 0;
  for (std::size_t k = 0; k < matrices.size(); ++k) {
    pointers.push_back(nb::cast<Pointers>(matrices[k][0]));
    indices.push_back(nb::cast<Indices>(matrices[k][1]));
    values.push_back(nb::cast<Values>(matrices[k][2]));
    const MatrixView a = columns_of(pointers[k], indices[k], &values[k], nb::cast<int>(matrices[k][3]));
    const std::size_t size = static_cast<std::size_t>(a.cols) * static_cast<std::size_t>(columns.at(k));
    systems.push_back({a, span_of(b).subspan(at, size), std::span(x).subspan(at, size), columns[k],
                       transpose ? Transpose::yes : Transpose::no});
    at += size;
  }
  BatchResult r;
  Turns turns{"solve_systems"};
  released(turns, [&] { r = solve_systems(systems, options); });
  return fields_of(r, std::move(x));
}

class BatchHandle {
 public:
  BatchHandle(const OptionTexts& options, nb::object log)
      : host_(std::make_shared<Host>(Host{std::move(log)})), batch_(options_of(options, host_)) {}

  nb::tuple analyze(const Pointers& p, const Indices& i, const Values& v, int storage) {
    const MatrixView view = columns_of(p, i, &v, storage);
    Status status;
    released(turns_, [&] { status = batch_.analyze(view).status; });
    n_ = view.cols;
    return status_of(status);
  }
  nb::tuple solve(const Values& values, const Values& b, Index count, Index columns, bool transpose) {
    std::vector<double> x(b.size());
    BatchResult r;
    released(turns_, [&] {
      r = batch_.solve(span_of(values), span_of(b), x, count, columns, transpose ? Transpose::yes : Transpose::no);
    });
    return fields_of(r, std::move(x));
  }

 private:
  std::shared_ptr<Host> host_;
  Batch batch_;
  Index n_ = 0;
  Turns turns_{"a batch was called from its own log handler"};
};

/// Goes through the handle of the solver, whose turn a call takes, and which may have got another solver meanwhile.
/// Complex numbers are pairs of doubles.
class ChangedHandle {
  template <class Body>
  auto with_changes(Body&& body) {
    if (auto* complex = std::get_if<ComplexChangedSystem>(&changed_)) return body(*complex);
    return body(std::get<ChangedSystem>(changed_));
  }

 public:
  explicit ChangedHandle(SolverHandle& solver) : solver_(solver), generation_(solver.generation()) {
    solver_.with_solver(generation_, [&](auto& s) {
      if constexpr (std::is_same_v<decltype(s), ComplexSolver&>)
        changed_.emplace<ComplexChangedSystem>(s, solver_.by_rows());
      else
        changed_.emplace<ChangedSystem>(s, solver_.transposed());
    });
  }
  nb::tuple add(const Pointers& p, const Indices& i, const Values& v, const Pointers& rp, const Indices& ri,
                const Values& rv, const Values& corner) {
    return status(
        [&](auto& c) { return c.add(entries_of(c, p, i, v), entries_of(c, rp, ri, rv), numbers(c, corner)); });
  }
  nb::tuple replace(const Indices& list, const Pointers& p, const Indices& i, const Values& v, const Pointers& rp,
                    const Indices& ri, const Values& rv) {
    return status([&](auto& c) {
      return c.replace({list.data(), list.size()}, entries_of(c, p, i, v), entries_of(c, rp, ri, rv));
    });
  }
  nb::tuple add_low_rank(const Pointers& p, const Indices& i, const Values& v, const Values& core, const Pointers& vp,
                         const Indices& vi, const Values& vv) {
    return status(
        [&](auto& c) { return c.add_low_rank(entries_of(c, p, i, v), numbers(c, core), entries_of(c, vp, vi, vv)); });
  }
  nb::tuple flip(const Indices& list) {
    return status([&](auto& c) { return c.flip({list.data(), list.size()}); });
  }
  nb::tuple prepare() {
    return status([](auto& c) { return c.prepare(); });
  }
  nb::tuple fold() {
    return status([](auto& c) { return c.fold(); });
  }
  void set_folding(bool automatic) {
    with_changes([&](auto& c) { c.set_folding(automatic); });
  }
  [[nodiscard]] nb::tuple cost() {
    const ChangeCost c = with_changes([](auto& changed) { return changed.cost(); });
    return nb::make_tuple(c.changes, c.factorization, c.columns, c.factorizations, c.column_seconds,
                          c.factorization_seconds);
  }
  nb::tuple remove(const Indices& list) {
    return status([&](auto& c) { return c.remove({list.data(), list.size()}); });
  }
  nb::tuple restore(const Indices& list) {
    return status([&](auto& c) { return c.restore({list.data(), list.size()}); });
  }
  nb::tuple solve(const Values& b, Index columns, int transpose) {
    std::vector<double> x(b.size());
    ChangedSolveResult r;
    call([&](auto& c) {
      const auto given = numbers(c, b);
      using Number = typename decltype(given)::value_type;
      r = c.solve(given, {reinterpret_cast<Number*>(x.data()), given.size()}, columns,
                  static_cast<Transpose>(transpose));
    });
    return solved(
        r, array_of(std::move(x), {static_cast<std::size_t>(columns), b.size() / static_cast<std::size_t>(columns)}));
  }
  nb::tuple inertia() {
    Inertia i;
    call([&](auto& c) { i = c.inertia(); });
    return inertia_of(i);
  }
  [[nodiscard]] Index size() {
    return with_changes([](auto& c) { return c.size(); });
  }
  [[nodiscard]] bool hermitian() {
    return with_changes([](auto& c) { return c.hermitian(); });
  }

 private:
  template <class T>
  static std::span<const T> numbers(const ChangedSystemOf<T>&, const Values& v) {
    return {reinterpret_cast<const T*>(v.data()), v.size() * sizeof(double) / sizeof(T)};
  }
  template <class T>
  static SparseColumnsOf<T> entries_of(const ChangedSystemOf<T>& c, const Pointers& p, const Indices& i,
                                       const Values& v) {
    return {{p.data(), p.size()}, {i.data(), i.size()}, numbers(c, v)};
  }
  template <class Body>
  void call(Body&& body) {
    solver_.with_solver(generation_, [&](auto&) { with_changes(body); });
  }
  template <class Body>
  nb::tuple status(Body&& body) {
    Status s;
    call([&](auto& c) { s = body(c); });
    return status_of(s);
  }
  SolverHandle& solver_;
  std::uint64_t generation_;
  std::variant<std::monostate, ChangedSystem, ComplexChangedSystem> changed_;
};

}  // namespace

void bind_changes(nb::module_& m) {
  const auto array = [](const char* name) { return nb::arg(name).noconvert(); };
  nb::class_<SchurHandle>(m, "SchurComplement")
      .def(nb::init<const OptionTexts&, nb::object>(), "options"_a, "log"_a.none())
      .def("factorize", &SchurHandle::factorize, array("pointers"), array("indices"), array("values"), "storage"_a,
           array("unknowns"), "analyze"_a)
      .def("complement", &SchurHandle::complement)
      .def("condense", &SchurHandle::condense, array("b"), "columns"_a, "transpose"_a)
      .def("expand", &SchurHandle::expand, array("b"), array("xs"), "columns"_a, "transpose"_a)
      .def("solve", &SchurHandle::solve, array("b"), "columns"_a, "transpose"_a)
      .def("inertia", &SchurHandle::inertia);
  nb::class_<BatchHandle>(m, "Batch")
      .def(nb::init<const OptionTexts&, nb::object>(), "options"_a, "log"_a.none())
      .def("analyze", &BatchHandle::analyze, array("pointers"), array("indices"), array("values"), "storage"_a)
      .def("solve", &BatchHandle::solve, array("values"), array("b"), "count"_a, "columns"_a, "transpose"_a);
  m.def("solve_systems", &solve_many, "matrices"_a, array("b"), "columns"_a, "transpose"_a, "options"_a,
        "log"_a.none());
  nb::class_<ChangedHandle>(m, "ChangedSystem")
      .def(nb::init<SolverHandle&>(), "solver"_a, nb::keep_alive<1, 2>())
      .def("add", &ChangedHandle::add, array("begin"), array("places"), array("values"), array("row_begin"),
           array("row_places"), array("row_values"), array("corner"))
      .def("replace", &ChangedHandle::replace, array("unknowns"), array("begin"), array("places"), array("values"),
           array("row_begin"), array("row_places"), array("row_values"))
      .def("add_low_rank", &ChangedHandle::add_low_rank, array("begin"), array("places"), array("values"), array("c"),
           array("v_begin"), array("v_places"), array("v_values"))
      .def("flip", &ChangedHandle::flip, array("unknowns"))
      .def("prepare", &ChangedHandle::prepare)
      .def("fold", &ChangedHandle::fold)
      .def("set_folding", &ChangedHandle::set_folding, "automatic"_a)
      .def("cost", &ChangedHandle::cost)
      .def("remove", &ChangedHandle::remove, array("unknowns"))
      .def("restore", &ChangedHandle::restore, array("unknowns"))
      .def("solve", &ChangedHandle::solve, array("b"), "columns"_a, "transpose"_a)
      .def("inertia", &ChangedHandle::inertia)
      .def_prop_ro("hermitian", &ChangedHandle::hermitian)
      .def_prop_ro("size", &ChangedHandle::size);
}

}  // namespace espalier::python
