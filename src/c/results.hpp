/// \file
/// Results as the C interface hands them out.
#pragma once

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "espalier/complex_solver.hpp"
#include "espalier/espalier.h"
#include "espalier/solver.hpp"

namespace espalier::solver {

espalier_analysis_info to_c(const AnalysisResult& r);
espalier_factor_info to_c(const FactorResult& r);
espalier_factor_info to_c(const ComplexFactorResult& r);
espalier_solve_info to_c(const SolveResult& r);

/// The null space of the caller's matrix.
struct NullSpace {
  std::vector<Index> rows;
  std::vector<double> vectors;  ///< of complex matrices their parts
};
/// @param by_rows  the caller's matrix is given by rows, of which the solver holds the transpose, whatever the storage
NullSpace null_space_of(FactorResult result, bool by_rows);
NullSpace null_space_of(ComplexFactorResult result, bool by_rows);

/// Copies as much of the result as the caller's struct holds; leaves its `size` alone. @param info  null: nobody asks
/// @throws std::invalid_argument for a struct without a size
template <class Result, class Info>
void hand_out(const Result& result, Info* info) {
  if (info == nullptr) return;
  if (info->size < sizeof(std::size_t))
    throw std::invalid_argument("the info's field 'size' must be sizeof of its struct");
  Info all = to_c(result);
  all.size = info->size;
  std::memcpy(info, &all, std::min(info->size, sizeof(Info)));
}

}  // namespace espalier::solver
