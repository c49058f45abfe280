/// \file
/// A solver as the Python module holds it: the C++ solver with a lock around it, and calls that let other Python
/// threads run.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <complex>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "espalier/complex_solver.hpp"
#include "espalier/inverse.hpp"
#include "espalier/solve_rows.hpp"
#include "espalier/solver.hpp"
#include "host.hpp"
#include "turns.hpp"

namespace espalier::python {

namespace nb = nanobind;

template <class T, int Dimensions>
using HostArray = nb::ndarray<T, nb::ndim<Dimensions>, nb::c_contig, nb::device::cpu>;
using Pointers = HostArray<const Offset, 1>;
using Indices = HostArray<const Index, 1>;
using Values = HostArray<const double, 1>;

/// How the arrays of a matrix are to be read.
struct Shape {
  Index n = 0;
  bool by_rows = false;                ///< compressed rows
  Storage storage = Storage::general;  ///< of the matrix itself, whatever the layout
  bool complex = false;                ///< values are pairs of doubles
};

/// A factorization of either sort of numbers; null vectors of complex matrices as their parts.
struct AnyFactor {
  AnyFactor() = default;
  AnyFactor(FactorResult r);         // NOLINT(google-explicit-constructor): it is one
  AnyFactor(ComplexFactorResult r);  // NOLINT(google-explicit-constructor)

  FactorReport report;
  bool complex = false;
  std::complex<double> sign;  ///< of the determinant: -1, 0 or 1; complex: its phase
  std::vector<double> null_vectors, left_null_vectors;
};

/// Entries of an inverse, or a trace, as doubles.
struct AnyInverse {
  InverseResult result;
  double trace_error = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> x;
};

/// Wanted unknowns, as doubles.
struct RowsSolved {
  SolveRowsResult result;
  std::vector<double> x;
};

/// What a saved factor is of: the matrix as Python has it, and its pattern.
struct SavedFactor {
  AnyFactor factor;
  AnalysisResult analysis;
  Shape shape;
  std::vector<Offset> pointers;
  std::vector<Index> indices;
  bool restored = false;  ///< see LoadedFactorOf
};

/// The storage of the columns of such a matrix: the rows of a triangle are the columns of the other one.
Storage storage_by_columns(const Shape& shape);

class SolverHandle {
 public:
  SolverHandle();

  /// @throws Error(invalid_input)
  void set_option(const std::string& key, const std::string& value);
  void set_permutation(const Indices& order);
  void set_log(nb::object log) { host_->log = std::move(log); }

