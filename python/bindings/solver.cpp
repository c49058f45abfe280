// The solver's part of the module _core. Private: the modules of the package give it types, checks and exceptions.
#include <nanobind/stl/complex.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <cstdint>
#include <string_view>
#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "device/registry.hpp"
#include "fields.hpp"
#include "solver/options/option_text.hpp"
#include "solver/session/build_info.hpp"
#include "solver/session/transposed_text.hpp"
#include "solver_handle.hpp"

namespace espalier::python {

namespace {

using namespace nb::literals;

std::string text(std::string_view view) { return std::string(view); }

// Vectors of n numbers; complex ones as pairs of doubles, which Python takes for what they are.
nb::object vectors(const std::vector<double>& all, std::size_t doubles) {
  if (all.empty() || doubles == 0) return nb::none();
  return array_of(all, {all.size() / doubles, doubles});
}

}  // namespace

nb::tuple fields(const AnalysisResult& r) {
  return nb::make_tuple(text(solver::name_of(r.kind)), r.seconds, r.matching_seconds, r.ordering_seconds,
                        r.plan_seconds, r.nonzeros_factor, r.flops, r.fronts, r.tiers, r.largest_front,
                        r.predicted_bytes, r.predicted_seconds, r.device);
}

nb::tuple fields(const AnyFactor& factor, bool by_rows, Index n) {
  const FactorReport& r = factor.report;
  // What is empty is the same on both sides.
  const auto& other_columns = r.dependent_columns.empty() ? r.dependent_rows : r.dependent_columns;
  const auto& rows = by_rows ? other_columns : r.dependent_rows;
  const auto& columns = by_rows ? r.dependent_rows : other_columns;
  const auto& other_side = factor.left_null_vectors.empty() ? factor.null_vectors : factor.left_null_vectors;
  const auto& right = by_rows ? other_side : factor.null_vectors;
  const auto& left = by_rows ? factor.null_vectors : other_side;
  const std::size_t doubles = static_cast<std::size_t>(n) * (factor.complex ? 2 : 1);
  const nb::object sign = factor.complex ? nb::cast(factor.sign) : nb::cast(factor.sign.real());
  return nb::make_tuple(r.seconds, r.flops_per_second,
                        nb::make_tuple(r.inertia.positive, r.inertia.negative, r.inertia.zero), sign, r.determinant_log,
                        r.rank, r.two_by_two, r.perturbed, r.delayed, r.peak_host_bytes, r.device, r.work_share,
                        nb::cast(rows), nb::cast(columns), vectors(right, doubles), vectors(left, doubles));
}

nb::tuple fields(const SolveResult& r) {
  return nb::make_tuple(r.seconds, r.solve_seconds, r.refinement_steps, r.backward_error, r.componentwise_error);
}

namespace {

Shape shape_of(const Pointers& pointers, bool by_rows, int storage, bool complex) {
  return {static_cast<Index>(pointers.size()) - 1, by_rows, static_cast<Storage>(storage), complex};
}

nb::tuple inverse_of(AnyInverse inverse) {
  const InverseResult& r = inverse.result;
  const std::size_t doubles = inverse.x.size();
  return nb::make_tuple(status_of(r.status), array_of(std::move(inverse.x), {doubles}),
                        nb::make_tuple(r.seconds, r.error, r.entry_error, inverse.trace_error, r.checked, r.solved));
}

// What is to be known of an array on a device; keeps it alive.
class Exported {
 public:
  explicit Exported(nb::ndarray<> array) : array_(std::move(array)) {}
  [[nodiscard]] std::uintptr_t address() const { return reinterpret_cast<std::uintptr_t>(array_.data()); }
  // "f8": kind and bytes, as NumPy calls them; "?" and bytes for kinds that it does not know.
  [[nodiscard]] std::string dtype() const {
    constexpr std::string_view kKinds = "iuf";  // in the order of DLPack's codes
    const nb::dlpack::dtype t = array_.dtype();
    return (t.code < kKinds.size() ? kKinds[t.code] : '?') + std::to_string(t.bits * t.lanes / 8);
  }
  // What `function` says of all dimensions; strides in elements.
  template <class Function>
  [[nodiscard]] nb::tuple all(Function function) const {
    nb::list list;
    for (std::size_t k = 0; k < array_.ndim(); ++k) list.append((array_.*function)(k));
    return nb::tuple(list);
  }

