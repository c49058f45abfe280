/// \file
/// The C interface: a lock and an error message around the C++ solver.
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <string>
#include <thread>
#include <tuple>

#include "base/forks.hpp"
#include "espalier/espalier.h"
#include "espalier/solver.hpp"
#include "solver/build_info.hpp"
#include "solver/c_matrix.hpp"
#include "solver/environment.hpp"
#include "solver/option_text.hpp"

using espalier::Error;
using espalier::Index;
using espalier::Offset;
using espalier::Status;
using espalier::StatusCode;

namespace {

/// Counts the threads inside the calls of one solver, so that the child of a fork() can tell a lock that nobody will
/// ever give back: a thread of the parent holds it.
class Callers {
 public:
  /// False when another thread was inside at the last fork(): that call will never end here.
  bool enter() {
    const std::uint64_t now = espalier::base::forks() << kBits;
    std::uint64_t seen = state_.load();
    for (;;) {
      const bool same = (seen & ~kMask) == now;
      if (!same && (seen & kMask) != 0) return false;
      if (state_.compare_exchange_weak(seen, same ? seen + 1 : now + 1)) return true;
    }
  }
  void leave() { state_.fetch_sub(1); }

 private:
  static constexpr int kBits = 32;
  static constexpr std::uint64_t kMask = (std::uint64_t{1} << kBits) - 1;
  std::atomic<std::uint64_t> state_{espalier::base::forks() << kBits};  // forks, then callers
};

void log_to_stderr(const char* line, void*) { std::fprintf(stderr, "espalier: %s\n", line); }

}  // namespace

struct espalier_solver {
  Callers callers;
  std::mutex mutex;
  std::atomic<std::thread::id> owner{};  // the thread inside a call: a log callback that calls back is turned away
  const espalier::solver::Environment environment = espalier::solver::read_environment();
  espalier::Options options = environment.options;
  espalier_log_callback log = environment.log_to_stderr ? &log_to_stderr : nullptr;
  void* log_user = nullptr;
  std::optional<espalier::Solver> solver;  // made at analysis, with the options of that moment
  Index rows = 0;
  Offset nonzeros = 0;
  bool transposed = false;  // the solver holds A^T
  std::string error;
  int64_t error_row = -1;
};

