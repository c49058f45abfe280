#include "solver_handle.hpp"

#include <nanobind/stl/string.h>

#include <span>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "solver/options/environment.hpp"
#include "solver/options/option_text.hpp"

namespace espalier::python {

Storage storage_by_columns(const Shape& shape) {
  if (!shape.by_rows) return shape.storage;
  if (shape.storage == Storage::symmetric_lower) return Storage::symmetric_upper;
  if (shape.storage == Storage::symmetric_upper) return Storage::symmetric_lower;
  if (shape.storage == Storage::hermitian_lower) return Storage::hermitian_upper;
  if (shape.storage == Storage::hermitian_upper) return Storage::hermitian_lower;
  return shape.storage;
}

namespace {

// Threads take longer to start than such systems to factorize.
constexpr Offset kSmall = 20'000;  // entries

MatrixView view_of(const Pointers& pointers, const Indices& indices, const Values* values, const Shape& shape) {
  MatrixView view;
  view.rows = view.cols = shape.n;
  view.col_ptr = {pointers.data(), pointers.size()};
  view.row_ind = {indices.data(), indices.size()};
  if (values != nullptr) view.values = {values->data(), values->size()};
  view.storage = storage_by_columns(shape);
  return view;
}

ComplexMatrixView complex_view_of(const Pointers& pointers, const Indices& indices, const Values* values,
                                  const Shape& shape) {
  const MatrixView pattern = view_of(pointers, indices, nullptr, shape);
  ComplexMatrixView view{pattern.rows, pattern.cols, pattern.col_ptr, pattern.row_ind, {}, pattern.storage};
  if (values != nullptr)
    view.values = {reinterpret_cast<const std::complex<double>*>(values->data()), values->size() / 2};
  return view;
}

// The view that a solver takes.
MatrixView matrix_for(const Solver&, const Pointers& p, const Indices& i, const Values* v, const Shape& s) {
  return view_of(p, i, v, s);
}
ComplexMatrixView matrix_for(const ComplexSolver&, const Pointers& p, const Indices& i, const Values* v,
                             const Shape& s) {
  return complex_view_of(p, i, v, s);
}

std::vector<double> parts_of(const std::vector<std::complex<double>>& v) {
  const double* first = reinterpret_cast<const double*>(v.data());
  return {first, first + 2 * v.size()};
}

// An address of GPU memory, or a stream, as Python's array interfaces give them.
template <class T>
T* address(std::uintptr_t number) {
  return reinterpret_cast<T*>(number);  // NOLINT(performance-no-int-to-ptr)
}

}  // namespace

AnyFactor::AnyFactor(FactorResult r)
    : sign(r.determinant_sign),
      null_vectors(std::move(r.null_vectors)),
      left_null_vectors(std::move(r.left_null_vectors)) {
  report = std::move(r);
}

AnyFactor::AnyFactor(ComplexFactorResult r)
    : complex(true),
      sign(r.determinant_phase),
      null_vectors(parts_of(r.null_vectors)),
      left_null_vectors(parts_of(r.left_null_vectors)) {
  report = std::move(r);
}

SolverHandle::SolverHandle() {
  solver::Environment environment = solver::read_environment();
  if (!environment.status.ok()) throw Error(environment.status);
  options_ = std::move(environment.options);
  options_.interrupted = &Host::interrupted;
  options_.interrupted_every = 0.1;  // the global lock may take 5 ms to come
  options_.log = [host = host_](const std::string& line) { host->write(line); };
}

SolverHandle::SolverHandle(const SolverHandle& original, int threads)
    : options_(original.options_),
      host_(original.host_),
      single_(original.single_ && threads == 0),
      other_options_(original.other_options_),
      by_rows_(original.by_rows_),
      transposed_(original.transposed_) {
  if (threads > 0) options_.threads = threads;
  if (original.solver_) solver_.emplace(original.solver_->clone(threads));
  if (original.complex_solver_) complex_solver_.emplace(original.complex_solver_->clone(threads));
}

void SolverHandle::set_option(const std::string& key, const std::string& value) {
  solver::set_option(options_, key, value);
}

void SolverHandle::set_permutation(const Indices& order) {
  options_.permutation.assign(order.data(), order.data() + order.size());
}

void SolverHandle::make_solver(Offset nonzeros, bool complex) {
  const bool single =
      options_.threads == 0 && nonzeros < kSmall && (options_.device == "auto" || options_.device == "cpu");
  if ((complex ? complex_solver_.has_value() : solver_.has_value()) && single == single_ && !other_options_) return;
  Options options = options_;
  if (single) options.threads = 1;
  solver_.reset();
  ++generation_;
  complex_solver_.reset();
  if (complex)
    complex_solver_.emplace(std::move(options));
  else
    solver_.emplace(std::move(options));
  single_ = single;
  other_options_ = false;
}

AnalysisResult SolverHandle::analyze(const Pointers& pointers, const Indices& indices,
                                     const std::optional<Values>& values, const Shape& shape) {
  const Values* given = values ? &*values : nullptr;
  return call([&] {
    make_solver(static_cast<Offset>(indices.size()), shape.complex);
    by_rows_ = shape.by_rows;
    transposed_ = shape.by_rows && shape.storage == Storage::general;
    if (shape.complex) return complex_solver_->analyze(complex_view_of(pointers, indices, given, shape));
    return solver_->analyze(view_of(pointers, indices, given, shape));
  });
}

ChangeResult SolverHandle::analyze_change(const Pointers& pointers, const Indices& indices,
                                          const std::optional<Values>& values, const Shape& shape) {
  return call([&] {
    ChangeResult change = with_analyzed([&](auto& s) {
      return s.analyze_change(matrix_for(s, pointers, indices, values ? &*values : nullptr, shape));
    });
    if (!change.analysis.status.ok()) return change;  // the solver is as it was
    by_rows_ = shape.by_rows;
    transposed_ = shape.by_rows && shape.storage == Storage::general;
    return change;
  });
}

AnalysisResult SolverHandle::load_analysis(const std::string& path, const Pointers& pointers, const Indices& indices,
                                           const std::optional<Values>& values, const Shape& shape) {
  const Values* given = values ? &*values : nullptr;
  return call([&] {
    make_solver(static_cast<Offset>(indices.size()), shape.complex);
    by_rows_ = shape.by_rows;
    transposed_ = shape.by_rows && shape.storage == Storage::general;
    if (shape.complex) return complex_solver_->load_analysis(path, complex_view_of(pointers, indices, given, shape));
    return solver_->load_analysis(path, view_of(pointers, indices, given, shape));
  });
}

Solver& SolverHandle::analyzed() {
  if (complex_solver_) throw Error(StatusCode::invalid_input, "the system is complex: it takes no arrays on a device");
  return *with_analyzed([&](auto&) { return &*solver_; });
}

AnyFactor SolverHandle::factorize(const Pointers& pointers, const Indices& indices, const Values& values,
                                  const Shape& shape) {
  return call([&] {
    return with_analyzed([&](auto& solver) -> AnyFactor {
      return solver.factorize(matrix_for(solver, pointers, indices, &values, shape));
    });
  });
}

AnyFactor SolverHandle::refactorize(const Values& values) {
  return call([&] {
    return with_analyzed([&](auto& solver) -> AnyFactor {
      if constexpr (std::is_same_v<decltype(solver), ComplexSolver&>)
        return solver.refactorize({reinterpret_cast<const std::complex<double>*>(values.data()), values.size() / 2});
      else
        return solver.refactorize({values.data(), values.size()});
    });
  });
}

AnyFactor SolverHandle::refactorize_entries(const Pointers& places, const Values& values) {
  const std::span<const Offset> at(places.data(), places.size());
  return call([&] {
    return with_analyzed([&](auto& solver) -> AnyFactor {
      if constexpr (std::is_same_v<decltype(solver), ComplexSolver&>)
        return solver.refactorize_entries(
            at, {reinterpret_cast<const std::complex<double>*>(values.data()), values.size() / 2});
      else
        return solver.refactorize_entries(at, {values.data(), values.size()});
    });
  });
}

SolveResult SolverHandle::solve(const nb::ndarray<const double, nb::device::cpu>& b,
                                const nb::ndarray<double, nb::device::cpu>& x, Index columns, int transpose) {
  return call([&] {
    return with_analyzed([&](auto& solver) {
      if constexpr (std::is_same_v<decltype(solver), ComplexSolver&>) {
        return solver.solve({reinterpret_cast<const std::complex<double>*>(b.data()), b.size() / 2},
                            {reinterpret_cast<std::complex<double>*>(x.data()), x.size() / 2}, columns,
                            static_cast<Transpose>(transpose));
      } else {
        const bool other = (transpose != 0) != transposed_;
        return solver.solve({b.data(), b.size()}, {x.data(), x.size()}, columns,
                            other ? Transpose::yes : Transpose::no);
      }
    });
  });
}

AnyFactor SolverHandle::refactorize_device(std::uintptr_t values, Offset count, std::uintptr_t stream) {
  return call([&] {
    return AnyFactor(analyzed().refactorize_device(address<const double>(values), count, address<void>(stream)));
  });
}

SolveResult SolverHandle::solve_device(std::uintptr_t b, std::uintptr_t x, Index columns, bool transpose,
                                       std::uintptr_t stream) {
  return call([&] {
    const bool other = transpose != transposed_;
    return analyzed().solve_device(address<const double>(b), address<double>(x), columns,
                                   other ? Transpose::yes : Transpose::no, address<void>(stream));
  });
}

int SolverHandle::gpu() {
  return call([&] { return solver_ ? solver_->gpu() : -1; });
}

ConditionResult SolverHandle::condition() {
  return call([&] { return with_analyzed([](auto& solver) { return solver.condition_estimate(); }); });
}

namespace {

template <class SolverType>
using NumberOf = std::conditional_t<std::is_same_v<SolverType, Solver>, double, std::complex<double>>;

// use(entries) with room for `count` numbers of the solver's sort.
template <class SolverType, class Use>
AnyInverse with_entries(const SolverType&, std::size_t count, Use&& use) {
  using Number = NumberOf<SolverType>;
  AnyInverse inverse;
  inverse.x.resize(count * sizeof(Number) / sizeof(double));
  inverse.result = use(std::span(reinterpret_cast<Number*>(inverse.x.data()), count));
  return inverse;
}

}  // namespace

AnyInverse SolverHandle::selected_inverse(const Pointers& pointers, const Indices& indices, bool transpose) {
  const Shape shape{static_cast<Index>(pointers.size()) - 1};
  return call([&] {
    return with_analyzed([&](auto& solver) {
      return with_entries(solver, indices.size(), [&](auto x) {
        return espalier::selected_inverse(solver, matrix_for(solver, pointers, indices, nullptr, shape), x,
                                          transpose ? Transpose::yes : Transpose::no);
      });
    });
  });
}

AnyInverse SolverHandle::inverse_blocks(Index size, Index n) {
  return call([&] {
    return with_analyzed([&](auto& solver) {
      return with_entries(solver, static_cast<std::size_t>(n) * static_cast<std::size_t>(size),
                          [&](auto x) { return espalier::inverse_blocks(solver, size, x); });
    });
  });
}

AnyInverse SolverHandle::trace_of_inverse(const Pointers& pointers, const Indices& indices, const Values& values) {
  const Shape shape{static_cast<Index>(pointers.size()) - 1};
  return call([&] {
    return with_analyzed([&](auto& solver) {
      double trace_error = 0;
      AnyInverse inverse = with_entries(solver, 1, [&](auto x) {
        const auto r = espalier::trace_of_inverse(solver, matrix_for(solver, pointers, indices, &values, shape));
        x[0] = r.trace;
        trace_error = r.trace_error;
        return static_cast<const InverseResult&>(r);
      });
      inverse.trace_error = trace_error;
      return inverse;
    });
  });
}

RowsSolved SolverHandle::solve_rows(const Pointers& pointers, const Indices& indices, const Values& values,
                                    const Indices& rows, int transpose) {
  return call([&] {
    return with_analyzed([&](auto& solver) {
      using Number = NumberOf<std::remove_reference_t<decltype(solver)>>;
      constexpr std::size_t kParts = sizeof(Number) / sizeof(double);
      const std::size_t columns = pointers.size() - 1;
      RowsSolved out;
      out.x.resize(kParts * columns * rows.size());
      const SparseColumnsOf<Number> b{{pointers.data(), pointers.size()},
                                      {indices.data(), indices.size()},
                                      {reinterpret_cast<const Number*>(values.data()), values.size() / kParts}};
      const bool other = kParts == 1 && (transpose != 0) != transposed_;
      const Transpose how = kParts == 2 ? static_cast<Transpose>(transpose) : other ? Transpose::yes : Transpose::no;
      out.result = espalier::solve_rows(solver, b, {rows.data(), rows.size()},
                                        {reinterpret_cast<Number*>(out.x.data()), columns * rows.size()}, how);
      return out;
    });
  });
}

Status SolverHandle::save_analysis(const std::string& path) {
  return call([&] { return with_analyzed([&](auto& solver) { return solver.save_analysis(path); }); });
}

Solver::State SolverHandle::state() {
  return call([&] {
    if (complex_solver_) return complex_solver_->state();
    return solver_ ? solver_->state() : Solver::State::empty;
  });
}

bool SolverHandle::has_pattern(const Pointers& pointers, const Indices& indices, const Shape& shape) {
  return call([&] {
    return with_analyzed(
        [&](auto& solver) { return solver.has_pattern(matrix_for(solver, pointers, indices, nullptr, shape)); });
  });
}

std::vector<double> SolverHandle::values() {
  return call([&] {
    if (complex_solver_) return parts_of(complex_solver_->values());
    return analyzed().values();
  });
}

std::unique_ptr<SolverHandle> SolverHandle::clone(int threads) {
  return call([&] {  // the constructor is private: no make_unique
    return with_analyzed([&](auto&) { return std::unique_ptr<SolverHandle>(new SolverHandle(*this, threads)); });
  });
}

void SolverHandle::close() {
  turns_.enter([&] {  // in the child of a fork the parent's call may go on elsewhere: nothing happens then
    solver_.reset();
    complex_solver_.reset();
    closed_ = true;
  });
}

}  // namespace espalier::python