 private:
  nb::ndarray<> array_;
};

}  // namespace

void bind_solver(nb::module_& m) {
  const auto array = [](const char* name) { return nb::arg(name).noconvert(); };
  m.attr("has_gpu") = device::registry().find("gpu") != nullptr;
  m.def("set_tick", &Host::set_tick, "tick"_a.none());
  m.def("progress", &Host::progress);
  nb::class_<Exported>(m, "Exported")  // an array that another library exported, a capsule of DLPack
      .def(nb::init<nb::ndarray<>>(), "capsule"_a)
      .def_prop_ro("address", &Exported::address)
      .def_prop_ro("dtype", &Exported::dtype)
      .def_prop_ro("shape", [](const Exported& e) { return e.all(&nb::ndarray<>::shape); })
      .def_prop_ro("strides", [](const Exported& e) { return e.all(&nb::ndarray<>::stride); });
  m.def("option_names", [] {
    nb::list names;
    for (const std::string_view name : solver::option_keys()) names.append(std::string(name));
    return names;
  });
  m.def("transposed_text", [](const std::string& message) { return solver::transposed_text(message); });
  nb::class_<SolverHandle>(m, "Solver", nb::dynamic_attr())
      .def(nb::init<>())
      .def("set_option", &SolverHandle::set_option)
      .def("set_permutation", &SolverHandle::set_permutation, array("order"))
      .def("set_log", &SolverHandle::set_log, "log"_a.none())
      .def(
          "analyze",
          [](SolverHandle& s, const Pointers& p, const Indices& i, const std::optional<Values>& v, bool by_rows,
             int storage, bool complex) {
            const AnalysisResult r = s.analyze(p, i, v, shape_of(p, by_rows, storage, complex));
            return nb::make_tuple(status_of(r.status), fields(r));
          },
          array("pointers"), array("indices"), nb::arg("values").noconvert().none(), "by_rows"_a, "storage"_a,
          "complex"_a)
      .def(
          "analyze_change",
          [](SolverHandle& s, const Pointers& p, const Indices& i, const std::optional<Values>& v, bool by_rows,
             int storage, bool complex) {
            const ChangeResult r = s.analyze_change(p, i, v, shape_of(p, by_rows, storage, complex));
            return nb::make_tuple(status_of(r.analysis.status), fields(r.analysis),
                                  nb::make_tuple(r.full, r.why, r.added_entries, r.removed_entries, r.moved_unknowns,
                                                 r.kept_fronts, r.reordered, r.entries_of_order));
          },
          array("pointers"), array("indices"), nb::arg("values").noconvert().none(), "by_rows"_a, "storage"_a,
          "complex"_a)
      .def(
          "load_analysis",
          [](SolverHandle& s, const std::string& path, const Pointers& p, const Indices& i,
             const std::optional<Values>& v, bool by_rows, int storage, bool complex) {
            const AnalysisResult r = s.load_analysis(path, p, i, v, shape_of(p, by_rows, storage, complex));
            return nb::make_tuple(status_of(r.status), fields(r));
          },
          "path"_a, array("pointers"), array("indices"), nb::arg("values").noconvert().none(), "by_rows"_a, "storage"_a,
          "complex"_a)
      .def(
          "factorize",
          [](SolverHandle& s, const Pointers& p, const Indices& i, const Values& v, bool by_rows, int storage,
             bool complex) {
            const Shape shape = shape_of(p, by_rows, storage, complex);
            const AnyFactor r = s.factorize(p, i, v, shape);
            return nb::make_tuple(status_of(r.report.status), fields(r, s.by_rows(), shape.n));
          },
          array("pointers"), array("indices"), array("values"), "by_rows"_a, "storage"_a, "complex"_a)
      .def(
          "refactorize",
          [](SolverHandle& s, const Values& v, Index n) {
            const AnyFactor r = s.refactorize(v);
            return nb::make_tuple(status_of(r.report.status), fields(r, s.by_rows(), n));
          },
          array("values"), "n"_a)
      .def(
          "refactorize_entries",
          [](SolverHandle& s, const Pointers& places, const Values& v, Index n) {
            const AnyFactor r = s.refactorize_entries(places, v);
            return nb::make_tuple(status_of(r.report.status), fields(r, s.by_rows(), n));
          },
          array("places"), array("values"), "n"_a)
      .def(
          "solve",
          [](SolverHandle& s, const nb::ndarray<const double, nb::device::cpu>& b,
             const nb::ndarray<double, nb::device::cpu>& x, Index columns, int transpose) {
            const SolveResult r = s.solve(b, x, columns, transpose);
            return nb::make_tuple(status_of(r.status), fields(r));
          },
          array("b"), array("x"), "columns"_a, "transpose"_a)
      .def(
          "refactorize_device",
          [](SolverHandle& s, std::uintptr_t values, Offset count, std::uintptr_t stream, Index n) {
            const AnyFactor r = s.refactorize_device(values, count, stream);
            return nb::make_tuple(status_of(r.report.status), fields(r, s.by_rows(), n));
          },
          "values"_a, "count"_a, "stream"_a, "n"_a)
      .def(
          "solve_device",
          [](SolverHandle& s, std::uintptr_t b, std::uintptr_t x, Index columns, bool transpose,
             std::uintptr_t stream) {
            const SolveResult r = s.solve_device(b, x, columns, transpose, stream);
            return nb::make_tuple(status_of(r.status), fields(r));
          },
          "b"_a, "x"_a, "columns"_a, "transpose"_a, "stream"_a)
      .def(
          "solve_rows",
          [](SolverHandle& s, const Pointers& p, const Indices& i, const Values& v, const Indices& rows,
             int transpose) {
            RowsSolved solved = s.solve_rows(p, i, v, rows, transpose);
            const SolveRowsResult& r = solved.result;
            const std::size_t doubles = solved.x.size();
            return nb::make_tuple(status_of(r.status), array_of(std::move(solved.x), {doubles}),
                                  nb::make_tuple(r.seconds, r.solve_seconds, r.refinement_steps, r.backward_error,
                                                 r.componentwise_error, r.share));
          },
          array("pointers"), array("indices"), array("values"), array("rows"), "transpose"_a)
      .def("gpu", &SolverHandle::gpu)
      .def("condition",
           [](SolverHandle& s) {
             const ConditionResult r = s.condition();
             return nb::make_tuple(status_of(r.status), r.estimate);
           })
      .def(
          "selected_inverse",
          [](SolverHandle& s, const Pointers& p, const Indices& i, bool transpose) {
            return inverse_of(s.selected_inverse(p, i, transpose));
          },
          array("pointers"), array("indices"), "transpose"_a)
      .def(
          "inverse_blocks", [](SolverHandle& s, Index size, Index n) { return inverse_of(s.inverse_blocks(size, n)); },
          "size"_a, "n"_a)
      .def(
          "trace_of_inverse",
          [](SolverHandle& s, const Pointers& p, const Indices& i, const Values& v) {
            return inverse_of(s.trace_of_inverse(p, i, v));
          },
          array("pointers"), array("indices"), array("values"))
      .def("save_analysis", [](SolverHandle& s, const std::string& path) { return status_of(s.save_analysis(path)); })
      .def("save_factor", [](SolverHandle& s, const std::string& path) { return status_of(s.save_factor(path)); })
      .def("load_factor",
           [](SolverHandle& s, const std::string& path) {
             SavedFactor saved = s.load_factor(path);
             const Shape& shape = saved.shape;
             const std::size_t begins = saved.pointers.size(), entries = saved.indices.size();
             return nb::make_tuple(status_of(saved.factor.report.status), fields(saved.factor, shape.by_rows, shape.n),
                                   fields(saved.analysis),
                                   nb::make_tuple(array_of(std::move(saved.pointers), {begins}),
                                                  array_of(std::move(saved.indices), {entries}), shape.by_rows,
                                                  static_cast<int>(shape.storage), shape.complex, saved.restored));
           })
      .def("state", [](SolverHandle& s) { return static_cast<int>(s.state()); })
      .def(
          "has_pattern",
          [](SolverHandle& s, const Pointers& p, const Indices& i, bool by_rows, int storage, bool complex) {
            return s.has_pattern(p, i, shape_of(p, by_rows, storage, complex));
          },
          array("pointers"), array("indices"), "by_rows"_a, "storage"_a, "complex"_a)
      .def("values",
           [](SolverHandle& s) {
             std::vector<double> values = s.values();
             const std::size_t count = values.size();
             return array_of(std::move(values), {count});
           })
      .def("clone", &SolverHandle::clone, "threads"_a)
      .def("close", &SolverHandle::close);
}

}  // namespace espalier::python
