#include "solver_handle.hpp"

#include <nanobind/stl/string.h>

#include <stdexcept>
#include <utility>

#include "solver/environment.hpp"
#include "solver/option_text.hpp"

namespace espalier::python {

namespace {

// Threads take longer to start than such systems to factorize.
constexpr Offset kSmall = 20'000;  // entries

// The rows of a triangle are the columns of the other one.
Storage by_columns(const Shape& shape) {
  if (!shape.by_rows) return shape.storage;
  if (shape.storage == Storage::symmetric_lower) return Storage::symmetric_upper;
  if (shape.storage == Storage::symmetric_upper) return Storage::symmetric_lower;
  return shape.storage;
}

MatrixView view_of(const Pointers& pointers, const Indices& indices, const Values* values, const Shape& shape) {
  MatrixView view;
  view.rows = view.cols = shape.n;
  view.col_ptr = {pointers.data(), pointers.size()};
  view.row_ind = {indices.data(), indices.size()};
  if (values != nullptr) view.values = {values->data(), values->size()};
  view.storage = by_columns(shape);
  return view;
}

// An address of GPU memory, or a stream, as Python's array interfaces give them.
template <class T>
T* address(std::uintptr_t number) {
  return reinterpret_cast<T*>(number);  // NOLINT(performance-no-int-to-ptr)
}

}  // namespace

SolverHandle::SolverHandle() {
  solver::Environment environment = solver::read_environment();
  if (!environment.status.ok()) throw Error(environment.status);
  options_ = std::move(environment.options);
  options_.interrupted = &Host::interrupted;
  options_.interrupted_every = 0.1;  // the global lock may take 5 ms to come
  options_.log = [host = host_](const std::string& line) { host->write(line); };
}

SolverHandle::SolverHandle(const SolverHandle& original, Solver&& clone, int threads)
    : options_(original.options_),
      host_(original.host_),
      solver_(std::move(clone)),
      single_(original.single_ && threads == 0),
      transposed_(original.transposed_) {
  if (threads > 0) options_.threads = threads;
}

void SolverHandle::set_option(const std::string& key, const std::string& value) {
  solver::set_option(options_, key, value);
}

void SolverHandle::set_permutation(const Indices& order) {
  options_.permutation.assign(order.data(), order.data() + order.size());
}

template <class Body>
auto SolverHandle::call(Body&& body) {
  return turns_.call([&] {
    if (closed_) throw std::logic_error("the solver is closed");
    return body();
  });
}

void SolverHandle::make_solver(Offset nonzeros) {
  const bool single =
      options_.threads == 0 && nonzeros < kSmall && (options_.device == "auto" || options_.device == "cpu");
  if (solver_ && single == single_) return;
  Options options = options_;
  if (single) options.threads = 1;
  solver_.reset();
  solver_.emplace(std::move(options));
  single_ = single;
}

AnalysisResult SolverHandle::analyze(const Pointers& pointers, const Indices& indices,
                                     const std::optional<Values>& values, const Shape& shape) {
  const MatrixView view = view_of(pointers, indices, values ? &*values : nullptr, shape);
  return call([&] {
    make_solver(static_cast<Offset>(indices.size()));
    transposed_ = shape.by_rows && shape.storage == Storage::general;
    return solver_->analyze(view);
  });
}

AnalysisResult SolverHandle::load_analysis(const std::string& path, const Pointers& pointers, const Indices& indices,
                                           const std::optional<Values>& values, const Shape& shape) {
  const MatrixView view = view_of(pointers, indices, values ? &*values : nullptr, shape);
  return call([&] {
    make_solver(static_cast<Offset>(indices.size()));
    transposed_ = shape.by_rows && shape.storage == Storage::general;
    return solver_->load_analysis(path, view);
  });
}

Solver& SolverHandle::analyzed() {
  if (!solver_ || solver_->state() == Solver::State::empty)
    throw std::logic_error("there is no analysis: call analyze(A) or factorize(A) first");
  return *solver_;
}

FactorResult SolverHandle::factorize(const Pointers& pointers, const Indices& indices, const Values& values,
                                     const Shape& shape) {
  const MatrixView view = view_of(pointers, indices, &values, shape);
  return call([&] { return analyzed().factorize(view); });
}

FactorResult SolverHandle::refactorize(const Values& values) {
  return call([&] { return analyzed().refactorize({values.data(), values.size()}); });
}

SolveResult SolverHandle::solve(const nb::ndarray<const double, nb::device::cpu>& b,
                                const nb::ndarray<double, nb::device::cpu>& x, Index columns, bool transpose) {
  return call([&] {
    const bool other = transpose != transposed_;
    return analyzed().solve({b.data(), b.size()}, {x.data(), x.size()}, columns,
                            other ? Transpose::yes : Transpose::no);
  });
}

FactorResult SolverHandle::refactorize_device(std::uintptr_t values, Offset count, std::uintptr_t stream) {
  return call(
      [&] { return analyzed().refactorize_device(address<const double>(values), count, address<void>(stream)); });
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
  return call([&] { return analyzed().condition_estimate(); });
}

Status SolverHandle::save_analysis(const std::string& path) {
  return call([&] { return analyzed().save_analysis(path); });
}

Solver::State SolverHandle::state() {
  return call([&] { return solver_ ? solver_->state() : Solver::State::empty; });
}

bool SolverHandle::has_pattern(const Pointers& pointers, const Indices& indices, const Shape& shape) {
  const MatrixView view = view_of(pointers, indices, nullptr, shape);
  return call([&] { return analyzed().has_pattern(view); });
}

std::vector<double> SolverHandle::values() {
  return call([&] { return analyzed().values(); });
}

std::unique_ptr<SolverHandle> SolverHandle::clone(int threads) {
  return call([&] {  // the constructor is private: no make_unique
    return std::unique_ptr<SolverHandle>(new SolverHandle(*this, analyzed().clone(threads), threads));
  });
}

void SolverHandle::close() {
  turns_.enter([&] {  // in the child of a fork the parent's call may go on elsewhere: nothing happens then
    solver_.reset();
    closed_ = true;
  });
}

}  // namespace espalier::python
