/// \file
/// Results as tuples, in the order of the dataclasses in _results.py.
#pragma once

#include "arrays.hpp"
#include "solver_handle.hpp"

namespace espalier::python {

nb::tuple fields(const AnalysisResult& r);
/// @param transposed  whether the factored matrix is the transpose of the caller's; @param n  its unknowns
nb::tuple fields(const AnyFactor& factor, bool transposed, Index n);
nb::tuple fields(const SolveResult& r);

}  // namespace espalier::python
