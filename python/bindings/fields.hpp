/// \file
/// Results as tuples, in the order of the dataclasses in _results.py.
#pragma once

#include "arrays.hpp"
#include "solver_handle.hpp"

namespace espalier::python {

nb::tuple fields(const AnalysisResult& r);
/// @param by_rows  the caller's matrix is given by rows, of which the solver holds the transpose; @param n  its
/// unknowns
nb::tuple fields(const AnyFactor& factor, bool by_rows, Index n);
nb::tuple fields(const SolveResult& r);

}  // namespace espalier::python