namespace {

int fail(espalier_solver& s, int code, const char* message, int64_t row = -1) noexcept {
  s.error_row = row;
  try {
    s.error = message;
  } catch (...) {
    s.error.clear();  // no memory for a message: the code alone must do
  }
  return code;
}

int finish(espalier_solver& s, const Status& status) noexcept {
  return fail(s, static_cast<int>(status.code), status.message.c_str(), status.row);
}

struct Inside {
  Callers& callers;
  explicit Inside(Callers& the_callers) : callers(the_callers) {}
  Inside(const Inside&) = delete;
  Inside& operator=(const Inside&) = delete;
  ~Inside() { callers.leave(); }
};

/// Runs `body` (returns a status) under the solver's lock; every exception becomes a code and a message.
template <class Body>
int guarded(espalier_solver* s, const Body& body) noexcept {
  if (s == nullptr) return ESPALIER_MISUSE;
  if (s->owner.load() == std::this_thread::get_id()) return ESPALIER_MISUSE;  // from inside a log callback
  if (!s->callers.enter())
    return fail(*s, ESPALIER_MISUSE,
                "another thread was inside a call on this solver when the process forked; make a new solver here");
  const Inside inside(s->callers);
  const std::lock_guard lock(s->mutex);
  s->owner = std::this_thread::get_id();
  int code = ESPALIER_OK;
  try {
    code = finish(*s, body(*s));
  } catch (const Error& e) {
    code = finish(*s, e.status());
  } catch (const std::bad_alloc&) {
    code = fail(*s, ESPALIER_OUT_OF_MEMORY, "the machine's memory is too small");
  } catch (const std::logic_error& e) {
    code = fail(*s, ESPALIER_MISUSE, e.what());
  } catch (const std::exception& e) {
    code = fail(*s, ESPALIER_INTERNAL_ERROR, e.what());
  } catch (...) {
    code = fail(*s, ESPALIER_INTERNAL_ERROR, "an unknown exception");
  }
  s->owner = std::thread::id{};
  return code;
}

void require(bool condition, const char* what) {
  if (!condition) throw std::invalid_argument(what);
}

/// Copies as much of `result` as the caller's struct holds; leaves its `size` alone.
template <class Info>
void hand_out(Info result, Info* info) {
  if (info == nullptr) return;
  require(info->size >= sizeof(std::size_t), "the info's field 'size' must be sizeof of its struct");
  result.size = info->size;
  std::memcpy(info, &result, std::min(info->size, sizeof(Info)));
}

espalier_analysis_info to_c(const espalier::AnalysisResult& r) {
  espalier_analysis_info info{};
  info.seconds = r.seconds;
  info.ordering_seconds = r.ordering_seconds;
  info.flops = r.flops;
  info.predicted_seconds = r.predicted_seconds;
  info.predicted_bytes = r.predicted_bytes;
  info.nonzeros_factor = r.nonzeros_factor;
  info.fronts = r.fronts;
  info.tiers = r.tiers;
  info.largest_front = r.largest_front;
  return info;
}

espalier_factor_info to_c(const espalier::FactorResult& r) {
  espalier_factor_info info{};
  info.seconds = r.seconds;
  info.flops_per_second = r.flops_per_second;
  info.positive = r.inertia.positive;
  info.negative = r.inertia.negative;
  info.zero = r.inertia.zero;
  info.two_by_two = r.two_by_two;
  info.perturbed = r.perturbed;
  info.rank = r.rank;
  info.determinant_sign = r.determinant_sign;
  info.determinant_log = r.determinant_log;
  info.peak_host_bytes = r.peak_host_bytes;
  return info;
}

espalier_solve_info to_c(const espalier::SolveResult& r) {
  espalier_solve_info info{};
  info.seconds = r.seconds;
  info.refinement_steps = r.refinement_steps;
  info.backward_error = r.backward_error;
  info.componentwise_error = r.componentwise_error;
  return info;
}

espalier::Solver& make_solver(espalier_solver& s) {
  if (!s.environment.status.ok()) throw Error(s.environment.status);
  espalier::Options options = s.options;
  if (s.log != nullptr) {
    options.log = [log = s.log, user = s.log_user](const std::string& line) { log(line.c_str(), user); };
  }
  s.solver.reset();  // gives back the memory of the pattern before
  return s.solver.emplace(std::move(options));
}

espalier::Solver& solver_of(espalier_solver& s) {
  require(s.solver && s.solver->state() != espalier::Solver::State::empty, "call espalier_analyze first");
  return *s.solver;
}

espalier::Solver& factorized(espalier_solver& s) {
  require(s.solver && s.solver->state() == espalier::Solver::State::factorized, "call espalier_factorize first");
  return *s.solver;
}

/// Analysis of a new pattern by `analyze(solver, view)`.
template <class Matrix, class Analyze>
int analyze_by(espalier_solver* solver, const Matrix* a, espalier_analysis_info* info, const Analyze& analyze) {
  return guarded(solver, [&](espalier_solver& s) {
    require(a != nullptr, "the matrix is null");
    const espalier::solver::CMatrix matrix(*a, false);
    const auto result = analyze(make_solver(s), matrix.view());
    s.rows = matrix.view().rows;
    s.nonzeros = matrix.view().nonzeros();
    s.transposed = matrix.transposed();
    hand_out(to_c(result), info);
    return result.status;
  });
}

template <class Matrix>
int analyze(espalier_solver* solver, const Matrix* a, espalier_analysis_info* info) {
  return analyze_by(solver, a, info,
                    [](espalier::Solver& s, const espalier::MatrixView& view) { return s.analyze(view); });
}

template <class Matrix>
int load_analysis(espalier_solver* solver, const char* path, const Matrix* a, espalier_analysis_info* info) {
  return analyze_by(solver, a, info, [&](espalier::Solver& s, const espalier::MatrixView& view) {
    require(path != nullptr, "the path is null");
    return s.load_analysis(path, view);
  });
}

template <class Matrix>
int factorize(espalier_solver* solver, const Matrix* a, espalier_factor_info* info) {
  return guarded(solver, [&](espalier_solver& s) {
    require(a != nullptr, "the matrix is null");
    espalier::Solver& cpp = solver_of(s);
    const espalier::solver::CMatrix matrix(*a, true);
    require(matrix.transposed() == s.transposed, "the layout is not that of the analysed matrix");
    const auto result = cpp.factorize(matrix.view());
    hand_out(to_c(result), info);
    return result.status;
  });
}

// New values by `call`, on the host or on the device.
template <class Call>
int refactorize(espalier_solver* solver, const double* values, std::int64_t count, espalier_factor_info* info,
                Call&& call) {
  return guarded(solver, [&](espalier_solver& s) {
    espalier::Solver& cpp = solver_of(s);
    require(count == s.nonzeros, "the number of values is not that of the analysed matrix");
    require(count == 0 || values != nullptr, "the values are null");
    const auto result = call(cpp);
    hand_out(to_c(result), info);
    return result.status;
  });
}

template <class Call>
int solve(espalier_solver* solver, const double* b, const double* x, std::int64_t columns, int transpose,
          espalier_solve_info* info, Call&& call) {
  return guarded(solver, [&](espalier_solver& s) {
    espalier::Solver& cpp = factorized(s);
    require(columns >= 1 && columns <= INT32_MAX, "the number of right-hand sides must lie from 1 to 2^31 - 1");
    require(transpose == ESPALIER_NO_TRANSPOSE || transpose == ESPALIER_TRANSPOSE, "transpose must be 0 or 1");
    const auto size = static_cast<std::size_t>(columns) * static_cast<std::size_t>(s.rows);
    require(size == 0 || (b != nullptr && x != nullptr), "the right-hand side or the solution is null");
    const bool flip = (transpose == ESPALIER_TRANSPOSE) != s.transposed;
    const auto result = call(cpp, size, flip ? espalier::Transpose::yes : espalier::Transpose::no);
    hand_out(to_c(result), info);
    return result.status;
  });
}

}  // namespace

