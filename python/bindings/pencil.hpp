/// \file
/// What calls with the matrices of a pencil have in common: views of their arrays, options of the solver.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "espalier/matrix.hpp"
#include "host.hpp"
#include "solver/options/environment.hpp"
#include "solver/options/option_text.hpp"
#include "solver_handle.hpp"

namespace espalier::python {

/// Compressed columns of a square matrix, whose rows are its columns where it is symmetric.
inline MatrixView view_of(const Pointers& pointers, const Indices& indices, const Values& values, int storage) {
  MatrixView view;
  view.rows = view.cols = static_cast<Index>(pointers.size()) - 1;
  view.col_ptr = {pointers.data(), pointers.size()};
  view.row_ind = {indices.data(), indices.size()};
  view.values = {values.data(), values.size()};
  view.storage = static_cast<Storage>(storage);
  return view;
}

/// Options of the environment and of what was given by name, interrupted by Python's signals.
inline Options pencil_solver(const std::vector<std::pair<std::string, std::string>>& given) {
  solver::Environment environment = solver::read_environment();
  if (!environment.status.ok()) throw Error(environment.status);
  Options o = std::move(environment.options);
  for (const auto& [key, value] : given) solver::set_option(o, key, value);
  o.interrupted = &Host::interrupted;
  o.interrupted_every = 0.1;  // the global lock may take 5 ms to come
  return o;
}

}  // namespace espalier::python
