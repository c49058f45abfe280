/// \file
/// The C interface: calls of the C++ solver under the lock of a handle.
#include <algorithm>
#include <complex>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "c/handle.hpp"
#include "c/matrix.hpp"
#include "c/results.hpp"
#include "solver/options/option_check.hpp"
#include "solver/options/option_text.hpp"
#include "solver/session/transposed_text.hpp"

using espalier::Error;
using espalier::Index;
using espalier::Kind;
using espalier::Status;
using espalier::StatusCode;
using espalier::solver::CallerStatus;
using espalier::solver::guarded;
using espalier::solver::hand_out;
using espalier::solver::heard_by_all;
using espalier::solver::make_complex_solver;
using espalier::solver::make_solver;
using espalier::solver::require;
using espalier::solver::with_analyzed;
using espalier::solver::with_factorized;

namespace {

const char* const kOnDevice = "arrays on a device: complex systems are solved on the host";

/// What the solver says of the matrix, of the matrix that the caller gave: of compressed rows it has taken the
/// transpose. The dependent rows of a symmetric matrix are columns, too.
CallerStatus to_caller(const espalier_solver& s, const Status& status, Kind kind) {
  const bool of_rows = status.code == StatusCode::singular && (kind == Kind::llt || kind == Kind::ldlt);
  const bool of_entries = status.code == StatusCode::invalid_input || status.code == StatusCode::singular;
  if (!s.by_rows || of_rows || !of_entries) return status;
  return {{status.code, espalier::solver::transposed_text(status.message), -1}, status.row};
}

const espalier::MatrixView& view_for(const espalier::Solver&, const espalier::solver::CMatrix& m) { return m.view(); }
const espalier::ComplexMatrixView& view_for(const espalier::ComplexSolver&, const espalier::solver::CMatrix& m) {
  return m.complex_view();
}

/// Takes note of the matrix that was analysed.
void note_layout(espalier_solver& s, const espalier::solver::CMatrix& matrix) {
  s.rows = s.vector_rows = matrix.view().rows;
  s.nonzeros = matrix.view().nonzeros();
  s.transposed = matrix.transposed();
  s.by_rows = matrix.by_rows();
  s.conjugated = matrix.complex() && matrix.by_rows() && matrix.complex_view().hermitian();
  s.null_space = {};
}

/// Analysis of a new pattern by `analyze(solver, view)`.
template <class Matrix, class Analyze>
int analyze_by(espalier_solver* solver, const Matrix* a, espalier_analysis_info* info, const Analyze& analyze) {
  return guarded(solver, [&](espalier_solver& s) {
    require(a != nullptr, "the matrix is null");
    require(s.ranks.size() == 1, "several ranks share the solver: give the matrix by espalier_analyze_rows");
    const espalier::solver::CMatrix matrix(*a, false);
    const auto result = matrix.complex() ? analyze(make_complex_solver(s), matrix.complex_view())
                                         : analyze(make_solver(s), matrix.view());
    note_layout(s, matrix);
    hand_out(result, info);
    return to_caller(s, result.status, result.kind);
  });
}

template <class Matrix>
int analyze(espalier_solver* solver, const Matrix* a, espalier_analysis_info* info) {
  return analyze_by(solver, a, info, [](auto& s, const auto& view) { return s.analyze(view); });
}

// The solver goes on with the options of its last analysis.
template <class Matrix>
int analyze_change(espalier_solver* solver, const Matrix* a, std::int32_t* anew, espalier_analysis_info* info) {
  return guarded(solver, [&](espalier_solver& s) {
    require(a != nullptr, "the matrix is null");
    const auto state = s.complex_solver ? s.complex_solver->state()
                       : s.solver       ? s.solver->state()
                                        : espalier::Solver::State::empty;
    require(state != espalier::Solver::State::empty, "call espalier_analyze first");
    const espalier::solver::CMatrix matrix(*a, false);
    require(matrix.complex() == s.complex_solver.has_value(), "the numbers are not those of the analysed matrix");
    const espalier::ChangeResult result = matrix.complex() ? s.complex_solver->analyze_change(matrix.complex_view())
                                                           : s.solver->analyze_change(matrix.view());
    if (result.analysis.status.ok()) note_layout(s, matrix);  // else the solver is as it was
    hand_out(result.analysis, info);
    if (anew != nullptr) *anew = result.full ? 1 : 0;
    return to_caller(s, result.analysis.status, result.analysis.kind);
  });
}

template <class Matrix>
int load_analysis(espalier_solver* solver, const char* path, const Matrix* a, espalier_analysis_info* info) {
  return analyze_by(solver, a, info, [&](auto& s, const auto& view) {
    require(path != nullptr, "the path is null");
    return s.load_analysis(path, view);
  });
}

// A factorization by `call`.
template <class AnySolver, class Call>
CallerStatus factorize_by(espalier_solver& s, AnySolver& cpp, espalier_factor_info* info, Call&& call) {
  s.null_space = {};
  auto result = call();
  hand_out(result, info);
  CallerStatus status = to_caller(s, result.status, cpp.analysis().kind);
  s.null_space = espalier::solver::null_space_of(std::move(result), s.by_rows);
  return status;
}

template <class Matrix>
int factorize(espalier_solver* solver, const Matrix* a, espalier_factor_info* info) {
  return guarded(solver, [&](espalier_solver& s) {
    require(a != nullptr, "the matrix is null");
    require(s.solver || s.complex_solver, "call espalier_analyze first");
    require(s.ranks.size() == 1, "several ranks share the solver: give values by espalier_refactorize");
    const espalier::solver::CMatrix matrix(*a, true);
    require(matrix.transposed() == s.transposed, "the layout is not that of the analysed matrix");
    require(matrix.complex() == s.complex_solver.has_value(), "the numbers are not those of the analysed matrix");
    return with_analyzed(
        s, [&](auto& cpp) { return factorize_by(s, cpp, info, [&] { return cpp.factorize(view_for(cpp, matrix)); }); });
  });
}

// New values by `call`, on the host or on the device.
template <class Call>
int refactorize(espalier_solver* solver, const double* values, std::int64_t count, espalier_factor_info* info,
                Call&& call) {
  return guarded(solver, [&](espalier_solver& s) {
    heard_by_all(s, [&] {
      with_analyzed(s, [](auto&) {});
      if (s.ranks.size() > 1) return;  // the solver says it, which fails on all ranks alike then
      require(count == s.nonzeros, "the number of values is not that of the analysed matrix");
      require(count == 0 || values != nullptr, "the values are null");
    });
    return with_analyzed(s, [&](auto& cpp) { return factorize_by(s, cpp, info, [&] { return call(cpp); }); });
  });
}

/// What the caller wants solved.
struct RightHandSides {
  const double* b;
  double* x;
  std::int64_t columns;
  int transpose;
};

/// Right-hand sides and solutions, which are turned where the conjugate of what the solver can solve is wanted.
class Conjugated {
 public:
  Conjugated(const espalier_solver& s, const RightHandSides& wanted, std::size_t size)
      : wanted_(wanted), size_(size), way_(espalier::solver::way_to_solve(s, wanted.transpose)) {
    if (!way_.conjugate) return;
    copy_.assign(wanted.b, wanted.b + 2 * size);
    turn(copy_.data());
  }
  [[nodiscard]] espalier::Transpose transpose() const { return way_.transpose; }
  [[nodiscard]] const double* right_hand_sides() const { return way_.conjugate ? copy_.data() : wanted_.b; }
  void finish() {
    if (way_.conjugate) turn(wanted_.x);
  }

