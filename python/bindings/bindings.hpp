/// \file
/// The parts of the module.
#pragma once

#include <nanobind/nanobind.h>

#include <string>

namespace espalier::python {

/// A message of the library with Python's names of calls and options: "Solver.factorize", not "Solver::refactorize".
std::string python_words(std::string message);

void bind_solver(nanobind::module_& m);
void bind_rank_solver(nanobind::module_& m);
void bind_simulation(nanobind::module_& m);
void bind_dae(nanobind::module_& m);
void bind_model_text(nanobind::module_& m);
void bind_fmu(nanobind::module_& m);
void bind_modes(nanobind::module_& m);
void bind_harmonic(nanobind::module_& m);
void bind_reduced(nanobind::module_& m);
void bind_changes(nanobind::module_& m);
void bind_sensitivities(nanobind::module_& m);
void bind_xla(nanobind::module_& m);

}  // namespace espalier::python
