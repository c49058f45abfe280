// A solver that the processes of an MPI share. Private: espalier/mpi.py gives it types and checks.
#include <dlfcn.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <complex>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

#include "bindings.hpp"
#include "espalier/nodes.hpp"
#include "espalier/ranks.h"
#include "fields.hpp"
#include "solver/options/environment.hpp"
#include "solver/options/option_text.hpp"

namespace espalier::python {

namespace {

using namespace nb::literals;

// The ranks of a communicator, by an adapter for the MPI that the process has loaded. Adapters stay loaded.
Ranks ranks_of(const std::string& adapter, int fortran_handle, double patience) {
  void* library = ::dlopen(adapter.c_str(), RTLD_NOW | RTLD_GLOBAL);
  if (library == nullptr) throw Error(StatusCode::device_error, ::dlerror());
  const auto table_of =
      reinterpret_cast<int (*)(int, espalier_rank_functions*)>(::dlsym(library, "espalier_mpi_adapter_f2c"));
  if (table_of == nullptr) throw Error(StatusCode::device_error, adapter + " is no adapter of espalier");
  espalier_rank_functions table{};
  if (const int error = table_of(fortran_handle, &table); error != 0)
    throw Error(StatusCode::invalid_input,
                adapter + ": the MPI refuses the communicator (error " + std::to_string(error) + ")");
  return Ranks(table, patience);
}

class RankSolver {
 public:
  RankSolver(const std::string& adapter, int fortran_handle, double patience, bool each_process) {
    solver::Environment environment = solver::read_environment();
    options_ = std::move(environment.options);
    options_.interrupted = &Host::interrupted;
    options_.interrupted_every = 0.1;
    options_.log = [host = host_](const std::string& line) { host->write(line); };
    ranks_ = ranks_of(adapter, fortran_handle, patience);
    set_nodes(ranks_, each_process ? Nodes::process : Nodes::host);
    bad_environment_ = std::move(environment.status);
  }

  void set_option(const std::string& key, const std::string& value) { solver::set_option(options_, key, value); }
  void set_log(nb::object log) { host_->log = std::move(log); }

  /// @param values  of complex matrices pairs of doubles, here and below
  /// @param path  of a saved analysis, which is taken; none: the matrix is ordered
  nb::tuple analyze(Index n, Index first_row, const Pointers& pointers, const Indices& indices,
                    const std::optional<Values>& values, int storage, bool complex,
                    const std::optional<std::string>& path) {
    const std::span<const double> numbers =
        values ? std::span(values->data(), values->size()) : std::span<const double>();
    const AnalysisResult r = turns_.call([&] {
      if (closed_) throw std::logic_error("the solver is closed");
      if (!bad_environment_.ok()) throw Error(bad_environment_);
      solver_.reset();
      complex_solver_.reset();
      const auto analyzed = [&](auto& solver, const auto& part) {
        return path ? solver.load_analysis(*path, part) : solver.analyze(part);
      };
      const std::span<const Offset> row_ptr(pointers.data(), pointers.size());
      const std::span<const Index> col(indices.data(), indices.size());
      const auto stored = static_cast<Storage>(storage);
      if (complex)
        return analyzed(complex_solver_.emplace(ranks_, options_),
                        ComplexLocalRows{n, first_row, row_ptr, col, complex_numbers(numbers), stored});
      return analyzed(solver_.emplace(ranks_, options_), LocalRows{n, first_row, row_ptr, col, numbers, stored});
    });
    n_ = n;
    return nb::make_tuple(status_of(r.status), fields(r));
  }

  nb::tuple refactorize(const Values& values) {
    const std::span<const double> numbers(values.data(), values.size());
    const AnyFactor r = turns_.call([&] {
      if (complex_solver_) return AnyFactor(complex_solver_->refactorize(complex_numbers(numbers)));
      return AnyFactor(solver().refactorize(numbers));
    });
    return nb::make_tuple(status_of(r.report.status), fields(r, false, n_));
  }

  /// @param transpose  a Transpose
  nb::tuple solve(const nb::ndarray<const double, nb::device::cpu>& b, const nb::ndarray<double, nb::device::cpu>& x,
                  Index columns, int transpose) {
    const auto how = static_cast<Transpose>(transpose);
    const SolveResult r = turns_.call([&] {
      if (complex_solver_)
        return complex_solver_->solve(complex_numbers({b.data(), b.size()}),
                                      {reinterpret_cast<std::complex<double>*>(x.data()), x.size() / 2}, columns, how);
      return solver().solve({b.data(), b.size()}, {x.data(), x.size()}, columns, how);
    });
    return nb::make_tuple(status_of(r.status), fields(r));
  }

  nb::tuple save_analysis(const std::string& path) {
    return status_of(turns_.call([&] { return with_analyzed([&](auto& s) { return s.save_analysis(path); }); }));
  }

  void set_rows(Index first, Index count) {
    (void)turns_.enter([&] { with_analyzed([&](auto& s) { s.set_rows({first, count}); }); });
  }
  nb::tuple rows() {
    const RowRange r = turns_.call([&] { return with_analyzed([](auto& s) { return s.rows(); }); });
    return nb::make_tuple(r.first, r.count);
  }
  void close() {
    turns_.enter([&] {
      solver_.reset();
      complex_solver_.reset();
      ranks_ = Ranks();
      closed_ = true;
    });
  }

 private:
  static std::span<const std::complex<double>> complex_numbers(std::span<const double> pairs) {
    return {reinterpret_cast<const std::complex<double>*>(pairs.data()), pairs.size() / 2};
  }
  Solver& solver() {
    if (!solver_) throw std::logic_error("there is no analysis: call analyze(A) or factorize(A) first");
    return *solver_;
  }
  // Calls use(solver) with the solver that there is.
  template <class Use>
  std::invoke_result_t<Use&, Solver&> with_analyzed(Use&& use) {
    return complex_solver_ ? use(*complex_solver_) : use(solver());
  }

  Options options_;
  std::shared_ptr<Host> host_ = std::make_shared<Host>();
  Status bad_environment_;
  Ranks ranks_;
  std::optional<Solver> solver_;  // one of them at most
  std::optional<ComplexSolver> complex_solver_;
  Index n_ = 0;
  bool closed_ = false;
  Turns turns_{"a solver was called from its own log handler"};
};

}  // namespace

void bind_rank_solver(nb::module_& m) {
  const auto array = [](const char* name) { return nb::arg(name).noconvert(); };
  nb::class_<RankSolver>(m, "RankSolver")
      .def(nb::init<const std::string&, int, double, bool>(), "adapter"_a, "comm"_a, "patience"_a, "each_process"_a)
      .def("set_option", &RankSolver::set_option)
      .def("set_log", &RankSolver::set_log, "log"_a.none())
      .def("analyze", &RankSolver::analyze, "n"_a, "first_row"_a, array("pointers"), array("indices"),
           nb::arg("values").noconvert().none(), "storage"_a, "complex"_a, "path"_a.none())
      .def("refactorize", &RankSolver::refactorize, array("values"))
      .def("solve", &RankSolver::solve, array("b"), array("x"), "columns"_a, "transpose"_a)
      .def("save_analysis", &RankSolver::save_analysis, "path"_a)
      .def("set_rows", &RankSolver::set_rows, "first"_a, "count"_a)
      .def("rows", &RankSolver::rows)
      .def("close", &RankSolver::close);
}

}  // namespace espalier::python