 private:
  void turn(double* v) const {
    for (std::size_t k = 0; k < size_; ++k) v[2 * k + 1] = -v[2 * k + 1];
  }

  const RightHandSides& wanted_;
  std::size_t size_;
  espalier::solver::WayToSolve way_;
  std::vector<double> copy_;
};

std::span<const std::complex<double>> complex_span(const double* v, std::size_t count) {
  return {reinterpret_cast<const std::complex<double>*>(v), count};
}
std::span<std::complex<double>> complex_span(double* v, std::size_t count) {
  return {reinterpret_cast<std::complex<double>*>(v), count};
}

template <class Call>
int solve(espalier_solver* solver, const RightHandSides& wanted, espalier_solve_info* info, Call&& call) {
  return guarded(solver, [&](espalier_solver& s) {
    const std::int64_t columns = wanted.columns;
    const auto size = static_cast<std::size_t>(columns) * static_cast<std::size_t>(s.vector_rows);
    heard_by_all(s, [&] {
      with_factorized(s, [](auto&) {});
      require(columns >= 1 && columns <= INT32_MAX, "the number of right-hand sides must lie from 1 to 2^31 - 1");
      require(wanted.transpose >= ESPALIER_NO_TRANSPOSE && wanted.transpose <= ESPALIER_CONJUGATE_TRANSPOSE,
              "transpose must be 0, 1 or 2");
      require(size == 0 || (wanted.b != nullptr && wanted.x != nullptr), "the right-hand side or the solution is null");
    });
    return with_factorized(s, [&](auto& cpp) {
      Conjugated conjugated(s, wanted, size);
      const auto result = call(cpp, conjugated.right_hand_sides(), size, conjugated.transpose());
      conjugated.finish();
      hand_out(result, info);
      return result.status;
    });
  });
}

}  // namespace

