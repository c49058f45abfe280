/// \file
/// Results of real numbers as those of the complex system that was factorized.
#pragma once

#include <complex>
#include <vector>

#include "espalier/complex_solver.hpp"
#include "solver/factor/factor.hpp"

namespace espalier::solver {

/// Pairs of doubles as numbers.
std::vector<std::complex<double>> numbers_of(const std::vector<double>& parts);
/// @param factor  that `from` is the result of
ComplexFactorResult complex_result(FactorResult from, const Factor& factor);

}  // namespace espalier::solver
