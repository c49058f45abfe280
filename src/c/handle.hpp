/// \file
/// The handle of the C interface: a C++ solver with a lock and an error message around it.
#pragma once

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <mutex>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "base/forks.hpp"
#include "c/results.hpp"
#include "espalier/complex_solver.hpp"
#include "espalier/espalier.h"
#include "espalier/solver.hpp"
#include "solver/options/environment.hpp"
#include "solver/ranks/on_all_ranks.hpp"

namespace espalier::solver {

/// Counts the threads inside the calls of one solver, so that the child of a fork() can tell a lock that nobody will
/// ever give back: a thread of the parent holds it.
class Callers {
 public:
  /// False when another thread was inside at the last fork(): that call will never end here.
  bool enter() {
    const std::uint64_t now = base::forks() << kBits;
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
  std::atomic<std::uint64_t> state_{base::forks() << kBits};  // forks, then callers
};

inline void log_to_stderr(const char* line, void*) { std::fprintf(stderr, "espalier: %s\n", line); }

}  // namespace espalier::solver

struct espalier_solver {
  espalier::solver::Callers callers;
  std::mutex mutex;
  std::atomic<std::thread::id> owner{};  // the thread inside a call: a log callback that calls back is turned away
  const espalier::solver::Environment environment = espalier::solver::read_environment();
  espalier::Options options = environment.options;
  espalier_log_callback log = environment.log_to_stderr ? &espalier::solver::log_to_stderr : nullptr;
  void* log_user = nullptr;
  espalier_interrupt_callback interrupt = nullptr;
  void* interrupt_user = nullptr;
  espalier::Ranks ranks;  // espalier_use_ranks
  // Made at analysis, with the options of that moment; one of them at most.
  std::optional<espalier::Solver> solver;
  std::optional<espalier::ComplexSolver> complex_solver;
  espalier::Index rows = 0;
  espalier::Index vector_rows = 0;  // of right-hand sides and solutions: fewer where the matrix came in parts
  espalier::Offset nonzeros = 0;
  bool transposed = false;                 // the solver holds A^T
  bool conjugated = false;                 // ... which of a Hermitian matrix is its conjugate: A by rows
  bool by_rows = false;                    // its columns are the caller's rows, of a symmetric matrix, too
  espalier::solver::NullSpace null_space;  // of the last factorization
  std::string error;
  int64_t error_row = -1;
  int64_t error_column = -1;  // where the solver's row is the caller's column
};

namespace espalier::solver {

inline int fail(espalier_solver& s, int code, const char* message, int64_t row = -1) noexcept {
  s.error_row = row;
  s.error_column = -1;
  try {
    s.error = message;
  } catch (...) {
    s.error.clear();  // no memory for a message: the code alone must do
  }
  return code;
}

/// How a call ended, in terms of the caller's matrix.
struct CallerStatus {
  CallerStatus(Status the_status, Index the_column = -1)  // NOLINT(google-explicit-constructor): most concern no column
      : status(std::move(the_status)), column(the_column) {}
  Status status;
  Index column;
};

inline int finish(espalier_solver& s, const CallerStatus& end) noexcept {
  const int code = fail(s, static_cast<int>(end.status.code), end.status.message.c_str(), end.status.row);
  s.error_column = end.column;
  return code;
}

struct Inside {
  Callers& callers;
  explicit Inside(Callers& the_callers) : callers(the_callers) {}
  Inside(const Inside&) = delete;
  Inside& operator=(const Inside&) = delete;
  ~Inside() { callers.leave(); }
};

/// Runs `body` (returns a Status or a CallerStatus) under the solver's lock; every exception becomes a code and a
/// message.
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

/// The options of this moment, with the log and the interruption. Throws where the environment was refused.
Options options_of(const espalier_solver& s);
/// A new solver with them.
Solver& make_solver(espalier_solver& s);
ComplexSolver& make_complex_solver(espalier_solver& s);

inline void require(bool condition, const char* what) {
  if (!condition) throw std::invalid_argument(what);
}

/// Calls use(solver) with the solver that there is.
template <class Use>
auto with_solver(espalier_solver& s, const char* missing, Solver::State least, const Use& use) {
  if (s.complex_solver && s.complex_solver->state() >= least) return use(*s.complex_solver);
  require(s.solver && s.solver->state() >= least, missing);
  return use(*s.solver);
}
template <class Use>
auto with_analyzed(espalier_solver& s, const Use& use) {
  return with_solver(s, "call espalier_analyze first", Solver::State::analyzed, use);
}
template <class Use>
auto with_factorized(espalier_solver& s, const Use& use) {
  return with_solver(s, "call espalier_factorize first", Solver::State::factorized, use);
}

/// How a system is solved with what the solver holds: A, or A^T of a general matrix by rows, or the conjugate of a
/// Hermitian one by rows.
struct WayToSolve {
  Transpose transpose = Transpose::no;
  bool conjugate = false;  ///< right-hand sides and solutions have to be conjugated
};
inline WayToSolve way_to_solve(const espalier_solver& s, int transpose) {
  if (!s.complex_solver) return {(transpose != ESPALIER_NO_TRANSPOSE) != s.transposed ? Transpose::yes : Transpose::no};
  if (s.transposed)  // A is the transpose of what is held; A^H is its conjugate
    return {transpose == ESPALIER_NO_TRANSPOSE ? Transpose::yes : Transpose::no,
            transpose == ESPALIER_CONJUGATE_TRANSPOSE};
  if (s.conjugated)  // A is the transpose of what is held, which is Hermitian; A^H is A
    return {transpose == ESPALIER_TRANSPOSE ? Transpose::no : Transpose::yes};
  return {transpose == ESPALIER_NO_TRANSPOSE ? Transpose::no
          : transpose == ESPALIER_TRANSPOSE  ? Transpose::yes
                                             : Transpose::conjugate};
}

/// What comes before a collective call on this rank: the others, which make that call meanwhile, hear of what `body`
/// throws, and end it.
template <class Body>
auto heard_by_all(espalier_solver& s, const Body& body) {
  try {
    return body();
  } catch (const std::exception&) {
    if (s.ranks.size() > 1) (void)on_all_ranks(*s.ranks.link(), []() -> Status { throw; });
    throw;
  }
}

}  // namespace espalier::solver