extern "C" {

int espalier_analyze_i32(espalier_solver* solver, const espalier_matrix_i32* a, espalier_analysis_info* info) {
  return analyze(solver, a, info);
}

int espalier_analyze_i64(espalier_solver* solver, const espalier_matrix_i64* a, espalier_analysis_info* info) {
  return analyze(solver, a, info);
}

int espalier_factorize_i32(espalier_solver* solver, const espalier_matrix_i32* a, espalier_factor_info* info) {
  return factorize(solver, a, info);
}

int espalier_factorize_i64(espalier_solver* solver, const espalier_matrix_i64* a, espalier_factor_info* info) {
  return factorize(solver, a, info);
}

int espalier_refactorize(espalier_solver* solver, const double* values, int64_t count, espalier_factor_info* info) {
  const std::size_t size = values == nullptr ? 0 : static_cast<std::size_t>(count);
  struct Call {
    const double* values;
    std::size_t size;
    auto operator()(espalier::Solver& cpp) const { return cpp.refactorize({values, size}); }
    auto operator()(espalier::ComplexSolver& cpp) const { return cpp.refactorize(complex_span(values, size)); }
  };
  return refactorize(solver, values, count, info, Call{values, size});
}

int espalier_refactorize_entries(espalier_solver* solver, const int64_t* places, const double* values, int64_t count,
                                 espalier_factor_info* info) {
  return guarded(solver, [&](espalier_solver& s) {
    require(s.ranks.size() == 1, "several ranks share the solver: give values by espalier_refactorize");
    require(count >= 0, "the number of places is negative");
    require(count == 0 || (places != nullptr && values != nullptr), "the places or the values are null");
    const std::span<const espalier::Offset> at(places, static_cast<std::size_t>(count));
    return with_analyzed(s, [&](auto& cpp) {
      require(cpp.state() == espalier::Solver::State::factorized, "call espalier_factorize first");
      return factorize_by(s, cpp, info, [&] {
        if constexpr (std::is_same_v<decltype(cpp), espalier::ComplexSolver&>)
          return cpp.refactorize_entries(at, complex_span(values, at.size()));
        else
          return cpp.refactorize_entries(at, {values, at.size()});
      });
    });
  });
}

int espalier_refactorize_device(espalier_solver* solver, const double* values, int64_t count, void* stream,
                                espalier_factor_info* info) {
  struct Call {
    const double* values;
    std::int64_t count;
    void* stream;
    auto operator()(espalier::Solver& cpp) const { return cpp.refactorize_device(values, count, stream); }
    espalier::ComplexFactorResult operator()(espalier::ComplexSolver&) const {
      throw Error(StatusCode::device_error, kOnDevice);
    }
  };
  return refactorize(solver, values, count, info, Call{values, count, stream});
}

int espalier_solve(espalier_solver* solver, const double* b, double* x, int64_t columns, int transpose,
                   espalier_solve_info* info) {
  return solve(solver, {b, x, columns, transpose}, info,
               [&](auto& cpp, const double* from, std::size_t size, espalier::Transpose how) {
                 const auto count = static_cast<Index>(columns);
                 if constexpr (std::is_same_v<decltype(cpp), espalier::ComplexSolver&>)
                   return cpp.solve(complex_span(from, size), complex_span(x, size), count, how);
                 else
                   return cpp.solve({from, size}, {x, size}, count, how);
               });
}

int espalier_set_refinement(espalier_solver* solver, int32_t steps, double required_backward_error) {
  return guarded(solver, [&](espalier_solver& s) {
    espalier::Options changed = s.options;
    changed.refinement_steps = steps;
    changed.required_backward_error = required_backward_error;
    espalier::solver::check_options(changed);
    if (s.solver) s.solver->set_refinement(steps, required_backward_error);
    if (s.complex_solver) s.complex_solver->set_refinement(steps, required_backward_error);
    s.options = std::move(changed);
    return Status{};
  });
}

int espalier_solve_device(espalier_solver* solver, const double* b, double* x, int64_t columns, int transpose,
                          void* stream, espalier_solve_info* info) {
  return solve(solver, {b, x, columns, transpose}, info,
               [&](auto& cpp, const double*, std::size_t, espalier::Transpose how) -> espalier::SolveResult {
                 if constexpr (std::is_same_v<decltype(cpp), espalier::ComplexSolver&>)
                   throw Error(StatusCode::device_error, kOnDevice);
                 else
                   return cpp.solve_device(b, x, static_cast<Index>(columns), how, stream);
               });
}

int espalier_null_space(espalier_solver* solver, int64_t capacity, int64_t* rows, double* vectors, int64_t* found) {
  return guarded(solver, [&](espalier_solver& s) {
    require(found != nullptr, "the place for the number of vectors is null");
    require(capacity >= 0, "the capacity is negative");
    const auto& known = s.null_space;
    const auto n = static_cast<std::size_t>(s.rows) * (s.complex_solver ? 2 : 1);
    const std::size_t count = n == 0 ? 0 : known.vectors.size() / n;
    const std::size_t given = std::min(count, static_cast<std::size_t>(capacity));
    if (rows != nullptr)
      std::copy_n(known.rows.begin(), std::min(static_cast<std::size_t>(capacity), known.rows.size()), rows);
    if (vectors != nullptr) std::copy_n(known.vectors.begin(), given * n, vectors);
    *found = static_cast<int64_t>(count);
    return Status{};
  });
}

int espalier_condition_estimate(espalier_solver* solver, double* estimate) {
  return guarded(solver, [&](espalier_solver& s) {
    heard_by_all(s, [&] {
      require(estimate != nullptr, "the place for the estimate is null");
      with_factorized(s, [](auto&) {});
    });
    const auto result = with_factorized(s, [](auto& cpp) { return cpp.condition_estimate(); });
    *estimate = result.estimate;
    return result.status;
  });
}

int espalier_save_analysis(espalier_solver* solver, const char* path) {
  return guarded(solver, [&](espalier_solver& s) {
    heard_by_all(s, [&] {
      require(path != nullptr, "the path is null");
      with_analyzed(s, [](auto&) {});
    });
    return with_analyzed(s, [&](auto& cpp) { return cpp.save_analysis(path); });
  });
}

int espalier_analyze_change_i32(espalier_solver* solver, const espalier_matrix_i32* a, std::int32_t* anew,
                                espalier_analysis_info* info) {
  return analyze_change(solver, a, anew, info);
}

int espalier_analyze_change_i64(espalier_solver* solver, const espalier_matrix_i64* a, std::int32_t* anew,
                                espalier_analysis_info* info) {
  return analyze_change(solver, a, anew, info);
}

int espalier_load_analysis_i32(espalier_solver* solver, const char* path, const espalier_matrix_i32* a,
                               espalier_analysis_info* info) {
  return load_analysis(solver, path, a, info);
}

int espalier_load_analysis_i64(espalier_solver* solver, const char* path, const espalier_matrix_i64* a,
                               espalier_analysis_info* info) {
  return load_analysis(solver, path, a, info);
}

}  // extern "C"
