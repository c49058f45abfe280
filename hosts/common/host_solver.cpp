#include "common/host_solver.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <new>
#include <stdexcept>
#include <string_view>

#include "common/log.hpp"

namespace espalier::hosts {

namespace {

constexpr double kNone = std::numeric_limits<double>::infinity();  // required of a backward error

}  // namespace

HostSolver::HostSolver(std::string interface) : interface_(std::move(interface)) {
  espalier_solver* solver = nullptr;
  if (espalier_create(&solver) != ESPALIER_OK) throw std::bad_alloc();
  solver_.reset(solver);
}

void HostSolver::set_default(const char* key, const std::string& value) {
  if (std::string_view(key) == "threads") threads_chosen_ = true;
  if (espalier_set_option(handle(), key, value.c_str()) != ESPALIER_OK) throw std::logic_error(message());
}

// What is not understood in ESPALIER_OPTIONS is the user's mistake: no host has words for it.
int HostSolver::prepare() {
  const char* words = std::getenv("ESPALIER_OPTIONS");
  user_looks_ = words != nullptr && (std::strstr(words, "refinement") != nullptr || std::strstr(words, "required"));
  const int status = espalier_apply_environment(handle());
  if (status != ESPALIER_OK) complain(interface_, message());
  for (const auto& [key, value] : insisted_) set_default(key.c_str(), value);
  return status;
}

// Waking threads costs more than a small factorization, which optimisers repeat thousands of times: 15,000 unknowns in
// 20 Mflop took a third longer with two threads than with one. Starting them costs more than the analysis of some
// hundred unknowns. The bits do not depend on the number of threads.
template <class Matrix>
int HostSolver::analyze_any(const Matrix& a, int (*call)(espalier_solver*, const Matrix*, espalier_analysis_info*)) {
  constexpr std::int64_t kEntriesForThreads = 8000;
  constexpr double kFlopsForThreads = 3e7;
  rows_ = vector_rows_ = a.rows;
  entries_ = a.nonzeros;
  const bool small = a.nonzeros < kEntriesForThreads;
  if (!threads_chosen_) espalier_set_option(handle(), "threads", small ? "1" : "0");
  int status = prepare();
  if (status == ESPALIER_OK) status = call(handle(), &a, &analysis_);
  if (status != ESPALIER_OK || (small && !threads_chosen_) || analysis_.flops >= kFlopsForThreads) return status;
  espalier_solver* alone = nullptr;
  if (espalier_clone(handle(), 1, &alone) == ESPALIER_OK) solver_.reset(alone);
  return status;
}

int HostSolver::analyze(const espalier_matrix_i32& a) { return analyze_any(a, espalier_analyze_i32); }

int HostSolver::analyze(const espalier_matrix_i64& a) { return analyze_any(a, espalier_analyze_i64); }

// Ranks agree on their threads.
int HostSolver::analyze(const espalier_local_rows_i32& part) {
  rows_ = part.n;
  vector_rows_ = part.rows;
  entries_ = part.rows > 0 ? part.pointers[part.rows] - part.index_base : 0;
  const int status = prepare();
  return status == ESPALIER_OK ? espalier_analyze_rows_i32(handle(), &part, &analysis_) : status;
}

int HostSolver::factorize(const double* values, std::int64_t count) {
  if (look_.first >= 0) set_look(steps_, kNone);
  const int status = espalier_refactorize(handle(), values, count, &factor_);
  if (logs()) say_factorized(status);
  return status;
}

// What is required must not reach the factorization, which would judge small pivots for the sake of it.
void HostSolver::set_look(int steps, double required) {
  if (user_looks_ || look_ == std::pair(steps, required)) return;
  if (espalier_set_refinement(handle(), steps, required) != ESPALIER_OK) throw std::logic_error(message());
  look_ = {steps, required};
}

int HostSolver::substitute(const double* b, double* x, std::int64_t columns, int transpose) {
  set_look(0, kNone);
  return espalier_solve(handle(), b, x, columns, transpose, &solution_);
}

int HostSolver::solve(const double* b, double* x, std::int64_t columns, int transpose) {
  constexpr int kMostSteps = 10;
  std::vector<double> copy;
  if (b == x) {
    copy.assign(b, b + columns * vector_rows_);
    b = copy.data();
  }
  const auto once = [&](int steps) {
    set_look(steps, kPromised);
    return espalier_solve(handle(), b, x, columns, transpose, &solution_);
  };
  int status = once(steps_);
  if (status == ESPALIER_ACCURACY_NOT_REACHED && steps_ < kMostSteps && !user_looks_) status = once(kMostSteps);
  // The solution of a matrix that is nearly singular; hosts have met it in the factor, or do so on purpose (shift and
  // invert).
  if (status == ESPALIER_SINGULAR && solution_.backward_error <= kPromised) status = ESPALIER_OK;
  if (status == ESPALIER_INVALID_INPUT && std::isinf(solution_.backward_error))
    status = ESPALIER_OK;  // b is not finite
  if (status != ESPALIER_OK) log(interface_, fmt::format("not solved: {}", message()));
  return status;
}

int HostSolver::clone(std::unique_ptr<HostSolver>& to) {
  espalier_solver* solver = nullptr;
  const int status = espalier_clone(handle(), 0, &solver);
  if (status != ESPALIER_OK) return status;
  to.reset(new HostSolver(interface_, solver));
  to->insisted_ = insisted_;
  to->rows_ = rows_;
  to->vector_rows_ = vector_rows_;
  to->entries_ = entries_;
  to->threads_chosen_ = threads_chosen_;
  to->analysis_ = analysis_;
  to->steps_ = steps_;
  to->look_ = look_;
  to->user_looks_ = user_looks_;
  return status;
}

void HostSolver::say_factorized(int status) const {
  std::string text = fmt::format("factorized n {}, {} entries, {} in the factor, {:.2g} Gflop, {:.2e} s", rows_,
                                 entries_, analysis_.nonzeros_factor, analysis_.flops * 1e-9, factor_.seconds);
  if (factor_.positive >= 0)
    text += fmt::format(", inertia {} {} {}", factor_.positive, factor_.negative, factor_.zero);
  if (factor_.delayed > 0) text += fmt::format(", {} delayed", factor_.delayed);
  if (factor_.perturbed > 0) text += fmt::format(", {} perturbed", factor_.perturbed);
  if (status != ESPALIER_OK) text += fmt::format("; {}: {}", espalier_status_name(status), message());
  log(interface_, text);
}

}  // namespace espalier::hosts
