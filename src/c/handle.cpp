/// \file
/// The C interface: the life of a handle, its options and callbacks.
#include "c/handle.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <tuple>
#include <utility>

#include "solver/options/option_check.hpp"
#include "solver/options/option_text.hpp"
#include "solver/session/build_info.hpp"

using espalier::Error;
using espalier::Status;
using espalier::StatusCode;
using espalier::solver::guarded;
using espalier::solver::require;

espalier::Options espalier::solver::options_of(const espalier_solver& s) {
  if (!s.environment.status.ok()) throw Error(s.environment.status);
  espalier::Options options = s.options;
  if (s.log != nullptr)
    options.log = [log = s.log, user = s.log_user](const std::string& line) { log(line.c_str(), user); };
  if (s.interrupt != nullptr)
    options.interrupted = [ask = s.interrupt, user = s.interrupt_user] { return ask(user) != 0; };
  return options;
}

namespace {

espalier::Options options_of_new_solver(espalier_solver& s) {
  espalier::Options options = espalier::solver::options_of(s);
  s.solver.reset();  // gives back the memory of the pattern before
  s.complex_solver.reset();
  return options;
}

}  // namespace

espalier::Solver& espalier::solver::make_solver(espalier_solver& s) {
  espalier::Options options = options_of_new_solver(s);
  return s.solver.emplace(s.ranks, std::move(options));
}

espalier::ComplexSolver& espalier::solver::make_complex_solver(espalier_solver& s) {
  espalier::Options options = options_of_new_solver(s);
  return s.complex_solver.emplace(s.ranks, std::move(options));
}

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
    std::tie(other->interrupt, other->interrupt_user) = std::tie(s.interrupt, s.interrupt_user);
    if (s.solver) other->solver.emplace(s.solver->clone(threads));
    other->ranks = s.ranks;
    if (s.complex_solver) other->complex_solver.emplace(s.complex_solver->clone(threads));
    other->conjugated = s.conjugated;
    std::tie(other->rows, other->vector_rows, other->nonzeros, other->transposed, other->by_rows) =
        std::tie(s.rows, s.vector_rows, s.nonzeros, s.transposed, s.by_rows);
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

int64_t espalier_last_error_column(const espalier_solver* solver) {
  return solver == nullptr ? -1 : solver->error_column;
}

int espalier_set_option(espalier_solver* solver, const char* key, const char* value) {
  return guarded(solver, [&](espalier_solver& s) {
    require(key != nullptr && value != nullptr, "the option's name or value is null");
    espalier::solver::set_option(s.options, key, value);
    return Status{};
  });
}

int espalier_apply_environment(espalier_solver* solver) {
  return guarded(solver, [&](espalier_solver& s) {
    espalier::solver::Environment environment = espalier::solver::read_environment(s.options);
    if (environment.status.ok()) s.options = std::move(environment.options);
    return environment.status;
  });
}

int espalier_set_log(espalier_solver* solver, espalier_log_callback log, void* user) {
  return guarded(solver, [&](espalier_solver& s) {
    s.log = log;
    s.log_user = user;
    return Status{};
  });
}

int espalier_set_interrupt(espalier_solver* solver, espalier_interrupt_callback interrupt, void* user) {
  return guarded(solver, [&](espalier_solver& s) {
    s.interrupt = interrupt;
    s.interrupt_user = user;
    return Status{};
  });
}

}  // extern "C"
