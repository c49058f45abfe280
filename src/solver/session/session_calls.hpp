/// \file
/// What the calls of Solver and ComplexSolver have in common: failures as statuses, results as copies. Used by the
/// sources of these two and of what works with their factors.
#pragma once

#include <fmt/format.h>

#include <new>
#include <stdexcept>
#include <string>
#include <utility>

#include "solver/ranks/on_all_ranks.hpp"
#include "solver/session/session.hpp"
#include "solver/session/status_of.hpp"

namespace espalier::solver {

template <class Body>
Status guarded(Session& s, Body&& body) {
  const auto here = [&] {
    return status_of(s.interruption, "use a smaller system or a machine with more memory", body);
  };
  if (s.link() == nullptr) return here();
  return on_all_ranks(*s.link(), here);
}

// The caller's copy of a result; without memory for it, a bare status.
template <class Result>
Result copy_of(const Result& result) {
  try {
    return result;
  } catch (const std::bad_alloc&) {
    Result bare;
    bare.status.code = StatusCode::out_of_memory;
    bare.status.message = "out of memory";  // short enough to need none
    return bare;
  }
}

inline void check_analyzed(const Session& s, const char* call) {
  if (!s.factor) throw std::logic_error(fmt::format("{}: call analyze() first", call));
}

inline void check_values(const Session& s, const char* call, Offset count) {
  check_analyzed(s, call);
  if (s.parts) return;  // one rank's mistake is told to all
  const Offset expected = s.current().system->prepared.caller_nonzeros;
  if (count != expected)
    throw std::invalid_argument(fmt::format("{}: {} values for a pattern of {} entries", call, count, expected));
}

inline void check_factorized(const Session& s, const char* call) {
  if (s.state() != Solver::State::factorized)
    throw std::logic_error(fmt::format("{}: there is no factorization", call));
}

// What `body` makes of s.factor; a failure takes the numbers with it.
template <class Body>
FactorResult factor_by(Session& s, Body&& body) {
  const int before = s.factor->changes();
  Status status = guarded(s, [&] {
    s.expect_usable();
    if (s.opening.valid()) s.opening.wait();
    s.note_devices();
    body(*s.factor);
  });
  FactorResult& result = s.factor->result();
  if (!status.ok()) {
    result.status = std::move(status);
    if (!s.device_lost()) s.factor->drop();
  }
  if (s.factor->changes() != before) s.analysis = copy_of(s.current().result);
  return copy_of(result);
}

// New values for all entries. With Options::partial_refactorization a factor outlives values that are refused, and so
// do numbers that are kept of it in a changed pattern.
inline FactorResult refactorize_by(Session& s, std::span<const double> values) {
  const bool factorized = s.state() == Solver::State::factorized;
  if (s.options.partial_refactorization && (factorized || s.factor->has_numbers())) {
    Status status = guarded(s, [&] { s.factor->expect_fit(values); });
    if (!status.ok()) {
      FactorResult refused;
      refused.status = std::move(status);
      return refused;
    }
  }
  return factor_by(s, [&](Factor& factor) { factor.factorize(values); });
}

// @param values  doubles (base::Numbers), as many as places ask for
inline FactorResult refactorize_entries(Session& s, const char* call, std::span<const Offset> places,
                                        std::span<const double> values) {
  check_factorized(s, call);
  if (s.parts || s.link() != nullptr)
    throw std::logic_error(fmt::format("{}: the matrix comes in parts; give all values", call));
  const std::size_t parts = at(base::parts_of(s.current().system->numbers()));
  if (values.size() != parts * places.size())
    throw std::invalid_argument(fmt::format("{}: {} values for {} places", call, values.size() / parts, places.size()));
  std::vector<double> all, before;
  bool alone = false;
  FactorResult refused;
  refused.status = guarded(s, [&] {
    s.expect_usable();
    alone = s.factor->accepts(places, values);
    if (alone) {
      before = s.factor->values_at(places);
    } else {
      all = s.factor->values_with(places, values);
      s.factor->expect_fit(all);
      before = s.factor->values_with({}, {});
    }
  });
  if (!refused.status.ok()) return refused;
  const auto factorized = [&](std::span<const double> some, std::span<const double> whole) {
    return factor_by(s, [&](Factor& factor) {
      if (alone)
        factor.factorize_entries(places, some);
      else
        factor.factorize(whole);
    });
  };
  FactorResult result = factorized(values, all);
  const StatusCode code = result.status.code;
  // The factor is that of the values before again, or where that fails there is none.
  if (code == StatusCode::singular || code == StatusCode::not_positive_definite) (void)factorized(before, before);
  return result;
}

template <class Body>
SolveResult solve_by(Session& s, Body&& body) {
  s.solution = SolveResult{};
  Status status = guarded(s, [&] {
    s.expect_usable();
    s.solution = body();
  });
  if (!status.ok()) s.solution.status = std::move(status);
  return copy_of(s.solution);
}

template <class Body>
AnalysisResult analysis_by(Session& s, Body&& body) {
  s.analysis = AnalysisResult{};
  s.analysis.status = guarded(s, [&] {
    s.expect_usable();
    body();
  });
  if (!s.analysis.status.ok() && !s.device_lost()) s.factor.reset();
  return copy_of(s.analysis);
}

// The rest is the same for both solvers; `call` is the name that the caller knows it by.

/// @throws std::invalid_argument unless a clone can have so many threads (0: as many as the original)
void check_threads(const char* call, int threads);
/// @throws std::invalid_argument  what the options of a solver do not allow
void set_refinement(Session& s, int steps, double required_backward_error);
/// `pattern` and the number of values, of a matrix that is valid, against the analysis.
/// @throws Error(invalid_input)
void expect_same_system(Session& s, const MatrixView& pattern, std::size_t values);
ChangeResult analyze_change(Session& s, const char* call, const GivenMatrix& a);
ConditionResult condition_of(Session& s, const char* call);
Status save_analysis(Session& s, const char* call, const std::string& path);
Status write_trace(Session& s, const char* call, const std::string& path);

}  // namespace espalier::solver