  AnalysisResult analyze(const Pointers& pointers, const Indices& indices, const std::optional<Values>& values,
                         const Shape& shape);
  AnalysisResult load_analysis(const std::string& path, const Pointers& pointers, const Indices& indices,
                               const std::optional<Values>& values, const Shape& shape);
  /// See Solver::analyze_change(). @throws std::logic_error without an analysis
  ChangeResult analyze_change(const Pointers& pointers, const Indices& indices, const std::optional<Values>& values,
                              const Shape& shape);
  AnyFactor factorize(const Pointers& pointers, const Indices& indices, const Values& values, const Shape& shape);
  AnyFactor refactorize(const Values& values);
  AnyFactor refactorize_entries(const Pointers& places, const Values& values);
  /// @param b, x  columns * n numbers, column by column; may be the same array
  /// @param transpose  of real systems whether the caller's matrix is transposed; of complex ones a Transpose of the
  ///                   matrix that the C++ solver holds
  SolveResult solve(const nb::ndarray<const double, nb::device::cpu>& b, const nb::ndarray<double, nb::device::cpu>& x,
                    Index columns, int transpose);
  /// The same with arrays in the memory of the GPU that holds the factor; addresses and a cudaStream_t as numbers. See
  /// Solver::refactorize_device() and solve_device().
  AnyFactor refactorize_device(std::uintptr_t values, Offset count, std::uintptr_t stream);
  SolveResult solve_device(std::uintptr_t b, std::uintptr_t x, Index columns, bool transpose, std::uintptr_t stream);
  /// See Solver::gpu().
  int gpu();
  /// See espalier::solve_rows(); right-hand sides by columns. @param values  of complex systems their parts
  RowsSolved solve_rows(const Pointers& pointers, const Indices& indices, const Values& values, const Indices& rows,
                        int transpose);
  ConditionResult condition();
  /// The inverse of the matrix that the C++ solver holds: see inverse.hpp. A pattern by its columns. transpose: of its
  /// transpose
  AnyInverse selected_inverse(const Pointers& pointers, const Indices& indices, bool transpose);
  AnyInverse inverse_blocks(Index size, Index n);
  /// @param values  of complex matrices their parts
  AnyInverse trace_of_inverse(const Pointers& pointers, const Indices& indices, const Values& values);
  Status save_analysis(const std::string& path);
  /// See espalier/factor_file.hpp. @throws std::logic_error without a factor
  Status save_factor(const std::string& path);
  /// A factor of either sort of numbers; without a solver where it fails. @throws Error(invalid_input) for what is no
  /// such file
  SavedFactor load_factor(const std::string& path);
  [[nodiscard]] Solver::State state();
  /// See Solver::has_pattern() and Solver::values().
  bool has_pattern(const Pointers& pointers, const Indices& indices, const Shape& shape);
  std::vector<double> values();
  /// See Solver::clone(). @throws std::logic_error without an analysis
  std::unique_ptr<SolverHandle> clone(int threads);
  void close();

  /// Rises when the C++ solver becomes another object.
  [[nodiscard]] std::uint64_t generation() const { return generation_; }
  /// Runs body(solver) in turn. @throws std::logic_error where the solver is another one than at `generation`
  template <class Body>
  void with_solver(std::uint64_t generation, Body&& body) {
    (void)turns_.call([&] {
      if (closed_ || generation != generation_ || !(solver_ || complex_solver_))
        throw std::logic_error(
            "the solver has been closed, or has begun anew with another matrix: call reset() and make the changes "
            "anew");
      if (complex_solver_)
        body(*complex_solver_);
      else
        body(*solver_);
      return true;
    });
  }

  /// Whether the caller's matrix is given by rows: the C++ solver holds its transpose, which is the matrix itself where
  /// it is symmetric, and its conjugate where it is Hermitian.
  [[nodiscard]] bool by_rows() const { return by_rows_; }
  /// For a real matrix: whether the C++ solver's calls are to be turned.
  [[nodiscard]] bool transposed() const { return transposed_; }

 private:
  SolverHandle(const SolverHandle& original, int threads);

  template <class Body>
  auto call(Body&& body) {
    return turns_.call([&] {
      if (closed_) throw std::logic_error("the solver is closed");
      return body();
    });
  }
  // Calls use(solver) with the solver that there is.
  template <class Use>
  auto with_analyzed(Use&& use) {
    if (complex_solver_ && complex_solver_->state() != Solver::State::empty) return use(*complex_solver_);
    if (!solver_ || solver_->state() == Solver::State::empty)
      throw std::logic_error("there is no analysis: call analyze(A) or factorize(A) first");
    return use(*solver_);
  }
  void make_solver(Offset nonzeros, bool complex);
  Solver& analyzed();

  Options options_;
  std::shared_ptr<Host> host_ = std::make_shared<Host>();
  std::optional<Solver> solver_;  // one of them at most
  std::optional<ComplexSolver> complex_solver_;
  std::uint64_t generation_ = 0;
  bool single_ = false;         // it has one thread because its system was small
  bool other_options_ = false;  // kind and precision are those of a file
  bool by_rows_ = false;        // it holds A^T ...
  bool transposed_ = false;     // ... of a matrix in general storage: solves turn it
  bool closed_ = false;
  Turns turns_{"a solver was called from its own log handler"};
};

}  // namespace espalier::python
