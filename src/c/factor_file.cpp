#include "espalier/factor_file.hpp"

#include <utility>

#include "c/handle.hpp"
#include "c/results.hpp"

using espalier::Storage;
using espalier::solver::guarded;
using espalier::solver::hand_out;
using espalier::solver::require;

namespace {

// What a call needs to know of the solver that a file has made; the numbers of either sort.
template <class Loaded, class Place>
espalier::Status take(espalier_solver& s, Loaded loaded, Place& place, espalier_factor_info* info) {
  s.solver.reset();
  s.complex_solver.reset();
  if (!loaded.result.status.ok()) return loaded.result.status;
  auto& solver = place.emplace(std::move(loaded.solver));
  s.by_rows = loaded.by_rows;
  s.transposed = loaded.by_rows && loaded.storage == Storage::general;
  s.conjugated = loaded.by_rows && loaded.storage >= Storage::hermitian_lower;
  s.rows = s.vector_rows = static_cast<espalier::Index>(solver.rows().count);
  s.nonzeros = static_cast<espalier::Offset>(solver.values().size());
  hand_out(loaded.result, info);
  espalier::Status status = loaded.result.status;
  s.null_space = espalier::solver::null_space_of(std::move(loaded.result), s.by_rows);
  return status;
}

}  // namespace

extern "C" {

int espalier_save_factor(espalier_solver* solver, const char* path) {
  return guarded(solver, [&](espalier_solver& s) -> espalier::Status {
    require(path != nullptr, "the path is null");
    return espalier::solver::with_factorized(s, [&](auto& cpp) { return espalier::save_factor(cpp, path, s.by_rows); });
  });
}

int espalier_load_factor(espalier_solver* solver, const char* path, espalier_factor_info* info) {
  return guarded(solver, [&](espalier_solver& s) -> espalier::Status {
    require(path != nullptr, "the path is null");
    require(s.ranks.size() <= 1, "a factor is loaded by one process");
    const espalier::Options options = espalier::solver::make_solver(s).options();
    s.solver.reset();
    s.null_space = {};
    if (espalier::is_complex_factor(path))
      return take(s, espalier::load_complex_factor(path, options), s.complex_solver, info);
    return take(s, espalier::load_factor(path, options), s.solver, info);
  });
}
}
