/// \file
/// The C interface of Schur complements: the lock and the messages are those of a solver's handle.
#include "espalier/schur.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "c/handle.hpp"
#include "c/matrix.hpp"
#include "c/results.hpp"

struct espalier_schur {
  espalier_solver frame;  // options, lock, message; it has no solver
  std::optional<espalier::SchurComplement> schur;
  espalier::Index rows = 0;
  std::int64_t nonzeros = 0;
  bool transposed = false;  // it holds A^T
};

namespace {

using espalier::Index;
using espalier::SolveResult;
using espalier::Transpose;
using espalier::solver::CallerStatus;
using espalier::solver::hand_out;
using espalier::solver::require;

template <class Body>
int guarded(espalier_schur* schur, const Body& body) noexcept {
  if (schur == nullptr) return ESPALIER_MISUSE;
  return espalier::solver::guarded(&schur->frame, [&](espalier_solver&) { return CallerStatus(body(*schur)); });
}

template <class Matrix>
int analyze(espalier_schur* schur, const Matrix* a, const std::int64_t* unknowns, std::int64_t count,
            espalier_analysis_info* info) {
  return guarded(schur, [&](espalier_schur& s) {
    require(a != nullptr, "the matrix is null");
    require(count >= 0 && (count == 0 || unknowns != nullptr), "the list of unknowns is null");
    const espalier::solver::CMatrix matrix(*a, false);
    require(!matrix.complex(), "complex systems are solved by espalier_solver alone");
    if (count > a->rows)  // each is listed once: the array behind it need not be as long
      throw espalier::Error(espalier::StatusCode::invalid_input,
                            fmt::format("{} unknowns are listed, and the matrix has {} rows", count, a->rows));
    std::vector<Index> list;
    for (std::int64_t k = 0; k < count; ++k)
      list.push_back(static_cast<Index>(std::clamp<std::int64_t>(unknowns[k] - a->index_base, -1, INT32_MAX)));
    s.schur.reset();
    s.schur.emplace(espalier::solver::options_of(s.frame));
    const espalier::AnalysisResult result = s.schur->analyze(matrix.view(), list);
    s.rows = matrix.view().rows;
    s.nonzeros = matrix.view().nonzeros();
    s.transposed = matrix.transposed();
    hand_out(result, info);
    return result.status;
  });
}

espalier::SchurComplement& factorized(espalier_schur& s) {
  require(s.schur && s.schur->factorized(), "call espalier_schur_factorize first");
  return *s.schur;
}

struct Wanted {
  std::int64_t columns;
  int transpose;
};

// call(schur, columns, transpose)
template <class Call>
int solve(espalier_schur* schur, Wanted wanted, espalier_solve_info* info, const Call& call) {
  return guarded(schur, [&](espalier_schur& s) {
    espalier::SchurComplement& cpp = factorized(s);
    require(wanted.columns >= 1 && wanted.columns <= INT32_MAX,
            "the number of right-hand sides must lie from 1 to 2^31 - 1");
    require(wanted.transpose == ESPALIER_NO_TRANSPOSE || wanted.transpose == ESPALIER_TRANSPOSE,
            "transpose must be 0 or 1");
    const bool flip = (wanted.transpose == ESPALIER_TRANSPOSE) != s.transposed;
    const SolveResult result = call(cpp, static_cast<Index>(wanted.columns), flip ? Transpose::yes : Transpose::no);
    hand_out(result, info);
    return result.status;
  });
}

std::size_t area(Index rows, std::int64_t columns) {
  return static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
}

}  // namespace

