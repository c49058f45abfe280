// A solver whose factor goes to a file and comes from one.
#include <utility>

#include "espalier/factor_file.hpp"
#include "solver_handle.hpp"

namespace espalier::python {

Status SolverHandle::save_factor(const std::string& path) {
  return call([&] {
    return with_analyzed([&](auto& solver) {
      if (solver.state() != Solver::State::factorized)
        throw std::logic_error("there is no factorization: call factorize(A) first");
      return espalier::save_factor(solver, path, by_rows_);
    });
  });
}

namespace {

// What of a loaded factor the caller sees; the solver goes to `place` where there is one.
template <class Loaded, class Place>
SavedFactor take(Loaded loaded, Place& place) {
  SavedFactor out;
  out.restored = loaded.restored;
  out.shape = {0, loaded.by_rows, loaded.storage, !std::is_same_v<Loaded, LoadedFactor>};
  out.shape.storage = storage_by_columns(out.shape);  // the rows of a triangle again
  if (loaded.result.status.ok()) {
    auto& solver = place.emplace(std::move(loaded.solver));
    out.analysis = solver.analysis();
    auto a = factorized_matrix(solver);
    out.shape.n = a.cols;
    out.pointers = std::move(a.col_ptr);
    out.indices = std::move(a.row_ind);
  }
  out.factor = std::move(loaded.result);
  return out;
}

}  // namespace

SavedFactor SolverHandle::load_factor(const std::string& path) {
  return call([&] {
    solver_.reset();
    complex_solver_.reset();
    ++generation_;
    SavedFactor loaded = is_complex_factor(path) ? take(load_complex_factor(path, options_), complex_solver_)
                                                 : take(espalier::load_factor(path, options_), solver_);
    other_options_ = true;
    by_rows_ = loaded.shape.by_rows;
    transposed_ = loaded.shape.by_rows && loaded.shape.storage == Storage::general;
    return loaded;
  });
}

}  // namespace espalier::python
