// Solves for a few unknowns in the C interface.
#include "espalier/solve_rows.hpp"

#include <fmt/format.h>

#include <complex>
#include <span>
#include <type_traits>
#include <vector>

#include "c/handle.hpp"
#include "espalier/espalier.h"

namespace {

using espalier::Index;
using espalier::solver::guarded;
using espalier::solver::require;

// The interface has 64 bits, the solver fewer.
std::vector<Index> narrowed(const int64_t* list, int64_t count, espalier::Index rows, const char* what) {
  std::vector<Index> out;
  out.reserve(static_cast<std::size_t>(count));
  for (int64_t k = 0; k < count; ++k) {
    if (list[k] < 0 || list[k] >= rows)
      throw espalier::Error(espalier::StatusCode::invalid_input,
                            fmt::format("{} {} is number {}, of {}", what, k, list[k], rows));
    out.push_back(static_cast<Index>(list[k]));
  }
  return out;
}

template <class Value>
void conjugate(std::span<Value> values) {
  if constexpr (!std::is_same_v<Value, double>)
    for (Value& v : values) v = std::conj(v);
}

}  // namespace

namespace espalier {

// Found by hand_out().
static espalier_rows_info to_c(const SolveRowsResult& r) {
  espalier_rows_info info{};
  info.seconds = r.seconds;
  info.backward_error = r.backward_error;
  info.componentwise_error = r.componentwise_error;
  info.share = r.share;
  return info;
}

}  // namespace espalier

int espalier_solve_rows(espalier_solver* solver, const espalier_columns* b, const int64_t* unknowns, int64_t wanted,
                        double* x, int64_t count, int transpose, espalier_rows_info* info) {
  return guarded(solver, [&](espalier_solver& s) {
    require(b != nullptr && b->begin != nullptr, "the right-hand sides or their begin are null");
    require(b->columns >= 1 && b->columns < INT32_MAX, "the number of right-hand sides must lie from 1 to 2^31 - 2");
    require(transpose >= ESPALIER_NO_TRANSPOSE && transpose <= ESPALIER_CONJUGATE_TRANSPOSE, "transpose is unknown");
    const auto columns = static_cast<std::size_t>(b->columns);
    const int64_t entries = b->begin[columns];
    require(entries >= 0, "the right-hand sides end before they begin");
    require(entries == 0 || (b->rows != nullptr && b->values != nullptr), "the rows or the values are null");
    require(wanted >= 0 && (wanted == 0 || (unknowns != nullptr && x != nullptr)), "the unknowns or x are null");
    require(wanted <= INT64_MAX / b->columns && count == wanted * b->columns,
            "the number of values in x is not that of unknowns times columns");
    const espalier::SolveRowsResult r = espalier::solver::with_factorized(s, [&](auto& cpp) {
      using Value = std::conditional_t<std::is_same_v<decltype(cpp), espalier::Solver&>, double, std::complex<double>>;
      const std::vector<Index> of_b = narrowed(b->rows, entries, s.rows, "the row of entry");
      const std::vector<Index> of_x = narrowed(unknowns, wanted, s.rows, "wanted unknown");
      const auto* first = reinterpret_cast<const Value*>(b->values);
      std::vector<Value> values(first, first + entries);
      const std::span<Value> to(reinterpret_cast<Value*>(x), static_cast<std::size_t>(count));
      const espalier::solver::WayToSolve way = espalier::solver::way_to_solve(s, transpose);
      if (way.conjugate) conjugate(std::span(values));
      auto found = espalier::solve_rows(cpp, {{b->begin, columns + 1}, of_b, values}, of_x, to, way.transpose);
      if (way.conjugate) conjugate(to);
      return found;
    });
    espalier::solver::hand_out(r, info);
    return r.status;
  });
}
