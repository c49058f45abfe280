#include "espalier/factor_file.hpp"
#include "solver/c_handle.hpp"
#include "solver/c_results.hpp"

using espalier::solver::guarded;
using espalier::solver::hand_out;
using espalier::solver::require;

extern "C" {

int espalier_save_factor(espalier_solver* solver, const char* path) {
  return guarded(solver, [&](espalier_solver& s) -> espalier::Status {
    require(path != nullptr, "the path is null");
    require(!s.complex_solver, "factors of complex matrices cannot be saved");
    require(s.solver && s.solver->state() == espalier::Solver::State::factorized, "call espalier_factorize first");
    return espalier::save_factor(*s.solver, path, s.transposed);
  });
}

int espalier_load_factor(espalier_solver* solver, const char* path, espalier_factor_info* info) {
  return guarded(solver, [&](espalier_solver& s) -> espalier::Status {
    require(path != nullptr, "the path is null");
    require(s.ranks.size() <= 1, "a factor is loaded by one process");
    espalier::LoadedFactor loaded = espalier::load_factor(path, espalier::solver::make_solver(s).options());
    espalier::solver::NullSpace none;
    s.null_space = std::move(none);
    s.complex_solver.reset();
    if (!loaded.result.status.ok()) {
      s.solver.reset();
      return loaded.result.status;
    }
    s.solver.emplace(std::move(loaded.solver));
    s.transposed = loaded.transposed;
    s.conjugated = false;
    s.by_rows = loaded.transposed;
    s.rows = s.vector_rows = static_cast<espalier::Index>(s.solver->rows().count);
    s.nonzeros = static_cast<espalier::Offset>(s.solver->values().size());
    hand_out(loaded.result, info);
    return loaded.result.status;
  });
}
}