extern "C" {

const char* espalier_version(void) { return espalier::solver::version(); }

const char* espalier_status_name(int status) {
  if (status == ESPALIER_MISUSE) return "misuse";
  if (status == ESPALIER_INTERNAL_ERROR) return "internal_error";
  return espalier::solver::name_of(static_cast<StatusCode>(status)).data();  // literals end in a zero
}

int espalier_create(espalier_solver** solver) {
  if (solver == nullptr) return ESPALIER_MISUSE;
  *solver = nullptr;
  try {
    *solver = new espalier_solver;
  } catch (...) {
    return ESPALIER_OUT_OF_MEMORY;
  }
  return ESPALIER_OK;
}

int espalier_clone(espalier_solver* solver, int32_t threads, espalier_solver** clone) {
  if (clone == nullptr) return ESPALIER_MISUSE;
  *clone = nullptr;
  return guarded(solver, [&](espalier_solver& s) {
    require(threads >= 0, "the number of threads must be 0 (as many as the solver has) or greater");
    auto other = std::make_unique<espalier_solver>();
    other->options = s.options;
    std::tie(other->log, other->log_user) = std::tie(s.log, s.log_user);
    if (s.solver) other->solver.emplace(s.solver->clone(threads));
    std::tie(other->rows, other->nonzeros, other->transposed) = std::tie(s.rows, s.nonzeros, s.transposed);
    *clone = other.release();
    return Status{};
  });
}

void espalier_destroy(espalier_solver* solver) {
  if (solver != nullptr && !solver->callers.enter()) return;  // half of a call of the parent's: left as it lies
  delete solver;
}

const char* espalier_last_error(const espalier_solver* solver) {
  return solver == nullptr ? "the solver is null" : solver->error.c_str();
}

int64_t espalier_last_error_row(const espalier_solver* solver) { return solver == nullptr ? -1 : solver->error_row; }

int espalier_set_option(espalier_solver* solver, const char* key, const char* value) {
  return guarded(solver, [&](espalier_solver& s) {
    require(key != nullptr && value != nullptr, "the option's name or value is null");
    espalier::solver::set_option(s.options, key, value);
    return Status{};
  });
}

int espalier_set_log(espalier_solver* solver, espalier_log_callback log, void* user) {
  return guarded(solver, [&](espalier_solver& s) {
    s.log = log;
    s.log_user = user;
    return Status{};
  });
}

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
  return refactorize(solver, values, count, info, [&](espalier::Solver& cpp) {
    return cpp.refactorize({values, static_cast<std::size_t>(count)});
  });
}

int espalier_refactorize_device(espalier_solver* solver, const double* values, int64_t count, void* stream,
                                espalier_factor_info* info) {
  return refactorize(solver, values, count, info,
                     [&](espalier::Solver& cpp) { return cpp.refactorize_device(values, count, stream); });
}

int espalier_solve(espalier_solver* solver, const double* b, double* x, int64_t columns, int transpose,
                   espalier_solve_info* info) {
  return solve(solver, b, x, columns, transpose, info,
               [&](espalier::Solver& cpp, std::size_t size, espalier::Transpose how) {
                 return cpp.solve({b, size}, {x, size}, static_cast<Index>(columns), how);
               });
}

int espalier_solve_device(espalier_solver* solver, const double* b, double* x, int64_t columns, int transpose,
                          void* stream, espalier_solve_info* info) {
  return solve(solver, b, x, columns, transpose, info,
               [&](espalier::Solver& cpp, std::size_t, espalier::Transpose how) {
                 return cpp.solve_device(b, x, static_cast<Index>(columns), how, stream);
               });
}

int espalier_condition_estimate(espalier_solver* solver, double* estimate) {
  return guarded(solver, [&](espalier_solver& s) {
    require(estimate != nullptr, "the place for the estimate is null");
    const auto result = factorized(s).condition_estimate();
    *estimate = result.estimate;
    return result.status;
  });
}

int espalier_save_analysis(espalier_solver* solver, const char* path) {
  return guarded(solver, [&](espalier_solver& s) {
    require(path != nullptr, "the path is null");
    return solver_of(s).save_analysis(path);
  });
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