extern "C" {

int espalier_schur_create(espalier_solver* solver, espalier_schur** schur) {
  if (schur == nullptr) return ESPALIER_MISUSE;
  *schur = nullptr;
  return espalier::solver::guarded(solver, [&](espalier_solver& s) {
    auto made = std::make_unique<espalier_schur>();
    made->frame.options = s.options;
    made->frame.log = s.log;
    made->frame.log_user = s.log_user;
    made->frame.interrupt = s.interrupt;
    made->frame.interrupt_user = s.interrupt_user;
    *schur = made.release();
    return espalier::Status{};
  });
}

void espalier_schur_destroy(espalier_schur* schur) { delete schur; }

const char* espalier_schur_last_error(const espalier_schur* schur) {
  return schur == nullptr ? "the handle is null" : schur->frame.error.c_str();
}

std::int64_t espalier_schur_last_error_row(const espalier_schur* schur) {
  return schur == nullptr ? -1 : schur->frame.error_row;
}

int espalier_schur_analyze_i32(espalier_schur* schur, const espalier_matrix_i32* a, const std::int64_t* unknowns,
                               std::int64_t count, espalier_analysis_info* info) {
  return analyze(schur, a, unknowns, count, info);
}

int espalier_schur_analyze_i64(espalier_schur* schur, const espalier_matrix_i64* a, const std::int64_t* unknowns,
                               std::int64_t count, espalier_analysis_info* info) {
  return analyze(schur, a, unknowns, count, info);
}

int espalier_schur_factorize(espalier_schur* schur, const double* values, std::int64_t count,
                             espalier_factor_info* info) {
  return guarded(schur, [&](espalier_schur& s) {
    require(s.schur.has_value(), "call espalier_schur_analyze first");
    require(count == s.nonzeros, "the number of values is not that of the analysed matrix");
    require(count == 0 || values != nullptr, "the values are null");
    const espalier::SchurResult result = s.schur->factorize({values, static_cast<std::size_t>(count)});
    hand_out(result.rest, info);
    return result.status;
  });
}

int espalier_schur_complement(espalier_schur* schur, double* to, std::int64_t count) {
  return guarded(schur, [&](espalier_schur& s) {
    const std::span<const double> of = factorized(s).complement();
    require(to != nullptr && count == static_cast<std::int64_t>(of.size()), "S has as many values as unknowns squared");
    const auto size = static_cast<std::size_t>(s.schur->size());
    for (std::size_t c = 0; c < size; ++c)
      for (std::size_t r = 0; r < size; ++r) to[c * size + r] = s.transposed ? of[r * size + c] : of[c * size + r];
    return espalier::Status{};
  });
}

int espalier_schur_condense(espalier_schur* schur, const double* b, double* g, std::int64_t columns, int transpose,
                            espalier_solve_info* info) {
  return solve(schur, {columns, transpose}, info, [&](auto& cpp, Index k, Transpose way) {
    require(b != nullptr && g != nullptr, "the right-hand side or its condensed form is null");
    return cpp.condense({b, area(schur->rows, k)}, {g, area(cpp.size(), k)}, k, way);
  });
}

int espalier_schur_expand(espalier_schur* schur, const double* b, const double* xs, double* x, std::int64_t columns,
                          int transpose, espalier_solve_info* info) {
  return solve(schur, {columns, transpose}, info, [&](auto& cpp, Index k, Transpose way) {
    require(b != nullptr && xs != nullptr && x != nullptr, "the right-hand side or a solution is null");
    return cpp.expand({b, area(schur->rows, k)}, {xs, area(cpp.size(), k)}, {x, area(schur->rows, k)}, k, way);
  });
}

int espalier_schur_solve(espalier_schur* schur, const double* b, double* x, std::int64_t columns, int transpose,
                         espalier_solve_info* info) {
  return solve(schur, {columns, transpose}, info, [&](auto& cpp, Index k, Transpose way) {
    require(b != nullptr && x != nullptr, "the right-hand side or the solution is null");
    return cpp.solve({b, area(schur->rows, k)}, {x, area(schur->rows, k)}, k, way);
  });
}

int espalier_schur_inertia(espalier_schur* schur, std::int64_t rest[3], std::int64_t complement[3]) {
  return guarded(schur, [&](espalier_schur& s) {
    require(rest != nullptr && complement != nullptr, "the counts are null");
    const espalier::SchurInertia i = factorized(s).inertia();
    const auto copy_counts = [](const espalier::Inertia& from, std::int64_t* to) {
      to[0] = from.positive;
      to[1] = from.negative;
      to[2] = from.zero;
    };
    copy_counts(i.rest, rest);
    copy_counts(i.complement, complement);
    return i.status;
  });
}

}  // extern "C"
